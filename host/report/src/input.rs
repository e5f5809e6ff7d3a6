//! What a report is drawn from.

use crate::uncertainty::ErrorBars;
use gonia_brdf::{Brdf, DenseBrdf};
use gonia_formats::Summary;
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::fit_toml::FitNote;
use gonia_rig::{CellMask, Remark, Rig};

/// What a report is drawn from.
#[derive(Clone, Copy)]
pub struct ReportInput<'a> {
    /// The numbers.
    pub summary: &'a Summary,
    /// The measured BRDF.
    pub dense: &'a DenseBrdf,
    /// Where bands were measured, what its colours are, sentence by sentence.
    pub bands: &'a [String],
    /// The true one, where it is known; drawn beside the measured one, with their difference.
    pub truth: Option<&'a dyn Brdf>,
    /// The cells that hold a measurement, where that is known.
    pub measured: Option<&'a CellMask>,
    /// The standard error of each cell, where it was computed.
    pub errors: Option<&'a ErrorBars>,
    /// The rig, for the spans of its frames.
    pub rig: Option<&'a Rig>,
    /// Models fitted to the measured BRDF.
    pub fits: &'a [FitNote],
    /// Baselines: other ways to the same BRDF.
    pub baselines: Option<&'a BaselineTable>,
    /// Charts that stand beside the data: name and SVG.
    pub charts: &'a [(String, String)],
    /// What is beside the data and is not shown, and why.
    pub remarks: &'a [Remark],
}

impl<'a> ReportInput<'a> {
    /// A report of numbers and values, with nothing beside them.
    pub fn new(summary: &'a Summary, dense: &'a DenseBrdf) -> Self {
        Self {
            summary,
            dense,
            bands: &[],
            truth: None,
            measured: None,
            errors: None,
            rig: None,
            fits: &[],
            baselines: None,
            charts: &[],
            remarks: &[],
        }
    }
}
