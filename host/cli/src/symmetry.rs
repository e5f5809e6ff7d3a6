//! A material's symmetry on the command line.

use gonia_brdf::SymmetryKind;

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
    /// The two sides of a plane through the normal are alike; its azimuth is found
    Bilateral,
    /// Half a turn about the normal changes nothing
    HalfTurn,
    /// Both: there are two such planes, upright on each other
    HalfTurnBilateral,
}

impl From<SymmetryArgument> for Option<SymmetryKind> {
    fn from(argument: SymmetryArgument) -> Self {
        match argument {
            SymmetryArgument::Auto => None,
            SymmetryArgument::None => Some(SymmetryKind::None),
            SymmetryArgument::Isotropic => Some(SymmetryKind::Isotropic),
            SymmetryArgument::Bilateral => Some(SymmetryKind::Bilateral),
            SymmetryArgument::HalfTurn => Some(SymmetryKind::HalfTurn),
            SymmetryArgument::HalfTurnBilateral => Some(SymmetryKind::HalfTurnBilateral),
        }
    }
}
