//! Scaling: what a slip costs, and the steps and breaks in it, over each size of the slider; all logarithmic.

use super::FigureError;
use super::axis::{Axis, logarithmic_bounds};
use super::frame::{ABOVE, Frame, LEFT, Layout, RIGHT};
use super::legend::{Entry, Mark, entry};
use super::picture::{Picture, Sheet, Stroke};
use super::style::{GREY, INKS, Look, curve, dot};

const NAME: &str = "scaling";
/// Powers of the size that are drawn as guides, and their dashes.
const GUIDES: [(i32, Stroke); 2] =
    [(1, Stroke::dashed(GREY, 1.4, (2.0, 3.0))), (2, Stroke::dashed(GREY, 1.4, (8.0, 4.0)))];
/// Guides start under the lowest curve by this factor.
const GUIDES_UNDER: f64 = 0.35;

/// A name and points, each a size and a value.
pub type Line = (String, Vec<(f64, f64)>);

/// What grows with a size of the slider.
#[derive(Clone, Debug, PartialEq)]
pub struct Growth {
    pub label: String,
    /// CPU times per slip, in s.
    pub costs: Vec<Line>,
    pub counts: Vec<Line>,
}

type LinesOf = fn(&Growth) -> &[Line];

/// Draws a column of two panels for each size: costs above, counts below. Names are those of the last.
pub fn scaling(growths: &[Growth], look: &Look) -> Result<Picture, FigureError> {
    let columns = growths.len();
    let heights = &[280.0; 2];
    let layout = Layout { columns, column_gap: LEFT, ..Layout::column(360.0, heights, ABOVE, RIGHT) };
    let (page, mut sheet) = layout.page(NAME, look, &growths.last().map_or(Vec::new(), legend));
    let rows: [(&str, LinesOf); 2] =
        [("CPU time per slip (s)", |growth| &growth.costs), ("Steps and breaks per slip", |growth| &growth.counts)];
    for (row, (y_label, lines_of)) in rows.into_iter().enumerate() {
        let values = growths.iter().flat_map(|growth| points(lines_of(growth))).map(|point| point.1);
        let (low, high) = logarithmic_bounds(values).ok_or(FigureError::Empty { figure: NAME, what: "costs" })?;
        for (column, growth) in growths.iter().enumerate() {
            let lines = lines_of(growth);
            let Some((first, last)) = logarithmic_bounds(points(lines).map(|point| point.0)) else { continue };
            let x = Axis::logarithmic(&growth.label, first, last);
            let y = Axis::logarithmic(if column == 0 { y_label } else { "" }, GUIDES_UNDER * low, high);
            let frame = page.frame(row, column, x, y);
            draw(&mut sheet, &frame, lines);
            frame.axes(&mut sheet);
        }
    }
    Ok(sheet.finish())
}

fn points(lines: &[Line]) -> impl Iterator<Item = (f64, f64)> {
    lines.iter().flat_map(|(_, points)| points).copied()
}

/// Lines of both panels, whose inks are the same, and the guides.
fn legend(growth: &Growth) -> Vec<Entry> {
    let lines = [("costs", &growth.costs), ("counts", &growth.counts)].map(|(of, lines)| (of, lines, INKS));
    let named = lines.into_iter().flat_map(|(of, lines, inks)| {
        lines.iter().zip(inks).map(move |((name, _), ink)| entry(Mark::Line(curve(ink)), format!("{of}: {name}")))
    });
    named.chain(GUIDES.map(|(power, stroke)| entry(Mark::Line(stroke), format!("slope {power}")))).collect()
}

/// The guides from under the first point of the lowest line, and the lines over them.
fn draw(sheet: &mut Sheet, frame: &Frame, lines: &[Line]) {
    let start = points(lines).fold((f64::INFINITY, f64::INFINITY), |least, (x, y)| (least.0.min(x), least.1.min(y)));
    frame.clipped(sheet, |sheet| {
        for (power, stroke) in GUIDES {
            let guide = |x: f64| (x, GUIDES_UNDER * start.1 * (x / start.0).powi(power));
            frame.curve(sheet, [guide(start.0), guide(frame.x.high)], stroke);
        }
        for ((_, points), ink) in lines.iter().zip(INKS) {
            frame.curve(sheet, points.iter().copied(), curve(ink));
            frame.points(sheet, points.iter().copied(), dot(ink));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_panels_a_size_and_each_label_once() {
        let line = |name: &str| (name.to_owned(), vec![(70.0, 0.01), (140.0, 0.03)]);
        let growth = |label: &str| Growth { label: label.to_owned(), costs: vec![line("a")], counts: vec![line("b")] };
        let picture = scaling(&[growth("Blocks N"), growth("Contacts")], &Look::default()).unwrap();
        let svg = picture.svg();
        assert_eq!(svg.matches("<clipPath").count(), 4);
        for text in [
            "Blocks N",
            "Contacts",
            "(a) CPU time per slip (s)",
            "(c) Steps and breaks per slip",
            "slope 1",
            "costs: a",
        ] {
            assert_eq!(svg.matches(&format!(">{text}<")).count(), 1, "{text}");
        }
        assert!(picture.png().unwrap().starts_with(b"\x89PNG"));
        assert!(scaling(&[], &Look::default()).is_err());
    }
}
