//! What the shading on the reference shows, as a function of the light, its arm and the target.

use crate::calibrate::mirror::{MirrorLight, PLACE};
use crate::calibrate::solve::Frames;
use crate::calibrate::unknowns::{CAMERA, LIGHT, TARGET, Unknown, values, with_values};
use crate::process::SampledFrame;
use crate::process::central::{n_terms, terms};
use crate::process::reflectance::KnownReference;
use gonia_brdf::direction::normalize;
use gonia_brdf::{Direction, Elementary, Vec3};
use gonia_imaging::{IdealLight, SamplingGrid};
use gonia_rig::{CameraModel, Rig, Role};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;

/// Standard deviations of a frame's own numbers: the light arm's θ and φ (degrees: what encoders keep), the
/// logarithm of the lamp's intensity, and how far its points lie from where its lines put them (pixels: across the
/// camera's line of sight and along it). At a grazing view a pixel is centimetres of the target: what moves the
/// lines there by hundredths of a pixel would be taken for a light that stands elsewhere.
const OWN: [f64; 5] = [0.03, 0.03, 0.01, 0.02, 0.02];

/// The least that they are taken to be: no arm repeats better, no lamp, and no line is placed better.
const LEAST_OWN: [f64; 5] = [0.005, 0.005, 1e-4, 0.002, 0.002];

/// The same of an unknown material's frames, with what the polynomial leaves of its reflectance over a frame: slopes
/// along x and y and three curvatures, as logarithms at the rim of the sampled disc. What it leaves is as smooth as
/// the material, and the points of a frame share it: taken for noise of each, it would say far too much of the light.
const OWN_OF_MATERIAL: [f64; 10] = [
    0.03, 0.03, 0.01, 0.02, 0.02, 0.01, 0.01, 0.005, 0.005, 0.005,
];
const LEAST_OWN_OF_MATERIAL: [f64; 10] = [
    0.005, 0.005, 1e-4, 0.002, 0.002, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4,
];
/// Arms and lines are no worse because a material is not as it is described.
const MOST_OWN_OF_MATERIAL: [f64; 10] = [
    0.03,
    0.03,
    f64::INFINITY,
    0.02,
    0.02,
    f64::INFINITY,
    f64::INFINITY,
    f64::INFINITY,
    f64::INFINITY,
    f64::INFINITY,
];

/// The index of the logarithm of the lamp's intensity, behind the light's and the target's numbers.
pub const LN_INTENSITY: usize = LIGHT.len() + TARGET;
/// Its standard deviation: nothing is known of it.
pub const LN_INTENSITY_PRIOR: f64 = 10.0;
/// Degrees of the polynomials (those of eq. (3)'s central field) that an unknown reference and an unknown material
/// are described by, and the standard deviation of their coefficients.
const DEGREE: usize = 2;
const DEGREE_OF_MATERIAL: usize = 3;
const COEFFICIENT_PRIOR: f64 = 0.5;
/// A material's points whose halfway vector is nearer to its normal than this cosine (25°) are of its highlight,
/// which no such polynomial describes.
const HIGHLIGHT_COSINE: f64 = 0.906;
/// The standard deviation of a material's coefficients; and the cosine below which its light (or camera) is so low that
/// it says more of the finish than of the light.
const MATERIAL_PRIOR: f64 = 5.0;
const GRAZING_COSINE: f64 = 0.17;
/// Points at which the light is lower than this (cosine of its angle from the normal) tell of it no more
/// than of themselves: a fibre's shadow is as long as a sample.
const LOWEST_COSINE: f64 = 0.05;
/// Points used, of all frames: more cost time and bring nothing.
const MOST_POINTS: usize = 120_000;
/// The same with an unknown reference, whose coefficients cost as much as all other numbers.
const MOST_POINTS_UNKNOWN: usize = 40_000;
/// The same with an unknown material.
const MOST_POINTS_OF_MATERIAL: usize = 15_000;
/// The logarithm of the least irradiance.
const LN_DARK: f64 = -13.8;
/// Points that show about where a light is.
const POINTS_FOR_A_START: usize = 10_000;
/// The least noise that a value is taken to have, relative.
const LEAST_NOISE: f64 = 2e-4;
/// Frames with fewer points than this tell nothing.
const FEWEST_POINTS: usize = 20;

/// A point of a frame.
#[derive(Clone, Copy, Debug)]
struct ShadedPoint {
    /// Where on the target it is, mm.
    at_mm: [f64; 2],
    /// The unit vector towards the camera.
    to_camera: Vec3,
    /// The logarithm of its radiance over its reflectance factor.
    ln: f64,
}

/// Values of the reference in one frame.
#[derive(Clone, Debug)]
pub struct ShadedFrame {
    /// The light arm's reading.
    pub light: Direction,
    /// Degree of the polynomial that describes the surface; 0 of a known one.
    degree: usize,
    points: Vec<ShadedPoint>,
    /// Relative noise of a value, from how neighbours differ.
    noise: f64,
    /// A pixel on the target, mm: across the camera's line of sight, and along it.
    pixel_mm: [[f64; 2]; 2],
}

/// Values of the reference in frames of a rig. The shared numbers are those of the light, those of the
/// target, the logarithm of the intensity, and the coefficients of an unknown reference.
pub struct Shading<'a> {
    /// The rig whose numbers are replaced.
    pub rig: &'a Rig,
    /// At least one frame.
    pub frames: &'a [ShadedFrame],
    /// What is known of the surface.
    pub shape: ReferenceShape,
    /// What a mirror says of the light.
    pub mirror: Option<MirrorTerm>,
}

/// What a mirror says of the light's place, as residuals: a frame more, behind all others.
pub struct MirrorTerm {
    place: Vec<f64>,
    /// A square root of the information.
    root: DMatrix<f64>,
    /// The common factor of the residuals' noise.
    pub scale: f64,
}

impl MirrorTerm {
    /// `None` where it says nothing.
    pub fn new(mirror: &MirrorLight<'_>) -> Option<Self> {
        let eigen = mirror.information.clone().symmetric_eigen();
        let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let root = DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose();
        let is_told = root.iter().all(|v| v.is_finite()) && root.amax() > 0.0;
        is_told.then(|| Self {
            place: mirror.place.clone(),
            root,
            scale: 1.0,
        })
    }

    fn residuals(&self, rig: &Rig) -> Vec<f64> {
        let off = self.off(&values(&LIGHT[..PLACE], rig));
        (self.scale * off).as_slice().to_vec()
    }

    /// How far a light's place (the first numbers of [`LIGHT`]) is from the mirror's, standard deviations: RMS.
    pub fn misfit(&self, place: &[f64]) -> f64 {
        self.off(place).norm() / (PLACE as f64).sqrt()
    }

    fn off(&self, place: &[f64]) -> DVector<f64> {
        &self.root * DVector::from_fn(PLACE, |k, _| place[k] - self.place[k])
    }
}

/// What is known of the reflectance of what frames show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceShape {
    /// All but a factor.
    Known,
    /// That it is smooth and reciprocal: the logarithm is a polynomial whose coefficients are shared numbers
    /// too, behind the intensity's.
    Smooth,
    /// That away from its highlight it is a material that is: such a polynomial of a higher degree.
    Material,
}

impl ReferenceShape {
    /// Of the surface that frames of this role show.
    pub fn of(rig: &Rig, role: Role) -> Self {
        match (role, &rig.reference) {
            (Role::Material, _) => Self::Material,
            (_, Some(_)) => Self::Known,
            (_, None) => Self::Smooth,
        }
    }

    /// Standard deviations of a frame's own numbers to start from, the least that they are taken to be and the most.
    pub fn own(self) -> [&'static [f64]; 3] {
        match self {
            Self::Known | Self::Smooth => [&OWN, &LEAST_OWN, &[f64::INFINITY; OWN.len()]],
            Self::Material => [
                &OWN_OF_MATERIAL,
                &LEAST_OWN_OF_MATERIAL,
                &MOST_OWN_OF_MATERIAL,
            ],
        }
    }

    /// Degree of the polynomial; 0 where there is none.
    fn degree(self) -> usize {
        match self {
            Self::Known => 0,
            Self::Smooth => DEGREE,
            Self::Material => DEGREE_OF_MATERIAL,
        }
    }

    /// Prior standard deviations of the coefficients; the constant is the intensity's.
    pub fn priors(self) -> Vec<f64> {
        let prior = match self {
            Self::Known | Self::Smooth => COEFFICIENT_PRIOR,
            Self::Material => MATERIAL_PRIOR,
        };
        vec![prior; n_terms(self.degree()) - 1]
    }
}

/// The target's numbers.
pub fn target_unknowns() -> &'static [Unknown] {
    &CAMERA[CAMERA.len() - TARGET..]
}

/// A value of the reference at a point of the sampling grid.
pub struct ReferenceValue {
    /// The point's number in the grid.
    pub point: usize,
    /// Where it was read, mm.
    pub at_mm: [f64; 2],
    /// The unit vector towards the camera.
    pub to_camera: Vec3,
    /// Its radiance, the sum of its channels, over the known reflectance factor's (over 1 of an unknown one).
    pub radiance: f64,
}

impl ShadedFrame {
    /// Of a frame of the reference or of a material, by its role; `None` where hardly anything of it is lit.
    pub fn new(rig: &Rig, grid: &SamplingGrid, frame: &SampledFrame) -> Option<Self> {
        let light = IdealLight::new(rig, frame.reading.light);
        let shape = ReferenceShape::of(rig, frame.report.role);
        let known = rig.reference.as_ref().map(KnownReference::new);
        let known = known.filter(|_| shape == ReferenceShape::Known);
        let camera = frame.camera_at(&CameraModel::new(rig));
        let values = grid.points_mm().iter().zip(&frame.points).enumerate();
        let values = values.filter_map(|(i, (at, point))| {
            let point = point.as_ref().ok()?;
            let at_mm = [0, 1].map(|k| at[k] + f64::from(point.offset_mm[k]));
            let to_camera = camera.direction_from(at_mm);
            let to_light = light.direction_from(at_mm);
            if shape == ReferenceShape::Material && !is_smooth(to_light, to_camera) {
                return None;
            }
            let factor = match &known {
                Some(known) => PI * sum(known.at(to_light, to_camera)),
                None => 1.0,
            };
            Some(ReferenceValue {
                point: i,
                at_mm,
                to_camera,
                radiance: sum(point.rgb) / factor,
            })
        });
        let shaded = Self::of_values(rig, frame.reading.light, values)?;
        Some(Self {
            degree: shape.degree(),
            ..shaded
        })
    }

    /// Of a frame's values, in the grid's order; `None` where hardly anything is lit.
    pub fn of_values(
        rig: &Rig,
        reading: Direction,
        values: impl Iterator<Item = ReferenceValue>,
    ) -> Option<Self> {
        let light = IdealLight::new(rig, reading);
        let is_lit = |value: &ReferenceValue| {
            light.direction_from(value.at_mm)[2] > LOWEST_COSINE
                && value.radiance > 0.0
                && value.radiance.is_finite()
        };
        let (mut points, mut row) = (Vec::new(), Vec::new());
        for value in values.filter(is_lit) {
            let ln = value.radiance.natural_log();
            row.push((value.point, ln));
            points.push(ShadedPoint {
                at_mm: value.at_mm,
                to_camera: value.to_camera,
                ln,
            });
        }
        if points.len() < FEWEST_POINTS {
            return None;
        }
        Some(Self {
            light: reading,
            degree: 0,
            noise: noise_of(&row),
            pixel_mm: pixel_mm(rig, points[points.len() / 2].to_camera),
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
            .map(|p| p.ln - ln_irradiance(light, p.at_mm))
            .collect();
        let middle = all.len() / 2;
        *all.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// RMS of ln radiance about what light and reference make of it, for shared numbers of a [`Shading`].
    pub fn misfit(&self, (rig, rest): &(Rig, Vec<f64>)) -> f64 {
        let light = IdealLight::new(rig, self.light);
        let off = self.off(&light, rest, [0.0; 2]);
        (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt()
    }

    /// The light that shone on it, by a frame's own numbers.
    fn light_at(&self, rig: &Rig, own: &[f64]) -> IdealLight {
        let reading = Direction {
            theta: self.light.theta + own[0].to_radians(),
            phi: self.light.phi + own[1].to_radians(),
        };
        IdealLight::new(rig, reading)
    }

    /// Where a point is that seems to lie elsewhere by so many pixels.
    fn shifted(&self, at_mm: [f64; 2], shift_px: [f64; 2]) -> [f64; 2] {
        let [across, along] = self.pixel_mm;
        [0, 1].map(|i| at_mm[i] + shift_px[0] * across[i] + shift_px[1] * along[i])
    }

    /// Derivatives of the residuals with respect to each coefficient; none of a known surface.
    fn by_coefficient(&self, rig: &Rig, own: &[f64]) -> Vec<Vec<f64>> {
        if self.degree == 0 {
            return Vec::new();
        }
        let light = self.light_at(rig, own);
        let mut row = Vec::new();
        let mut columns = vec![Vec::with_capacity(self.points.len()); n_terms(self.degree) - 1];
        for p in &self.points {
            let at_mm = self.shifted(p.at_mm, [own[3], own[4]]);
            terms(
                self.degree,
                light.direction_from(at_mm),
                p.to_camera,
                &mut row,
            );
            // The constant, 1, is the intensity's.
            for (column, term) in columns.iter_mut().zip(&row[1..]) {
                column.push(-term / self.noise);
            }
        }
        columns
    }

    /// ln radiance minus what light and reference make of it; `rest` are intensity and coefficients, `shift_px` how
    /// far the points lie from where they seem to.
    fn off(&self, light: &IdealLight, rest: &[f64], shift_px: [f64; 2]) -> Vec<f64> {
        let mut row = Vec::new();
        let of_point = |p: &ShadedPoint| {
            let at_mm = self.shifted(p.at_mm, shift_px);
            let mut off = p.ln - ln_irradiance(light, at_mm) - rest[0];
            if self.degree > 0 {
                terms(
                    self.degree,
                    light.direction_from(at_mm),
                    p.to_camera,
                    &mut row,
                );
                // The constant, 1, is the intensity's.
                let field = row.iter().zip(rest).skip(1);
                off -= field
                    .map(|(term, coefficient)| term * coefficient)
                    .sum::<f64>();
            }
            off
        };
        self.points.iter().map(of_point).collect()
    }
}

/// Whether most materials are smooth about these directions to light and camera: away from the highlight, neither
/// grazing.
fn is_smooth(to_light: Vec3, to_camera: Vec3) -> bool {
    let halfway = normalize([0, 1, 2].map(|i| to_light[i] + to_camera[i]));
    halfway[2] < HIGHLIGHT_COSINE && to_light[2].min(to_camera[2]) > GRAZING_COSINE
}

fn sum(rgb: [f32; 3]) -> f64 {
    f64::from(rgb.iter().sum::<f32>())
}

/// A pixel in the middle of the target, which a camera in this direction sees, mm: across the line of sight, and
/// along it where that is foreshortened.
fn pixel_mm(rig: &Rig, to_camera: Vec3) -> [[f64; 2]; 2] {
    let pixel_mm = 1000.0 * rig.camera.distance_m / rig.camera.focal_px;
    let [x, y, height] = to_camera;
    let sine = x.hypotenuse(y);
    // From straight above no direction is another.
    let along = match sine > 0.0 {
        true => [x / sine, y / sine],
        false => [1.0, 0.0],
    };
    let foreshortened_mm = pixel_mm / height.max(LOWEST_COSINE);
    [
        [-along[1] * pixel_mm, along[0] * pixel_mm],
        along.map(|way| way * foreshortened_mm),
    ]
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
pub fn thin(frames: &mut [ShadedFrame], reference: ReferenceShape) {
    let most = match reference {
        ReferenceShape::Known => MOST_POINTS,
        ReferenceShape::Smooth => MOST_POINTS_UNKNOWN,
        ReferenceShape::Material => MOST_POINTS_OF_MATERIAL,
    };
    thin_to(frames, most);
}

/// Thins frames to what shows about where the light is.
pub fn thin_for_a_start(frames: &mut [ShadedFrame]) {
    thin_to(frames, POINTS_FOR_A_START);
}

fn thin_to(frames: &mut [ShadedFrame], most: usize) {
    let points: usize = frames.iter().map(|frame| frame.points.len()).sum();
    let step = points.div_ceil(most).max(1);
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
    light.ln_irradiance(at).max(LN_DARK)
}

impl Frames for Shading<'_> {
    type At = (Rig, Vec<f64>);

    fn count(&self) -> usize {
        self.frames.len() + usize::from(self.mirror.is_some())
    }

    /// One mirror's term says nothing of how such terms scatter.
    fn is_known(&self, frame: usize) -> bool {
        frame >= self.frames.len()
    }

    fn at(&self, shared: &[f64]) -> (Rig, Vec<f64>) {
        let (light, target) = shared.split_at(LIGHT.len());
        let rig = with_values(&LIGHT, self.rig, light);
        let rig = with_values(target_unknowns(), &rig, &target[..TARGET]);
        (rig, shared[LN_INTENSITY..].to_vec())
    }

    fn residuals(&self, (rig, rest): &(Rig, Vec<f64>), frame: usize, own: &[f64]) -> Vec<f64> {
        let Some(frame) = self.frames.get(frame) else {
            return self
                .mirror
                .iter()
                .flat_map(|mirror| mirror.residuals(rig))
                .collect();
        };
        let light = frame.light_at(rig, own);
        let mut off = frame.off(&light, rest, [own[3], own[4]]);
        let uneven = own.get(5..).unwrap_or_default();
        let rim_mm = self.rig.sampling.disc_radius_mm;
        for (off, point) in off.iter_mut().zip(&frame.points) {
            let [x, y] = point.at_mm.map(|c| c / rim_mm);
            let shapes = [x, y, x * x, x * y, y * y];
            let left: f64 = uneven
                .iter()
                .zip(shapes)
                .map(|(own, shape)| own * shape)
                .sum();
            *off = (*off - own[2] - left) / frame.noise;
        }
        off
    }

    /// The polynomial's coefficients.
    fn by_last(&self, (rig, _): &Self::At, frame: usize, own: &[f64]) -> Vec<Vec<f64>> {
        let Some(frame) = self.frames.get(frame) else {
            return Vec::new();
        };
        frame.by_coefficient(rig, own)
    }
}
