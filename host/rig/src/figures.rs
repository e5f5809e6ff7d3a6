//! The figures of merit, and how they are printed.

use crate::Stratum;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fmt::Write as _;

/// How far a BRDF `a` is from another, `b`. See `gonia_pipeline::compare` for what is compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// Name of the first one.
    pub a: String,
    /// Name of the second one, which the first is judged by.
    pub b: String,
    /// Cells of the grid (of the mask, where there is one), a pole counted once.
    pub cells_total: u64,
    /// Cells compared. Fewer than all when they were subsampled.
    pub cells_compared: u64,
    /// Cells whose colour difference was taken: a regular share of those compared.
    pub cells_colour: u64,
    /// Values of `a` that are zero or negative and count as the floor of the logarithm.
    pub floored_a: u64,
    /// The same of `b`.
    pub floored_b: u64,
    /// The factor `a` was multiplied by, where either is relative: exp of the median of ln(b/a) in
    /// the interior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factor: Option<f64>,
    /// Mean ΔE00 over the lit pixels of a rendered sphere.
    pub sphere_delta_e: f64,
    /// Mean ΔE00 over the lit pixels of a rendered cylinder.
    pub cylinder_delta_e: f64,
    /// Figures by part of the domain. Parts without a cell are left out.
    pub strata: Vec<StratumFigures>,
}

/// The figures of one part of the domain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StratumFigures {
    /// The part.
    pub stratum: Stratum,
    /// Cells compared.
    pub cells: u64,
    /// Root mean square of ln(a/b) over cells and channels.
    pub log_rms: f64,
    /// Mean of ln(a/b): the bias in it.
    pub log_mean: f64,
    /// Mean of |a − b|·cosθi·cosθv over the mean of b·cosθi·cosθv.
    pub cos_error_mean: f64,
    /// 99th percentile of |a − b|·cosθi·cosθv over the mean of b·cosθi·cosθv.
    pub cos_error_p99: f64,
    /// Mean ΔE00 of π·f seen as a reflectance; absent where no cell of the share lay in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_e: Option<f64>,
    /// Root mean square of ln(a(i, v)/a(v, i)).
    pub reciprocity_a: f64,
    /// The same of `b`; absent for an analytic model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reciprocity_b: Option<f64>,
}

impl Figures {
    /// The figures of a part of the domain.
    pub fn stratum(&self, stratum: Stratum) -> Option<&StratumFigures> {
        self.strata.iter().find(|row| row.stratum == stratum)
    }

    /// What was compared, in a line: the share of cells and the factor are always said.
    pub fn basis(&self) -> String {
        let mut text = if self.cells_compared == self.cells_total {
            format!(
                "{} against {}, all {} cells",
                self.a, self.b, self.cells_total
            )
        } else {
            format!(
                "{} against {}, {} of {} cells ({:.1} %, evenly spread)",
                self.a,
                self.b,
                self.cells_compared,
                self.cells_total,
                100.0 * self.cells_compared as f64 / self.cells_total as f64
            )
        };
        let _ = write!(text, "; ΔE of {} of them", self.cells_colour);
        if let Some(factor) = self.factor {
            let _ = write!(text, "; relative: {} times {factor:.4}", self.a);
        }
        for (name, floored) in [(&self.a, self.floored_a), (&self.b, self.floored_b)] {
            if floored > 0 {
                let _ = write!(text, "; {floored} values of {name} are not positive");
            }
        }
        text
    }

    /// The table as CSV, one row a stratum; each with the factor that was taken out, where there is one.
    pub fn to_csv(&self) -> String {
        let mut text = String::from(
            "stratum,cells,log_rms,log_mean,cos_error_mean,cos_error_p99,delta_e,reciprocity_a,reciprocity_b,factor\n",
        );
        let optional = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        let factor = optional(self.factor);
        for row in &self.strata {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{factor}",
                row.stratum,
                row.cells,
                row.log_rms,
                row.log_mean,
                row.cos_error_mean,
                row.cos_error_p99,
                optional(row.delta_e),
                row.reciprocity_a,
                optional(row.reciprocity_b),
            );
        }
        for (name, value) in [
            ("sphere", self.sphere_delta_e),
            ("cylinder", self.cylinder_delta_e),
        ] {
            let _ = writeln!(text, "{name},,,,,,{value},,,{factor}");
        }
        text
    }
}

/// The table in plain text.
impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.basis())?;
        writeln!(
            f,
            "{:<10} {:>11} {:>9} {:>9} {:>9} {:>9} {:>8} {:>9} {:>9}",
            "stratum",
            "cells",
            "log RMS",
            "log mean",
            "cos mean",
            "cos p99",
            "ΔE00",
            "recip. a",
            "recip. b"
        )?;
        let optional = |value: Option<f64>, digits| match value {
            Some(value) => format!("{value:.digits$}"),
            None => "–".to_owned(),
        };
        for row in &self.strata {
            writeln!(
                f,
                "{:<10} {:>11} {:>9.4} {:>+9.4} {:>8.2}% {:>8.2}% {:>8} {:>9.4} {:>9}",
                row.stratum.name(),
                row.cells,
                row.log_rms,
                row.log_mean,
                100.0 * row.cos_error_mean,
                100.0 * row.cos_error_p99,
                optional(row.delta_e, 2),
                row.reciprocity_a,
                optional(row.reciprocity_b, 4),
            )?;
        }
        write!(
            f,
            "rendered   ΔE00 sphere {:.2}, cylinder {:.2}",
            self.sphere_delta_e, self.cylinder_delta_e
        )
    }
}
