//! Lengths of time on the command line: with units, or as Slurm writes them.

use std::time::Duration;

const MINUTE: u64 = 60;
const HOUR: u64 = 60 * MINUTE;
const DAY: u64 = 24 * HOUR;

/// A time such as `90s`, `55m`, `55min`, `1h30m`, or as Slurm reads it: `MM:SS`, `HH:MM:SS`, `D-HH`, `D-HH:MM`,
/// `D-HH:MM:SS`. A number alone is refused, since Slurm means minutes and people mean seconds.
pub fn parse(text: &str) -> Result<Duration, String> {
    if by_units(&format!("{text}s")).is_some() {
        return Err(format!(
            "{text} has no unit at its end; write {text}m for minutes or {text}s for seconds"
        ));
    }
    let seconds = if text.contains([':', '-']) {
        by_clock(text)
    } else {
        by_units(text)
    };
    let time = seconds
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .filter(|time| !time.is_zero());
    time.ok_or_else(|| {
        "must be a time with units d, h, m, s, such as 55m or 1h30m, or as for Slurm, such as 1:30:00 or 2-12"
            .to_owned()
    })
}

fn by_units(text: &str) -> Option<f64> {
    let mut seconds = 0.0;
    let mut rest = text;
    while !rest.is_empty() {
        let (number, tail) = rest.split_at(rest.find(|c: char| !(c.is_ascii_digit() || c == '.'))?);
        let next = tail.find(|c: char| c.is_ascii_digit());
        let (unit, after) = tail.split_at(next.unwrap_or(tail.len()));
        let unit = match unit {
            "d" => DAY,
            "h" => HOUR,
            "m" | "min" => MINUTE,
            "s" => 1,
            _ => return None,
        };
        seconds += number.parse::<f64>().ok()? * unit as f64;
        rest = after;
    }
    Some(seconds)
}

fn by_clock(text: &str) -> Option<f64> {
    let (days, clock) = match text.split_once('-') {
        Some((days, clock)) => (Some(days), clock),
        None => (None, text),
    };
    // With days the first number after them is hours; without, the last is seconds.
    let fields: Vec<&str> = clock.split(':').collect();
    let units: &[u64] = match (days, fields.len()) {
        (Some(_), 1..=3) | (None, 3) => &[HOUR, MINUTE, 1],
        (None, 2) => &[MINUTE, 1],
        _ => return None,
    };
    let fields = fields.into_iter().zip(units);
    let mut seconds = 0.0;
    for (number, unit) in fields.chain(days.map(|days| (days, &DAY))) {
        seconds += f64::from(number.parse::<u32>().ok()?) * *unit as f64;
    }
    Some(seconds)
}

/// A time with units, in whole seconds.
pub fn with_units(time: Duration) -> String {
    let seconds = time.as_secs();
    let parts = [
        (seconds / HOUR, "h"),
        (seconds % HOUR / MINUTE, "m"),
        (seconds % MINUTE, "s"),
    ];
    let mut text = String::new();
    for (number, unit) in parts.into_iter().filter(|(number, _)| *number > 0) {
        text += &number.to_string();
        text += unit;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units_or_are_read_as_slurm_reads_them() {
        let table = [
            ("90s", 90.0),
            ("55m", 3300.0),
            ("90min", 5400.0),
            ("1h30m", 5400.0),
            ("1h30min5s", 5405.0),
            ("0.5d", 43_200.0),
            ("1.5s", 1.5),
            ("5:30", 330.0),
            ("90:00", 5400.0),
            ("1:00:00", 3600.0),
            ("04:00:01", 14_401.0),
            ("1-12", 129_600.0),
            ("1-0:30", 88_200.0),
            ("2-01:02:03", 176_523.0),
        ];
        for (text, seconds) in table {
            assert_eq!(parse(text).unwrap().as_secs_f64(), seconds, "{text}");
        }
    }

    #[test]
    fn a_number_alone_is_refused_with_both_meanings() {
        for text in ["55", "1.5", "1h30"] {
            let error = parse(text).unwrap_err();
            assert!(
                error.contains(&format!("{text}m for minutes or {text}s for seconds")),
                "{error}"
            );
        }
    }

    #[test]
    fn what_is_no_time_is_refused() {
        let units = [
            "", "m", "0s", "-1", "nan", "nans", "inf", "infd", "1e300d", "5 m", "3w", "1m\u{e9}",
        ];
        let clocks = [
            "-1h", "2h-1h", ":", "1:", ":30", "0:00", "1:2:3:4", "1-2-3", "1-", "-12", "1:-2",
            "1.5:00", "1 :2",
        ];
        for text in units.into_iter().chain(clocks) {
            assert!(parse(text).unwrap_err().contains("such as 55m"), "{text}");
        }
    }

    #[test]
    fn what_is_written_is_read_again() {
        for (seconds, units) in [(60, "1m"), (14_400, "4h"), (183_845, "51h4m5s")] {
            let time = Duration::from_secs(seconds);
            assert_eq!((with_units(time).as_str(), parse(units)), (units, Ok(time)));
        }
    }
}
