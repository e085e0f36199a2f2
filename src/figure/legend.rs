//! Legends: what marks mean, in rows above the frames, where they cover nothing.

use super::picture::{Anchor, Picture};
use super::style::{
    BAR_WIDTH, BLACK, Dot, Fill, HOLLOW, Ink, LEGEND_TEXT, RADIUS, Stroke, outline_of, text_width,
};

/// Width of a line or a patch, and of a dot.
const MARK: f64 = 26.0;
const DOT: f64 = 10.0;
/// Between a mark and its text, and between entries.
const GAP: f64 = 7.0;
const ENTRY_GAP: f64 = 20.0;
/// Where the first row begins.
const TOP: f64 = 8.0;
/// Distance of rows.
pub(super) const ROW: f64 = 24.0;

/// What a legend shows beside a text.
#[derive(Clone, Copy, Debug)]
pub(super) enum Mark {
    Dot(Dot),
    /// A disc in a disc: their inks and radii.
    Ring(Ink, Ink, f64, f64),
    /// A dot with an error bar.
    Bar(Dot),
    /// The hollow mark of another directory, by its number.
    Hollow(usize),
    /// That of a directory of which a figure shows nothing: no entry, but a remark.
    Absent,
    Line(Stroke),
    Patch(Fill),
}

/// An entry of a legend: a mark and a text.
pub(super) type LegendEntry = (Mark, String);

pub(super) fn entry(mark: Mark, text: impl Into<String>) -> LegendEntry {
    (mark, text.into())
}

fn width((mark, text): &LegendEntry) -> f64 {
    mark_width(*mark) + GAP + text_width(text, LEGEND_TEXT)
}

const fn mark_width(mark: Mark) -> f64 {
    match mark {
        Mark::Dot(_) | Mark::Ring(..) | Mark::Bar(_) | Mark::Hollow(_) | Mark::Absent => DOT,
        Mark::Line(_) | Mark::Patch(_) => MARK,
    }
}

/// Entries in rows that fit a width.
pub(super) fn legend_rows(entries: &[LegendEntry], room: f64) -> Vec<Vec<&LegendEntry>> {
    let mut rows: Vec<Vec<&LegendEntry>> = Vec::new();
    let mut taken = 0.0;
    for entry in entries {
        let needed = width(entry) + ENTRY_GAP;
        match rows.last_mut() {
            Some(row) if taken + needed - ENTRY_GAP <= room => {
                row.push(entry);
                taken += needed;
            }
            _ => {
                rows.push(vec![entry]);
                taken = needed;
            }
        }
    }
    rows
}

/// Draws entries at the top of a sheet, between two edges.
pub(super) fn draw_legend(sheet: &mut Picture, entries: &[LegendEntry], left: f64, right: f64) {
    for (row, entries) in legend_rows(entries, right - left).into_iter().enumerate() {
        let middle = TOP + (row as f64 + 0.5) * ROW;
        let mut start = left;
        for entry in entries {
            draw_mark(sheet, entry.0, (start, middle));
            let place = (start + mark_width(entry.0) + GAP, middle);
            sheet.centred_text(place, &entry.1, LEGEND_TEXT, Anchor::Start);
            start += width(entry) + ENTRY_GAP;
        }
    }
}

fn draw_mark(sheet: &mut Picture, mark: Mark, (start, middle): (f64, f64)) {
    let end = start + MARK;
    let centre = (start + 0.5 * mark_width(mark), middle);
    match mark {
        Mark::Dot(dot) => {
            // A single faint dot could not be seen.
            let dot = Dot {
                radius: dot.radius.max(3.0),
                opacity: dot.opacity.max(0.7),
                ..dot
            };
            sheet.dots([centre], dot);
        }
        Mark::Ring(ink, middle, radius, hole) => {
            sheet.dots([centre], Dot::solid(ink, radius));
            sheet.dots([centre], Dot::solid(middle, hole));
        }
        Mark::Bar(dot) => {
            let ends = vec![(centre.0, middle - 9.0), (centre.0, middle + 9.0)];
            sheet.line(ends, Stroke::solid(dot.ink, 1.6));
            sheet.dots([centre], dot);
        }
        Mark::Hollow(other) => {
            let outline = outline_of(HOLLOW[other], RADIUS, centre);
            sheet.line(outline, Stroke::solid(BLACK, BAR_WIDTH));
        }
        Mark::Absent => {}
        Mark::Line(stroke) => sheet.line(vec![(start, middle), (end, middle)], stroke),
        Mark::Patch(fill) => sheet.rectangle([start, middle - 6.0, MARK, 12.0], fill),
    }
}

#[cfg(test)]
mod tests {
    use super::super::style::GRID;
    use super::*;

    #[test]
    fn a_legend_takes_as_many_rows_as_it_needs() {
        let entries: Vec<LegendEntry> = ["short", "a longer text", "another"]
            .map(|text| entry(Mark::Line(GRID), text))
            .to_vec();
        let rows = |room: f64| {
            legend_rows(&entries, room)
                .iter()
                .map(Vec::len)
                .collect::<Vec<_>>()
        };
        assert_eq!(rows(1000.0), [3]);
        assert_eq!(
            rows(width(&entries[0]) + ENTRY_GAP + width(&entries[1])),
            [2, 1]
        );
        assert_eq!(rows(1.0), [1, 1, 1]);
        assert!(legend_rows(&[], 100.0).is_empty());
    }
}
