//! Standing figures: those that a results directory has if their data are there.

use super::beside::Beside;
use super::files::{ADVICE, Drawn, read, remarks, sets_with_results, write};
use super::note::common;
use super::options::BadOption;
use super::picture::{Picture, PictureFormat};
use super::style::{INKS, Look};
use super::{drag, edge_values, histograms, intervals, map, overview, phase_eta, triggering};
use crate::reduce::{
    BackboneBin, Condition, EdgeRow, HistogramBin, Point, PulseRow, advise, points_of,
    read_control, read_optional, swept,
};
use crate::results::Results;
use crate::results::layout::Layout;
use crate::sets::SetRow;
use crate::table::columns::Row;
use anyhow::Result;
use std::ffi::OsStr;

/// What standing figures are drawn from.
struct Data<'a> {
    points: Vec<Point>,
    backbone: Vec<BackboneBin>,
    /// Slips after a pulse have a figure of their own.
    sets: Vec<SetRow>,
    control: Option<SetRow>,
    histograms: Vec<HistogramBin>,
    edges: Vec<EdgeRow>,
    pulses: Vec<PulseRow>,
    beside: &'a Beside,
    look: &'a Look,
}

impl<'a> Data<'a> {
    fn read(layout: &Layout<'_>, beside: &'a Beside, look: &'a Look) -> Result<Self> {
        let mut sets = sets_with_results(layout).map_err(advise(ADVICE))?;
        sets.retain(|set| set.parameters.pulse_start.is_none());
        let has_histograms = sets.len() <= histograms::MAX_SETS;
        Ok(Self {
            points: read(layout)?,
            backbone: read(layout)?,
            histograms: if has_histograms {
                read(layout)?
            } else {
                Vec::new()
            },
            sets,
            control: read_control(layout).map_err(advise(ADVICE))?,
            edges: read_optional(layout).map_err(advise(ADVICE))?,
            pulses: read_optional(layout).map_err(advise(ADVICE))?,
            beside,
            look,
        })
    }

    /// Those of the sets for which a condition holds, with their slips.
    fn retain(&mut self, results: &Results<'_>, condition: &str) -> Result<()> {
        if self.sets.is_empty() {
            return Ok(retain(&mut self.pulses, "pulses", condition)?);
        }
        retain(&mut self.sets, "sets", condition)?;
        self.points = points_of(results, &self.sets)?;
        // Their bins hold the slips of all sets.
        self.backbone.clear();
        // What the condition does not know of, or holds for none, has no figure.
        if retain(&mut self.edges, "edges", condition).is_err() {
            self.edges.clear();
        }
        if retain(&mut self.pulses, "pulses", condition).is_err() {
            self.pulses.clear();
        }
        Ok(())
    }

    /// Of each standing figure that these data make, or the overview.
    fn pictures(&self) -> Vec<Picture> {
        let figures = STANDING.iter();
        let mut pictures: Vec<Picture> = figures.filter_map(|(_, draw)| draw(self)).collect();
        if pictures.is_empty() {
            pictures.extend(overview::overview(
                &self.sets,
                None,
                self.beside,
                &self.of_all(),
            ));
        }
        pictures
    }

    /// The look of figures of this directory, and of all.
    fn own(&self) -> Look {
        let parameters = self.sets.iter().map(|set| &*set.parameters);
        self.look.with_note(&common(parameters, &[]))
    }

    fn of_all(&self) -> Look {
        self.beside.look(self.look, &self.sets)
    }

    /// The sets; none under a ramp, where a set has no one period.
    fn still(&self) -> &[SetRow] {
        let is_ramped = self.sets.iter().any(|set| set.parameters.ramp_time > 0.0);
        if is_ramped { &[] } else { &self.sets }
    }

    fn map(&self) -> Option<Picture> {
        let mut maps = [map::locking, map::regimes].into_iter();
        maps.find_map(|map| map(self.still(), &self.own()))
    }
}

/// `None` where a map shows it better: more values than colours would be a net of lines. A single set would be a dot.
fn overview_of_sets(data: &Data<'_>) -> Option<Picture> {
    let is_net = |sets: &[SetRow]| {
        let swept = swept(sets);
        swept
            .get(1)
            .is_some_and(|second| second.distinct.len() > INKS.len())
    };
    let sets = data.still();
    let is_shown = sets.len() > 1 && !(is_net(sets) && data.map().is_some());
    let of_control = data.control.as_ref();
    is_shown.then(|| overview::overview(sets, of_control, data.beside, &data.of_all()))?
}

/// Keeps the rows for which a condition holds; an error if it holds for none.
fn retain<R: Row>(rows: &mut Vec<R>, of: &str, text: &str) -> Result<(), BadOption> {
    let refused = |problem: String| BadOption::new("where", text, &problem);
    let condition = Condition::read(text, &R::columns()).map_err(refused)?;
    if !rows.iter().any(|row| condition.holds(row)) {
        return Err(refused(condition.unmatched(of, rows)));
    }
    rows.retain(|row| condition.holds(row));
    Ok(())
}

/// A figure, or `None` if its data are not there.
type DrawFigure = fn(&Data<'_>) -> Option<Picture>;

/// The figures that [`draw_all`] draws if their data are there, in the order of the report.
const STANDING: &[(&str, DrawFigure)] = &[
    (overview::NAME, overview_of_sets),
    (map::LOCKING, |data| map::locking(data.still(), &data.own())),
    (map::REGIMES, |data| map::regimes(data.still(), &data.own())),
    (edge_values::NAME, |data| {
        edge_values::edges(&data.edges, &data.own())
    }),
    (drag::NAME, |data| drag::drag(&data.points, &data.own())),
    (phase_eta::NAME, |data| {
        phase_eta::phase_eta(&data.points, &data.backbone, data.beside, &data.of_all())
    }),
    (intervals::NAME, |data| {
        intervals::intervals(&data.points, &data.own())
    }),
    (histograms::NAME, |data| {
        histograms::histograms(&data.sets, &data.histograms, &data.own())
    }),
    (triggering::NAME, |data| {
        triggering::triggering(&data.pulses, data.look)
    }),
];

/// Those that show other directories, too.
const BESIDE: [&str; 2] = [overview::NAME, phase_eta::NAME];

/// The names of the standing figures, in the order of the report.
pub fn standing() -> impl Iterator<Item = &'static str> {
    STANDING.iter().map(|(name, _)| *name)
}

/// Draws the figures of a results directory into `figures/`, each in these formats: those whose data are there. Standing
/// figures without data go, in all formats.
///
/// Returns the files, in the order in which they were written.
pub fn draw_all(
    layout: &Layout<'_>,
    beside: &Beside,
    look: &Look,
    formats: &[PictureFormat],
) -> Result<Drawn> {
    let pictures = Data::read(layout, beside, look)?.pictures();
    let mut remarks = remarks(&pictures);
    let is_beside = |picture: &Picture| BESIDE.contains(&picture.name());
    if !beside.others.is_empty() && !pictures.iter().any(is_beside) {
        let figures = BESIDE.join(" and ");
        remarks.push(format!(
            "other directories are not shown: only {figures} can show them, and neither is drawn"
        ));
    }
    let files = write(layout, &pictures, formats)?;
    // What earlier data gave, and these do not.
    for name in layout.storage.list(&layout.figures())? {
        let path = layout.figures().join(name);
        let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
        let is_drawn = pictures.iter().any(|picture| picture.name() == stem);
        if standing().any(|name| name == stem) && !is_drawn {
            layout.remove(&path)?;
        }
    }
    Ok(Drawn { files, remarks })
}

/// Draws the standing figures of the sets for which a condition holds. Their names end in `-where`.
pub fn draw_where(
    results: &Results<'_>,
    condition: &str,
    look: &Look,
    formats: &[PictureFormat],
) -> Result<Drawn> {
    let look = look.with_note(&format!("where {condition}"));
    let beside = Beside::default();
    let mut data = Data::read(results.layout(), &beside, &look)?;
    data.retain(results, condition)?;
    let mut pictures = data.pictures();
    for picture in &mut pictures {
        picture.name += "-where";
    }
    let files = write(results.layout(), &pictures, formats)?;
    Ok(Drawn {
        files,
        remarks: remarks(&pictures),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::style::{Size, Style};
    use crate::reduce::{BackboneBin, HistogramBin, Point};
    use crate::table::Table;
    use crate::table::arrow::Gaps;
    use crate::table::file::{Footer, TableWriter};
    use crate::table::storage::{Disk, Storage};
    use std::fs;
    use std::path::PathBuf;

    fn write_rows<R: Table>(layout: &Layout<'_>, rows: &[R]) {
        let path = layout.reduced_file(R::NAME);
        let file = Disk.create(&path).unwrap();
        let mut writer =
            TableWriter::new(&Gaps::default(), &path, file, &Footer::default()).unwrap();
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

    fn files_of(
        layout: &Layout<'_>,
        look: &Look,
        formats: &[PictureFormat],
    ) -> Result<Vec<PathBuf>> {
        Ok(draw_all(layout, &Beside::default(), look, formats)?.files)
    }

    fn modulated(step: u32) -> Point {
        let period = 0.01 * f64::from(1 + step % 5);
        Point {
            drive_velocity: 1e-4,
            amplitude: 1e-6,
            period: Some(period),
            eta: 0.5 + f64::from(step),
            interval: Some(4.0 * period),
            periods: Some(4),
            phase: Some(-0.01 * f64::from(step)),
            has_phase: step.is_multiple_of(2),
            ..Point::default()
        }
    }

    #[test]
    fn figures_are_byte_identical_when_drawn_again() {
        let (_root, layout) = reduced(&(0..200).map(modulated).collect::<Vec<_>>());
        let files = files_of(&layout, &Look::default(), &PictureFormat::DEFAULT).unwrap();
        let names: Vec<_> = files
            .iter()
            .map(|file| file.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        assert_eq!(
            names,
            ["phi-eta.svg", "phi-eta.png", "tau-T.svg", "tau-T.png"]
        );
        let stems = names.iter().filter_map(|name| name.split('.').next());
        assert!(
            stems
                .into_iter()
                .all(|stem| standing().any(|name| name == stem)),
            "the report shows them"
        );
        let bytes = || {
            files
                .iter()
                .map(|file| fs::read(file).unwrap())
                .collect::<Vec<_>>()
        };
        let before = bytes();
        assert_eq!(
            files_of(&layout, &Look::default(), &PictureFormat::DEFAULT).unwrap(),
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
            let files = files_of(&layout, &look, &[PictureFormat::Pdf]).unwrap();
            fs::read(&files[0]).unwrap()
        };
        let pdf = drawn();
        assert!(pdf.starts_with(b"%PDF-") && pdf.trim_ascii_end().ends_with(b"%%EOF"));
        assert!(drawn() == pdf);
        let svg = fs::read_to_string(&files_of(&layout, &look, &[PictureFormat::Svg]).unwrap()[0])
            .unwrap();
        assert!(svg.contains(r#"width="86.00mm""#), "{}", &svg[..200]);
    }

    #[test]
    fn a_size_that_a_figure_does_not_fit_is_refused_with_the_least_one() {
        let (_root, layout) = reduced(&(0..200).map(modulated).collect::<Vec<_>>());
        let drawn = |width, height| {
            files_of(
                &layout,
                &Look {
                    size: Some(Size { width, height }),
                    ..Look::default()
                },
                &[PictureFormat::Svg],
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
    fn without_modulation_no_phase_is_drawn_and_that_of_earlier_data_goes() {
        let still = Point {
            period: None,
            periods: None,
            phase: None,
            ..modulated(1)
        };
        let (_root, layout) = reduced(&[still]);
        fs::create_dir_all(layout.figures()).unwrap();
        for name in ["phi-eta.pdf", "tau_mean-V0.svg"] {
            fs::write(layout.figures().join(name), "earlier").unwrap();
        }
        assert!(
            files_of(&layout, &Look::default(), &PictureFormat::DEFAULT)
                .unwrap()
                .is_empty()
        );
        assert_eq!(Disk.list(&layout.figures()).unwrap(), ["tau_mean-V0.svg"]);
    }
}
