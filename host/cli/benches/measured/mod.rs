//! What benches of the command measure: analytic materials, from poses of theirs on the paper's rig.

use gonia_brdf::Elementary;
use gonia_brdf::direction::local_direction;
use gonia_brdf::{Brdf, DenseBrdf, Direction, Pose, Sample};
use gonia_pipeline::{Options, Side, Table, compare};
use gonia_plan::Rings;
use gonia_plan::adaptive::Reach;
use gonia_rig::{Figures, Scale};
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// The paper's rig.
pub const REACH: Reach = Reach {
    light_m: 1.1,
    camera_m: 1.8,
    radius_m: 0.277,
    theta_max_deg: [85.0, 75.0],
    keep_out_deg: 8.0,
};
/// Standard deviation of a sample, relative.
pub const NOISE: f64 = 0.015;
/// A dense BRDF against the truth.
pub fn compared(dense: &DenseBrdf, model: &dyn Brdf) -> Figures {
    let table = Table {
        brdf: dense,
        scale: Scale::Absolute,
    };
    compare(table, Side::Model(model), &Options::default()).expect("positive values")
}

/// The plan nearest to `n` poses with lights and views equally dense, in rings.
pub fn even(n: usize) -> Rings {
    let ring = |theta: f64, step: f64| {
        let around = 360.0 * theta.to_radians().sine() / step;
        (theta, around.round().max(1.0) as usize)
    };
    let plan = |step: f64| {
        let rows = (75.0 / step).round().max(1.0);
        let views: Vec<_> = (0..=rows as usize)
            .map(|k| ring(75.0 * k as f64 / rows, step))
            .collect();
        let mut lights = views.clone();
        lights.push(ring(85.0, step));
        Rings { lights, views }
    };
    (0..400)
        .map(|k| plan(8.0 + 0.1 * f64::from(k)))
        .min_by_key(|rings| rings.count().abs_diff(n))
        .expect("steps to try")
}

/// The samples of a material at poses, with noise.
pub fn measure(model: &dyn Brdf, poses: &[Pose]) -> Vec<Sample> {
    let points: Vec<[f64; 2]> = (-19..=19)
        .flat_map(|x| (-19..=19).map(move |y| [0.014 * f64::from(x), 0.014 * f64::from(y)]))
        .filter(|p| p[0].hypotenuse(p[1]) <= REACH.radius_m)
        .collect();
    let of_frame = |(frame, pose): (usize, &Pose)| -> Vec<Sample> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(frame as u64);
        points
            .iter()
            .map(|point| {
                let l = local_direction(pose.light, REACH.light_m, *point);
                let v = local_direction(pose.view, REACH.camera_m, *point);
                let rgb = model
                    .eval(l, v)
                    .map(|value| (value * (1.0 + NOISE * normal(&mut random))) as f32);
                let (l, v) = (Direction::from_vec3(l), Direction::from_vec3(v));
                Sample::new(l, v, rgb).in_frame(frame as u32)
            })
            .collect()
    };
    poses
        .par_iter()
        .enumerate()
        .flat_map_iter(of_frame)
        .collect()
}

/// A nearly normal number: the sum of twelve uniform ones.
fn normal(random: &mut Xoshiro256PlusPlus) -> f64 {
    (0..12)
        .map(|_| f64::from(random.next_u32()) / f64::from(u32::MAX))
        .sum::<f64>()
        - 6.0
}
