//! Figures: reduced data -> pictures, as SVG, PNG and PDF bytes. `files.rs` alone writes them.
//!
//! ```text
//! standing.rs            -> a file for each standing figure: its data, its panels; `None` where the data do not fit
//! overview.rs, custom.rs -> sets against a column (chart.rs, quantity.rs): an overview, and any column against another
//! map.rs                 -> sets over two parameters
//!     panel.rs            panels as data: axes, layers between them
//!     frame.rs, axis.rs   frames on a sheet, axes; legend.rs, hues.rs explain marks and colours
//!     style.rs            sizes, font, strokes and colours of all figures
//!     picture.rs, pdf.rs  lines, discs, text -> SVG, PNG, PDF
//! ```

mod axis;
mod beside;
mod chart;
mod custom;
mod drag;
mod drop_size;
mod edge_values;
mod files;
mod frame;
mod histograms;
mod hues;
mod intervals;
mod legend;
mod map;
mod note;
mod options;
mod overview;
mod panel;
mod pdf;
mod phase_eta;
mod picture;
mod quantity;
mod simulation;
mod standing;
mod style;
mod triggering;
mod work_precision;

pub use beside::Beside;
pub use custom::{CustomFigure, Dots, draw_custom};
pub use drop_size::draw_drop_size;
pub use files::{Drawn, remarks, write};
pub use options::BadOption;
pub use picture::{Picture, PictureFormat};
pub use quantity::AxisLimits;
pub use simulation::{measured_trace, simulation};
pub use standing::{draw_all, draw_where, standing};
pub use style::{INKS, Ink, Look, SCALE, Size, Style};
pub use work_precision::{ErrorPanel, WorkPrecision, work_precision};
