//! Whether the light stands where `rig.toml` puts it, by the shading of a known reference.
//!
//! Radiance over ρ/π and the irradiance E of the rig's light is 1 everywhere when all three are right. A light
//! that stands elsewhere leaves a pattern: ln E changes with its place, more where it is near or low. Other
//! things leave patterns too, and none of them is taken for a light that is off: a beam that is not even is
//! fixed to the light's arm, a lens that darkens towards its corners to the camera, an uneven reference to the
//! target, and a reference that is not quite Lambertian is the same with light and view exchanged. All of them
//! are fitted at once, in one linear step; what the light's place explains beyond all others must stand out
//! from the noise. By how much the light is off then, the solver that calibrates rigs tells from the same values.

use crate::calibrate::{LightOff, ReferenceValue, ShadedFrame, light_off};
use crate::process::reference::ReferenceFrame;
use crate::process::reflectance::KnownReference;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Direction, Elementary, Pose};
use gonia_imaging::IdealLight;
use gonia_rig::{CameraModel, CameraShift, Placement, Remark, Rig};
use nalgebra::{DMatrix, DVector};

/// Fewer frames tell nothing.
const LEAST_FRAMES: usize = 10;
/// More frames, or points of all of them, would tell hardly more.
const MOST_FRAMES: usize = 300;
const MOST_ROWS: usize = 100_000;
/// Lights lower than this say more of the reference's finish than of their place: its cosine.
const LEAST_COSINE: f64 = 0.17;
/// How far off directions of the light may be before it is said, degrees (95th percentile of the frames): of a
/// rig that was built with care, and of one that was calibrated, by the same shading: twice what its arms keep.
const TOLERATED_DEG: f64 = 0.1;
const CALIBRATED_DEG: f64 = 0.06;
/// And at least so many standard uncertainties.
const SURE: f64 = 3.0;
/// The same where only this fit says it, which was seen to find twice what is true.
const ROUGHLY_DEG: f64 = 0.25;
/// What the light's place explains must be this many times the variance of what is left: of a χ² of eight
/// degrees of freedom less than one in ten thousand is larger.
const CLEAR: f64 = 33.0;
/// The points of a frame share some of what is left. By how much that counts is seen in many frames, and
/// taken as this in fewer.
const MANY_FRAMES: usize = 40;
const SHARED: f64 = 4.0;
/// Rounds of reweighting, and deviations (in standard ones) from which a point counts less.
const ROUNDS: usize = 4;
const SOFT: f64 = 2.5;
/// Numbers of the rig that may be off: two zeros, right, miss, distance; height and two tilts of the target.
const MOVES: usize = 8;
/// Numbers that stand for everything else.
const OTHERS: usize = 20;
const ALL: usize = MOVES + OTHERS;

/// A change of the rig: each number in its prior's standard deviations.
type Moves = [f64; MOVES];

/// `rig` with the light's place changed. The units are what a rig that was measured with a ruler may be off by:
/// what the frames do not tell stays within them.
fn moved(rig: &Rig, by: &Moves) -> Rig {
    let mut rig = rig.clone();
    let arm = &mut rig.light.arm;
    arm.theta_zero_deg += 0.5 * by[0];
    arm.phi_zero_deg += 0.5 * by[1];
    arm.right_mm += 8.0 * by[2];
    arm.axis_miss_mm += 2.0 * by[3];
    rig.light.distance_m *= 1.0 + 0.015 * by[4];
    let place = &mut rig.target.place;
    place.height_mm += 2.0 * by[5];
    place.tilt_deg[0] += 0.2 * by[6];
    place.tilt_deg[1] += 0.2 * by[7];
    rig
}

/// A point of a frame: what is left of ln(I/(E·ρ/π)), and by what each number would change it.
struct Row {
    frame: usize,
    left: f64,
    by: [f64; ALL],
}

/// What speaks against the light's place. `points_mm` is the rig's grid.
pub fn warning(
    rig: &Rig,
    frames: &[ReferenceFrame],
    reference: &KnownReference,
    points_mm: &[[f64; 2]],
) -> Option<Remark> {
    let step = frames.len().div_ceil(MOST_FRAMES).max(1);
    let chosen: Vec<&ReferenceFrame> = frames.iter().step_by(step).collect();
    if chosen.len() < LEAST_FRAMES {
        return None;
    }
    let every = (chosen.len() * points_mm.len()).div_ceil(MOST_ROWS);
    let rows: Vec<Row> = chosen
        .iter()
        .enumerate()
        .flat_map(|(number, frame)| {
            // Another set of points in each frame.
            let points = (number % every..points_mm.len()).step_by(every);
            rows_of(rig, (number, frame), reference, points_mm, points)
        })
        .collect();
    let fit = fit_frames(rows, chosen.len())?;
    if fit.explained <= CLEAR {
        return None;
    }
    let by = match amount(rig, &chosen, reference, points_mm) {
        Some(LightOff { off, u }) => {
            let tolerated_deg = match rig.calibration {
                Some(_) => CALIBRATED_DEG,
                None => TOLERATED_DEG,
            };
            if off.p95 < tolerated_deg.max(SURE * u.p95) {
                return None;
            }
            format!(
                " by {:.2} ± {:.2} degrees in the median frame, by {:.2} at most",
                off.p50, u.p50, off.max
            )
        }
        None => {
            let lights = chosen.iter().map(|frame| frame.reading.light);
            let off = fit.directions(rig, lights, points_mm);
            if off.deg < ROUGHLY_DEG.max(off.u_deg) {
                return None;
            }
            String::new()
        }
    };
    Some(Remark::new(
        "reference",
        format_args!(
            "its shading is not that of a light where rig.toml puts it, whatever its beam, the lens and the reference's own unevenness: directions of the light are off{by}"
        ),
        match rig.calibration {
            Some(_) => {
                "the rig has changed since it was calibrated: run gonia calibrate DIR -o DIR/rig.toml again"
            }
            None => "run gonia calibrate DIR -o DIR/rig.toml, and process again",
        },
    ))
}

/// By how much directions of the light are off.
fn amount(
    rig: &Rig,
    frames: &[&ReferenceFrame],
    reference: &KnownReference,
    points_mm: &[[f64; 2]],
) -> Option<LightOff> {
    let shaded = |frame: &&ReferenceFrame| {
        let reading = frame.reading.light;
        let light = IdealLight::new(rig, reading);
        let camera = CameraModel::new(rig).placement(frame.reading.view, CameraShift::default());
        let values = points_mm.iter().zip(&frame.relative).enumerate();
        let values = values.map(|(point, (at_mm, relative))| {
            let to_camera = camera.direction_from(*at_mm);
            let known = reference.at(light.direction_from(*at_mm), to_camera);
            let of = |rgb: &[f32; 3]| f64::from(rgb.iter().sum::<f32>());
            ReferenceValue {
                point,
                at_mm: *at_mm,
                to_camera,
                radiance: of(relative) * light.irradiance(*at_mm) / of(&known),
            }
        });
        ShadedFrame::of_values(rig, reading, values)
    };
    let poses: Vec<Pose> = frames.iter().map(|frame| frame.reading).collect();
    light_off(rig, &poses, frames.iter().filter_map(shaded).collect())
}

/// The points of a frame that say something.
fn rows_of(
    rig: &Rig,
    (number, frame): (usize, &ReferenceFrame),
    reference: &KnownReference,
    points_mm: &[[f64; 2]],
    points: impl Iterator<Item = usize>,
) -> Vec<Row> {
    let light = IdealLight::new(rig, frame.reading.light);
    let stands = rig.light_at(frame.reading.light);
    let camera = CameraModel::new(rig).placement(frame.reading.view, CameraShift::default());
    let step = 0.01;
    let changed: [IdealLight; MOVES] = std::array::from_fn(|k| {
        let mut by = [0.0; MOVES];
        by[k] = step;
        IdealLight::new(&moved(rig, &by), frame.reading.light)
    });
    // Without the normalisation by distance, which a constant takes up anyway.
    let ln_e = |light: &IdealLight, at| light.irradiance(at).natural_log();
    let row = |point: usize| {
        let at = points_mm[point];
        let (to_light, to_camera) = (light.direction_from(at), camera.direction_from(at));
        if to_light[2] < LEAST_COSINE || to_camera[2] < LEAST_COSINE {
            return None;
        }
        let known = reference.at(to_light, to_camera);
        let seen = frame.relative.get(point)?;
        let ratio: f64 = (0..3).map(|c| f64::from(seen[c] / known[c])).sum::<f64>() / 3.0;
        if !(ratio.is_finite() && ratio > 0.0) {
            return None;
        }
        let here = ln_e(&light, at);
        let mut by = [0.0; ALL];
        for (by, changed) in by.iter_mut().zip(&changed) {
            *by = (ln_e(changed, at) - here) / step;
        }
        others(at, [&stands, &camera], [to_light, to_camera])
            .into_iter()
            .zip(&mut by[MOVES..])
            .for_each(|(value, by)| *by = value);
        let is_finite = by.iter().all(|v| v.is_finite());
        is_finite.then(|| Row {
            frame: number,
            left: ratio.natural_log(),
            by,
        })
    };
    points.filter_map(row).collect()
}

/// Patterns that are not the light's place.
fn others(
    at_mm: [f64; 2],
    [light, camera]: [&Placement; 2],
    [to_light, to_camera]: [Vec3; 2],
) -> [f64; OTHERS] {
    // Fixed to the light's arm, its beam, and to the camera, its lens.
    let [[u, v], [a, b]] = [light, camera].map(|from| tangents(from, at_mm));
    let (beam2, lens2) = (u * u + v * v, a * a + b * b);
    // Fixed to the target: shares of its half, about.
    let [x, y] = at_mm.map(|mm| mm * 1e-3);
    // A reference's own, the same with light and view exchanged.
    let (i, o) = (to_light[2], to_camera[2]);
    let between = dot(to_light, to_camera);
    [
        1.0,
        u,
        v,
        u * u,
        u * v,
        v * v,
        beam2 * beam2,
        a,
        b,
        lens2,
        lens2 * lens2,
        x,
        y,
        x * x,
        x * y,
        y * y,
        i + o,
        i * i + o * o,
        i * o,
        between,
    ]
}

/// Tangents to the right and up under which something on an arm sees a point of the target.
fn tangents(from: &Placement, at_mm: [f64; 2]) -> [f64; 2] {
    let to = [
        from.at_mm[0] - at_mm[0],
        from.at_mm[1] - at_mm[1],
        from.at_mm[2],
    ];
    let depth = dot(to, from.back);
    [-dot(to, from.right) / depth, -dot(to, from.up) / depth]
}

/// What the rows say of the light's place.
struct Fit {
    moves: Moves,
    covariance: DMatrix<f64>,
    /// What the moves explain beyond everything else, in variances of what is left.
    explained: f64,
    /// Standard deviation of what is left of a row, and what is left.
    noise: f64,
    left: Vec<f64>,
}

/// By how much directions of the light are off as this fit has it, RMS.
struct FittedOff {
    deg: f64,
    u_deg: f64,
}

/// Sums of the rows for the normal equations, with their priors.
fn sums(rows: &[Row], weights: &[f64], noise: f64) -> (DMatrix<f64>, DVector<f64>) {
    let mut normal = DMatrix::<f64>::identity(ALL, ALL) * (noise * noise);
    let mut right = DVector::<f64>::zeros(ALL);
    for (row, weight) in rows.iter().zip(weights) {
        for i in 0..ALL {
            let weighted = weight * row.by[i];
            right[i] += weighted * row.left;
            for j in 0..=i {
                normal[(i, j)] += weighted * row.by[j];
            }
        }
    }
    for i in 0..ALL {
        for j in 0..i {
            normal[(j, i)] = normal[(i, j)];
        }
    }
    (normal, right)
}

/// As [`fit`], of frames whose levels scatter: a lamp flickers, and arms are a little off at each pose. What
/// they scatter by is seen in a first fit, and with it the points of a frame are made independent of each
/// other: a share of the frame's mean is taken from them.
fn fit_frames(mut rows: Vec<Row>, frames: usize) -> Option<Fit> {
    let first = fit(&rows, frames)?;
    let mut counts = vec![0.0; frames];
    let mut levels = vec![0.0; frames];
    let mut means = vec![[0.0; ALL + 1]; frames];
    for (row, left) in rows.iter().zip(&first.left) {
        counts[row.frame] += 1.0;
        levels[row.frame] += left;
        for (mean, value) in means[row.frame].iter_mut().zip(row.values()) {
            *mean += value;
        }
    }
    for (frame, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
        levels[frame] /= count;
        for mean in &mut means[frame] {
            *mean /= count;
        }
    }
    let used = counts.iter().filter(|count| **count > 0.0).count();
    // As many numbers as are fitted do not show in what is left.
    let free = match used >= MANY_FRAMES {
        true => (used - ALL) as f64,
        false => used as f64 / SHARED,
    };
    let level2 = levels.iter().map(|l| l * l).sum::<f64>() / free;
    for row in &mut rows {
        let own = first.noise * first.noise / counts[row.frame];
        let share = 1.0 - (own / (own + level2)).sqrt();
        row.left -= share * means[row.frame][ALL];
        for (by, mean) in row.by.iter_mut().zip(&means[row.frame]) {
            *by -= share * mean;
        }
    }
    fit(&rows, frames)
}

impl Row {
    /// What it holds, the value last.
    fn values(&self) -> impl Iterator<Item = f64> {
        self.by.into_iter().chain([self.left])
    }
}

/// The numbers that explain the rows best, robustly.
fn fit(rows: &[Row], frames: usize) -> Option<Fit> {
    if rows.len() < 4 * ALL {
        return None;
    }
    let mut weights = vec![1.0; rows.len()];
    let mut noise = 0.01;
    let mut left: Vec<f64> = Vec::new();
    for _ in 0..ROUNDS {
        let (normal, right) = sums(rows, &weights, noise);
        let solution = normal.cholesky()?.solve(&right);
        let of = |row: &Row| {
            let said: f64 = row.by.iter().zip(solution.iter()).map(|(a, b)| a * b).sum();
            row.left - said
        };
        left = rows.iter().map(of).collect();
        let mut sizes: Vec<f64> = left.iter().map(|l| l.abs()).collect();
        let middle = sizes.len() / 2;
        // The median of a normal deviation is 0.6745 of its standard one.
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        noise = (median / 0.6745).max(1e-5);
        for (weight, left) in weights.iter_mut().zip(&left) {
            *weight = (SOFT * noise / left.abs()).min(1.0);
        }
    }
    let (normal, right) = sums(rows, &weights, noise);
    let others = normal.view((MOVES, MOVES), (OTHERS, OTHERS)).into_owned();
    let of_others = right.rows(MOVES, OTHERS).into_owned();
    let without = of_others.dot(&others.cholesky()?.solve(&of_others));
    let factor = normal.cholesky()?;
    let solution = factor.solve(&right);
    let variance = noise * noise * shared(rows, &weights, &left, noise, frames, &factor.inverse());
    let covariance = factor.inverse().view((0, 0), (MOVES, MOVES)) * variance;
    let moves: Moves = std::array::from_fn(|k| solution[k]);
    moves.iter().all(|m| m.is_finite()).then_some(Fit {
        moves,
        covariance,
        explained: (right.dot(&solution) - without) / variance,
        noise,
        left,
    })
}

/// By how much the variance of what is fitted is larger than that of independent points.
fn shared(
    rows: &[Row],
    weights: &[f64],
    left: &[f64],
    noise: f64,
    frames: usize,
    inverse: &DMatrix<f64>,
) -> f64 {
    if frames < MANY_FRAMES {
        return SHARED;
    }
    let mut gradients = vec![DVector::<f64>::zeros(ALL); frames];
    for ((row, weight), left) in rows.iter().zip(weights).zip(left) {
        for (sum, by) in gradients[row.frame].iter_mut().zip(&row.by) {
            *sum += weight * left * by;
        }
    }
    let seen: f64 = gradients.iter().map(|g| g.dot(&(inverse * g))).sum();
    // As many numbers as are fitted do not show in what is left.
    let free = (frames - ALL) as f64 / frames as f64;
    (seen / (noise * noise * ALL as f64 * free)).max(1.0)
}

impl Fit {
    /// Over the target, with the light at some readings.
    fn directions(
        &self,
        rig: &Rig,
        lights: impl Iterator<Item = Direction>,
        points_mm: &[[f64; 2]],
    ) -> FittedOff {
        let step = 0.01;
        let rigs: [Rig; MOVES] = std::array::from_fn(|k| {
            let mut by = [0.0; MOVES];
            by[k] = step;
            moved(rig, &by)
        });
        let every = points_mm.len().div_ceil(12).max(1);
        let mut products = DMatrix::<f64>::zeros(MOVES, MOVES);
        let mut count = 0.0;
        for reading in lights {
            let here = rig.light_at(reading);
            let there = rigs.each_ref().map(|rig| rig.light_at(reading));
            for at in points_mm.iter().step_by(every) {
                let from = here.direction_from(*at);
                let turns = there.each_ref().map(|placed| {
                    let to = placed.direction_from(*at);
                    [0, 1, 2].map(|i| (to[i] - from[i]) / step)
                });
                for (i, j) in (0..MOVES).flat_map(|i| (0..MOVES).map(move |j| (i, j))) {
                    products[(i, j)] += dot(turns[i], turns[j]);
                }
                count += 1.0;
            }
        }
        products /= f64::max(count, 1.0);
        let moves = DVector::from_row_slice(&self.moves);
        let u2 = (&products * &self.covariance).trace();
        FittedOff {
            deg: moves
                .dot(&(&products * &moves))
                .max(0.0)
                .sqrt()
                .to_degrees(),
            u_deg: u2.max(0.0).sqrt().to_degrees(),
        }
    }
}
