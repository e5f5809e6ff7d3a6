//! A BRDF for tests of exports: what is mirrored, turned or has light and view confused differs from it.

use gonia_brdf::direction::Vec3;
use gonia_brdf::{Brdf, DenseBrdf, Elementary, Grid};
use gonia_rig::{Channels, DenseChannels, DenseFile, Scale};
use std::collections::BTreeMap;

/// Not reciprocal, not the same with light and view both turned by 180°, nor mirrored.
pub struct Lopsided;

impl Brdf for Lopsided {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let lobe = |v: Vec3, a: f64| 1.0 + a * v[0] - 0.4 * v[1] + 0.3 * v[0] * v[1];
        let half: f64 = (0..3).map(|i| (light[i] + view[i]).powi(2)).sum();
        let shine = (-8.0 * (1.0 - (light[2] + view[2]) / half.sqrt())).exponential();
        let both = lobe(light, 0.5) * lobe(view, 0.3);
        [1.0, 2.0, 3.0].map(|c| 0.1 * c * both + 0.2 * shine)
    }
}

/// Isotropic and reciprocal, and not the same at φ and −φ.
pub struct Skew;

impl Brdf for Skew {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let across = light[0] * view[1] - light[1] * view[0];
        let along = light[0] * view[0] + light[1] * view[1];
        let skew = 3.0 * across * (light[2] - view[2]);
        [0.1 * (skew - 0.3 * along + 0.2 * (light[2] + view[2])).exponential(); 3]
    }
}

/// On a grid, absolute.
pub fn file(model: &dyn Brdf, step_deg: f64) -> DenseFile {
    DenseFile {
        brdf: DenseBrdf::tabulate(Grid::with_step_deg(step_deg).unwrap(), model),
        scale: Scale::Absolute,
        provenance: BTreeMap::from([("material".to_owned(), "lopsided & <odd> -- one".to_owned())]),
    }
}

/// Settings at a resolution.
pub fn settings(resolution: usize, is_one_value: bool) -> super::ExportSettings {
    super::ExportSettings {
        resolution,
        is_one_value,
    }
}

/// Median of |ln| of what is read against a model, at directions of polar angles up to `last_deg`.
pub fn median_ln(read: &dyn Brdf, model: &dyn Brdf, last_deg: f64) -> f64 {
    use gonia_brdf::Direction;
    let mut errors = Vec::new();
    for k in 0..3000 {
        let angle = |by: f64, range: f64| (f64::from(k) * by).fract() * range;
        let light = Direction::from_deg(angle(0.618_034, last_deg), angle(0.754_878, 360.0));
        let view = Direction::from_deg(angle(0.569_84, last_deg), angle(0.438_58, 360.0));
        let [light, view] = [light, view].map(Direction::to_vec3);
        let (wanted, found) = (model.eval(light, view), read.eval(light, view));
        errors.extend((0..3).map(|c| (found[c] / wanted[c]).natural_log().abs()));
    }
    errors.sort_by(f64::total_cmp);
    errors[errors.len() / 2]
}

/// Tables of each kind of channels, with standard uncertainties.
pub fn tables() -> Vec<(DenseChannels, DenseChannels)> {
    let grid = Grid::with_step_deg(30.0).unwrap();
    let kinds = [
        (Channels::Single, Scale::Absolute),
        (Channels::Rgb, Scale::Relative),
        (
            Channels::Bands(vec![400.0, 532.5, 1064.0, 10_600.0]),
            Scale::Absolute,
        ),
    ];
    let table = |(channels, scale): &(Channels, Scale), by: f32| DenseChannels {
        planes: (0..channels.count())
            .map(|c| {
                (0..grid.n_cells())
                    .map(|k| by * (c * 1000 + k + 1) as f32)
                    .collect()
            })
            .collect(),
        channels: channels.clone(),
        grid,
        scale: *scale,
        provenance: BTreeMap::from([
            ("material".to_owned(), "a \"wood\", µ".to_owned()),
            ("step_deg".to_owned(), "30".to_owned()),
        ]),
    };
    let both = |kind: &(Channels, Scale)| (table(kind, 1.0), table(kind, 0.015));
    kinds.iter().map(both).collect()
}
