//! Costs in CPU time, and the processor.

use crate::table::columns::columns;

columns! {
    /// What a solver costs, on one thread.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Cost {
        per_simulated_second as "cpu_per_simulated_second": f64 = "",
            "CPU seconds per simulated second, one thread";
        per_slip as "cpu_per_slip": f64 = "s", "CPU time per slip";
        per_step as "cpu_per_step": f64 = "s", "CPU time per step";
        steps_per_slip: f64 = "", "steps per slip";
        timed_slips: u64 = "",
            "slips that were timed; 0 if the cost per slip is extrapolated from that of a step";
    }
}

impl Cost {
    /// Whether the cost per slip follows from that of a step.
    pub const fn is_extrapolated(&self) -> bool {
        self.timed_slips == 0
    }
}

/// Name of the processor as the operating system gives it, and the architecture.
pub fn processor() -> String {
    let description = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |key: &str| {
        let line = description.lines().find(|line| line.starts_with(key))?;
        line.split_once(':')
            .map(|(_, value)| value.trim().to_owned())
    };
    let name = field("model name").unwrap_or_else(|| "unknown processor".to_owned());
    let clock = field("cpu MHz").map_or_else(String::new, |clock| format!(", {clock} MHz"));
    format!("{name} ({}{clock})", std::env::consts::ARCH)
}
