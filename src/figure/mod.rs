//! Figures: reduced data -> pictures, as SVG, PNG and PDF bytes; [`draw_all`] alone writes.
//!
//! ```text
//! draw.rs -> a file for each standing figure: its data, its panels; `None` where the data do not fit
//! own.rs  -> sets against a column: the overview of a sweep, and any column against any other
//! map.rs  -> sets over two parameters
//!            sets.rs                 in what sets differ, and the grid on which they lie
//!            panel.rs                panels as data: axes, layers between them
//!            frame.rs, axis.rs       frames on a sheet, axes; legend.rs, colour_bar.rs, hues.rs explain colours
//!            style.rs                sizes, strokes and colours of all figures
//!            picture.rs, pdf.rs      lines, discs, text -> SVG, PNG, PDF
//! ```

mod axis;
mod backbone;
mod colour_bar;
mod drag;
mod draw;
mod edges;
mod font;
mod frame;
mod histograms;
mod hues;
mod intervals;
mod legend;
mod map;
mod own;
mod panel;
mod pdf;
mod picture;
mod sets;
mod simulation;
mod style;
mod work_precision;

pub use draw::{draw_all, draw_own, write_own};
pub use own::OwnFigure;
pub use picture::{Format, Picture};
pub use simulation::simulation;
pub use style::{INKS, Look, SCALE, Size, Style};
pub use work_precision::{ErrorPanel, WorkPrecision, work_precision};

/// What was asked of a figure that cannot be drawn so: the flag, and what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct BadOption(String);

impl BadOption {
    fn new(option: &str, value: &str, problem: &str) -> Self {
        Self(format!("--{option} {value}: {problem}"))
    }
}
