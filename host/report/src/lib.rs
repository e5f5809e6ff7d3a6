//! Pictures and the HTML report.
//!
//! [`write_report`] draws one self-contained file from a [`ReportInput`]: a summary, which is also
//! kept as `summary.toml`, and the dense BRDF. So a report can be drawn again from a folder.

mod charts;
mod explorer;
mod figures;
mod fits;
pub mod folder;
pub mod frontier;
mod html;
mod make_baselines;
mod panels;
pub mod rivals;
mod shots;
mod slices;
mod spans;
mod subspaces;

pub use figures::write_figures;
pub use folder::report_folder;
pub use make_baselines::make_baselines;

use gonia_brdf::{Brdf, DenseBrdf};
use gonia_formats::fit_toml::FitNote;
use gonia_formats::rivals_toml::Rivals;
use gonia_formats::{FileError, Summary, write_whole_bytes};
use gonia_rig::{CellMask, Rig};
use std::path::Path;

/// What a report is drawn from.
#[derive(Clone, Copy)]
pub struct ReportInput<'a> {
    /// The numbers.
    pub summary: &'a Summary,
    /// The measured BRDF.
    pub dense: &'a DenseBrdf,
    /// The true one, where it is known; drawn beside the measured one, with their difference.
    pub truth: Option<&'a dyn Brdf>,
    /// The cells that hold a measurement, where that is known.
    pub measured: Option<&'a CellMask>,
    /// The standard error of each cell, where it was computed.
    pub errors: Option<&'a DenseBrdf>,
    /// The rig, for the spans of its frames.
    pub rig: Option<&'a Rig>,
    /// Models fitted to the measured BRDF.
    pub fits: &'a [FitNote],
    /// Other ways to the same BRDF.
    pub rivals: Option<&'a Rivals>,
    /// Charts that stand beside the data: name and SVG.
    pub charts: &'a [(String, String)],
}

impl<'a> ReportInput<'a> {
    /// A report of numbers and values, with nothing beside them.
    pub fn new(summary: &'a Summary, dense: &'a DenseBrdf) -> Self {
        Self {
            summary,
            dense,
            truth: None,
            measured: None,
            errors: None,
            rig: None,
            fits: &[],
            rivals: None,
            charts: &[],
        }
    }
}

/// Writes the report whole: one HTML file that needs no other file and no network.
///
/// # Errors
/// When the file cannot be written.
pub fn write_report(path: &Path, input: &ReportInput<'_>) -> Result<(), FileError> {
    write_whole_bytes(path, html::page(input).into_string().as_bytes())
}

/// Writes the picture of the lit sphere alone, as a PNG of `px` × `px` pixels (for a README).
///
/// # Errors
/// When the file cannot be written.
pub fn write_sphere(path: &Path, brdf: &dyn Brdf, px: usize) -> Result<(), FileError> {
    let picture = gonia_render::sphere(brdf, &gonia_render::studio(), px, 2);
    let exposure = shots::exposure(&picture);
    write_whole_bytes(
        path,
        &gonia_render::png::rgba(
            &gonia_render::tone::picture_rgba(&picture, exposure),
            px,
            px,
        ),
    )
}
