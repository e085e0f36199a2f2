//! Signals that end a run early: the first of them stops it cleanly, and what is done is kept.
//!
//! Batch systems warn with one signal and follow with others, and some send the same one twice. So only a second SIGINT,
//! which is Ctrl-C, exits at once. SIGINT and SIGTERM cancel a run; the others warn that its time is over.
//! SIGHUP keeps its usual effect: it ends the program unless `nohup` started it.

use super::exit::Exit;
use anyhow::{Context, Result};
use signal_hook::consts::signal::{SIGINT, SIGTERM, SIGUSR1, SIGUSR2, SIGXCPU, SIGXFSZ};
use signal_hook::flag::{register, register_conditional_shutdown};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};

const WARNING: &[i32] = &[SIGUSR1, SIGUSR2, SIGXCPU];
const CANCELLING: &[i32] = &[SIGINT, SIGTERM];

/// Set by the first signal that stops.
static STOP: AtomicBool = AtomicBool::new(false);
/// Set by the first signal that cancels.
static CANCELLED: AtomicBool = AtomicBool::new(false);
/// Set by the first SIGINT.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Set when a file would pass the limit on its size.
static FILE_TOO_LARGE: AtomicBool = AtomicBool::new(false);

/// Whether the signals are caught.
static CAUGHT: AtomicBool = AtomicBool::new(false);

/// Catches the signals; the flag turns true with the first.
pub fn catch() -> Result<&'static AtomicBool> {
    if !CAUGHT.swap(true, Ordering::Relaxed) {
        register_all().context("cannot catch signals")?;
    }
    Ok(&STOP)
}

/// Lets the write of a file that passes the limit on its size fail, where a signal would end the program.
pub fn outlive_limit_of_files() -> Result<()> {
    register(SIGXFSZ, &FILE_TOO_LARGE).context("cannot catch signals")?;
    Ok(())
}

/// Whether a signal came that cancels, alone or with others.
pub fn is_cancelled() -> bool {
    CANCELLED.load(Ordering::Relaxed)
}

fn register_all() -> io::Result<()> {
    // Before the flag that it looks at, so that the first SIGINT does not exit.
    register_conditional_shutdown(SIGINT, Exit::Stopped as i32, &INTERRUPTED)?;
    register(SIGINT, &INTERRUPTED)?;
    // Before the flag that stops: what stops a run finds it set.
    CANCELLING
        .iter()
        .try_for_each(|&signal| register(signal, &CANCELLED).map(drop))?;
    CANCELLING
        .iter()
        .chain(WARNING)
        .try_for_each(|&signal| register(signal, &STOP).map(drop))
}
