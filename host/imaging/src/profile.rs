//! The brightness across a line as the camera blurs it, and its fit at one station.
//!
//! Outwards from the sample: material, a gap of desk, the line, desk. With Φ the blur's integral,
//! the profile is D + L·[Φ((τ−a)/σ) − Φ((τ−b)/σ)] + M·Φ((e−τ)/σ), τ the distance from the line's
//! middle, a and b its inner and outer edge, e the material's edge. D, L and M are free at every
//! station, so that shading, highlights and folds cannot shift the line; the material's edge is in
//! the model because at grazing views it comes within a pixel of the line. There a pixel is centimetres
//! of the target, over which a near light changes by some per cent: each of the three is the blur of
//! something lit by 1 + g·τ + h·τ², with the light's growth g and its change h as the rig has it.

use crate::lines::{Edges, RunSample};
use gonia_brdf::Elementary;

/// How far the fit's window goes past an edge, in standard deviations of the blur, plus a pixel.
const WINDOW_SIGMAS: f64 = 3.0;

/// How far it goes into the material, likewise.
const MATERIAL_SIGMAS: f64 = 1.5;

/// Pixels that differ by this share of the brightest are none that nothing falls on, however uneven the light is.
const DIFFERS: f64 = 0.25;

/// Edges of line and material about a station.
#[derive(Clone, Copy)]
pub struct LineProfile {
    pub edges: Edges,
    /// The station's place along the line.
    pub s: f64,
    /// Standard deviation of the blur, pixels.
    pub sigma: f64,
    /// How the light changes outwards.
    pub light: Growth,
}

/// Light across a line: 1 + `linear`·τ + `square`·τ² of that in the line's middle, τ pixels outwards.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Growth {
    pub linear: f64,
    pub square: f64,
    /// A run of pixels is a piece of a row or a column, and goes along the line too where that is oblique: by so
    /// much the light grows with each of its pixels outwards for that.
    pub aside: f64,
}

impl Growth {
    fn at(&self, tau: f64) -> f64 {
        1.0 + tau * (self.linear + tau * self.square)
    }

    fn is_even(&self) -> bool {
        *self == Self::default()
    }

    /// By how much the light differs over a run, at most [`DIFFERS`].
    fn over(&self, [inner, outer]: [f64; 2]) -> f64 {
        let at = |tau: f64| self.at(tau) * (1.0 + self.aside * tau);
        (at(outer) - at(inner)).abs().min(DIFFERS)
    }
}

/// The blur about τ of what is lit and lies on one side of an edge, with its derivatives.
struct Blurred {
    value: f64,
    /// By τ − edge where the light stays.
    slope: f64,
    /// By ln σ.
    blur: f64,
}

impl Blurred {
    /// Of what lies inwards of an edge: ∫ (1 + g·u + h·u²) du over u < edge, weighed by the normal density about τ.
    /// With u = τ + σ·w and z = (edge − τ)/σ, ∫φ = Φ(z), ∫w·φ = −φ(z) and ∫w²·φ = Φ(z) − z·φ(z) over w < z.
    fn inwards_of(edge: f64, tau: f64, sigma: f64, light: Growth) -> Self {
        let z = (edge - tau) / sigma;
        let (share, density) = normal(z);
        let first = -density * sigma;
        let second = (share - z * density) * sigma * sigma;
        let (slope_here, square) = (light.linear + 2.0 * light.square * tau, light.square);
        let lit = light.at(edge);
        Self {
            value: light.at(tau) * share + slope_here * first + square * second,
            slope: -lit * density / sigma,
            blur: -z * lit * density + slope_here * first + 2.0 * square * second,
        }
    }

    fn times(self, factor: f64) -> Self {
        Self {
            value: factor * self.value,
            slope: factor * self.slope,
            blur: factor * self.blur,
        }
    }
}

/// The fit of one station's amplitudes, and what it tells about the line's place and the blur.
/// The derivatives are cleared of what a change of amplitudes could do as well.
#[derive(Clone, Copy, Default)]
pub struct StationFit {
    /// Sum of squared residuals.
    pub rss: f64,
    /// How much larger it would be without the line.
    pub gain: f64,
    /// Amplitude of the line.
    pub line: f64,
    /// Samples minus amplitudes.
    pub freedom: f64,
    /// Products of the derivatives by outward shift (0) and by ln σ (1).
    pub normal: [f64; 3],
    /// Their products with the residual.
    pub right: [f64; 2],
}

impl LineProfile {
    /// Fits a run whose line is `shift(sample)` from the predicted one. `None` with too few pixels.
    pub fn fit(&self, run: &[RunSample], shift: impl Fn(&RunSample) -> f64) -> Option<StationFit> {
        let margin = WINDOW_SIGMAS * self.sigma + 1.0;
        let [near, far, edge] = self.edges.at(self.s);
        let outer = far + margin;
        // A gap wide enough to stand in keeps the material out of it.
        let with_material = near - margin < edge + WINDOW_SIGMAS * self.sigma;
        // Little of the material: it may have a pattern of its own.
        let inner = if with_material {
            edge - MATERIAL_SIGMAS * self.sigma - 1.0
        } else {
            near - margin
        };
        let mut rows: [Row; MAX_RUN] = [Row::default(); MAX_RUN];
        let mut n = 0;
        for sample in run {
            let tau = f64::from(sample.t) - shift(sample);
            if tau < inner || tau > outer || !sample.value.is_finite() {
                continue;
            }
            if n == MAX_RUN {
                break;
            }
            rows[n] = self.row(sample, tau, with_material);
            n += 1;
        }
        // Where the pixels differ by less than the light should alone there is nothing that it falls on: a
        // saturated frame, a lid. What the light's growth leaves of an even run is no line.
        if !self.light.is_even() && !varies(&rows[..n], self.light.over([inner, outer])) {
            return None;
        }
        fit_rows(&rows[..n], with_material)
    }

    fn row(&self, sample: &RunSample, tau: f64, with_material: bool) -> Row {
        let light = self.light;
        let [near, far, edge] = self.edges.at(f64::from(sample.s));
        let aside = 1.0 + light.aside * tau;
        let of = |edge: f64| Blurred::inwards_of(edge, tau, self.sigma, light).times(aside);
        let (inner, outer) = (of(near), of(far));
        let desk = aside * (light.at(tau) + light.square * self.sigma * self.sigma);
        let mut row = Row {
            value: f64::from(sample.value),
            basis: [outer.value - inner.value, desk, 0.0],
            slope: [outer.slope - inner.slope, 0.0],
            blur: [outer.blur - inner.blur, 0.0],
        };
        if with_material {
            let material = of(edge);
            row.basis[2] = material.value;
            row.slope[1] = material.slope;
            row.blur[1] = material.blur;
        }
        row
    }
}

/// Whether the pixels of a run differ by more than this share of the brightest.
fn varies(rows: &[Row], share: f64) -> bool {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for row in rows {
        low = low.min(row.value);
        high = high.max(row.value);
    }
    high - low > share * high.abs()
}

/// Runs longer than this are cut: at 16 megapixels a window has some forty pixels.
const MAX_RUN: usize = 96;

#[derive(Clone, Copy, Default)]
struct Row {
    value: f64,
    /// Line, desk, material.
    basis: [f64; 3],
    /// Derivative by τ of line and material.
    slope: [f64; 2],
    /// Derivative by ln σ of line and material.
    blur: [f64; 2],
}

fn fit_rows(rows: &[Row], with_material: bool) -> Option<StationFit> {
    let unknowns = if with_material { 3 } else { 2 };
    if rows.len() < unknowns + 2 {
        return None;
    }
    let mut gram = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for row in rows {
        // Without material its basis is zero, and so are its products.
        for (i, basis) in row.basis.iter().enumerate() {
            right[i] += basis * row.value;
            for (sum, other) in gram[i].iter_mut().zip(row.basis) {
                *sum += basis * other;
            }
        }
    }
    if !with_material {
        gram[2][2] = 1.0;
    }
    let inverse = invert_symmetric(gram)?;
    let times =
        |v: [f64; 3]| [0, 1, 2].map(|i: usize| (0..3).map(|j| inverse[i][j] * v[j]).sum::<f64>());
    let amplitude = times(right);
    let mut fit = StationFit {
        line: amplitude[0],
        gain: amplitude[0] * amplitude[0] / inverse[0][0],
        freedom: (rows.len() - unknowns) as f64,
        ..StationFit::default()
    };
    // Derivatives by shift (outwards, so −d/dτ) and by ln σ, and their shadows on the amplitudes.
    let derivatives = |row: &Row| {
        [
            -(amplitude[0] * row.slope[0] + amplitude[2] * row.slope[1]),
            amplitude[0] * row.blur[0] + amplitude[2] * row.blur[1],
        ]
    };
    let mut shadow = [[0.0; 3]; 2];
    for row in rows {
        let d = derivatives(row);
        for (shadow, d) in shadow.iter_mut().zip(d) {
            for (sum, basis) in shadow.iter_mut().zip(row.basis) {
                *sum += d * basis;
            }
        }
    }
    let shadow = shadow.map(times);
    for row in rows {
        let project = |v: [f64; 3]| v[0] * row.basis[0] + v[1] * row.basis[1] + v[2] * row.basis[2];
        let residual = row.value - project(amplitude);
        let d = derivatives(row);
        let (by_shift, by_blur) = (d[0] - project(shadow[0]), d[1] - project(shadow[1]));
        fit.rss += residual * residual;
        fit.normal[0] += by_shift * by_shift;
        fit.normal[1] += by_shift * by_blur;
        fit.normal[2] += by_blur * by_blur;
        fit.right[0] += by_shift * residual;
        fit.right[1] += by_blur * residual;
    }
    Some(fit)
}

/// Inverse of a symmetric 3 × 3 matrix by its cofactors; `None` when nearly singular.
fn invert_symmetric(m: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let cofactor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let det: f64 = (0..3).map(|c| m[0][c] * cofactor(0, c)).sum();
    if det <= 1e-9 * m[0][0] * m[1][1] * m[2][2] {
        return None;
    }
    Some([0, 1, 2].map(|r| [0, 1, 2].map(|c| cofactor(c, r) / det)))
}

/// The normal distribution function (to 1e-7; Abramowitz & Stegun 7.1.26) and its density, which
/// share their exponential.
fn normal(z: f64) -> (f64, f64) {
    let half = z.abs() * std::f64::consts::FRAC_1_SQRT_2;
    if half > 4.5 {
        return (if z > 0.0 { 1.0 } else { 0.0 }, 0.0);
    }
    let t = 1.0 / (1.0 + 0.327_591_1 * half);
    let poly = t
        * (0.254_829_592
            + t * (-0.284_496_736
                + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let e = (-half * half).exponential();
    let upper = 0.5 * poly * e;
    const DENSITY: f64 = 0.398_942_280_401_432_7;
    (if z >= 0.0 { 1.0 - upper } else { upper }, DENSITY * e)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(half_width: f64, edge: f64, sigma: f64) -> LineProfile {
        let edges = Edges {
            line: [[-half_width, 0.0], [half_width, 0.0]],
            material: [-edge, 0.0],
        };
        LineProfile {
            edges,
            s: 0.0,
            sigma,
            light: Growth::default(),
        }
    }

    fn run(profile: &LineProfile, at: f64, amplitudes: [f64; 3]) -> Vec<RunSample> {
        (-12..=12)
            .map(|k| {
                let t = f64::from(k) + 0.3;
                let mut sample = RunSample {
                    s: 0.0,
                    t: t as f32,
                    value: 0.0,
                    pixel: [0; 2],
                };
                let row = profile.row(&sample, t - at, true);
                let value: f64 = (0..3).map(|i| amplitudes[i] * row.basis[i]).sum();
                sample.value = value as f32;
                sample
            })
            .collect()
    }

    #[test]
    fn a_hair_line_beside_a_brighter_material_is_placed_exactly() {
        // As at 400 px and θv = 75°: line 0.36 px thick, 1.2 px from the material.
        let truth = profile(0.18, 1.35, 0.5);
        let run = run(&truth, 0.37, [0.25, 0.01, 0.4]);
        let (mut at, mut sigma) = (0.0, 0.6);
        for _ in 0..8 {
            let fit = LineProfile { sigma, ..truth }.fit(&run, |_| at).unwrap();
            let [a, b, c] = fit.normal;
            let det = a * c - b * b;
            at += (c * fit.right[0] - b * fit.right[1]) / det;
            sigma *= ((a * fit.right[1] - b * fit.right[0]) / det)
                .clamp(-0.3, 0.3)
                .exponential();
        }
        assert!((at - 0.37).abs() < 1e-3, "{at}");
        assert!((sigma - 0.5).abs() < 2e-3, "{sigma}");
    }

    #[test]
    fn light_that_grows_across_a_line_does_not_move_it() {
        // At a grazing view a pixel is centimetres wide: under a near light some per cent a pixel.
        let truth = LineProfile {
            light: Growth {
                linear: -0.05,
                square: 0.004,
                aside: 0.0,
            },
            ..profile(0.12, 0.8, 0.5)
        };
        // Each thin slice of the target is lit as its place is, and blurred.
        let amplitudes = [0.27, 0.01, 0.26];
        let [near, far, edge] = truth.edges.at(0.0);
        let seen = |t: f64| -> f64 {
            let slices = (-12_000..12_000).map(|k| 1e-3 * (f64::from(k) + 0.5));
            let weighed = slices.map(|u| {
                let line = if (near..far).contains(&u) {
                    amplitudes[0]
                } else {
                    0.0
                };
                let material = if u < edge { amplitudes[2] } else { 0.0 };
                let z = (t - u) / truth.sigma;
                let blur = normal(z).1 / truth.sigma;
                1e-3 * blur * truth.light.at(u) * (line + amplitudes[1] + material)
            });
            weighed.sum()
        };
        let mut run = run(&truth, 0.0, amplitudes);
        for sample in &mut run {
            sample.value = seen(f64::from(sample.t)) as f32;
        }
        let placed = |profile: LineProfile| {
            let mut at = 0.0;
            for _ in 0..6 {
                let fit = profile.fit(&run, |_| at).unwrap();
                at += fit.right[0] / fit.normal[0];
            }
            at
        };
        let with = |light| placed(LineProfile { light, ..truth });
        let straight = Growth {
            square: 0.0,
            ..truth.light
        };
        let (all, straight, even) = (with(truth.light), with(straight), with(Growth::default()));
        println!("{all} {straight} {even}");
        assert!(all.abs() < 1e-3, "{all}");
        assert!(straight.abs() > 3e-3, "{straight}");
        assert!(even.abs() > 0.02, "{even}");
    }

    #[test]
    fn an_even_run_shows_no_line_in_whatever_light() {
        let truth = profile(0.12, 0.8, 0.5);
        let mut even = run(&truth, 0.0, [0.25, 0.01, 0.4]);
        even.iter_mut().for_each(|sample| sample.value = 0.5);
        let lit = |linear: f64| {
            let light = Growth {
                linear,
                ..Growth::default()
            };
            LineProfile { light, ..truth }.fit(&even, |_| 0.0)
        };
        assert!(lit(-0.05).is_none() && lit(0.05).is_none());
        let fit = lit(0.0).unwrap();
        assert!(fit.gain <= 1e-12, "{}", fit.gain);
    }

    #[test]
    fn a_flat_run_gains_nothing_from_a_line() {
        let profile = profile(0.7, 5.0, 0.5);
        let mut flat = run(&profile, 0.0, [0.0, 0.3, 0.0]);
        for (i, sample) in flat.iter_mut().enumerate() {
            sample.value += [0.01, -0.01, 0.0][i % 3];
        }
        let fit = profile.fit(&flat, |_| 0.0).unwrap();
        assert!(fit.gain < fit.rss);
    }
}
