//! Waiting for what a host of a network disk does not see yet, although the folder lists it.

use crate::table::error::ResultsError;
use std::time::{Duration, Instant};

/// How long to wait: longer than a network file system shows an old name, and the time between two looks.
const LATE: Duration = if cfg!(test) { Duration::from_millis(300) } else { Duration::from_mins(1) };
const PAUSE: Duration = if cfg!(test) { Duration::ZERO } else { Duration::from_millis(200) };

/// Looks until there is something to be seen, for a minute at most.
pub(super) fn settled<T>(mut look: impl FnMut() -> Result<Option<T>, ResultsError>) -> Result<Option<T>, ResultsError> {
    let begin = Instant::now();
    loop {
        let seen = look()?;
        if seen.is_some() || begin.elapsed() >= LATE {
            return Ok(seen);
        }
        std::thread::sleep(PAUSE);
    }
}
