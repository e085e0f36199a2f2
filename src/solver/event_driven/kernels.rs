//! The hot loops, compiled for each set of processor features and chosen at run time.

use super::chain::Chain;
use super::chebyshev::{ChebyshevPropagator, propagate};
use super::free_motion::{SplitMotion, split};
use super::taylor::{Series, State, StepInput, evaluate, expand, reachable};
use super::vector::Plain;
#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2, Avx512};
use crate::solver::harmonic::Harmonic;

/// The hot loops, compiled for the features of one kind of processor.
#[derive(Clone, Copy)]
pub(super) struct Kernels {
    expand: unsafe fn(&Chain, &State, &StepInput, &mut Series) -> bool,
    evaluate: unsafe fn(&Series, f64, f64, &mut State),
    reachable: unsafe fn(&Chain, &mut Series, &mut Vec<(usize, usize)>),
    split: unsafe fn(&Chain, &Harmonic, &mut SplitMotion) -> Option<f64>,
    propagate: unsafe fn(&Chain, f64, f64, &mut ChebyshevPropagator),
    /// Name of the processor features, for tests and reports.
    #[cfg_attr(not(test), expect(dead_code, reason = "names the path in tests"))]
    pub name: &'static str,
}

/// Compiles the loops for one set of processor features.
macro_rules! kernels {
    ($module:ident, $vector:ident, $rows:literal $(, $features:literal)?) => {
        mod $module {
            use super::{Chain, ChebyshevPropagator, Harmonic, Kernels, Series, SplitMotion, State, StepInput};
            use super::{evaluate, expand, propagate, reachable, split};
            use super::$vector;

            $(#[target_feature(enable = $features)])?
            fn expand_here(chain: &Chain, state: &State, input: &StepInput, series: &mut Series) -> bool {
                expand::<$vector, $rows>(chain, state, input, series)
            }

            $(#[target_feature(enable = $features)])?
            fn evaluate_here(series: &Series, s: f64, length: f64, state: &mut State) {
                evaluate::<$vector, $rows>(series, s, length, state);
            }

            $(#[target_feature(enable = $features)])?
            fn reachable_here(chain: &Chain, series: &mut Series, blocks: &mut Vec<(usize, usize)>) {
                reachable::<$vector, $rows>(chain, series, blocks);
            }

            $(#[target_feature(enable = $features)])?
            fn split_here(chain: &Chain, drive: &Harmonic, motion: &mut SplitMotion) -> Option<f64> {
                split(chain, drive, motion)
            }

            $(#[target_feature(enable = $features)])?
            fn propagate_here(chain: &Chain, seconds: f64, error: f64, propagator: &mut ChebyshevPropagator) {
                propagate::<$vector>(chain, seconds, error, propagator);
            }

            pub(super) const KERNELS: Kernels = Kernels {
                expand: expand_here,
                evaluate: evaluate_here,
                reachable: reachable_here,
                split: split_here,
                propagate: propagate_here,
                name: stringify!($module),
            };
        }
    };
}

kernels!(baseline, Plain, 0);
#[cfg(target_arch = "x86_64")]
kernels!(avx2, Avx2, 0, "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512, Avx512, 0, "avx512f,fma");
// The slider of the paper, 70 blocks in nine rows: loops of known length cost a quarter less.
#[cfg(target_arch = "x86_64")]
kernels!(avx2_nine_rows, Avx2, 9, "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512_nine_rows, Avx512, 9, "avx512f,fma");

impl Kernels {
    /// Every path that this processor can run for so many rows, the fastest last.
    pub fn available(rows: usize) -> Vec<Self> {
        let mut paths = vec![baseline::KERNELS];
        #[cfg(target_arch = "x86_64")]
        {
            let fuses = is_x86_feature_detected!("fma");
            if fuses && is_x86_feature_detected!("avx2") {
                paths.push(avx2::KERNELS);
                if rows == 9 {
                    paths.push(avx2_nine_rows::KERNELS);
                }
            }
            if fuses && is_x86_feature_detected!("avx512f") {
                paths.push(avx512::KERNELS);
                if rows == 9 {
                    paths.push(avx512_nine_rows::KERNELS);
                }
            }
        }
        paths
    }

    /// Expands the state into a series; false if it does not converge within the largest order; see [`expand`].
    #[inline]
    pub fn expand(self, chain: &Chain, state: &State, input: &StepInput, series: &mut Series) -> bool {
        // SAFETY: `available` yields only paths whose features this processor has.
        unsafe { (self.expand)(chain, state, input, series) }
    }

    /// State at s in [0, 1] of a step of so many seconds.
    #[inline]
    pub fn evaluate(self, series: &Series, s: f64, length: f64, state: &mut State) {
        // SAFETY: as above.
        unsafe { (self.evaluate)(series, s, length, state) }
    }

    /// Row and lane of every block that may reach a break position within the step.
    #[inline]
    pub fn reachable(self, chain: &Chain, series: &mut Series, blocks: &mut Vec<(usize, usize)>) {
        // SAFETY: as above.
        unsafe { (self.reachable)(chain, series, blocks) }
    }

    /// Splits the motion into driven solution and free motion; see [`split`].
    #[inline]
    pub fn split(self, chain: &Chain, drive: &Harmonic, motion: &mut SplitMotion) -> Option<f64> {
        // SAFETY: as above.
        unsafe { (self.split)(chain, drive, motion) }
    }

    /// Carries the free motion over so many seconds; see [`propagate`].
    #[inline]
    pub fn propagate(self, chain: &Chain, seconds: f64, error: f64, propagator: &mut ChebyshevPropagator) {
        // SAFETY: as above.
        unsafe { (self.propagate)(chain, seconds, error, propagator) }
    }
}
