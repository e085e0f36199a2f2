//! All figures that fit the reduced data of a sweep, written together.

use super::{FigureError, Picture};
use super::{backbone, dependence, drag, friction, histograms, intervals, locking_map, regimes, staircase};
use crate::reduce::{WRITER, read_reduced, read_sets};
use crate::results::commit::{Commit, alone};
use crate::results::layout::Layout;
use std::path::PathBuf;

/// Sets that figures hold at once, some 300 bytes each; of more, no figure of sets is drawn.
const MAX_SETS: usize = 100_000;

/// Draws the figures of a results directory into `figures/`, each as SVG and PNG: those whose data are there.
///
/// Returns the files, in the order in which they were written.
///
/// # Errors
/// When the reduced data are not there, are damaged, or a figure cannot be written.
pub fn draw_all(layout: &Layout<'_>) -> Result<Vec<PathBuf>, FigureError> {
    let _alone = alone(layout, WRITER)?;
    if !layout.storage.exists(&layout.reduced())? {
        return Err(FigureError::NotReduced { directory: layout.root().to_owned() });
    }
    let points = read_reduced(layout)?;
    let mut pictures: Vec<Picture> = Vec::new();
    pictures.extend(backbone::backbone(&points, &read_reduced(layout)?));
    pictures.extend(intervals::intervals(&points));
    pictures.extend(drag::drag(&points));
    let sets = read_sets(layout, MAX_SETS)?;
    // Under a ramp a set has no one period.
    if sets.iter().all(|set| set.parameters.ramp_time == 0.0) {
        for figure in [
            locking_map::locking_map,
            staircase::staircase,
            dependence::dependence,
            friction::friction,
            regimes::regimes,
            regimes::regime_map,
        ] {
            pictures.extend(figure(&sets));
        }
    }
    if sets.len() <= histograms::MAX_SETS {
        pictures.extend(histograms::histograms(&sets, &read_reduced(layout)?));
    }
    write(layout, &pictures)
}

fn write(layout: &Layout<'_>, pictures: &[Picture]) -> Result<Vec<PathBuf>, FigureError> {
    let folder = layout.figures();
    layout.ensure_folder(&folder)?;
    let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reduce::{BackboneBin, HistogramBin, Point, SetRow};
    use crate::table::columns::Table;
    use crate::table::file::{Footer, TableWriter};
    use crate::table::storage::{Disk, Storage};
    use std::fs;

    fn write_rows<R: Table>(layout: &Layout<'_>, rows: &[R]) {
        let file = Disk.create(&layout.reduced_file(R::NAME)).unwrap();
        let mut writer = TableWriter::new(file, &Footer::default()).unwrap();
        for row in rows {
            writer.push(row).unwrap();
        }
        writer.finish().unwrap();
    }

    fn reduced(points: &[Point]) -> (tempfile::TempDir, Layout<'static>) {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&Disk, root.path());
        fs::create_dir_all(layout.reduced()).unwrap();
        write_rows(&layout, points);
        write_rows::<BackboneBin>(&layout, &[]);
        write_rows::<SetRow>(&layout, &[]);
        write_rows::<HistogramBin>(&layout, &[]);
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
        let files = draw_all(&layout).unwrap();
        let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap().to_string_lossy().into_owned()).collect();
        assert_eq!(names, ["phi-eta.svg", "phi-eta.png", "tau-T.svg", "tau-T.png"]);
        let bytes = || files.iter().map(|file| fs::read(file).unwrap()).collect::<Vec<_>>();
        let before = bytes();
        assert_eq!(draw_all(&layout).unwrap(), files);
        assert!(bytes() == before);
        let (svg, png) = (String::from_utf8(before[0].clone()).unwrap(), &before[1]);
        assert!(svg.contains("φ (rad)") && svg.ends_with("</svg>"));
        assert!(png.starts_with(b"\x89PNG"));
    }

    #[test]
    fn without_modulation_no_phase_is_drawn() {
        let still = Point { period: None, periods: None, phase: None, ..modulated(1) };
        let (_root, layout) = reduced(&[still]);
        assert!(draw_all(&layout).unwrap().is_empty());
    }
}
