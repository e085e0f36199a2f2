//! Figures: reduced data -> pictures, as SVG, PNG and PDF bytes; [`draw_all`] alone writes.
//!
//! ```text
//! draw.rs -> a file for each standing figure: its data, its panels; `None` where the data do not fit
//! overview.rs, custom.rs -> sets against a column (chart.rs, chart_legend.rs, quantity.rs): the overview of a sweep, and
//!            any column against any other
//! map.rs  -> sets over two parameters
//!            sets.rs                 in what sets differ, and the grid on which they lie
//!            panel.rs                panels as data: axes, layers between them
//!            frame.rs, axis.rs       frames on a sheet, axes; legend.rs, colour_bar.rs, hues.rs explain colours
//!            style.rs                sizes, strokes and colours of all figures
//!            ink.rs                  colours, strokes, dots, fills
//!            picture.rs, pdf.rs      lines, discs, text -> SVG, PNG, PDF
//! ```

mod axis;
mod chart;
mod chart_legend;
mod colour_bar;
mod custom;
mod drag;
mod draw;
mod edge_values;
mod font;
mod frame;
mod histograms;
mod hues;
mod ink;
mod intervals;
mod legend;
mod map;
mod overview;
mod panel;
mod pdf;
mod phase_eta;
mod picture;
mod quantity;
mod sets;
mod simulation;
mod style;
mod work_precision;

pub use custom::CustomFigure;
pub use draw::{draw_all, draw_custom, write_custom};
pub use ink::Ink;
pub use picture::{Format, Picture};
pub use quantity::Limits;
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
