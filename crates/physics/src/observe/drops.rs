//! Drops: slips as an experimentalist sees them, from the shear force alone, and how they fit the slips of the
//! contacts.
//!
//! Method: a zigzag with hysteresis. A fall of F_S runs from its largest value since the last rise to its least before
//! the force has risen by the drop size again. Under modulation F_S swings by itself, so what the drive alone takes
//! away between these two instants does not count: a drop is a fall that is deeper than that by the drop size. Nothing
//! is sampled: the force is followed from one turning point to the next.

use crate::columns::columns;
use crate::model::{Drive, Parameters};
use crate::solver::Segment;

columns! {
    /// Drops before and during a slip; none of the values where drops are not recorded.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Drops {
        before as "drops_before": Option<u64> = "",
            "drops of the shear force since the previous slip; not there unless the sweep records drops, as what follows";
        largest_before as "largest_drop_before": Option<f64> = "N", "the largest of them; null without any";
        during as "drop_during": Option<f64> = "N",
            "the largest drop under way during the slip; null if the slip is not seen as a drop";
    }
}

/// The shear force, in N, and the displacement of the driven end, in m, at a time in s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Instant {
    pub time: f64,
    pub force: f64,
    pub driven: f64,
}

/// A fall of the force from a largest value to a least one.
#[derive(Clone, Copy, Debug)]
pub struct Fall {
    pub top: Instant,
    pub bottom: Instant,
}

impl Fall {
    /// How much deeper it is than what a drive of this stiffness, in N/m, takes away alone.
    pub fn size(&self, stiffness: f64) -> f64 {
        let by_drive = stiffness * (self.top.driven - self.bottom.driven).max(0.0);
        self.top.force - self.bottom.force - by_drive
    }
}

/// Follows a force from turning point to turning point. A rise by `least` ends a fall, and the reverse.
#[derive(Clone, Debug)]
pub struct Zigzag {
    pub least: f64,
    pub top: Instant,
    /// The least force since, once it has fallen by `least`.
    bottom: Option<Instant>,
}

impl Zigzag {
    pub const fn new(least: f64, top: Instant) -> Self {
        Self {
            least,
            top,
            bottom: None,
        }
    }

    /// The fall that ends now, as seen from a force that has not turned since the last instant.
    pub fn follow(&mut self, now: Instant) -> Option<Fall> {
        match &mut self.bottom {
            None if now.force >= self.top.force => self.top = now,
            None if now.force <= self.top.force - self.least => self.bottom = Some(now),
            Some(bottom) if now.force <= bottom.force => *bottom = now,
            Some(bottom) if now.force >= bottom.force + self.least => {
                let ended = self.under_way();
                (self.top, self.bottom) = (now, None);
                return ended;
            }
            _ => {}
        }
        None
    }

    /// The fall that a rise has not ended yet.
    pub fn under_way(&self) -> Option<Fall> {
        let top = self.top;
        self.bottom.map(|bottom| Fall { top, bottom })
    }
}

/// Finds drops as time passes.
#[derive(Clone, Debug)]
pub(super) struct DropDetector {
    drive: Drive,
    zigzag: Zigzag,
    drops: Vec<Fall>,
}

impl DropDetector {
    /// Finds drops of at least `least` newtons.
    pub(super) fn new(parameters: &Parameters, least: f64) -> Self {
        Self {
            drive: Drive::new(parameters),
            zigzag: Zigzag::new(least, Instant::default()),
            drops: Vec::new(),
        }
    }

    pub(super) fn advance(&mut self, segment: &Segment<'_>) {
        let (low, high) = segment.bounds();
        let Zigzag { least, top, bottom } = &self.zigzag;
        let changes_nothing = match bottom {
            None => high <= top.force && low > top.force - least,
            Some(bottom) => low >= bottom.force && high < bottom.force + least,
        };
        if changes_nothing {
            return;
        }
        segment.for_each_turn(|time, force| self.follow(time, force));
        self.follow(segment.end(), segment.end_force());
    }

    /// Follows a force that does not turn in between.
    fn follow(&mut self, time: f64, force: f64) {
        self.drive.advance_to(time);
        let driven = self.drive.motion(time).displacement;
        let ended = self.zigzag.follow(Instant {
            time,
            force,
            driven,
        });
        self.add(ended);
    }

    /// Adds a fall, if it is a drop.
    fn add(&mut self, fall: Option<Fall>) {
        let least = self.zigzag.least;
        let is_drop = |fall: &Fall| fall.size(self.drive.stiffness) >= least;
        self.drops.extend(fall.filter(is_drop));
    }

    /// The drops of slips, given the first and last break of each in order of time. A fall that is under way at the end
    /// counts as far as it went.
    pub(super) fn of_slips(mut self, slips: &[(f64, f64)]) -> Vec<Drops> {
        self.add(self.zigzag.under_way());
        let size = |drop: &Fall| drop.size(self.drive.stiffness);
        let largest = |drops: &[Fall]| drops.iter().map(size).max_by(f64::total_cmp);
        let mut drops = &self.drops[..];
        let of_slip = |&(first_break, last_break): &(f64, f64)| {
            let (before, others) =
                drops.split_at(drops.partition_point(|drop| drop.bottom.time < first_break));
            let (during, later) =
                others.split_at(others.partition_point(|drop| drop.top.time <= last_break));
            drops = later;
            Drops {
                before: Some(before.len() as u64),
                largest_before: largest(before),
                during: largest(during),
            }
        };
        slips.iter().map(of_slip).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONSTANT_DRIVE: f64 = 1e-4;

    /// The drops of slips when the force runs straight from one value to the next, one every millisecond.
    fn drops(least: f64, forces: &[f64], slips: &[(f64, f64)]) -> Vec<Drops> {
        let mut detector = DropDetector::new(
            &Parameters {
                drive_velocity: CONSTANT_DRIVE,
                ..Parameters::default()
            },
            least,
        );
        for (index, pair) in forces.windows(2).enumerate() {
            detector.advance(&Segment::polynomial(
                1e-3 * index as f64,
                1e-3,
                &[pair[0], pair[1] - pair[0]],
            ));
        }
        detector.of_slips(slips)
    }

    #[test]
    fn a_fall_counts_from_the_top_to_the_bottom_and_smaller_rises_do_not_cut_it() {
        let forces = [0.0, 100.0, 60.0, 64.0, 20.0, 80.0];
        let whole = Drops {
            before: Some(0),
            largest_before: None,
            during: Some(80.0),
        };
        assert_eq!(drops(10.0, &forces, &[(2e-3, 3e-3)]), [whole]);
        // With a least drop of 4 N the rise by 4 N cuts it.
        let cut = Drops {
            before: Some(1),
            largest_before: Some(40.0),
            during: Some(44.0),
        };
        assert_eq!(drops(4.0, &forces, &[(3.5e-3, 4e-3)]), [cut]);
        assert_eq!(
            drops(80.1, &forces, &[(2e-3, 3e-3)]),
            [Drops {
                during: None,
                ..whole
            }]
        );
    }

    #[test]
    fn each_drop_belongs_to_one_slip_and_a_fall_under_way_at_the_end_counts() {
        // Drops of 5, 50, 7, 6 and 60 N, the second and the last during slips.
        let forces = [
            0.0, 20.0, 15.0, 60.0, 10.0, 30.0, 23.0, 40.0, 34.0, 70.0, 10.0,
        ];
        let first = Drops {
            before: Some(1),
            largest_before: Some(5.0),
            during: Some(50.0),
        };
        let second = Drops {
            before: Some(2),
            largest_before: Some(7.0),
            during: Some(60.0),
        };
        assert_eq!(
            drops(5.0, &forces, &[(3.1e-3, 4.2e-3), (9.2e-3, 9.9e-3)]),
            [first, second]
        );
    }

    #[test]
    fn the_swing_of_the_drive_is_no_drop_and_a_fall_beyond_it_is_one() {
        let parameters = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.02),
            ..Parameters::default()
        };
        let drive = Drive::new(&parameters);
        let stiffness = drive.stiffness;
        let amplitude = drive.amplitude;
        let swing = |start: f64, duration: f64, slid: f64| Segment {
            start,
            duration,
            path: crate::solver::ForcePath::Harmonic(crate::solver::Harmonic {
                start: stiffness * (drive.velocity * start - amplitude - slid),
                rate: stiffness * drive.velocity,
                amplitude: stiffness * amplitude,
                phase: drive.phase(start),
                angular_frequency: drive.angular_frequency,
            }),
        };
        // Three periods at rest; then, from the middle of a fall on, slid by 0.3 µm: 12 N.
        let mut detector = DropDetector::new(&parameters, 5.0);
        detector.advance(&swing(0.0, 0.065, 0.0));
        detector.advance(&swing(0.065, 0.06, 3e-7));
        let [drops] = detector.of_slips(&[(1.0, 1.0)])[..] else {
            panic!("one slip")
        };
        assert_eq!((drops.before, drops.during), (Some(1), None));
        assert!(
            (drops.largest_before.unwrap() - 12.0).abs() < 1e-9,
            "{drops:?}"
        );
    }
}
