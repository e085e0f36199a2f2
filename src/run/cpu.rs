//! CPU time of the calling thread.

/// CPU time that the calling thread has used since some instant, in s.
pub fn thread_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// CPU seconds of the calling thread that a computation takes, and its result.
pub fn timed<T>(compute: impl FnOnce() -> T) -> (f64, T) {
    let start = thread_seconds();
    let result = compute();
    (thread_seconds() - start, result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_sleeps_uses_no_processor_time() {
        let (asleep, ()) = timed(|| std::thread::sleep(std::time::Duration::from_millis(30)));
        let (busy, sum) =
            timed(|| (0..3_000_000).fold(0.0_f64, |sum, i| (sum + f64::from(i)).sqrt()));
        assert!(asleep < 0.02, "{asleep}");
        assert!(busy > 0.0 && sum > 0.0);
    }
}
