//! Light from all around, as a few hundred directional lights (the paper's Fig. 2 has 512).

use crate::Light;
use crate::color::luminance;
use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot, normalize};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Radiance over all directions, as a latitude-longitude map: the first row looks straight up, the
/// middle column where the camera looks (away from the viewer), columns go round to the right.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    width: usize,
    height: usize,
    rgb: Vec<[f32; 3]>,
}

impl Environment {
    /// A map of `width` × `height` pixels, row by row from the top left. Values that are no radiance
    /// (negative, NaN, infinite) count as zero. `None` when the size does not fit or nothing shines.
    pub fn new(width: usize, height: usize, mut rgb: Vec<[f32; 3]>) -> Option<Self> {
        let sound = |v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 };
        rgb.iter_mut().for_each(|pixel| *pixel = pixel.map(sound));
        let shines = rgb.iter().any(|pixel| luminance(*pixel) > 0.0);
        (rgb.len() == width * height && shines).then_some(Self { width, height, rgb })
    }

    /// A clear sky with the sun at the upper left behind the viewer, over darker ground.
    pub fn sky() -> Self {
        const WIDTH: usize = 512;
        const HEIGHT: usize = 256;
        let sun = normalize([-0.55, 0.62, 0.56]);
        let pixel = |at: usize| {
            let towards = direction(at % WIDTH, at / WIDTH, WIDTH, HEIGHT);
            let near_sun = dot(towards, sun).clamp(-1.0, 1.0).arc_cosine().to_degrees();
            // A disc of a few degrees instead of half of one: soft edges, the same light.
            let sun =
                [1.0, 0.92, 0.78].map(|c| c * 60.0 * (-(near_sun / 4.0).powi(2)).exponential());
            let glow = [1.0, 0.9, 0.75].map(|c| c * 0.8 * (-near_sun / 18.0).exponential());
            let up = towards[1];
            let dome = if up >= 0.0 {
                let haze = (1.0 - up).powi(3);
                [0.28 + 0.60 * haze, 0.45 + 0.45 * haze, 0.85 + 0.10 * haze]
            } else {
                let near = (1.0 + up).powi(4);
                [0.10 + 0.22 * near, 0.09 + 0.20 * near, 0.08 + 0.18 * near]
            };
            [0, 1, 2].map(|c| (dome[c] + glow[c] + sun[c]) as f32)
        };
        Self {
            width: WIDTH,
            height: HEIGHT,
            rgb: (0..WIDTH * HEIGHT).into_par_iter().map(pixel).collect(),
        }
    }

    /// At most `n` lights that stand for the map: the map is cut into regions of equal luminous power
    /// (median cut, Debevec 2005), and each region is a light in its middle, as strong as the region.
    pub fn lights(&self, n: usize) -> Vec<Light> {
        let mut lights = Vec::new();
        let whole = Region {
            columns: 0..self.width,
            rows: 0..self.height,
        };
        self.cut(whole, n.max(1), &mut lights);
        lights
    }

    /// Adds `n` lights for a region, or fewer where it has no more pixels or does not shine.
    fn cut(&self, region: Region, n: usize, lights: &mut Vec<Light>) {
        let (wide, high) = (region.columns.len(), region.rows.len());
        if n == 1 || wide * high == 1 {
            lights.extend(self.light_of(&region));
            return;
        }
        // The longer side in angle; columns draw together towards the poles.
        let middle = (region.rows.start + region.rows.end) as f64 * 0.5;
        let width = wide as f64 * (middle / self.height as f64 * PI).sine().max(0.05);
        let along_columns = high == 1 || (wide > 1 && width > high as f64);
        let slices = if along_columns {
            region.columns.clone()
        } else {
            region.rows.clone()
        };
        let powers: Vec<f64> = slices
            .map(|k| {
                let sum = |at: usize| f64::from(luminance(self.rgb[at])) * self.solid_angle(at);
                if along_columns {
                    region
                        .rows
                        .clone()
                        .map(|row| sum(row * self.width + k))
                        .sum()
                } else {
                    region
                        .columns
                        .clone()
                        .map(|column| sum(k * self.width + column))
                        .sum()
                }
            })
            .collect();
        let total: f64 = powers.iter().sum();
        if total <= 0.0 {
            return;
        }
        // The cut nearest to the share of the lights that go to the first part, none of it empty.
        let first = n / 2;
        let wanted = total * first as f64 / n as f64;
        let mut passed = 0.0;
        let mut best = (f64::INFINITY, 1);
        for (k, power) in powers.iter().enumerate().take(powers.len() - 1) {
            passed += power;
            best = if (passed - wanted).abs() < best.0 {
                ((passed - wanted).abs(), k + 1)
            } else {
                best
            };
        }
        let (one, other) = region.split(along_columns, best.1);
        self.cut(one, first, lights);
        self.cut(other, n - first, lights);
    }

    fn light_of(&self, region: &Region) -> Option<Light> {
        let (mut irradiance, mut middle) = ([0.0; 3], [0.0; 3]);
        for row in region.rows.clone() {
            for column in region.columns.clone() {
                let at = row * self.width + column;
                let solid = self.solid_angle(at);
                let towards = direction(column, row, self.width, self.height);
                let power = f64::from(luminance(self.rgb[at])) * solid;
                for k in 0..3 {
                    irradiance[k] += f64::from(self.rgb[at][k]) * solid;
                    middle[k] += power * towards[k];
                }
            }
        }
        let shines = dot(middle, middle) > 0.0;
        shines.then(|| Light {
            towards: normalize(middle),
            irradiance,
        })
    }

    /// The solid angle of a pixel.
    fn solid_angle(&self, at: usize) -> f64 {
        let theta = ((at / self.width) as f64 + 0.5) / self.height as f64 * PI;
        theta.sine() * (TAU / self.width as f64) * (PI / self.height as f64)
    }
}

/// A part of the map.
struct Region {
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Region {
    /// Both parts of a region cut after `k` columns or rows.
    fn split(self, along_columns: bool, k: usize) -> (Region, Region) {
        let Region { columns, rows } = self;
        let halves = |range: &Range<usize>| {
            let cut = range.start + k;
            (range.start..cut, cut..range.end)
        };
        if along_columns {
            let (left, right) = halves(&columns);
            let one = Region {
                columns: left,
                rows: rows.clone(),
            };
            let other = Region {
                columns: right,
                rows,
            };
            (one, other)
        } else {
            let (upper, lower) = halves(&rows);
            let one = Region {
                columns: columns.clone(),
                rows: upper,
            };
            let other = Region {
                columns,
                rows: lower,
            };
            (one, other)
        }
    }
}

/// Where a pixel of the map looks, in camera space.
fn direction(column: usize, row: usize, width: usize, height: usize) -> Vec3 {
    let (s, c) = ((row as f64 + 0.5) / height as f64 * PI).sine_cosine();
    let around = ((column as f64 + 0.5) / width as f64 - 0.5) * TAU;
    [s * around.sine(), c, -s * around.cosine()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Irradiance on a surface that faces `normal`.
    fn irradiance(lights: &[Light], normal: Vec3) -> f64 {
        let facing = |light: &Light| dot(light.towards, normal).max(0.0) * light.irradiance[1];
        lights.iter().map(facing).sum()
    }

    #[test]
    fn an_even_white_surrounding_gives_pi_from_every_side() {
        let white = Environment::new(64, 32, vec![[1.0; 3]; 64 * 32]).unwrap();
        let lights = white.lights(512);
        assert!((400..=512).contains(&lights.len()), "{}", lights.len());
        for normal in [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-0.6, -0.8, 0.0]] {
            let found = irradiance(&lights, normal);
            assert!((found / PI - 1.0).abs() < 0.03, "{normal:?}: {found}");
        }
    }

    #[test]
    fn few_lights_stand_for_the_whole_sky() {
        let sky = Environment::sky();
        let (few, many) = (sky.lights(512), sky.lights(usize::MAX));
        assert!(few.len() <= 512);
        for normal in [
            [0.0, 0.0, 1.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [1.0, 0.0, 0.0],
        ] {
            let ratio = irradiance(&few, normal) / irradiance(&many, normal);
            assert!((ratio - 1.0).abs() < 0.03, "{normal:?}: {ratio}");
        }
        assert!(irradiance(&few, [0.0, 1.0, 0.0]) > 2.0 * irradiance(&few, [0.0, -1.0, 0.0]));
    }

    #[test]
    fn what_is_no_radiance_does_not_shine() {
        let mut rgb = vec![[0.0; 3]; 32];
        rgb[3] = [f32::INFINITY, f32::NAN, -1.0];
        assert_eq!(Environment::new(8, 4, rgb.clone()), None);
        rgb[9] = [1.0; 3];
        assert_eq!(
            Environment::new(8, 4, rgb.clone())
                .unwrap()
                .lights(10)
                .len(),
            1
        );
        assert_eq!(Environment::new(8, 5, rgb), None);
    }
}
