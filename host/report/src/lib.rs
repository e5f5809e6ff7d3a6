//! Pictures and the HTML report.
//!
//! [`write_report`] draws one self-contained file from a [`ReportInput`]: a summary, which is also
//! kept as `summary.toml`, and the dense BRDF. So a report can be drawn again from a folder.
//!
//! | module | what it draws |
//! |---|---|
//! | [`report_folder`] | everything, from the files of a run ([`files`]) |
//! | [`write_report`], [`write_figures`], [`write_sphere`] | the HTML report; the paper's figures; one picture |
//! | [`calibration`] | what a calibration of the rig leaves of lines and shading |
//! | [`frontier`] | the charts of `gonia chart`: error against cost and against images |
//! | [`baselines`] | the figure of `gonia rivals`: each baseline's slice and renders |

mod albedo;
pub mod baselines;
mod calibration;
mod charts;
mod explorer;
mod figures;
pub mod files;
mod fits;
mod folder;
pub mod frontier;
mod html;
mod input;
mod make_baselines;
mod panels;
mod shots;
mod slices;
mod spans;
mod subspaces;
mod uncertainty;

pub use calibration::calibration;
pub use figures::{write_figures, write_sphere};
pub use folder::{Drawn, report_folder};
pub use html::write_report;
pub use input::ReportInput;
pub use make_baselines::make_baselines;
pub use uncertainty::{ErrorBars, ShownBand};
