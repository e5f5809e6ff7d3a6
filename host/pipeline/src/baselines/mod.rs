//! Other ways to a dense BRDF, from the samples of the same session: what the paper's Fig. 8 and
//! Section VI compare with.

mod cylinder_strips;
mod paper;
mod session;

pub use cylinder_strips::measure_on_strips;
pub use paper::{check_grid, coarse, fill_check_cells};
pub use session::{BaselineOptions, Made, Measurement};

use gonia_brdf::{Direction, Sample, Vec3};
use std::collections::BTreeMap;

/// Views and lights of the uniform plan end at 75°; its oblique lights stand at 85°.
const UNIFORM_MAX_DEG: f32 = 80.0;

/// The sparse uniform measurement: of every frame whose light is not oblique, the one sample nearest
/// to the middle of the frame's directions. Samples without a frame number are left out.
pub fn centres(samples: &[Sample]) -> Vec<Sample> {
    let mut frames: BTreeMap<u32, Vec<&Sample>> = BTreeMap::new();
    for sample in samples.iter().filter(|s| s.frame != Sample::NO_FRAME) {
        frames.entry(sample.frame).or_default().push(sample);
    }
    frames
        .values()
        .filter_map(|frame| {
            let (mut light, mut view) = ([0.0; 3], [0.0; 3]);
            for sample in frame {
                let (l, v) = vectors(sample);
                for k in 0..3 {
                    light[k] += l[k] / frame.len() as f64;
                    view[k] += v[k] / frame.len() as f64;
                }
            }
            let distance = |sample: &Sample| {
                let (l, v) = vectors(sample);
                (0..3).fold(0.0, |sum, k| {
                    sum + (l[k] - light[k]).powi(2) + (v[k] - view[k]).powi(2)
                })
            };
            let nearest = frame
                .iter()
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (nearest.theta_i_deg <= UNIFORM_MAX_DEG).then_some(**nearest)
        })
        .collect()
}

fn vectors(sample: &Sample) -> (Vec3, Vec3) {
    let at = |theta: f32, phi: f32| Direction::from_deg(theta.into(), phi.into()).to_vec3();
    (
        at(sample.theta_i_deg, sample.phi_i_deg),
        at(sample.theta_v_deg, sample.phi_v_deg),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_sample_of_each_frame_that_is_not_oblique_stays() {
        let sample = |frame, theta_i_deg, phi_i_deg| Sample {
            theta_i_deg,
            phi_i_deg,
            theta_v_deg: 30.0,
            phi_v_deg: 0.0,
            rgb: [1.0; 3],
            frame,
        };
        let samples = [
            sample(4, 40.0, 10.0),
            sample(4, 45.0, 12.0),
            sample(4, 50.0, 14.0),
            sample(9, 84.0, 0.0),
            sample(9, 85.0, 0.0),
            sample(Sample::NO_FRAME, 20.0, 0.0),
        ];
        assert_eq!(centres(&samples), [samples[1]]);
    }
}
