//! The parts of the domain that figures are given for.

use gonia_brdf::Elementary;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A part of the domain. Parts overlap: each cell is in `All` and in any other it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stratum {
    /// Every cell.
    All,
    /// Both polar angles at most 75°, where views were taken.
    Interior,
    /// Either polar angle above 75°.
    Grazing,
    /// The unmeasured region: both polar angles above 78°, where no frame can be taken.
    #[serde(alias = "void")]
    Unmeasured,
    /// The one per cent of cells with the largest luminance · cos θi · cos θv of the second BRDF.
    Highlight,
    /// Light and view less than 8° apart, where the light's arm is in the way.
    Retro,
}

impl Stratum {
    /// All of them, in the order of tables.
    pub const ALL: [Stratum; 6] = [
        Stratum::All,
        Stratum::Interior,
        Stratum::Grazing,
        Stratum::Unmeasured,
        Stratum::Highlight,
        Stratum::Retro,
    ];

    /// Its word in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Stratum::All => "all",
            Stratum::Interior => "interior",
            Stratum::Grazing => "grazing",
            Stratum::Unmeasured => "unmeasured",
            Stratum::Highlight => "highlight",
            Stratum::Retro => "retro",
        }
    }

    /// What it is, in a few words.
    pub fn meaning(self) -> &'static str {
        match self {
            Stratum::All => "every cell",
            Stratum::Interior => "both θ ≤ 75°",
            Stratum::Grazing => "either θ > 75°",
            Stratum::Unmeasured => "both θ > 78°, never measured",
            Stratum::Highlight => "brightest 1 % (cosine-weighted)",
            Stratum::Retro => "light and view within 8°",
        }
    }
}

impl fmt::Display for Stratum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A set of strata as bits, bit `k` for `Stratum::ALL[k]`.
pub type StratumBits = u8;

const INTERIOR_DEG: f64 = 75.0;
const UNMEASURED_DEG: f64 = 78.0;
const RETRO_DEG: f64 = 8.0;
/// Nodes lie on such angles; rounding must not push one across.
const SLACK_DEG: f64 = 1e-6;

/// The strata of a pair of directions that depend on geometry alone.
pub fn of_geometry(theta_i_deg: f64, theta_v_deg: f64, cos_between: f64) -> StratumBits {
    let bit = |stratum: Stratum, inside: bool| u8::from(inside) << (stratum as u8);
    let most = theta_i_deg.max(theta_v_deg);
    let least = theta_i_deg.min(theta_v_deg);
    let interior = most <= INTERIOR_DEG + SLACK_DEG;
    bit(Stratum::All, true)
        | bit(Stratum::Interior, interior)
        | bit(Stratum::Grazing, !interior)
        | bit(Stratum::Unmeasured, least > UNMEASURED_DEG + SLACK_DEG)
        | bit(
            Stratum::Retro,
            cos_between > (RETRO_DEG - SLACK_DEG).to_radians().cosine(),
        )
}

/// The bit of the highlight stratum.
pub const HIGHLIGHT: StratumBits = 1 << (Stratum::Highlight as u8);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_with_the_old_word_for_the_unmeasured_region_are_still_read() {
        #[derive(Deserialize, Serialize)]
        struct Row {
            stratum: Stratum,
        }
        for word in ["void", "unmeasured"] {
            let row: Row = toml::from_str(&format!("stratum = \"{word}\"")).unwrap();
            assert_eq!(row.stratum, Stratum::Unmeasured);
            let written = toml::to_string(&row).unwrap();
            assert_eq!(written, "stratum = \"unmeasured\"\n");
        }
    }

    #[test]
    fn the_limits_are_those_of_the_definitions() {
        let has = |bits: StratumBits, stratum: Stratum| bits >> (stratum as u8) & 1 == 1;
        for (i, v, interior, unmeasured) in [
            (74.0, 74.0, true, false),
            (75.0, 0.0, true, false),
            (76.0, 0.0, false, false),
            (78.0, 86.0, false, false),
            (80.0, 80.0, false, true),
        ] {
            let bits = of_geometry(i, v, 0.0);
            assert!(has(bits, Stratum::All));
            assert_eq!(has(bits, Stratum::Interior), interior);
            assert_eq!(has(bits, Stratum::Grazing), !interior);
            assert_eq!(has(bits, Stratum::Unmeasured), unmeasured);
        }
        assert!(has(
            of_geometry(0.0, 6.0, 6f64.to_radians().cosine()),
            Stratum::Retro
        ));
        assert!(!has(
            of_geometry(0.0, 8.0, 8f64.to_radians().cosine()),
            Stratum::Retro
        ));
        for (k, stratum) in Stratum::ALL.into_iter().enumerate() {
            assert_eq!(stratum as usize, k);
        }
    }
}
