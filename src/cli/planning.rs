//! Planning: a command walks through all points of its sweep before it starts a job.
//!
//! Nothing is half-written then, so the first signal that stops, or the end of the walltime, ends the program at once. On a
//! terminal a line shows how far a long walk is.

use super::exit::Exit;
use super::output;
use crate::sweep::walked;
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Time between two looks at the flag and the clock.
const POLL: Duration = Duration::from_millis(100);
/// Planning that takes less is not shown.
const LONG: Duration = Duration::from_secs(1);

/// Watches over planning until it is dropped.
pub struct Planning {
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Planning {
    /// Ends the program when the flag turns true, or once this time is over.
    pub fn watch(stop: &'static AtomicBool, walltime: Option<Duration>) -> Result<Self> {
        let (end, ended) = channel();
        let watch = move || watch(&ended, stop, walltime);
        let thread = Builder::new().name("planning".to_owned()).spawn(watch).context("cannot start a thread")?;
        Ok(Self { end: Some(end), thread: Some(thread) })
    }
}

impl Drop for Planning {
    fn drop(&mut self) {
        self.end.take();
        // Where it is about to end the program, nothing may begin.
        self.thread.take().map(JoinHandle::join);
    }
}

fn watch(ended: &Receiver<()>, stop: &AtomicBool, walltime: Option<Duration>) {
    let begin = Instant::now();
    let line = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{msg}") {
        line.set_style(style);
    }
    let end = |why: &str| {
        line.finish_and_clear();
        output::report(why);
        exit(Exit::Stopped as i32);
    };
    while matches!(ended.recv_timeout(POLL), Err(RecvTimeoutError::Timeout)) {
        if stop.load(Ordering::Relaxed) {
            end("stopped while planning: no job was started");
        }
        if walltime.is_some_and(|walltime| begin.elapsed() >= walltime) {
            end("the time was over before any job was started: give a longer --walltime");
        }
        if begin.elapsed() >= LONG {
            let (point, points) = walked();
            let millions = |points: u64| points.div_ceil(1_000_000);
            line.set_message(format!("planning: {} of {} million points", millions(point), millions(points)));
        }
    }
    line.finish_and_clear();
}
