//! The uncertainty that samples have from reference, lamp and camera.

use crate::budget::equation::{Equation, Part, Shape, Slant};
use gonia_brdf::{Direction, Sample};
use gonia_rig::Budget;
use rayon::prelude::*;
use std::collections::HashMap;

/// The standard uncertainty (k = 1, in the unit of the values) of each sample's values by the measurement equation, from
/// what needs no BRDF: reference, lamp and camera. It is one error in all samples. What directions add follows from the
/// slopes of the filled BRDF, noise from the scatter of the samples: a fill has both.
pub fn scale_uncertainty(budget: &Budget, samples: &[Sample]) -> Vec<[f32; 3]> {
    let equation = Equation::new(budget);
    let mut frames: HashMap<u32, ([f64; 3], f64)> = HashMap::new();
    for sample in samples {
        let (sum, count) = frames.entry(sample.frame).or_default();
        (0..3).for_each(|c| sum[c] += f64::from(sample.rgb[c]));
        *count += 1.0;
    }
    let at = |theta: f32, phi: f32| Slant::of(Direction::from_deg(theta.into(), phi.into()));
    samples
        .par_iter()
        .map(|sample| {
            let light = at(sample.theta_i_deg, sample.phi_i_deg);
            let view = at(sample.theta_v_deg, sample.phi_v_deg);
            [0, 1, 2].map(|c| {
                let value = f64::from(sample.rgb[c]);
                // Samples of no frame have no surroundings that are known.
                let known = frames
                    .get(&sample.frame)
                    .filter(|_| sample.frame != Sample::NO_FRAME);
                let shape = Shape {
                    value,
                    surround: known.map_or(value, |(sum, count)| sum[c] / count),
                    ..Shape::default()
                };
                (value * equation.at(&light, &view, &shape).u(Part::Scale)) as f32
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::fixture::uncertain_of;
    use gonia_rig::Input;

    #[test]
    fn a_samples_uncertainty_is_that_of_the_equation_with_its_frames_mean_around_it() {
        let at = |deg: f64| Direction::from_deg(deg, 0.0);
        let sample = |value: f32, frame| Sample::new(at(0.0), at(20.0), [value; 3]).in_frame(frame);
        let samples = [
            sample(0.1, 1),
            sample(0.3, 1),
            sample(0.2, 2),
            sample(-0.1, 2),
        ];
        let reference = scale_uncertainty(&uncertain_of(&[(Input::Reference, 0.02)]), &samples);
        let close = |a: f32, b: f32| (a - b).abs() < 1e-6;
        assert!(close(reference[0][1], 0.002) && close(reference[1][2], 0.006));
        // Of a value that is not positive nothing is a share.
        assert_eq!(reference[3], [0.0; 3]);
        // Stray light is a share of the frame's mean, 0.2 and 0.05, and the sample looks smaller from 20 degrees.
        let stray = scale_uncertainty(&uncertain_of(&[(Input::StrayLight, 0.01)]), &samples);
        for (found, expected) in stray.iter().zip([0.001f32, 0.001, 0.0015]) {
            let expected = expected * at(20.0).to_vec3()[2] as f32;
            assert!(close(found[0], expected), "{stray:?}");
        }
    }
}
