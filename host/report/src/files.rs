//! The names of the files that a run writes into its folder, and the report is drawn from.

/// What the run did, in numbers: see [`gonia_formats::Summary`].
pub const SUMMARY: &str = "summary.toml";
/// The dense BRDF; the only file that must be there.
pub const DENSE: &str = "dense.exr";
/// The true BRDF as a table of the same grid.
pub const TRUTH: &str = "truth.exr";
/// The cells that hold a measurement, see [`gonia_rig::CellMask`].
pub const MEASURED: &str = "measured.npy";
/// The standard errors of `gonia fill --error`.
pub const ERRORS: &str = "error.exr";
/// The comparison of `gonia rivals`.
pub const RIVALS: &str = "rivals.toml";
/// The figure of that comparison, without its extension.
pub const RIVALS_FIGURE: &str = "rivals";
/// The rig.
pub const RIG: &str = "rig.toml";
/// The report.
pub const REPORT: &str = "report.html";
/// What a calibration of the rig leaves, drawn.
pub const CALIBRATION_FIGURE: &str = "calibration.svg";
