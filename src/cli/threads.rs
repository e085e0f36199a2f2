//! `--threads`: how many threads a command takes.

use super::exit::UsageError;
use crate::run::threads::{self, Threads};
use clap::Args;
use std::num::NonZeroUsize;

#[derive(Clone, Copy, Debug, Args)]
pub struct ThreadsFlag {
    /// Threads [default: those that the batch system grants, else all cores]
    #[arg(long, value_name = "N", value_parser = threads::parse)]
    threads: Option<NonZeroUsize>,
}

impl ThreadsFlag {
    /// Those that are asked for, else those of the environment.
    pub fn choose(self) -> Result<Threads, UsageError> {
        Threads::choose(self.threads, |variable| std::env::var_os(variable))
            .map_err(|error| UsageError(error.to_string()))
    }
}
