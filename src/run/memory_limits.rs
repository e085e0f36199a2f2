//! Memory that this process may take, in bytes; infinite if unknown.

use crate::sweep::LARGE;
use std::fs;
use std::path::Path;

const KILOBYTE: f64 = 1024.0;
/// Address space of a thread: its stack, and what the C library reserves for it.
const OF_A_THREAD: f64 = 68e6;

/// Memory that hard limits leave for jobs: limits of control groups, of the address space and of data.
pub fn allowed() -> f64 {
    let limits = text_of("/proc/self/limits");
    let status = text_of("/proc/self/status");
    let left = |limit: &str, taken: &str| {
        let taken = KILOBYTE * number_after(&status, taken).unwrap_or(0.0);
        number_after(&limits, limit).map_or(f64::INFINITY, |limit| (limit - taken).max(0.0))
    };
    of_groups(&text_of("/proc/self/cgroup"), Path::new("/sys/fs/cgroup"))
        .min(left("Max address space", "VmSize:"))
        .min(left("Max data size", "VmData:"))
}

/// Memory that this process has or could get now without taking it from others.
pub fn available() -> f64 {
    let free = number_after(&text_of("/proc/meminfo"), "MemAvailable:");
    let own = number_after(&text_of("/proc/self/status"), "VmRSS:");
    free.zip(own)
        .map_or(f64::INFINITY, |(free, own)| KILOBYTE * (free + own))
}

/// Memory of a job beside its threads. A small job fits into what is reserved for its thread.
pub fn beside_threads(job: f64, threads: usize) -> f64 {
    if job < LARGE {
        job
    } else {
        job + OF_A_THREAD * threads as f64
    }
}

fn text_of(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

fn number_after(text: &str, key: &str) -> Option<f64> {
    let value = text.lines().find_map(|line| line.strip_prefix(key))?;
    value.split_whitespace().next()?.parse().ok()
}

/// The least limit of the control groups and of all above them. A container may show its own group as the topmost.
fn of_groups(groups: &str, mount: &Path) -> f64 {
    let mut least = f64::INFINITY;
    for group in groups.lines() {
        let mut fields = group.splitn(3, ':').skip(1);
        let controllers = fields.next().unwrap_or_default();
        let path = fields.next().unwrap_or_default().trim_start_matches('/');
        let (top, file) = if controllers.is_empty() {
            (mount.to_owned(), "memory.max")
        } else if controllers.split(',').any(|name| name == "memory") {
            (mount.join("memory"), "memory.limit_in_bytes")
        } else {
            continue;
        };
        let limits = Path::new(path).ancestors().filter_map(|above| {
            let text = fs::read_to_string(top.join(above).join(file)).ok()?;
            text.trim().parse::<f64>().ok()
        });
        least = limits.fold(least, f64::min);
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_limit_of_all_control_groups_counts_and_none_is_no_limit() {
        let mount = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = mount.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        let limit = |groups: &str| of_groups(groups, mount.path());
        let second = "0::/slurm/job_7/step_0\n";
        assert_eq!(limit(second), f64::INFINITY);
        write("slurm/job_7/step_0/memory.max", "max\n");
        assert_eq!(limit(second), f64::INFINITY);
        write("slurm/job_7/memory.max", "2000000000\n");
        assert_eq!(limit(second), 2e9);
        write("memory.max", "1500000000\n");
        assert_eq!(limit(second), 1.5e9);
        let first = "3:cpuset:/other\n4:memory,hugetlb:/job/7\n";
        assert_eq!(limit(first), f64::INFINITY);
        write("memory/job/memory.limit_in_bytes", "9223372036854771712\n");
        assert_eq!(limit(first), 9_223_372_036_854_771_712.0);
        write("memory/memory.limit_in_bytes", "1000000000\n");
        assert_eq!(limit(&format!("{first}{second}")), 1e9);
    }

    #[test]
    fn limits_and_fields_are_read_and_unlimited_is_no_number() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
                      Max data size             unlimited            unlimited            bytes     \n\
                      Max address space         1536000000           unlimited            bytes     \n";
        assert_eq!(number_after(limits, "Max address space"), Some(1.536e9));
        assert_eq!(number_after(limits, "Max data size"), None);
        assert_eq!(
            number_after("MemAvailable:   23506 kB\n", "MemAvailable:"),
            Some(23_506.0)
        );
        assert!(allowed() > 0.0 && available() > 0.0);
    }
}
