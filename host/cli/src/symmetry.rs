//! A material's symmetry on the command line.

use gonia_brdf::Symmetry;

/// Which symmetry about its normal a material has.
#[derive(clap::ValueEnum, Clone, Copy)]
pub enum SymmetryArgument {
    /// What few samples show by cross-validation, and isotropy where only one azimuth was measured; of many
    /// samples none
    Auto,
    /// The BRDF depends on all four angles
    None,
    /// No turn about the normal changes anything
    Isotropic,
    /// Half a turn about the normal changes nothing
    HalfTurn,
}

impl From<SymmetryArgument> for Option<Symmetry> {
    fn from(argument: SymmetryArgument) -> Self {
        match argument {
            SymmetryArgument::Auto => None,
            SymmetryArgument::None => Some(Symmetry::None),
            SymmetryArgument::Isotropic => Some(Symmetry::Isotropic),
            SymmetryArgument::HalfTurn => Some(Symmetry::HalfTurn),
        }
    }
}
