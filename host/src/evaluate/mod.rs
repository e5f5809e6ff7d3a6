//! How far one BRDF is from another.
//!
//! [`compare`] gives the figures of merit by stratum; [`mod@render`] draws the sphere and the
//! cylinder that the image differences (and the report's pictures) are made of. [`motion`] is another
//! question: how fast the arms may be and how true they are then.

mod accumulate;
pub mod chart;
pub mod color;
pub mod compare;
pub mod figures;
pub mod motion;
pub mod render;
pub mod rivals;
mod shade;
pub mod stratum;
pub mod tabulated;

pub use compare::{CompareError, Options, Side, compare};
pub use figures::{Figures, StratumFigures};
pub use stratum::Stratum;
pub use tabulated::Tabulated;
