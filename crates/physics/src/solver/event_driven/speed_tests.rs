//! Speed is a part of the design, and the same bits say nothing of it: a wrapper that kept the processor's features from
//! the loops made the grid eight times as slow. The limits are far from what is measured, so that no load breaks them.

use super::kernels::{self, available};
use super::slider::BlockLayout;
use super::{Integration, Kernels};
use crate::model::Parameters;
use crate::solver::{Limits, Observer, Solver, simulate};
use std::time::{Duration, Instant};

const RUNS: usize = 5;
/// From rest past the first slip.
const LIMITS: Limits<'static> = Limits {
    end_time: 0.13,
    events: u64::MAX,
    interrupt: None,
};

/// Wants nothing, so that the solver alone is timed.
struct Nobody;

impl Observer for Nobody {
    fn follows_attachments(&self) -> bool {
        false
    }
}

/// How many times as long the second takes as the first: by the least of runs that take turns.
fn ratio(runs: [&dyn Fn(); 2]) -> f64 {
    let mut least = [Duration::MAX; 2];
    for _ in 0..RUNS {
        for (run, least) in runs.iter().zip(&mut least) {
            let begin = Instant::now();
            run();
            *least = begin.elapsed().min(*least);
        }
    }
    least[1].div_duration_f64(least[0])
}

#[test]
#[cfg_attr(debug_assertions, ignore = "speed of optimized code")]
fn loops_for_this_processor_are_faster_than_those_for_any() {
    let parameters = Parameters::default();
    let rows = BlockLayout::new(parameters.blocks).rows;
    if available(rows).len() == 1 {
        return;
    }
    let run = |kernels: Box<dyn Kernels>| {
        Integration::new(&parameters, 1e-3, true, LIMITS, kernels, None)
            .integrate(&mut Nobody)
            .unwrap();
    };
    let best = || run(kernels::fastest(rows));
    let baseline = || run(available(rows).swap_remove(0).1);
    // Seen: 3.6 to 6.6.
    let ratio = ratio([&best, &baseline]);
    assert!(ratio > 2.0, "{ratio}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "speed of optimized code")]
fn the_grid_is_faster_than_fixed_steps() {
    let run = |solver| {
        simulate(&Parameters::default(), solver, LIMITS, &mut Nobody).unwrap();
    };
    let grid = || run(Solver::default());
    let fixed_steps = || run(Solver::fixed_step(1e-6));
    // Seen: 7.8 to 8.6.
    let ratio = ratio([&grid, &fixed_steps]);
    assert!(ratio > 5.0, "{ratio}");
}
