//! What the benches measure: analytic materials, seen by the paper's plan on the paper's rig.

mod made_up;

use gonia_brdf::Elementary;
use gonia_brdf::direction::local_direction;
use gonia_brdf::hemisphere::{directions, paper_lights, paper_views};
use gonia_brdf::model::{Ggx, Kurt, KurtLobe, Material, Ward};
use gonia_brdf::{Brdf, Direction, Sample};
use rayon::prelude::*;
use std::sync::Arc;

/// Standard deviation of the noise, relative.
pub const NOISE: f64 = 0.015;

/// What interpolation was tuned on.
#[allow(dead_code)] // Some benches need one only.
pub const MATERIALS: [&str; 8] = [
    "matte", "broad", "fabric", "sharp", "sharper", "round", "ggx", "ward",
];

/// The materials that arguments name, these, those of `gonia demo` and made-up ones; without one, those above.
#[allow(dead_code)]
pub fn named(arguments: &[String]) -> Vec<&'static str> {
    let others = Material::NAMES.into_iter().chain(made_up::NAMES);
    let all = MATERIALS
        .into_iter()
        .chain(others.filter(|name| !MATERIALS.contains(name)));
    let mut named: Vec<_> = all.filter(|n| arguments.iter().any(|a| a == n)).collect();
    if named.is_empty() {
        named = MATERIALS.to_vec();
    }
    named
}

/// The material of a name that [`named`] gave.
#[allow(clippy::expect_used)]
pub fn material(name: &str) -> Arc<dyn Brdf> {
    let lobe = |specular: f64, mx, my| KurtLobe {
        specular: [specular, 0.8 * specular, 0.6 * specular],
        f0: 0.05,
        mx,
        my,
        alpha: 0.3,
        azimuth_deg: 31.0,
    };
    if name == "ggx" {
        return Arc::new(Ggx {
            diffuse: [0.1, 0.2, 0.3],
            specular: [1.0; 3],
            f0: 0.04,
            alpha_x: 0.1,
            alpha_y: 0.2,
            azimuth_deg: 77.0,
        });
    }
    if name == "ward" {
        return Arc::new(Ward {
            diffuse: [0.3, 0.2, 0.1],
            specular: [0.1; 3],
            alpha_x: 0.08,
            alpha_y: 0.3,
            azimuth_deg: 12.0,
        });
    }
    if let Some(made_up) = made_up::named(name) {
        return made_up;
    }
    Arc::new(match name {
        "matte" => Kurt::white_reference_fabric(),
        "broad" => Kurt::new([0.2, 0.15, 0.1], &[lobe(2.0, 0.15, 0.4)]),
        "sharp" => Kurt::new([0.2, 0.15, 0.1], &[lobe(1.0, 0.05, 0.3)]),
        "round" => Kurt::new([0.1, 0.2, 0.15], &[lobe(0.9, 0.07, 0.07)]),
        "sharper" => Kurt::new([0.2, 0.15, 0.1], &[lobe(1.0, 0.03, 0.12)]),
        _ => return Material::named(name).expect("a material").brdf,
    })
}

/// From where a bench measures.
pub struct Poses {
    lights: Vec<Direction>,
    views: Vec<Direction>,
    /// One in so many of their pairs.
    one_in: usize,
}

#[allow(dead_code)] // Some benches need the paper's only.
impl Poses {
    /// The paper's 8505.
    pub fn paper() -> Self {
        let (lights, views) = (paper_lights(), paper_views());
        Self {
            lights,
            views,
            one_in: 1,
        }
    }

    /// The plan nearest to `n` poses with lights and views equally dense, in rings.
    pub fn even(n: usize) -> Self {
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
            let (lights, views) = (directions(&lights), directions(&views));
            Self {
                lights,
                views,
                one_in: 1,
            }
        };
        let plans = (0..400).map(|k| plan(8.0 + 0.1 * f64::from(k)));
        let count = |plan: &Self| plan.lights.len() * plan.views.len();
        let nearest = plans.min_by_key(|plan| count(plan).abs_diff(n));
        nearest.unwrap_or_else(Self::paper)
    }

    /// Every tenth of the paper's, of no regular pattern.
    pub fn tenth() -> Self {
        Self {
            one_in: 10,
            ..Self::paper()
        }
    }

    /// About so many of the paper's, of no regular pattern.
    pub fn few(poses: usize) -> Self {
        let all = Self::paper();
        let one_in = all.lights.len() * all.views.len() / poses.max(1);
        // An odd number shares no factor with the rings' 6, 12, ...
        Self {
            one_in: one_in | 1,
            ..all
        }
    }

    /// The 925 of the quick demo: 37 lights, 25 views.
    pub fn quick() -> Self {
        let rings = [(0.0, 1), (25.0, 5), (50.0, 8), (73.0, 11)];
        let (mut lights, views) = (directions(&rings), directions(&rings));
        lights.extend(directions(&[(85.0, 12)]));
        Self {
            lights,
            views,
            one_in: 1,
        }
    }
}

/// The paper's plan on the paper's rig: 8505 frames of 1225 points, with the usual noise.
#[allow(dead_code)] // One bench has a noise of its own.
pub fn measure(model: &dyn Brdf) -> Vec<Sample> {
    measure_with(model, NOISE, &Poses::paper())
}

/// The same with another noise, relative, and from other poses.
pub fn measure_with(model: &dyn Brdf, noise: f64, poses: &Poses) -> Vec<Sample> {
    let (lights, views) = (&poses.lights, &poses.views);
    let points: Vec<[f64; 2]> = (-19..=19)
        .flat_map(|x| (-19..=19).map(move |y| [0.014 * f64::from(x), 0.014 * f64::from(y)]))
        .filter(|p| p[0].hypotenuse(p[1]) <= 0.277)
        .collect();
    (0..lights.len() * views.len())
        .into_par_iter()
        .filter(|frame| frame.is_multiple_of(poses.one_in))
        .flat_map_iter(|frame| {
            let (light, view) = (lights[frame / views.len()], views[frame % views.len()]);
            let points = &points;
            points.iter().enumerate().map(move |(k, point)| {
                let l = local_direction(light, 1.1, *point);
                let v = local_direction(view, 1.8, *point);
                let value = model.eval(l, v);
                let noise = [0, 1, 2].map(|c| 1.0 + noise * normal((frame * 1225 + k) * 3 + c));
                let (l, v) = (Direction::from_vec3(l), Direction::from_vec3(v));
                Sample::new(l, v, [0, 1, 2].map(|c| (value[c] * noise[c]) as f32))
                    .in_frame(frame as u32)
            })
        })
        .collect()
}

/// A nearly normal number from a counter: the sum of four uniform ones.
fn normal(counter: usize) -> f64 {
    let mut x = (counter as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d;
    x ^= x >> 31;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 28;
    let sum: f64 = (0..4).map(|k| f64::from((x >> (16 * k)) as u16)).sum();
    (sum / 65536.0 - 2.0) * 3f64.sqrt()
}

/// CPU seconds of all threads of this process so far.
pub fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let field = |k: usize| {
        after_name
            .split_whitespace()
            .nth(k)
            .and_then(|f| f.parse::<f64>().ok())
    };
    (field(11).unwrap_or(f64::NAN) + field(12).unwrap_or(f64::NAN)) / 100.0
}
