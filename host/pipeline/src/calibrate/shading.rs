//! What the shading on the reference shows, as a function of the light, its arm and the target.

use crate::calibrate::solve::Frames;
use crate::calibrate::unknowns::{CAMERA, LIGHT, TARGET, Unknown, with_values};
use crate::process::SampledFrame;
use crate::process::reflectance::KnownReference;
use gonia_brdf::{Direction, Elementary};
use gonia_imaging::{IdealLight, SamplingGrid};
use gonia_rig::{CameraModel, Rig};
use std::f64::consts::PI;

/// Standard deviations of a frame's own numbers: the light arm's θ and φ (degrees: what encoders keep), and
/// the logarithm of the lamp's intensity.
pub const OWN: [f64; 3] = [0.03, 0.03, 0.01];

/// The index of the logarithm of the lamp's intensity, behind the light's and the target's numbers.
pub const LN_INTENSITY: usize = LIGHT.len() + TARGET;
/// Its standard deviation: nothing is known of it.
pub const LN_INTENSITY_PRIOR: f64 = 10.0;
/// Points at which the light is lower than this (cosine of its angle from the normal) tell of it no more
/// than of themselves: a fibre's shadow is as long as a sample.
const LOWEST_COSINE: f64 = 0.05;
/// Points used, of all frames: more cost time and bring nothing.
const MOST_POINTS: usize = 120_000;
/// The least noise that a value is taken to have, relative.
const LEAST_NOISE: f64 = 2e-4;
/// Frames with fewer points than this tell nothing.
const FEWEST_POINTS: usize = 20;

/// A point of a frame: where on the target it is, mm, and the logarithm of its radiance over its
/// reflectance factor.
type ShadedPoint = ([f64; 2], f64);

/// Values of the reference in one frame.
#[derive(Clone, Debug)]
pub struct ShadedFrame {
    /// The light arm's reading.
    pub light: Direction,
    points: Vec<ShadedPoint>,
    /// Relative noise of a value, from how neighbours differ.
    noise: f64,
}

/// Values of the reference in frames of a rig. The shared numbers are those of the light, those of the
/// target, and the logarithm of the intensity.
pub struct Shading<'a> {
    /// The rig whose numbers are replaced.
    pub rig: &'a Rig,
    /// At least one frame.
    pub frames: &'a [ShadedFrame],
}

/// The target's numbers.
pub fn target_unknowns() -> &'static [Unknown] {
    &CAMERA[CAMERA.len() - TARGET..]
}

impl ShadedFrame {
    /// Of a frame of the reference; `None` where hardly anything of it is lit.
    pub fn new(rig: &Rig, grid: &SamplingGrid, frame: &SampledFrame) -> Option<Self> {
        let light = IdealLight::new(rig, frame.reading.light);
        let known = rig.reference.as_ref().map(KnownReference::new);
        let camera = frame.camera_at(&CameraModel::new(rig));
        let mut points = Vec::new();
        let mut row: Vec<(usize, f64)> = Vec::new();
        for (i, (at, point)) in grid.points_mm().iter().zip(&frame.points).enumerate() {
            let Ok(point) = point else { continue };
            let at = [0, 1].map(|k| at[k] + f64::from(point.offset_mm[k]));
            let to_light = light.direction_from(at);
            let value = f64::from(point.rgb.iter().sum::<f32>());
            let factor = match &known {
                Some(known) => {
                    let of = known.at(to_light, camera.direction_from(at));
                    PI * f64::from(of.iter().sum::<f32>())
                }
                None => 1.0,
            };
            if to_light[2] > LOWEST_COSINE && value > 0.0 && factor > 0.0 {
                let ln = (value / factor).natural_log();
                points.push((at, ln));
                row.push((i, ln));
            }
        }
        (points.len() >= FEWEST_POINTS).then(|| Self {
            light: frame.reading.light,
            noise: noise_of(&row),
            points,
        })
    }

    /// Relative noise of a value, from how neighbours differ.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// Keeps every so many points.
    fn thin(&mut self, step: usize) {
        let mut i = 0usize;
        self.points.retain(|_| {
            i += 1;
            (i - 1).is_multiple_of(step)
        });
    }

    /// Median of the logarithm of radiance over an ideal light's.
    fn level(&self, light: &IdealLight) -> f64 {
        let mut all: Vec<f64> = self
            .points
            .iter()
            .map(|(at, ln)| ln - ln_irradiance(light, *at))
            .collect();
        let middle = all.len() / 2;
        *all.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// RMS of ln radiance about a rig's light, whatever its intensity.
    pub fn misfit(&self, rig: &Rig, ln_intensity: f64) -> f64 {
        let light = IdealLight::new(rig, self.light);
        let squares = self.points.iter().map(|(at, ln)| {
            let off = ln - ln_irradiance(&light, *at) - ln_intensity;
            off * off
        });
        (squares.sum::<f64>() / self.points.len() as f64).sqrt()
    }
}

/// Noise by the second differences of neighbours in a row of the grid: shading has next to none.
fn noise_of(row: &[(usize, f64)]) -> f64 {
    let mut differences: Vec<f64> = row
        .windows(3)
        .filter(|w| w[2].0 == w[0].0 + 2)
        .map(|w| (w[0].1 - 2.0 * w[1].1 + w[2].1).abs())
        .collect();
    if differences.is_empty() {
        return 1e-2;
    }
    let middle = differences.len() / 2;
    let median = *differences.select_nth_unstable_by(middle, f64::total_cmp).1;
    // The second difference of three values of variance σ² has 6 σ².
    (1.4826 * median / 6f64.sqrt()).max(LEAST_NOISE)
}

/// Thins frames to what is worth computing.
pub fn thin(frames: &mut [ShadedFrame]) {
    let points: usize = frames.iter().map(|frame| frame.points.len()).sum();
    let step = points.div_ceil(MOST_POINTS).max(1);
    frames.iter_mut().for_each(|frame| frame.thin(step));
}

/// The logarithm of the intensity that fits a rig's light best: the median of the frames'.
pub fn ln_intensity(rig: &Rig, frames: &[ShadedFrame]) -> f64 {
    let mut levels: Vec<f64> = frames
        .iter()
        .map(|frame| frame.level(&IdealLight::new(rig, frame.light)))
        .collect();
    let middle = levels.len() / 2;
    *levels.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A point below the light's horizon is as dark as makes no difference.
fn ln_irradiance(light: &IdealLight, at: [f64; 2]) -> f64 {
    light.irradiance(at).max(1e-6).natural_log()
}

impl Frames for Shading<'_> {
    type At = (Rig, f64);

    fn count(&self) -> usize {
        self.frames.len()
    }

    fn at(&self, shared: &[f64]) -> (Rig, f64) {
        let (light, target) = shared.split_at(LIGHT.len());
        let rig = with_values(&LIGHT, self.rig, light);
        let rig = with_values(target_unknowns(), &rig, &target[..TARGET]);
        (rig, shared[LN_INTENSITY])
    }

    fn residuals(&self, (rig, level): &(Rig, f64), frame: usize, own: &[f64]) -> Vec<f64> {
        let frame = &self.frames[frame];
        let reading = Direction {
            theta: frame.light.theta + own[0].to_radians(),
            phi: frame.light.phi + own[1].to_radians(),
        };
        let light = IdealLight::new(rig, reading);
        let of_point = |(at, ln): &ShadedPoint| {
            (ln - ln_irradiance(&light, *at) - level - own[2]) / frame.noise
        };
        frame.points.iter().map(of_point).collect()
    }
}
