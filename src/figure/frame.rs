//! Frames: rectangles with two axes and the data in them. A layout places them on a sheet, with the legend above and
//! the small print under them.

use super::axis::Axis;
use super::legend::{self, LegendEntry, draw_legend, legend_rows};
use super::picture::{Anchor, Picture, snapped};
use super::style::{
    AXIS, DARK_GREY, LABEL_TEXT, LEGEND_TEXT, Look, NOTE_TEXT, Place, Style, TICK_TEXT, text_width,
};

/// Lower and upper end.
pub(super) type Ends = (f64, f64);
/// A rectangle of data: its ends along x and along y.
pub(super) type Cell = (Ends, Ends);

/// The outline of a rectangle between two corners.
pub(super) fn outline((left, top): Place, (right, bottom): Place) -> Vec<Place> {
    let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
    [&corners[..], &corners[..1]].concat()
}

const TICK_LENGTH: f64 = 7.0;
const MINOR_TICK_LENGTH: f64 = 4.0;
/// Where labels of y axes, legends and small print begin.
const MARGIN: f64 = 14.0;
/// Between the number of a tick and the axis.
const TICK_GAP: f64 = 8.0;

/// Between the labels of neighbours.
const LABEL_GAP: f64 = 12.0;
/// Between a number and the edge of the sheet.
const EDGE: f64 = 2.0;

/// Space left of a frame for numbers.
pub(super) const LEFT: f64 = 76.0;
/// Space right of a frame.
const RIGHT: f64 = 26.0;
/// Space above a frame for the label of its y axis.
pub(super) const ABOVE: f64 = 38.0;
/// Space under a frame for numbers and label.
const UNDER: f64 = 58.0;
/// What a row over frames with another x axis needs beside, for its own numbers and label.
pub(super) const NUMBERS: f64 = UNDER - 12.0;
/// Between two rows of frames, for a label and some air.
const ROW_GAP: f64 = 52.0;
/// Space above a frame for a heading.
pub(super) const HEADING: f64 = 26.0;
/// Distance of the lines of small print.
const NOTE_ROW: f64 = 16.0;
/// Of the label of the y axis over the frame or its heading.
const Y_LABEL_RISE: f64 = 13.0;
/// By how much a cell reaches under a neighbour that is drawn later: viewers that scale would show a seam.
pub(super) const OVERLAP: f64 = 0.5;
/// Shortest side of a frame. If the requested sheet has no room for it, the sheet becomes larger.
const SHORTEST: f64 = 60.0;

/// Frames of a figure, in rows and columns; numbers and label of the x axes stand under the lowest row only.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub(super) columns: usize,
    pub(super) width: f64,
    pub(super) column_gap: f64,
    pub(super) row_gap: f64,
    /// Space right of the last column.
    pub(super) right: f64,
    /// Space above each frame for a heading.
    pub(super) heading: f64,
}

impl Layout {
    /// One under the other.
    pub(super) const fn column(width: f64) -> Self {
        Self {
            columns: 1,
            width,
            column_gap: 0.0,
            row_gap: ROW_GAP,
            right: RIGHT,
            heading: 0.0,
        }
    }

    /// Places frames with these heights, those of a row as high as the first, on a sheet of the requested size, under
    /// this legend.
    pub(super) fn page(
        self,
        name: &str,
        look: &Look,
        legend: &[LegendEntry],
        natural_heights: &[f64],
    ) -> (Page, Picture) {
        let count = natural_heights.len();
        let row_heights = natural_heights.iter().step_by(self.columns);
        let columns = self.columns as f64;
        let between = (columns - 1.0) * self.column_gap;
        let beside = LEFT + between + self.right;
        let natural = beside + columns * self.width;
        let asked = look.asked();
        let total = asked.map_or_else(|| look.width(natural), |(width, _)| width);
        let width = ((total - beside) / columns).max(SHORTEST);
        let total = beside + columns * width;

        let right = total - MARGIN;
        let top = ABOVE + legend_rows(legend, right - MARGIN).len() as f64 * legend::ROW;
        let notes = if look.has_caption() {
            let notes = std::iter::once(&look.note).chain(&look.directories);
            notes
                .flat_map(|note| wrapped(note, right - MARGIN))
                .collect()
        } else {
            Vec::new()
        };
        let rows = row_heights.len() as f64;
        let above_notes = top + rows * self.heading + (rows - 1.0) * self.row_gap + UNDER;
        let below_last = if notes.is_empty() { 0.0 } else { 0.5 };
        let around = above_notes + (notes.len() as f64 + below_last) * NOTE_ROW;
        let natural: f64 = row_heights.clone().sum();
        let scale = match asked {
            Some((_, height)) => (height - around) / natural,
            None => (width / self.width).min(1.0),
        };
        let scaled = row_heights.map(|height| (scale * height).max(SHORTEST));
        let heights: Vec<f64> = scaled.collect();
        let frames: f64 = heights.iter().sum();

        let mut sheet = Picture::new(name, look, (total, frames + around));
        draw_legend(&mut sheet, legend, MARGIN, right);
        for (row, line) in (1..).map(f64::from).zip(&notes) {
            let place = (MARGIN, frames + above_notes + row * NOTE_ROW - 4.0);
            sheet.coloured_text(place, line, NOTE_TEXT, Anchor::Start, Some(DARK_GREY));
        }
        (
            Page {
                layout: Self { width, ..self },
                count,
                heights,
                top,
                end: right,
            },
            sheet,
        )
    }
}

/// A text in lines that fit a width, broken at spaces that may be broken at.
fn wrapped(text: &str, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    // A percent sign stays with its number.
    let kept = text.replace(" %", "\u{a0}%");
    for word in kept.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), NOTE_TEXT) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
        .into_iter()
        .map(|line| line.replace('\u{a0}', " "))
        .collect()
}

/// Where frames lie on a sheet.
pub(super) struct Page {
    /// With the width that the frames have.
    layout: Layout,
    count: usize,
    /// Of the rows.
    heights: Vec<f64>,
    top: f64,
    end: f64,
}

impl Page {
    /// The frame of this number, from 0, row by row. One of several has a letter.
    pub(super) fn frame(&self, number: usize, x: Axis, y: Axis, has_numbers: bool) -> Frame {
        let layout = self.layout;
        let columns = layout.columns;
        let row = number / columns;
        let column = number % columns;
        let above: f64 = self.heights[..row]
            .iter()
            .map(|height| height + layout.row_gap + layout.heading)
            .sum();
        let start = |column: usize| MARGIN + column as f64 * (layout.width + layout.column_gap);
        // The same in all columns, so that they are labelled alike.
        let end = if columns > 1 {
            self.end.min(start(column + 1) - LABEL_GAP)
        } else {
            self.end
        };
        Frame {
            left: start(column) - MARGIN + LEFT,
            room: (start(column), end),
            // Over headings there is one for a row.
            y_label_end: if layout.heading > 0.0 { self.end } else { end },
            top: self.top + above + layout.heading,
            width: layout.width,
            height: self.heights[row],
            x,
            y,
            heading: layout.heading,
            letter: ('a'..='z').nth(number).filter(|_| self.count > 1),
            has_numbers,
        }
    }
}

pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// Where the label of the x axis may lie.
    room: (f64, f64),
    /// Where that of the y axis ends at the latest.
    y_label_end: f64,
    heading: f64,
    letter: Option<char>,
    /// Whether it has the numbers and the label of the x axis.
    has_numbers: bool,
}

impl Frame {
    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub(super) fn x_of(&self, value: f64) -> f64 {
        self.left + self.x.place(value) * self.width
    }

    pub(super) fn y_of(&self, value: f64) -> f64 {
        self.top + (1.0 - self.y.place(value)) * self.height
    }

    pub(super) fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x_of(x), self.y_of(y))
    }

    /// Left edge, upper edge, width and height of a rectangle of data, on whole pixels.
    pub(super) fn box_of(&self, (x, y): Cell) -> [f64; 4] {
        let [left, right] = [x.0, x.1].map(|value| snapped(self.x_of(value)));
        let [top, bottom] = [y.1, y.0].map(|value| snapped(self.y_of(value)));
        [left, top, right - left, bottom - top]
    }

    /// Border, ticks, their numbers, and the labels of both axes, over the data.
    pub(super) fn axes(&self, sheet: &mut Picture) {
        let right = self.right();
        let bottom = self.bottom();
        let style = sheet.look.style;
        for (value, length) in ticks(&self.x, self.width, style) {
            let x = self.x_of(value);
            sheet.line(vec![(x, bottom), (x, bottom - length)], AXIS);
            sheet.line(vec![(x, self.top), (x, self.top + length)], AXIS);
        }
        for (value, length) in ticks(&self.y, self.height, style) {
            let y = self.y_of(value);
            sheet.line(vec![(self.left, y), (self.left + length, y)], AXIS);
            sheet.line(vec![(right, y), (right - length, y)], AXIS);
        }
        for side in outline((self.left, self.top), (right, bottom)).windows(2) {
            sheet.line(side.to_vec(), AXIS);
        }
        self.numbers(sheet);
        self.labels(sheet);
    }

    fn numbers(&self, sheet: &mut Picture) {
        let height = f64::from(TICK_TEXT);
        // Where a frame is small, numbers that would meet their neighbours are left out, and those that would be cut.
        let mut free = f64::INFINITY;
        for (value, number) in &self.y.ticks {
            let y = self.y_of(*value);
            if y <= free {
                let size = fitting(number, TICK_TEXT, LEFT - TICK_GAP - EDGE).unwrap_or(NOTE_TEXT);
                sheet.centred_text((self.left - TICK_GAP, y), number, size, Anchor::End);
                free = y - 1.1 * height;
            }
        }
        let mut free = EDGE;
        for (value, number) in self.x.ticks.iter().filter(|_| self.has_numbers) {
            let x = self.x_of(*value);
            let half = 0.5 * text_width(number, TICK_TEXT);
            if x - half >= free && x + half <= sheet.scene.width - EDGE {
                let place = (x, self.bottom() + 1.3 * height);
                sheet.text(place, number, TICK_TEXT, Anchor::Middle);
                free = x + half + 0.3 * height;
            }
        }
    }

    fn labels(&self, sheet: &mut Picture) {
        let (label, size) = self.y_label();
        if !label.is_empty() {
            let place = (self.room.0, self.top - self.heading - Y_LABEL_RISE);
            sheet.text(place, &label, size, Anchor::Start);
        }
        if self.has_numbers {
            let (start, end) = self.room;
            let (label, size) = fitted_label("", &self.x, end - start);
            let half = 0.5 * text_width(&label, size);
            let of_frame = self.left + 0.5 * self.width;
            let middle = of_frame.min(end - half).max(start + half);
            let place = (middle, self.bottom() + UNDER - 12.0);
            sheet.text(place, &label, size, Anchor::Middle);
        }
    }

    /// Letter and label of the y axis, above its numbers, and their size; the letter of a frame with a heading goes
    /// there.
    fn y_label(&self) -> (String, u32) {
        let letter = self
            .letter
            .filter(|_| self.heading == 0.0)
            .map(|letter| format!("({letter}) "))
            .unwrap_or_default();
        fitted_label(&letter, &self.y, self.y_label_end - self.room.0)
    }

    /// Where the label of the y axis ends.
    pub(super) fn y_label_end(&self) -> f64 {
        let (label, size) = self.y_label();
        self.room.0 + text_width(&label, size)
    }

    /// What the frame shows, above it, after its letter.
    pub(super) fn heading(&self, sheet: &mut Picture, text: &str) {
        let y = self.top - 9.0;
        if let Some(letter) = self.letter {
            let place = (self.left - LEFT + MARGIN, y);
            let letter = format!("({letter})");
            sheet.text(place, &letter, LABEL_TEXT, Anchor::Start);
        }
        let (text, size) = fitted(text, LEGEND_TEXT, self.room.1 - self.left);
        sheet.text((self.left, y), &text, size, Anchor::Start);
    }
}

/// The largest size, up to one, at which a text fits a width; `None` if it would be smaller than small print.
pub(super) fn fitting(text: &str, size: u32, room: f64) -> Option<u32> {
    (NOTE_TEXT..=size)
        .rev()
        .find(|&size| text_width(text, size) <= room)
}

/// A text and its size, up to one: smaller where there is little room, and cut at worst.
fn fitted(text: &str, size: u32, room: f64) -> (String, u32) {
    if let Some(size) = fitting(text, size, room) {
        return (text.to_owned(), size);
    }
    let mut width = text_width("…", NOTE_TEXT);
    let fits = |letter: &char| {
        width += text_width(letter.encode_utf8(&mut [0; 4]), NOTE_TEXT);
        width <= room
    };
    let cut: String = text.chars().take_while(fits).collect();
    (format!("{}…", cut.trim_end()), NOTE_TEXT)
}

/// The label of an axis after a letter, in short where there is little room, and its size.
fn fitted_label(letter: &str, axis: &Axis, room: f64) -> (String, u32) {
    let [long, short] = [&axis.label, &axis.short_label].map(|label| format!("{letter}{label}"));
    let label = if text_width(&long, LABEL_TEXT) <= room {
        long
    } else {
        short
    };
    fitted(label.trim_end(), LABEL_TEXT, room)
}

/// Values at the ticks of an axis of this length, and their lengths; in print without those that would stand close.
fn ticks(axis: &Axis, length: f64, style: Style) -> impl Iterator<Item = (f64, f64)> {
    let are_left_out = style == Style::Print && axis.is_crowded(length);
    let shown = axis.minor.iter().filter(move |_| !are_left_out);
    let minor = shown.map(|&value| (value, MINOR_TICK_LENGTH));
    minor.chain(axis.ticks.iter().map(|&(value, _)| (value, TICK_LENGTH)))
}

#[cfg(test)]
mod tests {
    use super::super::style::{Size, Style};
    use super::*;

    #[test]
    fn a_sheet_has_the_size_that_is_asked_for_and_never_frames_too_small_to_read() {
        let layout = Layout::column(500.0);
        let drawn = |style, size| {
            let look = Look {
                style,
                size,
                note: "small print ".repeat(40),
                ..Look::default()
            };
            layout.page("", &look, &[], &[300.0, 200.0]).1.size()
        };
        for style in [Style::Screen, Style::Print] {
            let size = Size {
                width: 86.0,
                height: if style == Style::Print { 60.0 } else { 140.0 },
            };
            let found = drawn(style, Some(size));
            assert!(
                (found.width - size.width).abs() < 1e-9
                    && (found.height - size.height).abs() < 1e-9,
                "{found:?}"
            );
            let found = drawn(
                style,
                Some(Size {
                    width: 5.0,
                    height: 5.0,
                }),
            );
            assert!(found.width > 15.0 && found.height > 15.0);
        }
        assert!((drawn(Style::Print, None).width - 86.0).abs() < 1e-9);
    }

    /// The text elements of a small figure: where each starts and ends, and what it says.
    fn texts(
        style: Style,
        (width, height): (f64, f64),
        x: &Axis,
        y: &Axis,
    ) -> (f64, Vec<(f64, f64, String)>) {
        let look = Look {
            style,
            size: Some(Size { width, height }),
            note: "Sweep test".to_owned(),
            ..Look::default()
        };
        let layout = Layout {
            columns: 2,
            column_gap: LEFT,
            ..Layout::column(300.0)
        };
        let (page, mut sheet) = layout.page("", &look, &[], &[200.0; 2]);
        for column in 0..2 {
            let frame = page.frame(column, x.clone(), y.clone(), true);
            frame.axes(&mut sheet);
            frame.heading(
                &mut sheet,
                "set with a long name, of which much is to be said",
            );
        }
        (sheet.scene.width, sheet.texts())
    }

    #[test]
    fn labels_and_numbers_of_small_figures_are_neither_cut_nor_overlap() {
        let long = "Standard deviation of the intervals between slips, tau_sd (s)";
        let x = Axis::linear(long, 0.0, 1000.0);
        let mut y = Axis::logarithmic(long, 3e-9, 8e-9);
        y.short_label = "tau_sd (s)".to_owned();
        for size in [(60.0, 40.0), (86.0, 60.0), (178.0, 60.0)] {
            let (width, texts) = texts(Style::Print, size, &x, &y);
            assert!(
                texts
                    .iter()
                    .all(|(start, end, _)| *start >= 0.0 && *end <= width),
                "{width} {texts:?}"
            );
            let is_label = |text: &str| text.starts_with('(') && text.contains("tau");
            let kinds: [&dyn Fn(&str) -> bool; 3] =
                [&is_label, &|text| text.starts_with("Standard"), &|text| {
                    text.starts_with("set")
                }];
            for is_of_kind in kinds {
                let row: Vec<_> = texts
                    .iter()
                    .filter(|(_, _, text)| is_of_kind(text))
                    .collect();
                assert!(row.len() == 2 && row[0].1 < row[1].0, "{row:?}");
            }
        }
    }

    #[test]
    fn print_has_no_small_print_and_enough_numbers() {
        let x = Axis::logarithmic("x", 40.0, 125.0);
        let y = Axis::sparse("y", 0.0, 78.0);
        let of = |style| texts(style, (120.0, 80.0), &x, &y).1;
        let has = |texts: &[(f64, f64, String)], wanted: &str| {
            texts.iter().any(|(_, _, text)| text == wanted)
        };
        let screen = of(Style::Screen);
        let print = of(Style::Print);
        assert!(has(&screen, "Sweep test") && !has(&print, "Sweep test"));
        assert!(has(&screen, "20") && has(&print, "20"), "{print:?}");
    }

    #[test]
    fn small_print_is_wrapped_at_spaces_and_complete() {
        let lines = wrapped(
            "alpha beta  gamma\u{a0}delta 95 % epsilon",
            text_width("alpha beta g", NOTE_TEXT),
        );
        assert_eq!(lines, ["alpha beta", "gamma delta", "95 %", "epsilon"]);
        assert_eq!(wrapped("longerthanaline", 10.0), ["longerthanaline"]);
        assert!(wrapped("", 10.0).is_empty());
    }
}
