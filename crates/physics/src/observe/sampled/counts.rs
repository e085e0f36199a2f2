//! The second pass: the number of slips for each of many drop sizes, smallest first, as a larger size follows only the
//! turning points of a smaller one. A range of sizes over which the number hardly changes is a plateau.

use super::super::drops::{Fall, Instant, Zigzag};
use super::{Pass, Samples, TraceDrive};

/// A plateau: a range of drop sizes by this factor over which the number of slips changes by at most this part.
const PLATEAU: f64 = 1.75;
const CHANGE: f64 = 0.1;

/// The slips for one drop size.
#[derive(Clone, Debug)]
pub struct Count {
    pub least: f64,
    pub slips: u64,
    /// Between slips of one run, and their sum in s.
    pub intervals: u64,
    pub seconds: f64,
    zigzag: Option<Zigzag>,
    before: Option<f64>,
}

impl Count {
    fn add(&mut self, fall: Fall, stiffness: f64) {
        if fall.size(stiffness) < self.least {
            return;
        }
        self.slips += 1;
        if let Some(before) = self.before.replace(fall.top.time) {
            self.intervals += 1;
            self.seconds += fall.top.time - before;
        }
    }
}

/// How many slips there are for each of many drop sizes.
#[derive(Clone, Debug)]
pub struct Counts {
    /// Rising.
    pub of_sizes: Vec<Count>,
}

impl Counts {
    pub fn new(sizes: impl IntoIterator<Item = f64>) -> Self {
        let count = |least| Count {
            least,
            slips: 0,
            intervals: 0,
            seconds: 0.0,
            zigzag: None,
            before: None,
        };
        Self {
            of_sizes: sizes.into_iter().map(count).collect(),
        }
    }

    /// The widest plateau, with some slips at least: of those that hold a drop size, if one is given.
    pub fn plateau(&self, size: Option<f64>, slips: u64) -> Option<[f64; 2]> {
        let counts = &self.of_sizes;
        let plateau = |(low, first): (usize, &Count)| {
            let least = ((1.0 - CHANGE) * first.slips as f64).max(slips as f64);
            let last = counts[low..]
                .iter()
                .take_while(|count| count.slips as f64 >= least);
            Some([first.least, last.last()?.least])
        };
        let holds = |[low, high]: &[f64; 2]| size.is_none_or(|size| *low <= size && size <= *high);
        let all = counts.iter().enumerate().filter_map(plateau).filter(holds);
        let widest =
            all.max_by(|left, right| (left[1] / left[0]).total_cmp(&(right[1] / right[0])));
        widest.filter(|[low, high]| *high >= PLATEAU * low)
    }
}

impl Count {
    /// Follows turning points; returns those that larger drop sizes must follow.
    fn follow(&mut self, turns: &[Instant], stiffness: f64) -> Vec<Instant> {
        let mut coarser = Vec::new();
        for &now in turns {
            let zigzag = Zigzag::new(self.least, now);
            if let Some(fall) = self.zigzag.get_or_insert(zigzag).follow(now) {
                self.add(fall, stiffness);
                coarser.extend([fall.top, fall.bottom]);
            }
        }
        coarser
    }
}

impl Pass for Counts {
    fn push(&mut self, loading: &TraceDrive, samples: Samples<'_>) {
        let least = self.of_sizes.first().map_or(0.0, |count| count.least);
        let mut turns = Vec::new();
        loading.turns(samples, least, |now| turns.push(now));
        for count in &mut self.of_sizes {
            turns = count.follow(&turns, loading.drive.stiffness);
        }
    }

    fn end(&mut self, loading: &TraceDrive) {
        let stiffness = loading.drive.stiffness;
        let mut turns = Vec::new();
        for count in &mut self.of_sizes {
            turns = count.follow(&turns, stiffness);
            if let Some(fall) = count.zigzag.take().and_then(|zigzag| zigzag.under_way()) {
                count.add(fall, stiffness);
                turns.extend([fall.top, fall.bottom]);
            }
            count.before = None;
        }
    }
}
