//! Figures: reduced data -> pictures, as SVG, PNG and PDF bytes; [`draw_all`] alone writes.
//!
//! ```text
//! draw.rs -> a file for each standing figure: its data, its panels; `None` where the data do not fit
//! own.rs  -> any column of the sets against any other
//!            scatter.rs, sets.rs     slips as dots; in what sets differ, and the grid on which they lie
//!            frame.rs, axis.rs       panels on a sheet, axes; legend.rs, colour_bar.rs, hues.rs explain colours
//!            style.rs                sizes, strokes and colours of all figures
//!            picture.rs, pdf.rs      lines, discs, text -> SVG, PNG, PDF
//! ```

mod axis;
mod backbone;
mod colour_bar;
mod dependence;
mod drag;
mod draw;
mod font;
mod frame;
mod friction;
mod histograms;
mod hues;
mod intervals;
mod legend;
mod locking_map;
mod own;
mod pdf;
mod picture;
mod refined;
mod regimes;
mod regions;
mod scatter;
mod sets;
mod simulation;
mod staircase;
mod style;
mod values;
mod work_precision;

pub use draw::{draw_all, draw_own, write_own};
pub use own::{OwnFigure, columns};
pub use picture::{Format, Picture};
pub use simulation::{AttachedMap, Simulation, simulation};
pub use style::{Look, Size, Style};
pub use work_precision::{ErrorPanel, MethodLine, WorkPrecision, work_precision};

use crate::table::file::DatasetError;
use crate::table::shown::shown;
use crate::table::storage::StorageError;
use std::path::PathBuf;

/// A figure that cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// There is nothing to draw.
    #[error("figure {figure}: there are no {what} to draw")]
    Empty { figure: &'static str, what: &'static str },
    /// A file of a picture cannot be made.
    #[error("figure {figure}: cannot be turned into {}: {reason}", format.extension().to_uppercase())]
    Encoding { figure: String, format: Format, reason: String },
    /// A figure does not fit the size that is asked for.
    #[error("--size: figure {figure} needs at least {:.0}mmx{:.0}mm with its legend and small print, and less in the style print", size.width.ceil(), size.height.ceil())]
    TooSmall { figure: String, size: Size },
    /// An option of a figure of one's own does not fit the data.
    #[error("--{option} {value}: {problem}")]
    Option {
        option: &'static str,
        value: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// There are no reduced data.
    #[error("{0}: has no reduced data to draw; run `stickslip reduce {0}` first", shown(directory))]
    NotReduced { directory: PathBuf },
    /// The reduced data cannot be read.
    #[error("{0}; if it is missing or damaged, reduce the tables again")]
    Reduced(#[from] DatasetError),
    /// A figure cannot be put in its place.
    #[error(transparent)]
    Storage(#[from] StorageError),
}
