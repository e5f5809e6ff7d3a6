//! The light from the shading on the reference.

use crate::calibrate::camera::{are_free, covariance_of, priors, started, states};
use crate::calibrate::error::CalibrateError;
use crate::calibrate::median;
use crate::calibrate::mirror::{self, MirrorLight};
use crate::calibrate::numbers::{Alternatives, LightSolution, among_all};
use crate::calibrate::residuals::ShadingResidual;
use crate::calibrate::shading::{
    LN_INTENSITY, LN_INTENSITY_PRIOR, MirrorTerm, ReferenceShape, ShadedFrame, Shading,
    ln_intensity, target_unknowns, thin,
};
use crate::calibrate::solve::{Frames, Problem, Solved, solve};
use crate::calibrate::unknowns::{CAMERA, LIGHT, TARGET, values, with_values};
use gonia_rig::{Remark, Rig, Role};
use nalgebra::DMatrix;

/// Frames of the reference that a light needs.
const FEWEST: usize = 6;
/// Standard deviation of a frame's level, or of values within a frame, beyond which a reference does not
/// scatter as it is thought to (relative).
const NOT_AS_THOUGHT: f64 = 0.02;
/// A light that shading draws so many standard deviations from the mirror's contradicts it.
const CONTRADICTS: f64 = 4.0;
/// A frame's noise is seen in itself. Values that fit better than that noise do not lower it: of frames without
/// noise the model's own errors would be all that pulls.
const LEAST_FACTOR: f64 = 1.0;
/// Values within a frame may differ by so many times their noise, however large that is.
const NOISES: f64 = 3.0;

/// What became of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightState {
    /// It was found.
    Found {
        /// The surface whose shading shows it: the reference, or a material.
        surface: Role,
        /// Frames of it.
        frames: usize,
        /// RMS of the surface's values about what the light makes of them, before and after, relative;
        /// the median frame's.
        shading: [f64; 2],
        /// Standard deviation of the lamp's intensity from frame to frame, relative.
        lamp: f64,
        /// Standard deviation of the light arm's θ and φ from frame to frame, degrees.
        arm_deg: [f64; 2],
    },
    /// Its place was found by its image in a mirror alone.
    FoundByMirror {
        /// Frames of the mirror.
        frames: usize,
    },
    /// It stays as it was: too few frames of the reference, or without one of the material, show anything.
    NoReference {
        /// Those that do.
        frames: usize,
        /// How many are needed.
        needed: usize,
    },
    /// It stays as it was: the reference does not scatter as the rig says, or without a reflectance (and a material)
    /// as a smooth, reciprocal surface does.
    Unlike {
        /// The surface: the reference, or a material.
        surface: Role,
        /// Standard deviation of a frame's level, relative.
        level: f64,
        /// Standard deviation of values within a frame, relative.
        within: f64,
    },
    /// It stays as it was: the shading on a material of which nothing is known hardly tells where it is.
    NotTold {
        /// Frames of the material.
        frames: usize,
        /// The standard uncertainty that its directions would have, degrees: 95th percentile. `None` where no light
        /// fits.
        u_deg: Option<f64>,
    },
}

/// A light whose directions a material leaves more uncertain than this share of what was thought possible stays.
const TELLS: f64 = 0.25;

/// What is known before the light is looked for.
pub struct Known<'a> {
    /// The covariance of [`CAMERA`]'s numbers.
    pub camera: &'a DMatrix<f64>,
    /// What frames of a mirror say.
    pub mirror: Option<&'a MirrorLight<'a>>,
    /// The surface whose shading is seen.
    pub surface: Role,
}

impl Known<'_> {
    /// The light by the mirror alone, where there are enough frames of it; else it is left as it was, for
    /// this reason.
    fn by_mirror_or(&self, rig: &Rig, left: LightState) -> Result<Light, CalibrateError> {
        let Some(mirror) = self.mirror.filter(|m| m.frames() >= mirror::FEWEST) else {
            return Ok(Light::left(left));
        };
        let (nominal, prior) = (values(&LIGHT, rig), priors(&LIGHT, rig));
        let solution = mirror.alone(self.camera, |shared, own| {
            states(&LIGHT, rig, &nominal, &prior, shared, own)
        })?;
        Ok(Light {
            state: LightState::FoundByMirror {
                frames: mirror.frames(),
            },
            residuals: Vec::new(),
            from_mirror: 0.0,
            solution: Some(solution),
        })
    }
}

/// The light's part of a covariance of camera and light together.
fn own_of(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let (at, light) = (CAMERA.len(), LIGHT.len());
    covariance.view((at, at), (light, light)).into_owned()
}

/// The light, found or not.
pub struct Light {
    state: LightState,
    residuals: Vec<ShadingResidual>,
    /// How far shading draws the light from where the mirror has it, standard deviations.
    from_mirror: f64,
    solution: Option<LightSolution>,
}

impl Light {
    /// Finds the light of a rig whose camera and target are known. A material that leads nowhere leaves it as it was.
    pub fn find(
        rig: &Rig,
        frames: Vec<ShadedFrame>,
        known: &Known<'_>,
    ) -> Result<Self, CalibrateError> {
        let count = frames.len();
        match (Self::by_shading(rig, frames, known), known.surface) {
            (Err(CalibrateError::NoSolution), Role::Material) => {
                Ok(Self::left(LightState::NotTold {
                    frames: count,
                    u_deg: None,
                }))
            }
            (found, _) => found,
        }
    }

    fn by_shading(
        rig: &Rig,
        mut frames: Vec<ShadedFrame>,
        known: &Known<'_>,
    ) -> Result<Self, CalibrateError> {
        if frames.len() < FEWEST {
            let state = LightState::NoReference {
                frames: frames.len(),
                needed: FEWEST,
            };
            return known.by_mirror_or(rig, state);
        }
        let reference = ReferenceShape::of(rig, known.surface);
        thin(&mut frames, reference);
        let mut shading = Shading {
            rig,
            frames: &frames,
            shape: reference,
            mirror: known.mirror.and_then(MirrorTerm::new),
        };
        let level = ln_intensity(rig, &frames);
        let nominal = nominal(rig, level, reference);
        let prior = with_target(rig, reference);
        let typical = median(frames.iter().map(ShadedFrame::noise).collect());
        let everything = free(&[true; LIGHT.len()], prior.len());
        let [usual, ..] = reference.own();
        let first = solve_light(&shading, &nominal, &prior, &everything, (Some(usual), None))?;
        // Residuals of shading are in units of a noise that is found with them.
        if let Some(mirror) = &mut shading.mirror {
            mirror.scale = first.noise;
        }
        let all = solve_light(
            &shading,
            &nominal,
            &prior,
            &everything,
            (None, Some(&first)),
        )?;
        if let Some(unlike) = unlike(&all, typical, known.surface) {
            return known.by_mirror_or(rig, unlike);
        }
        let full = joined(known.camera, &all, &prior, &everything)?;
        let (was, likely) = (&nominal[..LIGHT.len()], &prior[..LIGHT.len()]);
        let states = states(&LIGHT, rig, was, likely, &all.shared, &own_of(&full));
        let moves = are_free(&LIGHT, &states);
        let kept = free(&moves, prior.len());
        let solved = solve_light(
            &shading,
            &nominal,
            &prior,
            &kept,
            (Some(&all.own), Some(&all)),
        )?;
        let covariance = about_kept(
            (&nominal, &prior),
            &moves,
            (&all, &full),
            (&solved, &joined(known.camera, &solved, &prior, &kept)?),
        )?;
        // What the light was thought to be, with the intensity and the reference that fit it best.
        let held = free(&[false; LIGHT.len()], prior.len());
        let before = solve_light(&shading, &nominal, &prior, &held, (Some(&all.own), None))?;
        let residuals = residuals_of(&shading, &before, &solved);
        let state = found_state(known.surface, &residuals, &solved);
        let mirror = shading.mirror.as_ref();
        Ok(Self {
            state,
            residuals,
            from_mirror: mirror.map_or(0.0, |mirror| mirror.misfit(&solved.shared)),
            solution: Some(LightSolution {
                shared: solved.shared[..LIGHT.len()].to_vec(),
                covariance,
                states,
            }),
        })
    }

    /// The light as it was where a material's frames tell hardly more of it: standard uncertainties (95th
    /// percentile, degrees) of its directions as found, and as they were.
    pub fn unless_told(self, found_deg: f64, was_deg: f64) -> Self {
        match self.state {
            LightState::Found {
                surface: Role::Material,
                frames,
                ..
            } if found_deg > TELLS * was_deg => Self::left(LightState::NotTold {
                frames,
                u_deg: Some(found_deg),
            }),
            _ => self,
        }
    }

    fn left(state: LightState) -> Self {
        Self {
            state,
            residuals: Vec::new(),
            from_mirror: 0.0,
            solution: None,
        }
    }

    /// That mirror and shading contradict each other.
    pub fn remark(&self) -> Option<Remark> {
        (self.from_mirror > CONTRADICTS).then(|| {
            Remark::new(
                "the light",
                format_args!(
                    "the mirror and the shading on the reference put it apart, by {:.0} standard deviations",
                    self.from_mirror
                ),
                "check target.mirror_height_mm, that the mirror is flat, and the reference's reflectance",
            )
        })
    }

    /// What its shading leaves, frame by frame.
    pub fn residuals(&self) -> &[ShadingResidual] {
        &self.residuals
    }

    /// A rig with this light.
    pub fn rig(&self, rig: &Rig) -> Rig {
        match &self.solution {
            Some(solution) => with_values(&LIGHT, rig, &solution.shared),
            None => rig.clone(),
        }
    }

    /// What became of it.
    pub fn state(&self) -> LightState {
        self.state
    }

    /// Its numbers, where they were found.
    pub fn solution(&self) -> Option<&LightSolution> {
        self.solution.as_ref()
    }
}

/// What the shading of each frame leaves, before and after.
fn residuals_of(shading: &Shading<'_>, before: &Solved, after: &Solved) -> Vec<ShadingResidual> {
    let at = [before, after].map(|solved| shading.at(&solved.shared));
    let of_frame = |frame: &ShadedFrame| ShadingResidual {
        theta_i_deg: frame.light.theta_deg(),
        share: [frame.misfit(&at[0]), frame.misfit(&at[1])],
    };
    shading.frames.iter().map(of_frame).collect()
}

fn found_state(surface: Role, residuals: &[ShadingResidual], solved: &Solved) -> LightState {
    let typical = |i: usize| median(residuals.iter().map(|r| r.share[i]).collect());
    LightState::Found {
        surface,
        frames: residuals.len(),
        shading: [typical(0), typical(1)],
        lamp: solved.own[2],
        arm_deg: [solved.own[0], solved.own[1]],
    }
}

/// What a surface shows that does not scatter as it is thought to, where its values have a `typical` noise.
pub fn unlike(solved: &Solved, typical: f64, surface: Role) -> Option<LightState> {
    let (level, within) = (solved.own[2], solved.noise * typical);
    let is_unlike = level > NOT_AS_THOUGHT || within > NOT_AS_THOUGHT.max(NOISES * typical);
    is_unlike.then_some(LightState::Unlike {
        surface,
        level,
        within,
    })
}

/// Where the shared numbers start: the light's, the target's, the intensity's, the reference's.
pub fn nominal(rig: &Rig, level: f64, reference: ReferenceShape) -> Vec<f64> {
    let mut nominal = values(&LIGHT, rig);
    nominal.extend(values(target_unknowns(), rig));
    nominal.push(level);
    nominal.resize(nominal.len() + reference.priors().len(), 0.0);
    nominal
}

pub fn with_target(rig: &Rig, reference: ReferenceShape) -> Vec<f64> {
    let mut prior = priors(&LIGHT, rig);
    prior.extend(priors(target_unknowns(), rig));
    prior.push(LN_INTENSITY_PRIOR);
    prior.extend(reference.priors());
    prior
}

/// The target's numbers are those of the lines; intensity and reference are nobody else's.
fn free(light: &[bool], count: usize) -> Vec<bool> {
    let mut free = light.to_vec();
    free.extend([false; TARGET]);
    free.resize(count, true);
    free
}

/// `own` are the standard deviations of frames' own numbers, where they are known already; `start` is an
/// earlier solution.
pub fn solve_light(
    shading: &Shading<'_>,
    nominal: &[f64],
    prior: &[f64],
    free: &[bool],
    (own, start): (Option<&[f64]>, Option<&Solved>),
) -> Result<Solved, CalibrateError> {
    let [usual, least_own, most_own] = shading.shape.own();
    let problem = Problem {
        nominal,
        prior,
        free,
        own: own.unwrap_or(usual),
        least_own,
        most_own,
        least_noise: LEAST_FACTOR,
        finds_noise: own.is_none(),
    };
    let start = started(nominal, free, start);
    solve(shading, &problem, &start).ok_or(CalibrateError::NoSolution)
}

/// The covariance of camera and light about a light of which some numbers are held: `all` is the solution where none
/// is, `kept` that where only those move that `moves` says.
fn about_kept(
    (nominal, prior): (&[f64], &[f64]),
    moves: &[bool],
    (all, full): (&Solved, &DMatrix<f64>),
    (kept, known): (&Solved, &DMatrix<f64>),
) -> Result<DMatrix<f64>, CalibrateError> {
    let (camera, light) = (CAMERA.len(), LIGHT.len());
    // Shading does not change the camera.
    let behind_camera = |of: &[f64]| [&vec![0.0; camera], &of[..light]].concat();
    let held: Vec<usize> = (0..light)
        .filter(|k| !moves[*k])
        .map(|k| camera + k)
        .collect();
    let alternatives = Alternatives {
        held: &held,
        nominal: &behind_camera(nominal),
        prior: &behind_camera(prior),
        free: (&behind_camera(&all.shared), full),
        kept: (&behind_camera(&kept.shared), known),
    };
    let covariance = alternatives.covariance();
    covariance.ok_or(CalibrateError::NoSolution)
}

/// The covariance of camera, target and light together, of a light whose numbers are known where they are not
/// `free`. With N the information of shading and l, t the numbers of light (with intensity and reference) and
/// target, l follows a change of t by G = −N_ll⁻¹ N_lt.
fn joined(
    camera: &DMatrix<f64>,
    solved: &Solved,
    prior: &[f64],
    free: &[bool],
) -> Result<DMatrix<f64>, CalibrateError> {
    let all = 0..prior.len();
    let is_target = |k: usize| (LIGHT.len()..LN_INTENSITY).contains(&k);
    let some: Vec<usize> = all.filter(|k| free[*k] && !is_target(*k)).collect();
    let information = &solved.information;
    let pick =
        |of: &[usize]| DMatrix::from_fn(some.len(), of.len(), |i, j| information[(some[i], of[j])]);
    let some_prior: Vec<f64> = some.iter().map(|i| prior[*i]).collect();
    let bread = covariance_of(&pick(&some), &some_prior)?;
    let own = solved.covariance(prior, &some);
    let own = own.ok_or(CalibrateError::NoSolution)?;
    let target: Vec<usize> = (LIGHT.len()..LIGHT.len() + TARGET).collect();
    let follows = -bread * pick(&target);
    let of_light = some.iter().filter(|k| **k < LIGHT.len()).count();
    let places: Vec<usize> = some[..of_light].to_vec();
    let (n, l) = (CAMERA.len(), LIGHT.len());
    let target_rows = camera.rows(n - TARGET, TARGET).into_owned();
    let across = &follows * &target_rows;
    let target_alone = target_rows.columns(n - TARGET, TARGET).into_owned();
    let light_alone = own + &follows * target_alone * follows.transpose();
    let light_alone = light_alone.view((0, 0), (of_light, of_light)).into_owned();
    let mut joined = DMatrix::zeros(n + l, n + l);
    joined.view_mut((0, 0), (n, n)).copy_from(camera);
    joined
        .view_mut((n, n), (l, l))
        .copy_from(&among_all(l, &places, &light_alone));
    for (i, place) in places.iter().enumerate() {
        for k in 0..n {
            joined[(n + place, k)] = across[(i, k)];
            joined[(k, n + place)] = across[(i, k)];
        }
    }
    Ok(joined)
}
