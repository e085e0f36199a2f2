//! How far the walk through points is that this process is at: for a display alone, which knows nothing of what walks.

use std::sync::atomic::{AtomicU64, Ordering};

/// Points between two notes, some milliseconds.
const SPACING: u64 = 1 << 16;

static POINT: AtomicU64 = AtomicU64::new(0);
static END: AtomicU64 = AtomicU64::new(0);

/// A walk has come to a point.
pub(super) fn note(point: u64, end: u64) {
    if point.is_multiple_of(SPACING) {
        POINT.store(point, Ordering::Relaxed);
        END.store(end, Ordering::Relaxed);
    }
}

/// The point that the last walk has come to, and where it ends.
pub fn walked() -> (u64, u64) {
    (POINT.load(Ordering::Relaxed), END.load(Ordering::Relaxed))
}
