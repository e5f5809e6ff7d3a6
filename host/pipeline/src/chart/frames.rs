//! Which samples take part: frames for cross-validation, and subsets of frames.

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, angle_between, normalize};
use gonia_brdf::{Direction, Pose, Sample};
use std::collections::HashMap;

/// One frame in so many is left out for validation.
const HOLD_OUT: u64 = 32;
/// A frame whose light and view lie this near to a held-out frame's view and light measures the
/// same by reciprocity, degrees; the plan's directions are 15° apart.
const RECIPROCAL_DEG: f64 = 4.0;
/// Sizes of the subsets of frames.
const SUBSETS: [usize; 5] = [4000, 2000, 1000, 500, 250];
/// Lights beyond this polar angle are the plan's oblique ones, which sparse plans do without.
const OBLIQUE_DEG: f64 = 80.0;

/// Why samples cannot be charted.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ChartError {
    /// Nothing to compare with.
    #[error(
        "only {0} frames are numbered, and at least 64 are needed to hold some out: \
         give samples with frame numbers, or the truth (--truth DENSE.exr)"
    )]
    TooFewFrames(usize),
    /// A truth of another grid.
    #[error("its step is {0}°: chart on its own grid (--step {0})")]
    OtherGrid(String),
    /// A truth, or samples, without a positive value.
    #[error("no test has a positive value to compare with: check the samples and the truth")]
    NothingToJudge,
}

/// The mean directions of a frame.
struct Frame {
    number: u32,
    light: Vec3,
    view: Vec3,
}

/// The frames of samples, by number; samples without a number belong to none.
fn frames_of(samples: &[Sample]) -> Vec<Frame> {
    let mut sums: HashMap<u32, (Vec3, Vec3)> = HashMap::new();
    for sample in samples.iter().filter(|s| s.frame != Sample::NO_FRAME) {
        let (light, view) = directions(sample);
        let sum = sums.entry(sample.frame).or_default();
        for k in 0..3 {
            sum.0[k] += light[k];
            sum.1[k] += view[k];
        }
    }
    let mut frames: Vec<Frame> = sums
        .into_iter()
        .map(|(number, (light, view))| Frame {
            number,
            light: normalize(light),
            view: normalize(view),
        })
        .collect();
    frames.sort_by_key(|frame| frame.number);
    frames
}

/// The poses that samples came from, as well as their mean directions tell; none where samples do not
/// say their frames.
pub fn poses_of(samples: &[Sample]) -> Vec<Pose> {
    frames_of(samples)
        .iter()
        .map(|frame| Pose {
            light: Direction::from_vec3(frame.light),
            view: Direction::from_vec3(frame.view),
        })
        .collect()
}

fn directions(sample: &Sample) -> (Vec3, Vec3) {
    let of = |theta: f32, phi: f32| Direction::from_deg(theta.into(), phi.into()).to_vec3();
    (
        of(sample.theta_i_deg, sample.phi_i_deg),
        of(sample.theta_v_deg, sample.phi_v_deg),
    )
}

/// Spreads frame numbers, so that a choice of them is no regular pattern of the plan.
fn hash(frame: u32) -> u64 {
    let mut x = u64::from(frame)
        .wrapping_add(1)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 31;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^ (x >> 29)
}

/// Samples in two parts: what is interpolated, and whole frames that it is validated with.
pub struct Split {
    /// What is interpolated.
    pub training: Vec<Sample>,
    /// Frames that the training lacks, as it lacks their reciprocal ones.
    pub tests: Vec<Sample>,
}

impl Split {
    /// Holds out one frame in 32, with its reciprocal one, which is left out of both.
    ///
    /// # Errors
    /// Too few frames.
    pub fn new(samples: Vec<Sample>) -> Result<Self, ChartError> {
        let frames = frames_of(&samples);
        if frames.len() < 64 {
            return Err(ChartError::TooFewFrames(frames.len()));
        }
        #[derive(Clone, Copy, PartialEq)]
        enum Part {
            Training,
            Test,
            Neither,
        }
        let is_test = |frame: &&Frame| hash(frame.number).is_multiple_of(HOLD_OUT);
        let tests: Vec<&Frame> = frames.iter().filter(is_test).collect();
        let near = RECIPROCAL_DEG.to_radians();
        let parts: HashMap<u32, Part> = frames
            .iter()
            .map(|frame| {
                let is_reciprocal = |test: &&Frame| {
                    angle_between(frame.light, test.view) < near
                        && angle_between(frame.view, test.light) < near
                };
                let part = if is_test(&frame) {
                    Part::Test
                } else if tests.iter().any(is_reciprocal) {
                    Part::Neither
                } else {
                    Part::Training
                };
                (frame.number, part)
            })
            .collect();
        // Samples without a frame may be a held-out frame's: they take no part.
        let of = |part: Part| {
            let samples = samples.iter();
            let chosen = samples.filter(|s| parts.get(&s.frame) == Some(&part));
            chosen.copied().collect::<Vec<Sample>>()
        };
        Ok(Self {
            training: of(Part::Training),
            tests: of(Part::Test),
        })
    }
}

/// Some of the frames, or of each only its centre.
pub struct FrameSubset<'a> {
    samples: &'a [Sample],
    name: String,
    frames: Vec<u32>,
    /// The sample nearest to the frame's mean directions, of each frame.
    centres: Option<Vec<Sample>>,
}

impl<'a> FrameSubset<'a> {
    /// All frames, then fewer and fewer of them (in an order without pattern, each subset a part of
    /// the one before), then one central sample of each frame whose light is not oblique.
    pub fn all_of(samples: &'a [Sample]) -> Vec<FrameSubset<'a>> {
        let frames = frames_of(samples);
        let mut order: Vec<u32> = frames.iter().map(|frame| frame.number).collect();
        order.sort_by_key(|number| hash(*number));
        let total = order.len();
        let sizes = std::iter::once(total).chain(SUBSETS.into_iter().filter(|size| *size < total));
        let mut subsets: Vec<FrameSubset> = sizes
            .map(|size| FrameSubset {
                samples,
                name: format!("{size} images"),
                frames: order[..size].to_vec(),
                centres: None,
            })
            .collect();
        let centres = centres_of(samples, &frames);
        subsets.push(FrameSubset {
            samples,
            name: format!("{} images, central samples only", centres.len()),
            frames: centres.iter().map(|sample| sample.frame).collect(),
            centres: Some(centres),
        });
        subsets
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// Its samples.
    pub fn samples(&self) -> Vec<Sample> {
        if let Some(centres) = &self.centres {
            return centres.clone();
        }
        let wanted: std::collections::HashSet<u32> = self.frames.iter().copied().collect();
        let samples = self.samples.iter();
        samples
            .filter(|s| wanted.contains(&s.frame))
            .copied()
            .collect()
    }
}

fn centres_of(samples: &[Sample], frames: &[Frame]) -> Vec<Sample> {
    let limit = OBLIQUE_DEG.to_radians().cosine();
    let means: HashMap<u32, &Frame> = frames
        .iter()
        .filter(|frame| frame.light[2] > limit)
        .map(|frame| (frame.number, frame))
        .collect();
    let mut best: HashMap<u32, (f64, Sample)> = HashMap::new();
    for sample in samples {
        let Some(frame) = means.get(&sample.frame) else {
            continue;
        };
        let (light, view) = directions(sample);
        let off = angle_between(light, frame.light) + angle_between(view, frame.view);
        let entry = best.entry(sample.frame).or_insert((off, *sample));
        if off < entry.0 {
            *entry = (off, *sample);
        }
    }
    let mut centres: Vec<Sample> = best.into_values().map(|(_, sample)| sample).collect();
    centres.sort_by_key(|sample| sample.frame);
    centres
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use gonia_brdf::hemisphere::{paper_lights, paper_views};

    /// Five samples of every 1 in `every` of the paper's frames, the third one central.
    pub fn samples(every: usize) -> Vec<Sample> {
        let (lights, views) = (paper_lights(), paper_views());
        (0..lights.len() * views.len())
            .step_by(every)
            .flat_map(|frame| {
                let (light, view) = (lights[frame / views.len()], views[frame % views.len()]);
                [-2.0, -1.0, 0.0, 1.0, 2.0].map(|off| Sample {
                    theta_i_deg: (light.theta_deg() - off).abs() as f32,
                    phi_i_deg: light.phi_deg() as f32,
                    theta_v_deg: (view.theta_deg() + 0.5 * off).abs() as f32,
                    phi_v_deg: view.phi_deg() as f32,
                    rgb: [
                        1.0 + light.theta as f32,
                        1.0 + view.theta as f32,
                        off as f32 + 5.0,
                    ],
                    frame: frame as u32,
                })
            })
            .collect()
    }

    #[test]
    fn held_out_frames_and_their_reciprocals_are_missing_in_the_training() {
        let held = Split::new(samples(1)).unwrap();
        let (tests, training) = (frames_of(&held.tests), frames_of(&held.training));
        let share = 8505.0 / tests.len() as f64;
        assert!((26.0..40.0).contains(&share), "{share}");
        let both = tests.len() + training.len();
        assert!((8505 - 300..8505 - 150).contains(&both), "{both}");
        for test in &tests {
            let known = training.iter().filter(|frame| {
                let near = |a, b| angle_between(a, b) < 0.05;
                let same = near(frame.light, test.light) && near(frame.view, test.view);
                same || (near(frame.light, test.view) && near(frame.view, test.light))
            });
            assert_eq!(known.count(), 0);
        }
        let mut nameless = samples(1);
        nameless.iter_mut().for_each(|s| s.frame = Sample::NO_FRAME);
        assert_eq!(
            Split::new(nameless).err(),
            Some(ChartError::TooFewFrames(0))
        );
    }

    #[test]
    fn subsets_shrink_inside_each_other_and_end_with_the_central_samples() {
        let samples = samples(1);
        let subsets = FrameSubset::all_of(&samples);
        let sizes: Vec<usize> = subsets.iter().map(FrameSubset::frames).collect();
        assert_eq!(sizes, [8505, 4000, 2000, 1000, 500, 250, 6561]);
        assert!(
            subsets[2]
                .frames
                .iter()
                .all(|f| subsets[1].frames.contains(f))
        );
        assert_eq!(subsets[3].samples().len(), 5000);
        let centres = subsets[6].samples();
        assert_eq!(centres.len(), 6561);
        // At the pole all samples are on one side of the centre, which is not their mean.
        let central = centres.iter().filter(|s| s.rgb[2] == 5.0).count();
        assert!(central > 6200, "{central}");
    }
}
