//! All figures that fit the reduced data of a sweep, written together.

use super::sets::{modulation, setting, swept};
use super::{Bar, FigureError, HistogramPanel, MOST_PANELS, Picture};
use super::{backbone, dependence, drag, friction, histograms, intervals, locking_map, staircase};
use crate::model::{Parameters, Symbol};
use crate::reduce::{HistogramBin, Point, SetSummary, WRITER, read_reduced, read_sets};
use crate::results::commit::{Commit, alone, create_folder};
use crate::results::layout::Layout;
use crate::table::storage::Storage;
use std::path::PathBuf;

/// Sets that figures hold at once, some 300 bytes each; of more, no figure of sets is drawn.
const MOST_SETS: usize = 100_000;

/// Draws the figures of a results directory into `figures/`, each as SVG and PNG: φ against η and τ against T if the drive
/// is modulated, both along the way if the modulation is ramped, histograms of τ if there are few sets, and those figures of
/// sets whose conditions hold.
///
/// Returns the files, in the order in which they were written.
///
/// # Errors
/// When the reduced data are not there, are damaged, or a figure cannot be written.
pub fn draw_all(storage: &dyn Storage, layout: &Layout) -> Result<Vec<PathBuf>, FigureError> {
    let _alone = alone(storage, layout, WRITER)?;
    let points = read_reduced::<Point>(storage, layout)?;
    let mut pictures = Vec::new();
    if points.iter().any(|point| point.phase.is_some()) {
        pictures.push(backbone(&points, &read_reduced(storage, layout)?)?);
    }
    if points.iter().any(|point| point.period.is_some() && point.interval.is_some()) {
        pictures.push(intervals(&points)?);
    }
    if points.iter().any(|point| point.ramp_stage.is_some() && point.interval.is_some()) {
        pictures.push(drag(&points)?);
    }
    let sets = read_sets(storage, layout, MOST_SETS)?;
    // Under a ramp a set has no one period.
    if sets.iter().all(|set| set.parameters.ramp_time == 0.0) {
        for figure in [locking_map, staircase, dependence, friction] {
            pictures.extend(figure(&sets));
        }
    }
    // Each panel may hold a second set, of identical contacts.
    let are_few = (1..=2 * MOST_PANELS).contains(&sets.len());
    let panels = if are_few { panels(&sets, &read_reduced(storage, layout)?) } else { Vec::new() };
    if (1..=MOST_PANELS).contains(&panels.len()) {
        pictures.push(histograms(&panels)?);
    }
    write(storage, layout, &pictures)
}

fn write(storage: &dyn Storage, layout: &Layout, pictures: &[Picture]) -> Result<Vec<PathBuf>, FigureError> {
    let folder = layout.figures();
    create_folder(storage, &folder)?;
    let mut commit = Commit::begin(storage, &layout.staging(WRITER))?;
    let mut files = Vec::new();
    for picture in pictures {
        for (extension, bytes) in [("svg", picture.svg().into_bytes()), ("png", picture.png()?)] {
            let file = folder.join(format!("{}.{extension}", picture.name()));
            commit.stage_bytes(&file, &bytes)?;
            files.push(file);
        }
    }
    commit.publish()?;
    Ok(files)
}

/// A panel per set; one of identical contacts goes onto the panel of the set that it otherwise equals.
fn panels(sets: &[SetSummary], bins: &[HistogramBin]) -> Vec<HistogramPanel> {
    let bars = |set: &SetSummary| -> Vec<Bar> {
        bins.iter().filter(|bin| bin.set_id == set.set_id).map(|bin| (bin.low, bin.high, bin.density)).collect()
    };
    let identical = |parameters: &Parameters| Parameters { threshold_deviation: 0.0, ..parameters.clone() };
    let is_identical = |set: &SetSummary| set.parameters.threshold_deviation == 0.0;
    let twin = |set: &SetSummary| {
        sets.iter().find(|other| is_identical(other) && other.parameters == identical(&set.parameters))
    };
    let is_overlaid = |set: &SetSummary| {
        is_identical(set)
            && sets.iter().any(|other| !is_identical(other) && identical(&other.parameters) == set.parameters)
    };
    // By rising frequency, as in Fig. 2; sets come in the order of Δ and then T.
    let mut shown: Vec<&SetSummary> = sets.iter().filter(|set| !is_overlaid(set)).collect();
    shown.sort_by(|left, right| {
        left.parameters.modulation_frequency().total_cmp(&right.parameters.modulation_frequency())
    });
    let swept = swept(&shown);
    let panel = |set: &SetSummary| HistogramPanel {
        title: title(&set.parameters, &swept),
        bars: bars(set),
        overlay: twin(set).filter(|_| !is_identical(set)).map(|twin| ("identical contacts".to_owned(), bars(twin))),
        period: set.parameters.modulation_period,
    };
    shown.into_iter().map(panel).collect()
}

/// Modulation and whatever else differs between the sets.
fn title(parameters: &Parameters, swept: &[Symbol]) -> String {
    let settings = swept.iter().map(|&symbol| setting(parameters, symbol));
    std::iter::once(modulation(parameters)).chain(settings).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reduce::SetRow;
    use crate::reduce::{BackboneBin, Point, reduced_file};
    use crate::table::file::{Footer, TableWriter};
    use crate::table::storage::Disk;
    use std::fs;

    fn set(id: &str, deviation: f64, frequency: Option<f64>) -> SetSummary {
        let parameters = Parameters {
            threshold_deviation: deviation,
            modulation_amplitude: frequency.map_or(0.0, |_| 1e-6),
            modulation_period: frequency.map(|frequency| 1.0 / frequency),
            ..Parameters::default()
        };
        SetSummary { set_id: id.to_owned(), parameters, ..SetSummary::default() }
    }

    fn bin(id: &str, low: f64) -> HistogramBin {
        HistogramBin { set_id: id.to_owned(), low, high: low + 0.01, count: 1, density: 100.0 }
    }

    #[test]
    fn sets_become_the_panels_of_fig_2() {
        let sets = [
            set("identical", 0.0, None),
            set("still", 6.9e-3, None),
            set("58", 6.9e-3, Some(58.0)),
            set("29", 6.9e-3, Some(29.0)),
        ];
        let panels = panels(&sets, &[bin("identical", 0.1), bin("still", 0.2), bin("29", 0.3), bin("58", 0.4)]);
        assert_eq!(panels.len(), 3);
        assert_eq!(panels[0].bars, [(0.2, 0.2 + 0.01, 100.0)]);
        assert_eq!(panels[0].overlay.as_ref().unwrap().1, [(0.1, 0.1 + 0.01, 100.0)]);
        assert_eq!(panels[1].title, "Δ = 1 µm, 1/T = 29 Hz");
        assert_eq!((panels[2].period, panels[2].overlay.as_ref()), (Some(1.0 / 58.0), None));
    }

    fn reduced(points: &[Point]) -> (tempfile::TempDir, Layout) {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        fs::create_dir_all(layout.reduced()).unwrap();
        let footer = Footer::default();
        let path = |name: &str| reduced_file(&layout, name);
        let mut writer = TableWriter::<Point>::create(&Disk, &path("points"), &footer).unwrap();
        for point in points {
            writer.push(point).unwrap();
        }
        writer.finish().unwrap();
        TableWriter::<BackboneBin>::create(&Disk, &path("backbone"), &footer).unwrap().finish().unwrap();
        TableWriter::<SetRow>::create(&Disk, &path("sets"), &footer).unwrap().finish().unwrap();
        TableWriter::<HistogramBin>::create(&Disk, &path("histograms"), &footer).unwrap().finish().unwrap();
        (root, layout)
    }

    fn modulated(step: u32) -> Point {
        let period = 0.01 * f64::from(1 + step % 5);
        Point {
            drive_velocity: 1e-4,
            amplitude: 1e-6,
            period: Some(period),
            eta: 0.5 + f64::from(step),
            ramp_stage: None,
            onset: 1.0,
            interval: Some(4.0 * period),
            periods: Some(4),
            phase: Some(-0.01 * f64::from(step)),
            is_locked: step.is_multiple_of(2),
        }
    }

    #[test]
    fn figures_are_byte_identical_when_drawn_again() {
        let (_root, layout) = reduced(&(0..200).map(modulated).collect::<Vec<_>>());
        let files = draw_all(&Disk, &layout).unwrap();
        let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap().to_string_lossy().into_owned()).collect();
        assert_eq!(names, ["phi-eta.svg", "phi-eta.png", "tau-T.svg", "tau-T.png"]);
        let bytes = || files.iter().map(|file| fs::read(file).unwrap()).collect::<Vec<_>>();
        let before = bytes();
        assert_eq!(draw_all(&Disk, &layout).unwrap(), files);
        assert!(bytes() == before);
        let (svg, png) = (String::from_utf8(before[0].clone()).unwrap(), &before[1]);
        assert!(svg.contains("φ (rad)") && svg.ends_with("</svg>"));
        assert!(png.starts_with(b"\x89PNG"));
    }

    #[test]
    fn without_modulation_no_phase_is_drawn() {
        let still = Point { period: None, periods: None, phase: None, ..modulated(1) };
        let (_root, layout) = reduced(&[still]);
        assert!(draw_all(&Disk, &layout).unwrap().is_empty());
    }
}
