//! All figures that fit the reduced data of a sweep, written together, and custom figures.

use super::style::INKS;
use super::{BadOption, CustomFigure, Format, Look, Picture};
use super::{custom, drag, edge_values, histograms, intervals, map, overview, phase_eta, sets};
use crate::reduce::{EdgeRow, SetRow, WRITER, advise, read_reduced, read_sets, swept};
use crate::results::commit::{Commit, exclusive_lock};
use crate::results::layout::Layout;
use crate::table::columns::Table;
use anyhow::Result;
use std::path::PathBuf;

/// Sets that figures hold at once, about a kilobyte each; of more, no figure of sets is drawn.
const MAX_SETS: usize = 100_000;
const ADVICE: &str = "if it is missing or damaged, reduce the tables again";

/// Draws the figures of a results directory into `figures/`, each in these formats: those whose data are there.
///
/// Returns the files, in the order in which they were written.
pub fn draw_all(layout: &Layout<'_>, look: &Look, formats: &[Format]) -> Result<Vec<PathBuf>> {
    let _alone = exclusive_lock(layout, WRITER)?;
    let points = read(layout)?;
    let sets = read_sets(layout, MAX_SETS).map_err(advise(ADVICE))?;
    let look = &look.with_note(&sets::common(sets.iter().map(|set| &*set.parameters)));
    let mut pictures: Vec<Picture> = Vec::new();
    pictures.extend(phase_eta::phase_eta(&points, &read(layout)?, &sets, look));
    pictures.extend(intervals::intervals(&points, look));
    pictures.extend(drag::drag(&points, look));
    // Under a ramp a set has no one period.
    if sets.iter().all(|set| set.parameters.ramp_time == 0.0) {
        let map = map::map(&sets, look);
        // More values than colours would be a net of lines, which a map shows better; a single set would be a dot.
        let is_net = || {
            swept(&sets)
                .get(1)
                .is_some_and(|second| second.distinct.len() > INKS.len())
        };
        if sets.len() > 1 && !(map.is_some() && is_net()) {
            pictures.extend(overview::overview(&sets, look));
        }
        pictures.extend(map);
    }
    if layout.storage.exists(&layout.reduced_file(EdgeRow::NAME))? {
        pictures.extend(edge_values::edges(&read(layout)?, look));
    }
    if sets.len() <= histograms::MAX_SETS {
        pictures.extend(histograms::histograms(&sets, &read(layout)?, look));
    }
    if pictures.is_empty() {
        pictures.extend(overview::overview(&sets, look));
    }
    write(layout, &pictures, look, formats)
}

/// Draws a custom figure from the sets of a results directory; writes nothing.
pub fn draw_custom(layout: &Layout<'_>, figure: &CustomFigure, look: &Look) -> Result<Picture> {
    let mut rows: Vec<SetRow> = read(layout)?;
    rows.retain(|row| !row.is_control);
    let look = &look.with_note(&sets::common(rows.iter().map(|row| &*row.parameters)));
    let picture = custom::custom(&rows, figure, look)?;
    check_size(&picture, look)?;
    Ok(picture)
}

/// Puts a figure into `figures/`, in these formats.
pub fn write_custom(
    layout: &Layout<'_>,
    picture: Picture,
    look: &Look,
    formats: &[Format],
) -> Result<Vec<PathBuf>> {
    let _alone = exclusive_lock(layout, WRITER)?;
    write(layout, &[picture], look, formats)
}

fn read<R: Table>(layout: &Layout<'_>) -> Result<Vec<R>> {
    read_reduced(layout).map_err(advise(ADVICE))
}

/// A picture is larger than it is asked to be if its frames would be too small to read.
fn check_size(picture: &Picture, look: &Look) -> Result<(), BadOption> {
    const SLACK: f64 = 1.001;
    let size = picture.size();
    match look.size {
        Some(asked) if size.width > SLACK * asked.width || size.height > SLACK * asked.height => {
            let problem = format!(
                "--size: figure {} needs at least {:.0}mmx{:.0}mm with its legend and small print, and less in the style print",
                picture.name(),
                size.width.ceil(),
                size.height.ceil()
            );
            Err(BadOption(problem))
        }
        _ => Ok(()),
    }
}

fn write(
    layout: &Layout<'_>,
    pictures: &[Picture],
    look: &Look,
    formats: &[Format],
) -> Result<Vec<PathBuf>> {
    pictures
        .iter()
        .try_for_each(|picture| check_size(picture, look))?;
    let folder = layout.figures();
    layout.ensure_folder(&folder)?;
    let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
    let mut files = Vec::new();
    for picture in pictures {
        for &format in formats {
            let file = folder.join(format!("{}.{}", picture.name(), format.word()));
            commit.stage_bytes(&file, &picture.encoded(format)?)?;
            files.push(file);
        }
    }
    commit.publish()?;
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::super::style::{Size, Style};
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
            has_phase: step.is_multiple_of(2),
        }
    }

    #[test]
    fn figures_are_byte_identical_when_drawn_again() {
        let (_root, layout) = reduced(&(0..200).map(modulated).collect::<Vec<_>>());
        let files = draw_all(&layout, &Look::default(), &Format::DEFAULT).unwrap();
        let names: Vec<_> = files
            .iter()
            .map(|file| file.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        assert_eq!(
            names,
            ["phi-eta.svg", "phi-eta.png", "tau-T.svg", "tau-T.png"]
        );
        let bytes = || {
            files
                .iter()
                .map(|file| fs::read(file).unwrap())
                .collect::<Vec<_>>()
        };
        let before = bytes();
        assert_eq!(
            draw_all(&layout, &Look::default(), &Format::DEFAULT).unwrap(),
            files
        );
        assert!(bytes() == before);
        let svg = String::from_utf8(before[0].clone()).unwrap();
        let png = &before[1];
        assert!(svg.contains("φ (rad)") && svg.ends_with("</svg>"));
        assert!(png.starts_with(b"\x89PNG"));
    }

    #[test]
    fn a_pdf_is_whole_and_byte_identical_when_drawn_again_and_has_the_size_of_its_style() {
        let (_root, layout) = reduced(&(0..200).map(modulated).collect::<Vec<_>>());
        let look = Look {
            style: Style::Print,
            ..Look::default()
        };
        let drawn = || {
            let files = draw_all(&layout, &look, &[Format::Pdf]).unwrap();
            fs::read(&files[0]).unwrap()
        };
        let pdf = drawn();
        assert!(pdf.starts_with(b"%PDF-") && pdf.trim_ascii_end().ends_with(b"%%EOF"));
        assert!(drawn() == pdf);
        let svg =
            fs::read_to_string(&draw_all(&layout, &look, &[Format::Svg]).unwrap()[0]).unwrap();
        assert!(svg.contains(r#"width="86.00mm""#), "{}", &svg[..200]);
    }

    #[test]
    fn a_size_that_a_figure_does_not_fit_is_refused_with_the_least_one() {
        let (_root, layout) = reduced(&(0..200).map(modulated).collect::<Vec<_>>());
        let drawn = |width, height| {
            draw_all(
                &layout,
                &Look {
                    size: Some(Size { width, height }),
                    ..Look::default()
                },
                &[Format::Svg],
            )
        };
        let error = drawn(5.0, 5.0).unwrap_err().to_string();
        assert!(
            error.starts_with("--size: figure phi-eta needs at least "),
            "{error}"
        );
        assert!(drawn(150.0, 100.0).is_ok());
    }

    #[test]
    fn without_modulation_no_phase_is_drawn() {
        let still = Point {
            period: None,
            periods: None,
            phase: None,
            ..modulated(1)
        };
        let (_root, layout) = reduced(&[still]);
        assert!(
            draw_all(&layout, &Look::default(), &Format::DEFAULT)
                .unwrap()
                .is_empty()
        );
    }
}
