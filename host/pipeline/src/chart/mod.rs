//! What every interpolation method costs, and how far it is off: on one set of samples, judged by
//! the truth or by frames held out.
//!
//! [`methods`] measures each [`Contender`] on the same cells; [`images`] measures a few of them on
//! fewer and fewer frames. `report::frontier` draws both.

mod contender;
mod cpu;
mod frames;
mod judge;
mod table;

pub use contender::{Contender, Family, standard};
pub use frames::{ChartError, HeldOut, Subset, poses_of};
pub use judge::{Judge, TestCounts};
pub use table::{front, to_csv};

use crate::Error;
use gonia_brdf::Bins;
use gonia_rig::StratumFigures;

/// A method's place on the chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
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
    /// Mean ΔE2000 over a sphere whose pixels take their nearest cells; `None` without a truth.
    pub sphere_delta_e: Option<f64>,
    /// Figures by part of the domain, of cells that are neither measured nor a measured one's
    /// mirror (or of frames held out).
    pub strata: Vec<StratumFigures>,
}

/// Measures every contender on the same bins.
///
/// # Errors
/// Too few bins.
pub fn methods(
    bins: &Bins,
    frames: usize,
    contenders: &[Contender],
    judge: &Judge,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<Point>, Error> {
    let mut points = Vec::with_capacity(contenders.len());
    for (k, contender) in contenders.iter().enumerate() {
        points.push(measure(bins, frames, contender, judge)?);
        progress((k + 1) as f64 / contenders.len() as f64);
    }
    Ok(points)
}

/// Measures contenders on subsets of the frames.
///
/// # Errors
/// Too few bins.
pub fn images(
    subsets: &[Subset<'_>],
    contenders: &[Contender],
    judge: &Judge,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<Point>, Error> {
    let mut points = Vec::new();
    for (k, subset) in subsets.iter().enumerate() {
        let bins = Bins::new(judge.grid(), &subset.samples());
        for contender in contenders {
            let mut point = measure(&bins, subset.frames(), contender, judge)?;
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
    contender: &Contender,
    judge: &Judge,
) -> Result<Point, Error> {
    let run = contender.run(bins, judge.cells())?;
    let (strata, sphere_delta_e) = judge.figures(&run.values);
    Ok(Point {
        name: contender.to_string(),
        family: contender.family(),
        is_default: contender.is_default(bins.grid()),
        frames,
        core_s: run.core_s,
        share: run.share,
        failed: run.failed,
        sphere_delta_e,
        strata,
    })
}
