//! Figures: reduced data -> pictures in the paper's layout, as SVG and PNG bytes; [`draw_all`] alone writes.
//!
//! ```text
//! draw.rs -> a file for each figure: its data, its panels; `None` where the data do not fit
//!            scatter.rs, sets.rs     slips as dots; in what sets differ, and the grid on which they lie
//!            frame.rs, axis.rs       panels on a sheet, axes, legends
//!            colour_bar.rs           the colours of maps
//!            picture.rs              lines, discs, text -> SVG, PNG
//! ```

mod axis;
mod backbone;
mod colour_bar;
mod dependence;
mod drag;
mod draw;
mod frame;
mod friction;
mod histograms;
mod intervals;
mod locking_map;
mod picture;
mod regimes;
mod scaling;
mod scatter;
mod sets;
mod simulation;
mod staircase;
mod work_precision;

pub use draw::draw_all;
pub use picture::Picture;
pub use scaling::{Growth, Line, scaling};
pub use simulation::{AttachedMap, simulation};
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
    Empty {
        /// Name of the figure.
        figure: &'static str,
        /// What is missing.
        what: &'static str,
    },
    /// The PNG cannot be made.
    #[error("figure {figure}: cannot be turned into a PNG: {reason}")]
    Raster {
        /// Name of the figure.
        figure: &'static str,
        /// The reason.
        reason: String,
    },
    /// There are no reduced data.
    #[error("{0}: has no reduced data to draw; run `stickslip reduce {0}` first", shown(directory))]
    NotReduced {
        /// The results directory.
        directory: PathBuf,
    },
    /// The reduced data cannot be read.
    #[error("{0}; if it is missing or damaged, reduce the tables again")]
    Reduced(#[from] DatasetError),
    /// A figure cannot be put in its place.
    #[error(transparent)]
    Storage(#[from] StorageError),
}
