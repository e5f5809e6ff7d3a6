//! A simulated session whose rig, reference, lamp and camera have errors of stated sizes.

use gonia_brdf::model::Brdf;
use gonia_brdf::random::Random;
use gonia_brdf::{Elementary, Pose, Sample, Vec3};
use gonia_formats::FileError;
use gonia_pipeline::process::FrameSource;
use gonia_rig::{Certificate, Frame, FrameRow, Input, Reference, Rig, Role, Uncertainties};
use gonia_sim::scene::{Noise, Scene, SceneGeometry};
use std::sync::Arc;

/// Pixels of a side of the frames.
const PX: usize = 160;
/// The reference's albedo.
const RHO: f64 = 0.9;

/// What the rig states, one standard uncertainty each (diameters as they are).
pub fn stated(input: Input) -> f64 {
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
pub fn nominal(scale: f64) -> Rig {
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
pub struct Errors {
    drawn: [[f64; 2]; Input::ALL.len()],
}

/// Of so many sessions one after the other each error has one value in each of so many equal shares of its distribution, in
/// an order of its own (a Latin hypercube): else a few sessions would tell of the luck of their draws.
#[allow(dead_code)] // The test of each error alone draws none.
const STRATA: usize = 40;
/// Normal numbers that a stratum is one of, at random.
#[allow(dead_code)]
const OF_STRATUM: usize = 64;

impl Errors {
    /// Drawn for the inputs that have any: those of the session of this number, of the sessions of one seed.
    #[allow(dead_code)] // The test of each error alone draws none.
    pub fn draw((seed, number): (u64, u64), has: &dyn Fn(Input) -> bool) -> Self {
        let [round, place] = [number / STRATA as u64, number % STRATA as u64];
        let mut component = 0;
        let mut one = || {
            component += 1;
            let mut random = Random::new(seed ^ (round << 32) ^ (component << 48));
            let mut normal: Vec<f64> = (0..STRATA * OF_STRATUM).map(|_| random.normal()).collect();
            normal.sort_by(f64::total_cmp);
            let mut order: Vec<usize> = (0..STRATA).collect();
            for k in (1..STRATA).rev() {
                order.swap(k, (random.share() * (k + 1) as f64) as usize);
            }
            let within: Vec<usize> = (0..STRATA)
                .map(|_| (random.share() * OF_STRATUM as f64) as usize)
                .collect();
            let place = place as usize;
            normal[order[place] * OF_STRATUM + within[place]]
        };
        let drawn = Input::ALL.map(|input| {
            let by = [one(), one()];
            by.map(|by| if has(input) { by * stated(input) } else { 0.0 })
        });
        Self { drawn }
    }

    /// Of one input alone, so many standard uncertainties.
    pub fn one(input: Input, scale: f64, sizes: [f64; 2]) -> Self {
        let drawn = Input::ALL.map(|of| match of == input {
            true => sizes.map(|size| size * scale * stated(input)),
            false => [0.0; 2],
        });
        Self { drawn }
    }

    pub fn of(&self, input: Input) -> f64 {
        self.drawn[input as usize][0]
    }

    pub fn pair(&self, input: Input) -> [f64; 2] {
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
        // Four places on the rim of one disc or of the other, each pair as often as any: of both discs together they have the
        // second moments, r²/4 of each component, and no first or third ones.
        let rim = |d: Vec3, radius: f64| -> [Vec3; 4] {
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
            [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]].map(|[c, s]| {
                let to = [0, 1, 2].map(|j| d[j] + radius * (c * along[j] + s * across[j]));
                gonia_brdf::direction::normalize(to)
            })
        };
        let lights = rim(light, self.radius[0]).map(|light| (light, view));
        let views = rim(view, self.radius[1]).map(|view| (light, view));
        let mut sum = [0.0; 3];
        for (light, view) in lights.into_iter().chain(views) {
            let value = self.of.eval(light, view);
            (0..3).for_each(|c| sum[c] += value[c] / 8.0);
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
pub struct Session {
    rows: Vec<FrameRow>,
    scenes: [Scene; 2],
    pub errors: Errors,
    /// The reference's radiance under light from straight above.
    bright: f64,
}

impl Session {
    /// Of `poses` directions drawn by `seed`, with the rig that it is thought to be. Each has a frame of the material and
    /// one of the reference; noise is 1 % of a pixel.
    pub fn new(
        rig: &Rig,
        material: Arc<dyn Brdf>,
        errors: Errors,
        (seed, poses): (u64, usize),
    ) -> Self {
        let keys = rig.uncertainty.unwrap_or_default();
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
        let mut raised = rig.clone();
        raised.target.place.height_mm += errors.of(Input::ReferenceHeight);
        let tilt = errors.pair(Input::ReferenceTilt);
        for (of, by) in raised.target.place.tilt_deg.iter_mut().zip(tilt) {
            *of += by;
        }
        let mut random = Random::new(seed ^ 0x5eed);
        let mut rows = Vec::new();
        for k in 0..poses {
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
            scenes: [scene(rig), scene(&raised)],
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

/// Samples whose directions are believed to be where they are not. The irradiance is that of the true ones, of material
/// and reference alike, so that it cancels.
pub fn with_directions_off(samples: &mut [Sample], errors: &Errors) {
    let [light, view] = [Input::LightDirection, Input::ViewDirection].map(|of| errors.pair(of));
    for sample in samples {
        let (theta, phi) = moved([sample.theta_i_deg, sample.phi_i_deg], light);
        (sample.theta_i_deg, sample.phi_i_deg) = (theta, phi);
        let (theta, phi) = moved([sample.theta_v_deg, sample.phi_v_deg], view);
        (sample.theta_v_deg, sample.phi_v_deg) = (theta, phi);
    }
}

fn moved([theta, phi]: [f32; 2], [along, across]: [f64; 2]) -> (f32, f32) {
    let theta = f64::from(theta);
    let sine = theta.to_radians().sine().max(0.05);
    let (theta, phi) = (theta - along, f64::from(phi) - across / sine);
    let phi = if theta < 0.0 { phi + 180.0 } else { phi };
    (theta.abs() as f32, phi.rem_euclid(360.0) as f32)
}
