//! Whether a dense BRDF reflects more than it receives.

use gonia_brdf::{DenseBrdf, Elementary, Grid};
use gonia_rig::{Channels, DenseChannels, Remark, Scale};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::{Mutex, PoisonError};

/// The directional albedo ρ(ω) = ∫ f(ω, ωv) cos θv dωv of a dense BRDF: the share of the light from ω that is
/// reflected, per channel; without a unit where f is in 1/sr.
///
/// Beyond the last polar angle of the grid its values count on to the horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionalAlbedo {
    /// Mean over the azimuths of light, per channel, by the grid's polar angles.
    pub by_polar_angle: Vec<Vec<f64>>,
    /// The highest of all directions of light within what was measured.
    pub highest: f64,
    /// The channel of the highest, by its number …
    pub channel: usize,
    /// … and by its name.
    pub channel_name: String,
    /// Where the highest is: polar angle of the light, degrees.
    pub theta_i_deg: f64,
    /// Where the highest is: azimuth of the light, degrees.
    pub phi_i_deg: f64,
    /// Step of the polar angles, degrees.
    pub step_deg: f64,
}

impl DirectionalAlbedo {
    /// Sums a BRDF; the highest albedo is looked for up to a polar angle of light.
    pub fn of(brdf: &DenseBrdf, up_to_deg: f64) -> Self {
        Self::of_planes(brdf.grid(), brdf.planes(), &Channels::Rgb, up_to_deg)
    }

    /// The same of any channels.
    pub(crate) fn of_channels(brdf: &DenseChannels, up_to_deg: f64) -> Self {
        Self::of_planes(brdf.grid, &brdf.planes, &brdf.channels, up_to_deg)
    }

    fn of_planes(grid: Grid, planes: &[Vec<f32>], channels: &Channels, up_to_deg: f64) -> Self {
        let (n, rings) = (grid.n_directions(), Rings::of(grid));
        let of_light = |light: usize| {
            let row = |plane: &Vec<f32>| rings.albedo(&plane[light * n..(light + 1) * n]);
            planes.iter().map(row).collect()
        };
        let all: Vec<Vec<f64>> = (0..n).into_par_iter().map(of_light).collect();
        Self::of_lights(grid, &all, channels, up_to_deg)
    }

    /// Of the albedos of all directions of light, in the grid's order, each of every channel.
    fn of_lights(grid: Grid, all: &[Vec<f64>], channels: &Channels, up_to_deg: f64) -> Self {
        let (n_phi, step_deg) = (grid.n_phi(), grid.step_deg());
        let of_ring = |ring: &[Vec<f64>]| {
            let of_channel = |c| ring.iter().map(|a| a[c]).sum::<f64>() / n_phi as f64;
            (0..channels.count()).map(of_channel).collect()
        };
        let by_polar_angle = all.chunks(n_phi).map(of_ring).collect();
        let measured = ((up_to_deg / step_deg).round() as usize + 1) * n_phi;
        let (mut highest, mut channel, mut place) = (f64::NEG_INFINITY, 0, 0);
        for (light, albedo) in all.iter().enumerate().take(measured) {
            for (c, albedo) in albedo.iter().enumerate() {
                if *albedo > highest {
                    (highest, channel, place) = (*albedo, c, light);
                }
            }
        }
        let light = grid.direction(place);
        Self {
            by_polar_angle,
            highest,
            channel,
            channel_name: channels.names().get(channel).cloned().unwrap_or_default(),
            theta_i_deg: light.theta_deg(),
            phi_i_deg: light.phi_deg(),
            step_deg,
        }
    }

    /// The mean over azimuths at a polar angle of light, per channel: of the nearest node.
    pub fn at(&self, theta_i_deg: f64) -> &[f64] {
        let last = self.by_polar_angle.len().saturating_sub(1);
        let nearest = ((theta_i_deg / self.step_deg).round() as usize).min(last);
        self.by_polar_angle.get(nearest).map_or(&[], Vec::as_slice)
    }
}

/// Sums rows of a dense BRDF that is not in memory as a whole, as they are made.
pub(crate) struct AlbedoRows {
    grid: Grid,
    rings: Rings,
    channels: Channels,
    /// Of each direction of light the albedo of every channel.
    lights: Mutex<Vec<Vec<f64>>>,
}

impl AlbedoRows {
    pub fn new(grid: Grid, channels: &Channels) -> Self {
        Self {
            grid,
            rings: Rings::of(grid),
            channels: channels.clone(),
            lights: Mutex::new(vec![vec![0.0; channels.count()]; grid.n_directions()]),
        }
    }

    /// Adds the row of a direction of light in some channels.
    pub fn add(&self, light: usize, channels: &[usize], row: &[&[f32]]) {
        let albedos: Vec<f64> = row.iter().map(|values| self.rings.albedo(values)).collect();
        let mut lights = self.lights.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(of_light) = lights.get_mut(light) else {
            return;
        };
        for (channel, albedo) in channels.iter().zip(albedos) {
            if let Some(place) = of_light.get_mut(*channel) {
                *place = albedo;
            }
        }
    }

    /// When all rows were added: see [`DirectionalAlbedo::of`].
    pub fn finish(self, up_to_deg: f64) -> DirectionalAlbedo {
        let lights = self.lights.into_inner();
        let lights = lights.unwrap_or_else(PoisonError::into_inner);
        DirectionalAlbedo::of_lights(self.grid, &lights, &self.channels, up_to_deg)
    }
}

/// ∫ sin θ cos θ dθ dφ of a node of each polar angle.
struct Rings {
    n_phi: usize,
    weights: Vec<f64>,
}

impl Rings {
    fn of(grid: Grid) -> Self {
        Self {
            n_phi: grid.n_phi(),
            weights: ring_weights(grid.n_theta(), grid.n_phi(), grid.step_deg()),
        }
    }

    /// ∫ f cos θv dωv of the values of all views.
    fn albedo(&self, row: &[f32]) -> f64 {
        row.chunks(self.n_phi)
            .zip(&self.weights)
            .map(|(ring, weight)| weight * ring.iter().map(|f| f64::from(*f)).sum::<f64>())
            .sum()
    }
}

/// ∫ sin θ cos θ dθ dφ of a node of each polar angle, the last one's on to the horizon.
pub(crate) fn ring_weights(n_theta: usize, n_phi: usize, step_deg: f64) -> Vec<f64> {
    let step = step_deg.to_radians();
    (0..n_theta)
        .map(|ring| {
            let middle = ring as f64 * step;
            let from = (middle - 0.5 * step).max(0.0);
            let to = if ring + 1 == n_theta {
                FRAC_PI_2
            } else {
                middle + 0.5 * step
            };
            0.5 * (to.sine().powi(2) - from.sine().powi(2)) * TAU / n_phi as f64
        })
        .collect()
}

/// More than all light, by more than the calibration of a white reference may be off.
const ALBEDO_MAX: f64 = 1.05;

/// What is to be said of a BRDF that is said to be absolute.
pub(crate) fn remark(albedo: &DirectionalAlbedo, scale: Scale) -> Option<Remark> {
    let above = scale == Scale::Absolute && albedo.highest > ALBEDO_MAX;
    above.then(|| {
        Remark::new(
            "dense BRDF",
            format_args!(
                "it reflects {:.3} of the light from theta_i {:.0}, phi_i {:.0} in channel {}: more than it receives, which no absolute BRDF does",
                albedo.highest,
                albedo.theta_i_deg,
                albedo.phi_i_deg,
                albedo.channel_name
            ),
            "check the reference's reflectance and a factor of pi or of a cosine in the values, or call them relative",
        )
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use gonia_brdf::model::Lambert;

    #[test]
    fn a_lambertian_surface_reflects_its_albedo_and_more_than_all_light_is_remarked_on() {
        for step in [2.0, 10.0, 30.0] {
            let grid = Grid::with_step_deg(step).unwrap();
            let model = Lambert {
                albedo: [0.2, 1.2, 0.5],
            };
            let albedo = DirectionalAlbedo::of(&DenseBrdf::tabulate(grid, &model), 60.0);
            for theta in [0.0, 30.0, 90.0] {
                assert!((albedo.at(theta)[0] - 0.2).abs() < 1e-5, "{albedo:?}");
            }
            assert!((albedo.highest - 1.2).abs() < 1e-5 && albedo.channel == 1);
            assert_eq!(remark(&albedo, Scale::Relative), None);
            let said = remark(&albedo, Scale::Absolute).unwrap().to_string();
            assert!(said.contains("1.200 of the light"), "{said}");
        }
    }

    #[test]
    fn rows_added_in_any_order_have_the_albedo_of_the_whole() {
        let grid = Grid::with_step_deg(15.0).unwrap();
        let brdf = DenseBrdf::from_fn(grid, |light, view| {
            [0, 1, 2].map(|c| (light + c * view) as f32)
        });
        let rows = AlbedoRows::new(grid, &Channels::Rgb);
        let n = grid.n_directions();
        for light in (0..n).rev() {
            let row = |c: usize| &brdf.planes()[c][light * n..(light + 1) * n];
            rows.add(light, &[2, 0], &[row(2), row(0)]);
            rows.add(light, &[1], &[row(1)]);
        }
        assert_eq!(rows.finish(75.0), DirectionalAlbedo::of(&brdf, 75.0));
    }
}
