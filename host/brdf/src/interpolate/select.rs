//! Which settings suit a material: cross-validation over held-out frames.
//!
//! Holding out single bins tells nothing, because a bin's neighbours come from the same frame;
//! whole frames are what is missing between the measured directions.

use super::Settings;
use super::block::BlockSolver;
use super::coordinates::Coordinates;
use super::neighbours::Neighbours;
use super::nodes::{log_noise_variance, nodes_of};
use crate::bins::{Bin, Bins};
use crate::sample::Sample;
use rayon::prelude::*;

/// Held-out bins that are predicted, at most.
const TESTS: usize = 4000;
/// One frame in so many is held out.
const HOLD_OUT: u32 = 32;
/// The systems of coordinates that compete.
const CANDIDATES: [Coordinates; 4] = [
    Coordinates::HalfDifference { weight: 0.5 },
    Coordinates::HalfDifference { weight: 0.25 },
    Coordinates::SumDifference { weight: 0.5 },
    Coordinates::SumDifference { weight: 1.0 },
];

/// One candidate and how it did.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The settings tried.
    pub settings: Settings,
    /// RMS of the natural logarithm of predicted over measured, trimmed by the worst 1 %.
    pub log_rms: f64,
}

/// The outcome of a selection.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// The best settings.
    pub settings: Settings,
    /// All that was tried; empty when there were too few frames to hold any out.
    pub trials: Vec<Trial>,
}

/// Estimates the noise from the spread inside bins, then tries the candidate coordinates on frames
/// held out. Without frame numbers, or with too few frames, `base` keeps its coordinates.
pub fn select(bins: &Bins, base: Settings) -> Selection {
    let mut settings = base;
    if let Some(variance) = log_noise_variance(bins.bins().iter()) {
        settings.noise_variance = variance;
    }
    let held_out = |bin: &&Bin| hash(bin.frame).is_multiple_of(HOLD_OUT);
    let known = |bin: &&Bin| bin.frame != Sample::NO_FRAME;
    let candidates: Vec<&Bin> = bins.bins().iter().filter(known).filter(held_out).collect();
    let tests: Vec<&Bin> = candidates
        .iter()
        .step_by(candidates.len().div_ceil(TESTS).max(1))
        .copied()
        .collect();
    if tests.len() < 100 {
        return Selection {
            settings,
            trials: Vec::new(),
        };
    }
    // Bins of several frames may hold a part of a held-out frame, so none of them takes part.
    let training = bins.bins().iter().filter(known).filter(|b| !held_out(b));
    let trials: Vec<Trial> = CANDIDATES
        .iter()
        .map(|coordinates| {
            let settings = Settings {
                coordinates: *coordinates,
                ..settings
            };
            let neighbours = Neighbours::new(nodes_of(training.clone(), *coordinates));
            Trial {
                settings,
                log_rms: log_rms_at(&tests, &neighbours, &settings),
            }
        })
        .collect();
    if let Some(best) = trials.iter().min_by(|a, b| a.log_rms.total_cmp(&b.log_rms)) {
        settings = best.settings;
    }
    Selection { settings, trials }
}

/// RMS over the tests of the log error, each predicted from its own neighbourhood.
fn log_rms_at(tests: &[&Bin], neighbours: &Neighbours, settings: &Settings) -> f64 {
    let mut squares: Vec<f64> = tests
        .par_iter()
        .map_init(
            || (BlockSolver::default(), Vec::new(), Vec::new()),
            |(solver, found, values), bin| {
                let point = settings
                    .coordinates
                    .point(bin.light.map(f64::from), bin.view.map(f64::from));
                let radius = neighbours.gather(&point, settings.nodes, found);
                let nodes = neighbours.nodes();
                let block = settings.block();
                solver.fit(
                    found.iter().map(|(_, k)| &nodes[*k as usize]),
                    radius,
                    &block,
                );
                values.clear();
                solver.evaluate(&[point], values);
                let log = values[0];
                (0..3)
                    .filter(|c| bin.median[*c] > 0.0)
                    .map(|c| f64::from(log[c] - bin.median[c].ln()).powi(2))
                    .sum::<f64>()
                    / 3.0
            },
        )
        .collect();
    // A few outliers must not decide.
    squares.sort_by(f64::total_cmp);
    squares.truncate(squares.len() - squares.len() / 100);
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// Spreads frame numbers, so that held-out frames are no regular pattern of the plan.
fn hash(frame: u32) -> u32 {
    let mut x = u64::from(frame).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 29;
    (x.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 32) as u32
}
