//! What a study says of one solver, in a few lines: whether its slips are biased, by how much its breaks are off, and
//! whether the statistical error of a sweep is larger.
//!
//! A bias counts if it is significant at 5 % after Bonferroni's correction for the number of comparisons: of a solver
//! without bias, one study in twenty reports one by chance. With few slips no bias counts.

use super::{BiasRow, Findings, MethodRow, SolverColumns, Study, set_in_words};

/// Least number of slips on either side with which a bias counts.
const MIN_SLIPS: u64 = 100;
/// A bias that is surely less than this share of the statistical error is not what limits a sweep.
const MINOR: f64 = 1.0 / 3.0;
/// A tighter setting is one whose breaks are off by less than this share.
const TIGHTER: f64 = 0.5;

pub fn shows_bias(row: &BiasRow, comparisons: usize) -> bool {
    let by_chance = row.bias.half_width_among(comparisons);
    can_tell(row) && by_chance.is_some_and(|by_chance| row.bias.of_mean.abs() > by_chance)
}

fn can_tell(row: &BiasRow) -> bool {
    row.bias.freedom.is_some() && fewest_slips(row) >= MIN_SLIPS
}

fn fewest_slips(row: &BiasRow) -> u64 {
    row.slips.min(row.reference_slips)
}

/// What a study with few slips will not show.
pub fn too_few_slips(study: &Study) -> Option<String> {
    let slips = study.seeds * study.slips;
    (slips < MIN_SLIPS).then(|| {
        format!(
            "{slips} slips per solver show costs and errors of break times, and no bias: that takes {MIN_SLIPS}, by \
             --seeds and --slips"
        )
    })
}

/// The lines, the answer first.
pub fn verdict(study: &Study, findings: &Findings) -> Vec<String> {
    let own = SolverColumns::from(study.own);
    let own_biases = findings.biases.iter().filter(|row| row.solver == own);
    let compared: Vec<&BiasRow> = own_biases.collect();
    let own_methods = findings.methods.iter().filter(|row| row.solver == own);
    let rows: Vec<&MethodRow> = own_methods.collect();
    let subject = if study.slips_of_sets.is_empty() {
        "The solver"
    } else {
        "Your sweep"
    };
    let slips = compared.iter().map(|row| fewest_slips(row));
    let Some(slips) = slips.min() else {
        return vec![format!(
            "{subject} ({own}): not compared, as its slips would take too long"
        )];
    };
    let comparisons = compared.len();
    let by_chance = |row: &BiasRow| row.bias.half_width_among(comparisons).unwrap_or(f64::NAN);
    let excess = |row: &BiasRow| row.bias.of_mean.abs() / by_chance(row);
    let most = compared
        .iter()
        .filter(|row| shows_bias(row, comparisons))
        .max_by(|a, b| excess(a).total_cmp(&excess(b)));
    let mut intervals = compared.clone();
    intervals.retain(|row| row.quantity == "interval");
    let unseen = |row: &BiasRow| percent(row, by_chance(row));
    let least_known = compared
        .iter()
        .max_by(|a, b| unseen(a).total_cmp(&unseen(b)));
    let finding = match most {
        _ if !compared.iter().all(|row| can_tell(row)) => {
            format!("too few slips: {slips} per solver; take more --seeds or --slips")
        }
        Some(row) => format!(
            "biased: {} by {:+.2} ± {:.2} % at {}, more than chance among {} comparisons",
            row.quantity,
            percent(row, row.bias.of_mean),
            percent(row, half_width(row)),
            set_in_words(&row.parameters),
            comparisons
        ),
        None => {
            let caveat = least_known.map(|row| {
                let place = set_in_words(&row.parameters);
                format!(
                    "one of the {} below {:.1} % would go unseen at {place}",
                    row.quantity,
                    unseen(row)
                )
            });
            format!(
                "no bias found; with {slips} slips per solver {}",
                caveat.unwrap_or_default()
            )
        }
    };
    let mut lines = vec![format!("{subject} ({own}): {finding}.")];
    lines.extend(break_errors(&rows));
    lines.extend(unbalanced(&rows));
    lines.extend(statistical_error(study, &intervals, most.is_some()));
    lines.extend(tighter(findings, &rows));
    lines
}

/// Half of the interval of a bias; no number for fewer than two realisations.
fn half_width(row: &BiasRow) -> f64 {
    row.bias.half_width().unwrap_or(f64::NAN)
}

/// A value in percent of the mean of the reference.
fn percent(row: &BiasRow, value: f64) -> f64 {
    100.0 * value / row.reference_mean.abs()
}

/// How far breaks are off before trajectories part.
fn break_errors(rows: &[&MethodRow]) -> Option<String> {
    let largest = |value: fn(&MethodRow) -> Option<f64>| {
        rows.iter().filter_map(|row| value(row)).reduce(f64::max)
    };
    let median = largest(|row| row.break_times.median)?;
    let most_off = largest(|row| row.break_times.largest)?;
    Some(format!(
        "Before trajectories part, breaks are off by {median:.0e} s in the median, and by {most_off:.0e} s at most."
    ))
}

/// How well energy balances in jobs of the sweep.
fn unbalanced(rows: &[&MethodRow]) -> Option<String> {
    let residuals = rows.iter().filter_map(|row| row.unbalanced);
    let largest = residuals.reduce(f64::max)?;
    Some(format!(
        "Energy balances to {largest:.0e} of the work of the drive."
    ))
}

/// The statistical error of the mean interval in the sets of a sweep, and whether the solver could add to it.
fn statistical_error(study: &Study, intervals: &[&BiasRow], is_biased: bool) -> Option<String> {
    // The error of a difference of two means, scaled to the slips of the sweep: neighbours are correlated in both.
    let errors: Vec<f64> = study
        .slips_of_sets
        .iter()
        .zip(&study.sets)
        .filter(|(slips, _)| **slips > 0)
        .filter_map(|(&own, set)| {
            let row = intervals.iter().find(|row| *row.parameters == *set)?;
            let of_difference = 1.0 / row.slips as f64 + 1.0 / row.reference_slips as f64;
            let scaled = half_width(row) * (1.0 / (own as f64 * of_difference)).sqrt();
            Some(percent(row, scaled)).filter(|error| error.is_finite())
        })
        .collect();
    let least = errors.iter().copied().reduce(f64::min)?;
    let largest = errors.iter().copied().reduce(f64::max)?;
    let excluded_from = |row: &&BiasRow| percent(row, row.bias.of_mean.abs() + half_width(row));
    let conclusion = if is_biased {
        ""
    } else if intervals
        .iter()
        .all(|row| excluded_from(row) <= MINOR * least)
    {
        ", so the solver is not what limits you"
    } else {
        "; more --seeds here would show whether the solver adds to it"
    };
    let range = if largest < 1.05 * least {
        String::new()
    } else {
        format!("{least:.1} to ")
    };
    Some(format!(
        "Statistical error of the mean interval in your sets (95 %), estimated from these slips: {range}{largest:.1} \
         %{conclusion}."
    ))
}

/// The cheapest setting whose breaks are off by much less.
fn tighter(findings: &Findings, rows: &[&MethodRow]) -> Option<String> {
    let row = rows.first()?;
    let error = row.break_times.median? * TIGHTER;
    let is_tighter = |other: &&MethodRow| {
        let median = other.break_times.median;
        other.parameters == row.parameters && median.is_some_and(|median| median < error)
    };
    let cheapest = findings
        .methods
        .iter()
        .filter(is_tighter)
        .min_by(|a, b| a.cost.per_slip.total_cmp(&b.cost.per_slip))?;
    let times = cheapest.cost.per_slip / row.cost.per_slip;
    Some(format!(
        "For more: {} costs {times:.1} times as much.",
        cheapest.solver
    ))
}

#[cfg(test)]
mod tests {
    use super::super::Cost;
    use super::super::comparison::{Bias, BreakErrors};
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
    use crate::solver::{Resolve, Solver};
    use crate::table::columns::Interval;

    const GRID: Solver = Solver {
        resolve: Resolve::Grid,
        ..Solver::event_driven(1e-3)
    };

    fn row(quantity: &str, slips: u64, bias: f64) -> BiasRow {
        BiasRow {
            parameters: Selected::new(Parameters::default()),
            case: String::new(),
            solver: GRID.into(),
            quantity: quantity.to_owned(),
            slips,
            reference_slips: 2 * slips,
            mean: 0.1 + bias,
            reference_mean: 0.1,
            deviation: 0.01,
            reference_deviation: 0.01,
            bias: Bias {
                of_mean: bias,
                interval_of_mean: Some(Interval::around(bias, 1e-3)),
                freedom: Some(1e9),
                ..Bias::default()
            },
        }
    }

    fn method(solver: Solver, error: f64, per_slip: f64) -> MethodRow {
        MethodRow {
            unbalanced: None,
            parameters: Selected::new(Parameters::default()),
            case: String::new(),
            solver: solver.into(),
            cost: Cost {
                per_slip,
                timed_slips: 9,
                ..Cost::default()
            },
            break_times: BreakErrors {
                median: Some(error),
                largest: Some(10.0 * error),
                ..BreakErrors::default()
            },
        }
    }

    fn lines(slips_of_set: u64, biases: Vec<BiasRow>) -> Vec<String> {
        let tighter = Solver {
            resolve: Resolve::Grid,
            ..Solver::event_driven(1e-5)
        };
        let study = Study {
            sets: vec![Parameters::default()],
            own: GRID,
            slips_of_sets: vec![slips_of_set],
            ..Study::quick()
        };
        let methods = vec![method(GRID, 2e-7, 1e-3), method(tighter, 1e-9, 1.6e-3)];
        verdict(&study, &Findings { methods, biases })
    }

    #[test]
    fn a_bias_counts_if_it_survives_the_number_of_comparisons_and_there_are_slips_enough() {
        let with = |slips, bias| {
            let others = ["drop", "duration", "peak_force", "front_speed"]
                .map(|quantity| row(quantity, slips, 0.0));
            lines(
                1000,
                others
                    .into_iter()
                    .chain([row("interval", slips, bias)])
                    .collect(),
            )
            .remove(0)
        };
        // 1.2 half-widths, or 2.35 standard errors, count for one comparison and not for five, of which 2.58 are
        // needed.
        assert!(
            with(1000, 1.2e-3).contains("no bias found; with 1000 slips per solver one of the ")
        );
        assert!(
            lines(1000, vec![row("interval", 1000, 1.2e-3)])[0]
                .contains("biased: interval by +1.20 ± 1.00 % at V0")
        );
        assert!(with(1000, -1.4e-3).contains("biased: interval by -1.40"));
        for bias in [5e-3, 0.0] {
            assert!(with(24, bias).contains("too few slips: 24 per solver"));
        }
        // Of three degrees of freedom, 2.4 half-widths are needed for five.
        let of_few = |bias| {
            let mut row = row("interval", 1000, bias);
            row.bias.freedom = Some(3.0);
            let others = ["drop", "duration", "peak_force", "front_speed"]
                .map(|quantity| super::tests::row(quantity, 1000, 0.0));
            lines(1000, others.into_iter().chain([row]).collect()).remove(0)
        };
        assert!(
            of_few(1.7e-3).contains("no bias found"),
            "{}",
            of_few(1.7e-3)
        );
        assert!(of_few(2.2e-3).contains("biased"), "{}", of_few(2.2e-3));
    }

    #[test]
    fn what_would_go_unseen_is_the_quantity_that_is_known_worst() {
        let mut duration = row("duration", 1000, 0.0);
        duration.bias.interval_of_mean = Some(Interval {
            low: -5e-3,
            high: 5e-3,
        });
        let said = lines(1000, vec![row("interval", 1000, 0.0), duration]).remove(0);
        assert!(
            said.contains("one of the duration below 5.7 % would go unseen at V0"),
            "{said}"
        );
    }

    #[test]
    fn the_solver_is_compared_with_the_statistical_error_of_the_sweep_and_what_is_tighter_has_its_price()
     {
        // 1 % is the error of 1000 slips against 2000, which is that of 667 alone.
        let said = |slips| lines(slips, vec![row("interval", 1000, 0.0)]);
        let few = said(60);
        assert!(
            few[0].contains("no bias found; with 1000 slips per solver one of the interval below 1.0 % would go unseen"),
            "{}",
            few[0]
        );
        assert_eq!(
            few[1],
            "Before trajectories part, breaks are off by 2e-7 s in the median, and by 2e-6 s at most."
        );
        assert!(
            few[2].ends_with("slips: 3.3 %, so the solver is not what limits you."),
            "{}",
            few[2]
        );
        assert_eq!(
            few[3],
            "For more: grid, tolerance 1e-5 costs 1.6 times as much."
        );
        assert!(said(66_700)[2].contains("0.1 %; more --seeds here"));
        // 0.9 % was found, and up to 1.9 % are not excluded.
        let off = |slips| lines(slips, vec![row("interval", 1000, 9e-4)]).remove(2);
        assert!(
            off(18).ends_with("not what limits you.")
                && off(30).contains("4.7 %; more --seeds here"),
            "{}",
            off(30)
        );
        assert!(lines(10, Vec::new())[0].contains("not compared"));
    }
}
