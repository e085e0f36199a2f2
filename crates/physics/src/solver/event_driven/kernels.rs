//! The hot loops, compiled for each set of processor features and chosen at run time.

use super::grid::{Grid, GridStep, advance, velocity};
use super::leap::{LeapBounds, PlannedLeap, Split, leap};
use super::moving_frame::StepDrive;
use super::slider::{Chain, Slider, Slot, State};
use super::taylor::{StepInput, TaylorSeries, evaluate, expand, reachable};
use crate::model::simd::Simd;
use crate::solver::harmonic::Harmonic;
use crate::solver::ledger::Audit;
use pulp::Scalar512b;
#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};

/// The loops compiled for the features of `S` and for `R` rows, or for any number if that is 0.
struct Compiled<S, const R: usize>(S);

/// Describes each hot loop once: what it does, its arguments, its result and the function that is compiled.
macro_rules! kernels {
    ($($(#[$about:meta])* fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty = $function:expr;)*) => {
        /// The hot loops for one set of processor features.
        pub(super) trait Kernels {
            $($(#[$about])* fn $name(&self, $($argument: $type),*) -> $result;)*
        }

        impl<S: Simd, const R: usize> Kernels for Compiled<S, R> {
            $(fn $name(&self, $($argument: $type),*) -> $result {
                self.0.run(#[inline(always)] |simd| $function(simd, $($argument),*))
            })*
        }
    };
}

kernels! {
    /// Expands the state into a series; false if it does not converge within the largest order; see [`expand`].
    fn expand(chain: &Chain, state: &State, input: &StepInput, series: &mut TaylorSeries) -> bool = expand::<S, R>;
    /// State at s in [0, 1] of a step of `length` s.
    fn evaluate(series: &TaylorSeries, s: f64, length: f64, state: &mut State) -> () = evaluate::<S, R>;
    /// The blocks that may reach a break position within the step.
    fn reachable(chain: &Chain, series: &mut TaylorSeries, blocks: &mut Vec<Slot>) -> () = reachable::<S, R>;
    /// Takes up to `steps` steps of the grid; see [`advance`].
    fn advance(slider: &mut Slider, grid: &mut Grid, time: f64, steps: usize) -> usize = advance::<S, R>;
    /// Writes the velocities of a motion on the grid; see [`velocity`].
    fn velocity(chain: &Chain, step: &mut GridStep, drive: &StepDrive, state: &mut State) -> () = velocity::<S, R>;
    /// Tries to leap; see [`leap`].
    fn leap(split: &mut Split, slider: &mut Slider, drive: &Harmonic, bounds: LeapBounds, audit: Option<&Audit>)
        -> Result<PlannedLeap, f64> = leap::<S>;
}

/// The fastest loops that this processor can run for this many rows.
pub(super) fn fastest(rows: usize) -> Box<dyn Kernels> {
    let (_, fastest) = available(rows)
        .pop()
        .unwrap_or_else(|| unreachable!("there is always the baseline"));
    fastest
}

/// All loops that this processor can run for this many rows, with their names; the fastest last.
#[cfg_attr(not(target_arch = "x86_64"), expect(unused_mut, unused_variables))]
pub(super) fn available(rows: usize) -> Vec<(&'static str, Box<dyn Kernels>)> {
    let mut paths: Vec<(&'static str, Box<dyn Kernels>)> =
        vec![("baseline", Box::new(Compiled::<_, 0>(Scalar512b)))];
    // The slider of the paper, 70 blocks in nine rows: loops of known length cost a quarter less.
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(avx2) = V3::try_new() {
            paths.push(("AVX2", Box::new(Compiled::<_, 0>(avx2))));
            if rows == 9 {
                paths.push(("AVX2, nine rows", Box::new(Compiled::<_, 9>(avx2))));
            }
        }
        if let Some(avx512) = V4::try_new() {
            paths.push(("AVX-512", Box::new(Compiled::<_, 0>(avx512))));
            if rows == 9 {
                paths.push(("AVX-512, nine rows", Box::new(Compiled::<_, 9>(avx512))));
            }
        }
    }
    paths
}
