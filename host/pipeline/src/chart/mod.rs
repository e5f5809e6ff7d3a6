//! What every interpolation method costs, and how far it is off: on one set of samples, tested
//! against the truth or by cross-validation, grouped by image.
//!
//! [`methods`] measures each [`Method`] on the same cells; [`images`] measures a few of them on
//! fewer and fewer frames. `report::frontier` draws both.

mod cpu;
mod frames;
mod method;
mod table;
mod test_set;

pub use frames::{ChartError, FrameSubset, Split, poses_of};
pub use method::{Family, Method, standard};
pub use table::{front, to_csv};
pub use test_set::{TestCounts, TestSet};

use crate::Error;
use gonia_brdf::Bins;
use gonia_rig::StratumFigures;

/// A method's place on the chart.
#[derive(Clone, Debug, PartialEq)]
pub struct ChartPoint {
    /// What was measured: the method's name, and the samples it had where they are not all.
    pub name: String,
    /// What kind of method it is.
    pub family: Family,
    /// Whether it is what `gonia fill` does by itself.
    pub is_default: bool,
    /// Frames behind the samples.
    pub frames: usize,
    /// CPU seconds, all threads together, from bins to the full dense array, with choosing the
    /// settings where the method does that.
    pub core_s: f64,
    /// The share of the interpolations of a full fill that were done and timed, 0 ..= 1.
    pub share: f64,
    /// Interpolations that failed, as a share of those done.
    pub failed: f64,
    /// Mean ΔE00 over a sphere whose pixels take their nearest cells; `None` without a truth.
    pub sphere_delta_e: Option<f64>,
    /// Figures by part of the domain, of cells that are neither measured nor a measured one's
    /// mirror (or of frames left out).
    pub strata: Vec<StratumFigures>,
}

/// Measures every method on the same bins.
///
/// # Errors
/// Too few bins.
pub fn methods(
    bins: &Bins,
    frames: usize,
    compared: &[Method],
    tests: &TestSet,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<ChartPoint>, Error> {
    let mut points = Vec::with_capacity(compared.len());
    for (k, method) in compared.iter().enumerate() {
        points.push(measure(bins, frames, method, tests)?);
        progress((k + 1) as f64 / compared.len() as f64);
    }
    Ok(points)
}

/// Measures methods on subsets of the frames.
///
/// # Errors
/// Too few bins.
pub fn images(
    subsets: &[FrameSubset<'_>],
    compared: &[Method],
    tests: &TestSet,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<ChartPoint>, Error> {
    let mut points = Vec::new();
    for (k, subset) in subsets.iter().enumerate() {
        let bins = Bins::new(tests.grid(), &subset.samples());
        for method in compared {
            let mut point = measure(&bins, subset.frames(), method, tests)?;
            point.name = format!("{} from {}", point.name, subset.name());
            points.push(point);
        }
        progress((k + 1) as f64 / subsets.len() as f64);
    }
    Ok(points)
}

fn measure(
    bins: &Bins,
    frames: usize,
    method: &Method,
    tests: &TestSet,
) -> Result<ChartPoint, Error> {
    let run = method.run(bins, tests.cells())?;
    let (strata, sphere_delta_e) = tests.figures(&run.values);
    Ok(ChartPoint {
        name: method.to_string(),
        family: method.family(),
        is_default: method.is_default(bins.grid()),
        frames,
        core_s: run.core_s,
        share: run.share,
        failed: run.failed,
        sphere_delta_e,
        strata,
    })
}
