//! Figures: reduced data -> pictures in the paper's layout, as SVG and PNG bytes; [`draw_all`] alone writes.

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
mod scaling;
mod sets;
mod simulation;
mod staircase;
mod work_precision;

pub use backbone::backbone;
pub use dependence::dependence;
pub use drag::drag;
pub use draw::draw_all;
pub use friction::friction;
pub use histograms::{Bar, HistogramPanel, MOST_PANELS, histograms};
pub use intervals::intervals;
pub use locking_map::locking_map;
pub use picture::Picture;
pub use scaling::{Growth, Line, scaling};
pub use simulation::{AttachedMap, simulation};
pub use staircase::staircase;
pub use work_precision::{ErrorPanel, WorkPrecision, work_precision};

use crate::table::file::DatasetError;
use crate::table::storage::StorageError;

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
    /// The reduced data cannot be read.
    #[error("{0}; if it is missing or damaged, reduce the tables again")]
    Reduced(#[from] DatasetError),
    /// A figure cannot be put in its place.
    #[error(transparent)]
    Storage(#[from] StorageError),
}
