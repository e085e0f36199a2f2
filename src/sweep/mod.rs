//! Sweeps: a file that says what to run, and the jobs and parts that follow from it.
//!
//! ```text
//! sweep file ->  axes, conditions -> points -> jobs -> parts
//! source.rs      read_axes.rs        grid.rs   job.rs   plan.rs
//! read.rs        axes.rs                       cost.rs
//! checks.rs      expression.rs
//! controls.rs: the same jobs without modulation
//! read_rounds.rs -> rounds.rs -> adaptive.rs: an adaptive sweep, which runs in rounds
//! measured.rs: where slips come from that were measured
//! variation.rs: a file with other values, as text
//! ```
//!
//! Nothing here runs or writes anything. A plan is a function of texts and of the jobs that were done earlier: the same
//! jobs in the same order, the same ids, the same parts on every machine. Points are never held: a sweep walks through
//! them, and looks one up without walking.

mod adaptive;
mod axes;
mod checks;
mod controls;
mod cost;
mod expression;
mod grid;
mod job;
mod measured;
mod plan;
mod quantity;
mod read;
mod read_axes;
mod read_rounds;
mod rounds;
mod source;
#[cfg(test)]
mod tests;
mod variation;

pub use cost::{LARGE, certain_memory, predicted_cost, predicted_memory};
pub use expression::Expression;
pub use grid::Sweep;
pub use job::{Identity, Job};
pub use measured::{Measured, SourceFile};
pub use plan::{
    Extension, Outline, PART_COST, PART_JOBS, PLAN_VERSION, Part, PartName, Plan, Totals,
};
pub use quantity::{SYNONYMS, hint, nearest, synonym};
pub use read::MAX_NAME;
pub use rounds::{
    Bounds, Goal, MIN_SEEDS, Precision, Refinement, Round, Rounds, Standing, Target, merged,
};
pub use source::{Mistake, SweepError};
pub use variation::{KeyChange, varied};

/// JSON Schema of a sweep file, for editors that complete and check TOML. What depends on several keys, such as `dfs <=
/// fs`, is left to [`Sweep::parse`].
pub const SCHEMA: &str = include_str!("../../docs/sweep.schema.json");
