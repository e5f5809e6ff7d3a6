//! The light from its image in a plane mirror that lies in the sample's place.
//!
//! The camera sees the light where the light's mirror image stands: a highlight tells the light's direction
//! as well as the camera's is known. The mirror need not lie quite in the target's plane: its height and its
//! tilt are found as well. Camera, camera arm and target come from the lines; their uncertainty is carried
//! over.

use crate::calibrate::camera::{are_free, covariance_of, priors, started};
use crate::calibrate::error::CalibrateError;
use crate::calibrate::lines::{LineFrame, arm_offset};
use crate::calibrate::numbers::{LightSolution, NumberState};
use crate::calibrate::solve::{Frames, Problem, Solved, solve};
use crate::calibrate::unknowns::{CAMERA, LIGHT, values, with_values};
use gonia_brdf::direction::{Vec3, dot, normalize};
use gonia_brdf::{Direction, Elementary};
use gonia_imaging::Highlight;
use gonia_rig::{CameraModel, Remark, Rig};
use nalgebra::DMatrix;

/// The numbers of the light's place, before those of its beam, of which a highlight says nothing.
pub const PLACE: usize = 6;
/// A light that is known by its highlights alone needs so many.
pub const FEWEST: usize = 6;
/// Standard deviations of the mirror's height about what the rig says (mm) and of its tilts against the target
/// (degrees). Highlights hardly tell a mirror that is too high from an arm's zero and axes that are off.
const MIRROR_PRIOR: [f64; 3] = [0.2, 0.3, 0.3];
/// What an arm repeats within at best, degrees.
const ARM_DEG: f64 = 0.01;
/// A highlight that is so many standard deviations from where the light found has it is another's.
const ODD: f64 = 8.0;
/// A residual of a highlight that the camera cannot see.
const NOWHERE: f64 = 1e6;

/// A highlight, and the lines of its frame.
#[derive(Clone, Debug)]
pub struct MirrorFrame {
    /// The frame, with its lines.
    pub lines: LineFrame,
    /// The light's image.
    pub highlight: Highlight,
}

/// What the frames of the mirror gave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorFit {
    /// Frames of the mirror.
    pub frames: usize,
    /// RMS distance of the highlights from where the rig's light has them, before and after, pixels.
    pub highlight_px: [f64; 2],
    /// How far the mirror lies above the target, mm, and how it is tilted against it, degrees.
    pub height_mm: f64,
    /// Likewise about x and y.
    pub tilt_deg: [f64; 2],
}

/// Highlights in frames of a rig. Shared numbers: the light's, the camera's, the mirror's.
struct Mirrors<'a> {
    rig: &'a Rig,
    frames: &'a [MirrorFrame],
    /// Standard deviations of the camera arm's θ and φ, degrees.
    arm_deg: [f64; 2],
}

/// What highlights say of the light's place, beside its priors.
pub struct MirrorLight<'a> {
    /// Values of the first numbers of [`LIGHT`].
    pub place: Vec<f64>,
    /// Their information.
    pub information: DMatrix<f64>,
    mirrors: Mirrors<'a>,
    solved: Solved,
    nominal: Vec<f64>,
    prior: Vec<f64>,
    highlight_px: [f64; 2],
}

impl<'a> MirrorLight<'a> {
    /// Of a rig whose camera, camera arm and target are known with this covariance; the camera's arm repeats
    /// within `arm_deg`. `None` without a frame.
    pub fn find(
        rig: &'a Rig,
        frames: &'a [MirrorFrame],
        camera: &DMatrix<f64>,
        arm_deg: [f64; 2],
    ) -> Result<Option<Self>, CalibrateError> {
        if frames.is_empty() {
            return Ok(None);
        }
        let Some(height_mm) = rig.target.mirror_height_mm else {
            let frames = frames.len();
            return Err(CalibrateError::NoMirrorHeight { frames });
        };
        let mirrors = Mirrors {
            rig,
            frames,
            arm_deg,
        };
        let mut nominal = values(&LIGHT, rig);
        nominal.extend(values(&CAMERA, rig));
        nominal.extend([height_mm, 0.0, 0.0]);
        let mut prior = priors(&LIGHT, rig);
        prior.extend(priors(&CAMERA, rig));
        prior.extend(MIRROR_PRIOR);
        let solved = mirrors.solve((&nominal, &prior), &[true; PLACE], &nominal)?;
        let highlight_px = [&nominal, &solved.shared].map(|shared| mirrors.rms_px(shared));
        Ok(Some(Self {
            place: solved.shared[..PLACE].to_vec(),
            information: of_place(&solved.information, &prior, camera)?,
            mirrors,
            solved,
            nominal,
            prior,
            highlight_px,
        }))
    }

    /// What came of the frames.
    pub fn fit(&self) -> MirrorFit {
        let mirror = &self.solved.shared[LIGHT.len() + CAMERA.len()..];
        MirrorFit {
            frames: self.frames(),
            highlight_px: self.highlight_px,
            height_mm: mirror[0],
            tilt_deg: [mirror[1], mirror[2]],
        }
    }

    /// How many frames there are.
    pub fn frames(&self) -> usize {
        self.mirrors.frames.len()
    }

    /// What is said of frames whose highlight is another's.
    pub fn remarks(&self) -> Vec<Remark> {
        let at = self.mirrors.at(&self.solved.shared);
        let limit = ODD * self.solved.noise.max(1.0);
        let is_odd = |f: &usize| {
            let residuals = self.mirrors.residuals(&at, *f, &[]);
            residuals.iter().any(|r| r.abs() > limit)
        };
        let remark = |f: usize| {
            let px = self.mirrors.off_px(&at, f);
            Remark::new(
                format_args!("mirror frame {}", self.mirrors.frames[f].lines.row.frame),
                format_args!(
                    "its highlight is {px:.1} pixels from where the other frames have the light's, and has little weight"
                ),
                "look for another lamp or a window in the mirror, or for a mirror that was moved",
            )
        };
        (0..self.frames()).filter(is_odd).map(remark).collect()
    }

    /// The light by the mirror alone; `states` says of values and covariance which numbers move.
    pub fn alone(
        &self,
        camera: &DMatrix<f64>,
        states: impl FnOnce(&[f64], &DMatrix<f64>) -> Vec<NumberState>,
    ) -> Result<LightSolution, CalibrateError> {
        let covariance = joined(&self.solved.information, &self.prior, camera)?;
        let (n, l) = (CAMERA.len(), LIGHT.len());
        let own = covariance.view((n, n), (l, l)).into_owned();
        let states = states(&self.solved.shared[..l], &own);
        let free = are_free(&LIGHT[..PLACE], &states[..PLACE]);
        let priors = (&self.nominal[..], &self.prior[..]);
        let start = started(&self.nominal, &all_free(&free), Some(&self.solved));
        let kept = self.mirrors.solve(priors, &free, &start)?;
        Ok(LightSolution {
            shared: kept.shared[..l].to_vec(),
            covariance,
            states,
        })
    }
}

/// Which numbers move when of the light's place these do.
fn all_free(place: &[bool]) -> Vec<bool> {
    let mut free = place.to_vec();
    free.resize(LIGHT.len() + CAMERA.len(), false);
    free.resize(LIGHT.len() + CAMERA.len() + MIRROR_PRIOR.len(), true);
    free
}

/// The covariance of the light's numbers and how they follow the camera's: with N the information and l, c
/// the numbers of light (with the mirror's) and camera, l follows a change of c by G = −N_ll⁻¹ N_lc.
fn following(
    information: &DMatrix<f64>,
    prior: &[f64],
) -> Result<(DMatrix<f64>, DMatrix<f64>), CalibrateError> {
    let (l, n) = (LIGHT.len(), CAMERA.len());
    let light: Vec<usize> = (0..l).chain(l + n..prior.len()).collect();
    let pick = |of: &[usize]| {
        DMatrix::from_fn(light.len(), of.len(), |i, j| information[(light[i], of[j])])
    };
    let light_prior: Vec<f64> = light.iter().map(|i| prior[*i]).collect();
    let own = covariance_of(&pick(&light), &light_prior)?;
    let camera: Vec<usize> = (l..l + n).collect();
    let follows = -&own * pick(&camera);
    Ok((own, follows))
}

/// Information on the light's place: what is known without the mirror's numbers and with the camera's
/// uncertainty, less the priors.
fn of_place(
    information: &DMatrix<f64>,
    prior: &[f64],
    camera: &DMatrix<f64>,
) -> Result<DMatrix<f64>, CalibrateError> {
    let (own, follows) = following(information, prior)?;
    let all = own + &follows * camera * follows.transpose();
    // In units of the priors.
    let scaled = DMatrix::from_fn(PLACE, PLACE, |i, j| all[(i, j)] / (prior[i] * prior[j]));
    let known = scaled
        .cholesky()
        .ok_or(CalibrateError::NoSolution)?
        .inverse();
    let mut beside = (known - DMatrix::identity(PLACE, PLACE)).symmetric_eigen();
    // Where nothing is known but the prior, rounding may leave less than nothing.
    beside.eigenvalues.apply(|value| *value = value.max(0.0));
    let beside = beside.recompose();
    Ok(DMatrix::from_fn(PLACE, PLACE, |i, j| {
        beside[(i, j)] / (prior[i] * prior[j])
    }))
}

/// The covariance of camera and light together.
fn joined(
    information: &DMatrix<f64>,
    prior: &[f64],
    camera: &DMatrix<f64>,
) -> Result<DMatrix<f64>, CalibrateError> {
    let (own, follows) = following(information, prior)?;
    let (l, n) = (LIGHT.len(), CAMERA.len());
    let across = (&follows * camera).rows(0, l).into_owned();
    let light = (own + &follows * camera * follows.transpose())
        .view((0, 0), (l, l))
        .into_owned();
    let mut joined = DMatrix::zeros(n + l, n + l);
    joined.view_mut((0, 0), (n, n)).copy_from(camera);
    joined.view_mut((n, n), (l, l)).copy_from(&light);
    joined.view_mut((n, 0), (l, n)).copy_from(&across);
    joined
        .view_mut((0, n), (n, l))
        .copy_from(&across.transpose());
    Ok(joined)
}

/// A plane near the target's.
#[derive(Clone, Copy)]
pub struct MirrorPlane {
    height_mm: f64,
    normal: Vec3,
}

impl MirrorPlane {
    fn new(height_mm: f64, tilt_deg: [f64; 2]) -> Self {
        let [x, y] = tilt_deg.map(|t| t.to_radians().tangent());
        Self {
            height_mm,
            normal: normalize([y, -x, 1.0]),
        }
    }

    /// Where something at a place seems to stand in the mirror.
    fn image(&self, at: Vec3) -> Vec3 {
        let above = dot(at, self.normal) - self.height_mm * self.normal[2];
        [0, 1, 2].map(|i| at[i] - 2.0 * above * self.normal[i])
    }
}

impl Mirrors<'_> {
    /// Finds the numbers of the light's place that are free, and the mirror's.
    fn solve(
        &self,
        (nominal, prior): (&[f64], &[f64]),
        place: &[bool],
        start: &[f64],
    ) -> Result<Solved, CalibrateError> {
        let problem = Problem {
            nominal,
            prior,
            free: &all_free(place),
            own: &[],
            least_own: &[],
            most_own: &[],
            least_noise: 1e-6,
            finds_noise: false,
        };
        let mut solved = solve(self, &problem, start).ok_or(CalibrateError::NoSolution)?;
        // Few frames seem to scatter less than they do.
        if solved.noise < 1.0 {
            solved.information *= solved.noise * solved.noise;
        }
        Ok(solved)
    }

    fn rms_px(&self, shared: &[f64]) -> f64 {
        let at = self.at(shared);
        let squares = (0..self.frames.len()).map(|f| self.off_px(&at, f).powi(2));
        (squares.sum::<f64>() / self.frames.len() as f64).sqrt()
    }

    /// The pixel in which the camera of a frame sees the light, and pixels a degree of its arm.
    fn seen(
        &self,
        (rig, camera, mirror): &(Rig, CameraModel, MirrorPlane),
        f: usize,
    ) -> ([f64; 2], f64) {
        let frame = &self.frames[f];
        let pose = frame.lines.row.pose;
        let by = arm_offset(
            camera,
            rig.target.line_offset_mm,
            &frame.lines,
            self.arm_deg,
        );
        let pixel = |light: Direction| {
            let image = mirror.image(rig.light_at(light).at_mm);
            let eye = camera.placement(pose.view, by).at_mm;
            // Any point of the line of sight is seen in the same pixel: that in the target's plane.
            let share = eye[2] / (eye[2] - image[2]);
            let at = [0, 1].map(|i| eye[i] + share * (image[i] - eye[i]));
            camera.distort(camera.predict(pose.view, by).apply(at))
        };
        let here = pixel(pose.light);
        let step = 1f64.to_radians();
        let there = pixel(Direction {
            theta: pose.light.theta + 0.1 * step,
            phi: pose.light.phi,
        });
        (
            here,
            10.0 * (there[0] - here[0]).hypotenuse(there[1] - here[1]),
        )
    }

    fn off_px(&self, at: &(Rig, CameraModel, MirrorPlane), f: usize) -> f64 {
        let (pixel, _) = self.seen(at, f);
        let seen = self.frames[f].highlight.pixel;
        (pixel[0] - seen[0]).hypotenuse(pixel[1] - seen[1])
    }
}

impl Frames for Mirrors<'_> {
    type At = (Rig, CameraModel, MirrorPlane);

    fn count(&self) -> usize {
        self.frames.len()
    }

    fn at(&self, shared: &[f64]) -> Self::At {
        let (light, rest) = shared.split_at(LIGHT.len());
        let (camera, mirror) = rest.split_at(CAMERA.len());
        let rig = with_values(&CAMERA, &with_values(&LIGHT, self.rig, light), camera);
        let model = CameraModel::new(&rig);
        (
            rig,
            model,
            MirrorPlane::new(mirror[0], [mirror[1], mirror[2]]),
        )
    }

    fn residuals(&self, at: &Self::At, frame: usize, _: &[f64]) -> Vec<f64> {
        let highlight = &self.frames[frame].highlight;
        let (pixel, px_per_deg) = self.seen(at, frame);
        let u = highlight.u_px.hypotenuse(ARM_DEG * px_per_deg);
        let of = |i: usize| {
            let residual = (pixel[i] - highlight.pixel[i]) / u;
            match residual.is_finite() {
                true => residual.clamp(-NOWHERE, NOWHERE),
                false => NOWHERE,
            }
        };
        vec![of(0), of(1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_above_a_mirror_is_seen_below_it() {
        let near = |a: Vec3, b: Vec3| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        let flat = MirrorPlane::new(3.0, [0.0; 2]);
        assert!(near(flat.image([10.0, -20.0, 103.0]), [10.0, -20.0, -97.0]));
        // Tilted about x by +1°, its +y side is high: what stands straight above is seen towards +y, by 2°.
        let tilted = MirrorPlane::new(0.0, [1.0, 0.0]);
        let (sine, cosine) = 2f64.to_radians().sine_cosine();
        let image = tilted.image([0.0, 0.0, 100.0]);
        assert!(
            near(image, [0.0, 100.0 * sine, -100.0 * cosine]),
            "{image:?}"
        );
    }
}
