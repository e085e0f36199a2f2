//! All figures that fit the reduced data of a sweep, written together.

use super::{FigureError, Picture};
use super::{backbone, dependence, drag, friction, histograms, intervals, locking_map, staircase};
use crate::reduce::{WRITER, read_reduced, read_sets};
use crate::results::commit::{Commit, alone, create_folder};
use crate::results::layout::Layout;
use crate::table::storage::Storage;
use std::path::PathBuf;

/// Sets that figures hold at once, some 300 bytes each; of more, no figure of sets is drawn.
const MAX_SETS: usize = 100_000;

/// Draws the figures of a results directory into `figures/`, each as SVG and PNG: those whose data are there.
///
/// Returns the files, in the order in which they were written.
///
/// # Errors
/// When the reduced data are not there, are damaged, or a figure cannot be written.
pub fn draw_all(storage: &dyn Storage, layout: &Layout) -> Result<Vec<PathBuf>, FigureError> {
    let _alone = alone(storage, layout, WRITER)?;
    let points = read_reduced(storage, layout)?;
    let mut pictures: Vec<Picture> = Vec::new();
    pictures.extend(backbone::backbone(&points, &read_reduced(storage, layout)?));
    pictures.extend(intervals::intervals(&points));
    pictures.extend(drag::drag(&points));
    let sets = read_sets(storage, layout, MAX_SETS)?;
    // Under a ramp a set has no one period.
    if sets.iter().all(|set| set.parameters.ramp_time == 0.0) {
        for figure in [locking_map::locking_map, staircase::staircase, dependence::dependence, friction::friction] {
            pictures.extend(figure(&sets));
        }
    }
    if sets.len() <= histograms::MAX_SETS {
        pictures.extend(histograms::histograms(&sets, &read_reduced(storage, layout)?));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reduce::{BackboneBin, HistogramBin, Point, SetRow, reduced_file};
    use crate::table::file::{Footer, TableWriter};
    use crate::table::storage::Disk;
    use std::fs;

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
