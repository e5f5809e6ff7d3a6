//! Whether U (k = 2) is true: sessions whose rigs, references, lamps and cameras have errors drawn from the stated
//! uncertainties, from frames to cells, against the truth.
//!
//! `cargo bench -p gonia-pipeline --bench coverage [-- SESSIONS]` prints, for each material and part of the domain,
//! the share of cells (all but extrapolated ones) whose true value lies within U of the found one; then the same of
//! sessions that have one error alone, with it in the budget and without.

#![allow(clippy::expect_used, clippy::unwrap_used)]

use gonia_brdf::model::{Brdf, Material};
use gonia_brdf::random::Random;
use gonia_brdf::{Direction, Elementary, Grid, Pose, Sample, Vec3};
use gonia_formats::FileError;
use gonia_pipeline::budget::{CellUncertainty, Effect, budget_of};
use gonia_pipeline::process::{FrameSource, Masks, process};
use gonia_pipeline::{FillOptions, fill, silent};
use gonia_rig::Stratum;
use gonia_rig::{Certificate, Frame, FrameRow, Input, Reference, Rig, Role, Scale, Uncertainties};
use gonia_sim::scene::{Noise, Scene, SceneGeometry};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;

const STEP_DEG: f64 = 6.0;
/// An error that is alone is larger than usual by this: it must show over noise and interpolation.
const ALONE: f64 = 4.0;
const POSES: usize = 60;
const PX: usize = 160;
const RHO: f64 = 0.9;
const PARTS: [Stratum; 4] = [
    Stratum::All,
    Stratum::Interior,
    Stratum::Grazing,
    Stratum::Highlight,
];

/// What the rig states, one standard uncertainty each (diameters as they are).
fn stated(input: Input) -> f64 {
    match input {
        Input::Reference => 0.01,
        Input::ReferenceAngle => 0.05,
        Input::ReferenceTilt => 0.15,
        Input::ReferenceHeight => 1.0,
        Input::Drift => 0.005,
        Input::Linearity => 0.01,
        Input::Offset => 0.001,
        Input::StrayLight => 0.005,
        Input::LightDirection => 0.2,
        Input::ViewDirection => 0.2,
        Input::LightDiameter | Input::LensDiameter => 40.0,
    }
}

/// A rig that states them, times `scale`.
fn nominal(scale: f64) -> Rig {
    let mut rig = Rig::paper(PX);
    let some = |input| Some(scale * stated(input));
    let mut reference = Reference::lambertian([RHO; 3]);
    reference.certificate = Certificate {
        u: some(Input::Reference),
        u_angle: some(Input::ReferenceAngle),
        tilt_u_deg: some(Input::ReferenceTilt),
        height_u_mm: some(Input::ReferenceHeight),
        ..Certificate::default()
    };
    rig.reference = Some(reference);
    rig.uncertainty = Some(Uncertainties {
        drift: some(Input::Drift),
        linearity: some(Input::Linearity),
        offset: some(Input::Offset),
        stray_light: some(Input::StrayLight),
        light_deg: some(Input::LightDirection),
        view_deg: some(Input::ViewDirection),
        light_diameter_mm: some(Input::LightDiameter),
        lens_diameter_mm: some(Input::LensDiameter),
    });
    rig
}

/// The errors of a session, in the inputs' units.
struct Errors {
    drawn: [[f64; 2]; Input::ALL.len()],
}

impl Errors {
    /// Drawn for the inputs that have any.
    fn draw(seed: u64, scale: f64, has: &dyn Fn(Input) -> bool) -> Self {
        let mut random = Random::new(seed);
        let drawn = Input::ALL.map(|input| {
            let by = [random.normal(), random.normal()];
            by.map(|by| {
                if has(input) {
                    by * scale * stated(input)
                } else {
                    0.0
                }
            })
        });
        Self { drawn }
    }

    fn of(&self, input: Input) -> f64 {
        self.drawn[input as usize][0]
    }

    fn pair(&self, input: Input) -> [f64; 2] {
        self.drawn[input as usize]
    }
}

/// A material as lamp and lens of these radii over their distances see it: its mean over both cones.
struct OverCones {
    of: Arc<dyn Brdf>,
    radius: [f64; 2],
}

impl Brdf for OverCones {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        // Rings of a disc with the same second moments as the disc: r²/2 of each component's square, twice.
        let about = |d: Vec3, radius: f64| -> Vec<Vec3> {
            let across = [-d[1], d[0], 0.0];
            let flat = across[0].hypotenuse(across[1]);
            let across = if flat > 1e-9 {
                across.map(|k| k / flat)
            } else {
                [0.0, 1.0, 0.0]
            };
            let along = [
                across[1] * d[2],
                -across[0] * d[2],
                across[0] * d[1] - across[1] * d[0],
            ];
            (0..6)
                .map(|k| {
                    let (s, c) = (f64::from(k) * std::f64::consts::FRAC_PI_3).sine_cosine();
                    let r = radius / 2f64.sqrt();
                    let to = [0, 1, 2].map(|j| d[j] + r * (c * along[j] + s * across[j]));
                    gonia_brdf::direction::normalize(to)
                })
                .collect()
        };
        let (lights, views) = (about(light, self.radius[0]), about(view, self.radius[1]));
        let mut sum = [0.0; 3];
        for light in &lights {
            for view in &views {
                let value = self.of.eval(*light, *view);
                (0..3).for_each(|c| sum[c] += value[c] / 36.0);
            }
        }
        sum
    }
}

/// A reference that departs from a Lambertian one.
struct White {
    rho: f64,
    departs: f64,
}

impl Brdf for White {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let departs = |d: Vec3| self.departs * (1.0 - d[2]).powi(2);
        let value = self.rho / (1.0 + departs(light) + departs(view)) / std::f64::consts::PI;
        [value; 3]
    }
}

/// Frames of a session with errors.
struct Session {
    rows: Vec<FrameRow>,
    scenes: [Scene; 2],
    errors: Errors,
    /// The reference's radiance under light from straight above.
    bright: f64,
}

impl Session {
    fn new(rig: &Rig, material: Arc<dyn Brdf>, errors: Errors, seed: u64) -> Self {
        let keys = rig.uncertainty.unwrap_or_default();
        let mut truth = rig.clone();
        let light = errors.pair(Input::LightDirection);
        truth.light.arm.theta_zero_deg += light[0];
        truth.light.arm.phi_zero_deg += light[1];
        let radius = |input, diameter: Option<f64>, m: f64| {
            let has = errors.of(input) != 0.0;
            diameter.filter(|_| has).map_or(0.0, |d| d / 2000.0 / m)
        };
        let (lamp, lens) = (keys.light_diameter_mm, keys.lens_diameter_mm);
        let radius = [
            radius(Input::LightDiameter, lamp, rig.light.distance_m),
            radius(Input::LensDiameter, lens, rig.camera.distance_m),
        ];
        let seen: Arc<dyn Brdf> = if radius == [0.0; 2] {
            material
        } else {
            Arc::new(OverCones {
                of: material,
                radius,
            })
        };
        let white = Arc::new(White {
            rho: RHO / (1.0 + errors.of(Input::Reference)),
            departs: errors.of(Input::ReferenceAngle),
        });
        let scene = |rig: &Rig| {
            let mut scene = Scene::new(
                SceneGeometry::of_rig(rig),
                seen.clone(),
                white.clone(),
                seed,
            );
            scene.occluder = None;
            scene.beam = None;
            scene.noise = Some(Noise {
                shot: 0.01,
                ..Noise::default()
            });
            scene
        };
        let mut raised = truth.clone();
        raised.target.place.height_mm += errors.of(Input::ReferenceHeight);
        let tilt = errors.pair(Input::ReferenceTilt);
        for (of, by) in raised.target.place.tilt_deg.iter_mut().zip(tilt) {
            *of += by;
        }
        let mut random = Random::new(seed ^ 0x5eed);
        let mut rows = Vec::new();
        for k in 0..POSES {
            let mut direction = |most: f64| {
                let cosine = 1.0 - random.share() * (1.0 - most.to_radians().cosine());
                [cosine.arc_cosine().to_degrees(), random.between(0.0, 360.0)]
            };
            let ([ti, pi], [tv, pv]) = (direction(80.0), direction(72.0));
            for (at, role) in [Role::Material, Role::Reference].into_iter().enumerate() {
                rows.push(FrameRow {
                    frame: (2 * k + at) as u32,
                    role,
                    pose: Pose::from_deg([ti, pi, tv, pv]),
                    file: format!("frames/{k}-{at}.exr"),
                });
            }
        }
        let bright = RHO / std::f64::consts::PI / rig.light.distance_m.powi(2);
        Self {
            rows,
            scenes: [scene(&truth), scene(&raised)],
            errors,
            bright,
        }
    }
}

impl FrameSource for Session {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let is_material = row.role == Role::Material;
        let scene = &self.scenes[usize::from(!is_material)];
        let mut frame = scene.frame(row.role, row.pose, u64::from(row.frame));
        let e = |input| self.errors.of(input);
        let n = frame.rgb.len() as f64;
        let mean = frame.rgb.iter().map(|p| f64::from(p[1])).sum::<f64>() / n;
        let lamp = if is_material {
            1.0 + e(Input::Drift)
        } else {
            1.0
        };
        let exponent = e(Input::Linearity) / 10f64.natural_log();
        for pixel in &mut frame.rgb {
            for value in pixel {
                let spread = e(Input::StrayLight) * mean + e(Input::Offset) * self.bright;
                let light = (f64::from(*value) * lamp + spread).max(1e-9);
                *value = (light * (light / self.bright).power(exponent)) as f32;
            }
        }
        Ok(frame)
    }
}

/// Samples whose views are believed to be where they are not.
fn with_views_off(samples: &mut [Sample], [along, across]: [f64; 2]) {
    for sample in samples {
        let theta = f64::from(sample.theta_v_deg);
        let sine = theta.to_radians().sine().max(0.05);
        let (theta, phi) = (theta - along, f64::from(sample.phi_v_deg) - across / sine);
        let phi = if theta < 0.0 { phi + 180.0 } else { phi };
        sample.theta_v_deg = theta.abs() as f32;
        sample.phi_v_deg = phi.rem_euclid(360.0) as f32;
    }
}

/// Cells within U of the truth, and all, by part of the domain; for a budget each.
type Counts = Vec<[[usize; 2]; PARTS.len()]>;

/// A session from its frames to its cells: its errors are `scale` times those stated usually, and the rig says so.
fn run(
    material: &Arc<dyn Brdf>,
    (seed, scale): (u64, f64),
    has: &dyn Fn(Input) -> bool,
    without: &[Option<Input>],
) -> Counts {
    let rig = nominal(scale);
    let errors = Errors::draw(seed, scale, has);
    let session = Session::new(&rig, material.clone(), errors, seed);
    let go = &|_, _| ControlFlow::Continue(());
    let mut done = process(&rig, &session, &Masks::default(), go).expect("frames are sound");
    with_views_off(&mut done.samples, session.errors.pair(Input::ViewDirection));
    let mut budget = budget_of(&rig, done.calibration, &done.samples);
    for input in Input::ALL {
        if !has(input) {
            budget = budget.with(input, 0.0);
        }
    }
    let options = FillOptions {
        with_errors: true,
        ..FillOptions::with_step_deg(STEP_DEG)
    };
    let filled =
        fill(done.samples, Scale::Absolute, &options, &silent).expect("samples are enough");
    let errors = filled.errors.expect("asked for");
    let grid = filled.dense.grid;
    let plane = &filled.dense.planes[1];
    let highlight = brightest(grid, material.as_ref());
    without
        .iter()
        .map(|left_out| {
            let budget = left_out.map_or(budget.clone(), |input| budget.clone().with(input, 0.0));
            let cells = CellUncertainty::new(grid, plane, &budget).expect("its own plane");
            count(
                &cells,
                plane,
                (&errors.standard_error[1], &errors.origin),
                material.as_ref(),
                highlight,
            )
        })
        .collect()
}

fn count(
    cells: &CellUncertainty<'_>,
    plane: &[f32],
    (noise, origin): (&[f32], &[u8]),
    material: &dyn Brdf,
    highlight: f64,
) -> [[usize; 2]; PARTS.len()] {
    let grid = Grid::with_step_deg(STEP_DEG).expect("it divides 180");
    let mut counts = [[0; 2]; PARTS.len()];
    for cell in 0..grid.n_cells() {
        let (light, view) = grid.light_and_view(cell);
        let (d_light, d_view) = (grid.direction(light), grid.direction(view));
        // Poles repeat one value.
        if origin[cell] == 3
            || light % grid.n_phi() > 0 && light < grid.n_phi()
            || view % grid.n_phi() > 0 && view < grid.n_phi()
        {
            continue;
        }
        let truth = material.eval(d_light.to_vec3(), d_view.to_vec3())[1];
        let found = f64::from(plane[cell]);
        let effects = cells.effects(light, view);
        let shares: f64 = Effect::ALL.iter().map(|e| effects.of(*e).powi(2)).sum();
        let u = (f64::from(noise[cell]).powi(2) + found * found * shares).sqrt();
        let is_within = (found - truth).abs() <= 2.0 * u;
        for (part, counts) in PARTS.iter().zip(&mut counts) {
            if is_in(*part, (d_light, d_view), truth, highlight) {
                counts[0] += usize::from(is_within);
                counts[1] += 1;
            }
        }
    }
    counts
}

fn is_in(part: Stratum, (light, view): (Direction, Direction), truth: f64, highlight: f64) -> bool {
    let (ti, tv) = (light.theta_deg(), view.theta_deg());
    match part {
        Stratum::Interior => ti <= 75.0 && tv <= 75.0,
        Stratum::Grazing => ti > 75.0 || tv > 75.0,
        Stratum::Highlight => weighted(light, view, truth) >= highlight,
        _ => true,
    }
}

fn weighted(light: Direction, view: Direction, value: f64) -> f64 {
    value * light.to_vec3()[2] * view.to_vec3()[2]
}

/// The value, weighted by the cosines, that one cell in a hundred exceeds.
fn brightest(grid: Grid, material: &dyn Brdf) -> f64 {
    let mut all: Vec<f64> = (0..grid.n_cells())
        .map(|cell| {
            let (light, view) = grid.light_and_view(cell);
            let (light, view) = (grid.direction(light), grid.direction(view));
            weighted(
                light,
                view,
                material.eval(light.to_vec3(), view.to_vec3())[1],
            )
        })
        .collect();
    all.sort_by(|a, b| b.total_cmp(a));
    all[all.len() / 100]
}

fn sum(all: Vec<Counts>) -> Counts {
    let mut all = all.into_iter();
    let mut sum = all.next().expect("a session at least");
    for counts in all {
        for (sum, of) in sum.iter_mut().zip(counts) {
            for (sum, of) in sum.iter_mut().zip(of) {
                (0..2).for_each(|k| sum[k] += of[k]);
            }
        }
    }
    sum
}

fn print(name: &str, counts: &[[usize; 2]; PARTS.len()]) {
    let shares =
        counts.map(|[within, all]| format!("{:.1}", 100.0 * within as f64 / all.max(1) as f64));
    println!("| {name} | {} |", shares.join(" | "));
}

/// Matte, a fabric, a sharp one, and one that nothing in gonia was chosen on.
fn materials() -> [(&'static str, Arc<dyn Brdf>); 4] {
    ["white", "fabric", "satin-paint", "shot-silk"].map(|name| {
        let material = Material::named(name).expect("a material of the demo");
        (name, material.brdf)
    })
}

fn main() {
    let sessions: u64 = std::env::args()
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(200);
    let names = PARTS.map(Stratum::name).join(" | ");
    println!("| within U (k = 2), % | {names} |\n|---|---|---|---|---|");
    let all = |_: Input| true;
    let materials = materials();
    for (name, material) in &materials {
        let counts = (0..sessions / 4)
            .into_par_iter()
            .map(|seed| run(material, (1000 + seed, 1.0), &all, &[None]));
        print(name, &sum(counts.collect())[0]);
    }
    for input in Input::ALL {
        // Directions show where a BRDF is sharp, the rest where it is smooth.
        let is_direction =
            matches!(input.unit(), "degrees" | "mm") && !input.key().starts_with("reference.");
        let shows = &materials[if is_direction { 2 } else { 0 }].1;
        let has = |of: Input| of == input;
        let both = [None, Some(input)];
        let counts = (0..(sessions / 10).max(2))
            .into_par_iter()
            .map(|seed| run(shows, (5000 + seed, ALONE), &has, &both));
        let counts = sum(counts.collect());
        print(&format!("{} alone", input.key()), &counts[0]);
        print(
            &format!("{} alone, not in the budget", input.key()),
            &counts[1],
        );
    }
}
