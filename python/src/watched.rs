//! Work on a separate thread, without the interpreter's lock, while this one waits and obeys Ctrl-C: signals reach only
//! the main thread, where Python handles them only on request.

use crate::errors::Error;
use pyo3::prelude::*;
use std::any::Any;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two looks for signals, and two calls of `show`.
const POLL: Duration = Duration::from_millis(50);

/// Runs `work` until it ends. `note` collects its messages, and `show` shows them now and then. An exception, by `show`
/// or by Ctrl-C, sets the flag of `work`, and is raised once that has ended.
pub fn watched<T: Send, M: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool, &Sender<M>) -> Result<T, Error> + Send,
    mut note: impl FnMut(M) + Send,
    mut show: impl FnMut(Python<'_>) -> PyResult<()> + Send,
) -> Result<T, Error> {
    py.detach(|| {
        let stop = &AtomicBool::new(false);
        let (sender, receiver) = channel();
        thread::scope(|scope| {
            // The sender is dropped with the work, which ends the loop.
            let worker = scope.spawn(move || work(stop, &sender));
            let mut raised = Ok(());
            let mut last_look = Instant::now();
            loop {
                match receiver.recv_timeout(POLL) {
                    Ok(message) => note(message),
                    Err(RecvTimeoutError::Timeout) => (),
                    Err(RecvTimeoutError::Disconnected) => break,
                }
                if raised.is_ok() && last_look.elapsed() >= POLL {
                    last_look = Instant::now();
                    raised = Python::attach(|py| py.check_signals().and_then(|()| show(py)));
                    if raised.is_err() {
                        stop.store(true, Ordering::Relaxed);
                    }
                }
            }
            let ended = worker
                .join()
                .unwrap_or_else(|panic| Err(Error::Simulation(message_of(&*panic))));
            raised?;
            Python::attach(&mut show)?;
            ended
        })
    })
}

fn message_of(panic: &(dyn Any + Send)) -> String {
    let literal = panic.downcast_ref::<&str>().copied();
    let text = literal.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("panic: {}", text.unwrap_or("without a message"))
}
