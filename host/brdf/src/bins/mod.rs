//! Binning: samples that share a cell become one value, their median (paper, Section III).

mod node;
mod noise;

use crate::elementary::Elementary;
use crate::grid::Grid;
use crate::quantile::median;
use crate::sample::Sample;
use node::{Node, Nodes};
use rayon::prelude::*;

/// A filled cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin<const N: usize = 3> {
    /// The cell, see [`Grid::cell`].
    pub cell: u64,
    /// Number of samples.
    pub count: u32,
    /// Their frame when all came from the same one, else [`Sample::NO_FRAME`].
    pub frame: u32,
    /// Median per channel.
    pub median: [f32; N],
    /// Median absolute deviation from the median, per channel; 0 for a single sample.
    pub mad: [f32; N],
    /// Mean of the light directions, a unit vector. The samples sit off the node, and a value
    /// belongs to where it was measured.
    pub light: [f32; 3],
    /// Mean of the view directions, a unit vector.
    pub view: [f32; 3],
}

/// All filled cells of a grid, in ascending order of the cell.
#[derive(Clone, Debug)]
pub struct Bins<const N: usize = 3> {
    grid: Grid,
    bins: Vec<Bin<N>>,
    outside: usize,
    noise_variance: Option<f32>,
}

impl<const N: usize> Bins<N> {
    /// Bins samples to their nearest nodes. Samples beyond the grid's last polar angle, and samples
    /// with a value or an angle that is not finite, are counted as outside.
    pub fn new(grid: Grid, samples: &[Sample<N>]) -> Self {
        // Sorting ten million cells at once goes through memory many times. Sorted by their light
        // first, each light's thousand samples fit the nearest cache.
        let size = samples.len().div_ceil(4 * rayon::current_num_threads());
        let shares: Vec<ByLight> = samples
            .par_chunks(size.max(1))
            .enumerate()
            .map(|(k, share)| ByLight::new(grid, share, k * size))
            .collect();
        let nodes = Nodes::new(grid);
        let lights: Vec<usize> = (0..grid.n_directions()).collect();
        let noise_one_in = samples.len().div_ceil(NOISE_SAMPLES).max(1) | 1;
        let (parts, variances): (Vec<Vec<Bin<N>>>, Vec<Vec<f32>>) = lights
            .par_chunks(LIGHTS_AT_A_TIME)
            .map(|lights| {
                let mut scratch = Vec::new();
                let mut keys: Vec<u64> = Vec::new();
                let mut sorted: Vec<Sample<N>> = Vec::new();
                // Room for one bin a sample: memory that is not touched costs nothing.
                let samples_here =
                    |light: &usize| shares.iter().map(|s| s.of(*light).len()).sum::<usize>();
                let mut bins = Vec::with_capacity(lights.iter().map(samples_here).sum());
                let mut variances = Vec::new();
                for &light in lights {
                    keys.clear();
                    for share in &shares {
                        keys.extend_from_slice(share.of(light));
                    }
                    // By view, then by number: the result does not depend on the threads.
                    keys.sort_unstable();
                    // One copy of them all waits for memory once, not once a bin.
                    sorted.clear();
                    sorted.extend(keys.iter().map(|key| samples[number_of(*key)]));
                    let mut rest = &sorted[..];
                    for same in keys.chunk_by(|a, b| view_of(*a) == view_of(*b)) {
                        let (group, others) = rest.split_at(same.len());
                        rest = others;
                        let nodes = (nodes.at(light), nodes.at(view_of(same[0])));
                        let cell = grid.cell(light, view_of(same[0]));
                        bins.push(summarize(cell, nodes, group, &mut scratch));
                        if cell.is_multiple_of(noise_one_in) {
                            variances
                                .extend(noise::variances_about_plane(group).into_iter().flatten());
                        }
                    }
                }
                (bins, variances)
            })
            .unzip();
        Self {
            grid,
            bins: joined(&parts),
            outside: shares.iter().map(|share| share.outside).sum(),
            noise_variance: noise::usual(variances.concat()),
        }
    }

    /// As they were once: of a grid, with how many samples were outside, and the variance of a sample's logarithm.
    /// `None` where the bins are none of this grid in ascending order, or have no number where one must be.
    pub fn from_parts(
        grid: Grid,
        bins: Vec<Bin<N>>,
        outside: usize,
        noise_variance: Option<f32>,
    ) -> Option<Self> {
        let is_sound = |bin: &Bin<N>| {
            let floats = bin.median.iter().chain(&bin.mad);
            (bin.cell as usize) < grid.n_cells()
                && bin.count > 0
                && floats
                    .chain(&bin.light)
                    .chain(&bin.view)
                    .all(|v| v.is_finite())
        };
        let ascending = bins.is_sorted_by(|a, b| a.cell < b.cell);
        (ascending && bins.iter().all(is_sound)).then_some(Self {
            grid,
            bins,
            outside,
            noise_variance,
        })
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The filled cells.
    pub fn bins(&self) -> &[Bin<N>] {
        &self.bins
    }

    /// Variance of the natural logarithm of one sample; `None` where no cell has enough samples to tell.
    pub fn noise_variance(&self) -> Option<f32> {
        self.noise_variance
    }

    /// Natural logarithm of what a bin's median says of the true value, of one channel; the median counts as
    /// `floor` at least.
    ///
    /// The noise of samples is as much above the value as below it, but their logarithms lie lower in the mean, by half of
    /// the median's relative variance: nothing at 1.5 % of noise, and two per cent of a single sample at the 20 %
    /// of a coarse yarn, which no averaging over bins would take away.
    pub fn log_value(&self, bin: &Bin<N>, channel: usize, floor: f32) -> f32 {
        let variance = self
            .noise_variance
            .map_or(0.0, |v| v.min(NOISE_MAX * NOISE_MAX));
        let of_bin = variance * variance_of_median(bin.count) / bin.count.max(1) as f32;
        bin.median[channel].max(floor).natural_log() + 0.5 * of_bin
    }

    /// The same bins with one of their channels.
    pub fn channel(&self, channel: usize) -> Bins<1> {
        let of_bin = |bin: &Bin<N>| Bin {
            cell: bin.cell,
            count: bin.count,
            frame: bin.frame,
            median: [bin.median[channel]],
            mad: [bin.mad[channel]],
            light: bin.light,
            view: bin.view,
        };
        Bins {
            grid: self.grid,
            bins: self.bins.iter().map(of_bin).collect(),
            outside: self.outside,
            noise_variance: self.noise_variance,
        }
    }

    /// How many samples fell outside the grid.
    pub fn outside(&self) -> usize {
        self.outside
    }
}

/// A view's node and a sample's number in one word, so that one sort of words groups samples by view
/// and keeps their order within it.
fn key_of(view: u32, number: usize) -> u64 {
    (u64::from(view) << 32) | number as u64
}

fn view_of(key: u64) -> usize {
    (key >> 32) as usize
}

fn number_of(key: u64) -> usize {
    (key & 0xffff_ffff) as usize
}

/// All parts in one, by all threads: the new memory costs more than the copying.
fn joined<const N: usize>(parts: &[Vec<Bin<N>>]) -> Vec<Bin<N>> {
    let mut count = 0;
    let starts: Vec<usize> = parts
        .iter()
        .map(|part| {
            count += part.len();
            count - part.len()
        })
        .collect();
    (0..count)
        .into_par_iter()
        .map(|k| {
            // Of empty parts, which start where the next one does, the last of them all is not empty.
            let part = starts.partition_point(|start| *start <= k) - 1;
            parts[part][k - starts[part]]
        })
        .collect()
}

/// So many samples, about, tell the noise.
const NOISE_SAMPLES: usize = 600_000;

/// Of more noise than this, relative to the value, half a variance is not what logarithms lie lower by.
const NOISE_MAX: f32 = 0.5;

/// Light directions that one task sorts and summarizes.
const LIGHTS_AT_A_TIME: usize = 32;

/// In place of a node, of a sample that is outside.
const OUTSIDE: u32 = u32::MAX;

/// Some of the samples, put in order of their light's node.
struct ByLight {
    /// See [`key_of`].
    keys: Vec<u64>,
    /// Where the keys of each light begin; one more than there are lights.
    starts: Vec<u32>,
    outside: usize,
}

impl ByLight {
    /// `first` is the number of the first sample.
    fn new<const N: usize>(grid: Grid, samples: &[Sample<N>], first: usize) -> Self {
        let mut starts = vec![0u32; grid.n_directions() + 1];
        let nodes: Vec<(u32, u32)> = samples
            .iter()
            .map(|s| {
                let (light, view) = nodes_of(grid, s).unwrap_or((OUTSIDE, OUTSIDE));
                if light != OUTSIDE {
                    starts[light as usize + 1] += 1;
                }
                (light, view)
            })
            .collect();
        for light in 0..grid.n_directions() {
            starts[light + 1] += starts[light];
        }
        let inside = starts[grid.n_directions()] as usize;
        let mut keys = vec![0u64; inside];
        let mut next = starts.clone();
        for (number, &(light, view)) in nodes.iter().enumerate() {
            if light != OUTSIDE {
                let at = &mut next[light as usize];
                keys[*at as usize] = key_of(view, first + number);
                *at += 1;
            }
        }
        Self {
            keys,
            starts,
            outside: samples.len() - inside,
        }
    }

    fn of(&self, light: usize) -> &[u64] {
        &self.keys[self.starts[light] as usize..self.starts[light + 1] as usize]
    }
}

/// The nodes of light and view of a sample within the grid.
fn nodes_of<const N: usize>(grid: Grid, s: &Sample<N>) -> Option<(u32, u32)> {
    if !s.rgb.iter().all(|v| v.is_finite()) {
        return None;
    }
    let light = grid.nearest(s.theta_i_deg.into(), s.phi_i_deg.into())?;
    let view = grid.nearest(s.theta_v_deg.into(), s.phi_v_deg.into())?;
    Some((light as u32, view as u32))
}

fn summarize<const N: usize>(
    cell: usize,
    (light, view): (Node, Node),
    group: &[Sample<N>],
    scratch: &mut Vec<f32>,
) -> Bin<N> {
    let mut frame = group[0].frame;
    if group.iter().any(|s| s.frame != frame) {
        frame = Sample::NO_FRAME;
    }
    let (value, mad) = match group {
        // Many bins are one of these two.
        [one] => (one.rgb, [0.0; N]),
        [a, b] => (
            std::array::from_fn(|c| 0.5 * (a.rgb[c] + b.rgb[c])),
            std::array::from_fn(|c| 0.5 * (a.rgb[c] - b.rgb[c]).abs()),
        ),
        _ => {
            let (mut value, mut mad) = ([0.0; N], [0.0; N]);
            for c in 0..N {
                scratch.clear();
                scratch.extend(group.iter().map(|s| s.rgb[c]));
                value[c] = median(scratch);
                let centre = value[c];
                scratch.iter_mut().for_each(|v| *v = (*v - centre).abs());
                mad[c] = median(scratch);
            }
            (value, mad)
        }
    };
    Bin {
        cell: cell as u64,
        count: group.len() as u32,
        frame,
        median: value,
        mad,
        light: light.mean(group.iter().map(|s| (s.theta_i_deg, s.phi_i_deg))),
        view: view.mean(group.iter().map(|s| (s.theta_v_deg, s.phi_v_deg))),
    }
}

/// Variance of the median of normal values over that of their mean, within 2 % of
/// the exact ratios for 1 to 10 values.
pub fn variance_of_median(count: u32) -> f32 {
    use std::f32::consts::FRAC_PI_2;
    let n = count.max(1) as f32;
    let fewer = if count.is_multiple_of(2) {
        1.3
    } else {
        FRAC_PI_2 - 1.0
    };
    (FRAC_PI_2 * n / (n + fewer)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::Direction;
    use crate::random::Random;

    fn sample(theta_i: f32, phi_i: f32, value: f32, frame: u32) -> Sample {
        Sample {
            theta_i_deg: theta_i,
            phi_i_deg: phi_i,
            theta_v_deg: 30.0,
            phi_v_deg: 90.0,
            rgb: [value, 2.0 * value, 3.0 * value],
            frame,
        }
    }

    #[test]
    fn a_grid_of_half_a_degree_has_more_cells_than_32_bits_count() {
        let grid = Grid::with_step_deg(0.5).unwrap();
        let sample = Sample {
            theta_i_deg: 80.1,
            phi_i_deg: 359.4,
            theta_v_deg: 60.0,
            phi_v_deg: 0.2,
            rgb: [1.0; 3],
            frame: 0,
        };
        let bins = Bins::new(grid, &[sample]);
        let cell = bins.bins()[0].cell;
        assert!(cell > u64::from(u32::MAX));
        let (light, view) = grid.light_and_view(cell as usize);
        let nodes =
            [light, view].map(|d| (grid.direction(d).theta_deg(), grid.direction(d).phi_deg()));
        for ((theta, phi), wanted) in nodes.into_iter().zip([(80.0, 359.5), (60.0, 0.0)]) {
            assert!((theta - wanted.0).abs() < 1e-9 && (phi - wanted.1).abs() < 1e-9);
        }
    }

    #[test]
    fn a_bin_holds_median_spread_count_and_mean_direction() {
        let bins = Bins::new(
            Grid::PAPER,
            &[
                sample(40.5, 359.5, 1.0, 3),
                sample(40.5, 0.5, 9.0, 3),
                sample(39.5, 0.0, 2.0, 3),
                sample(88.0, 0.0, 1.0, 3),
                sample(40.0, 0.0, f32::NAN, 3),
            ],
        );
        assert_eq!(bins.outside(), 2);
        assert_eq!(bins.bins().len(), 1);
        let bin = bins.bins()[0];
        let grid = Grid::PAPER;
        assert_eq!(bin.cell as usize, grid.cell(20 * 180, 15 * 180 + 45));
        assert_eq!((bin.count, bin.frame), (3, 3));
        assert_eq!(bin.median, [2.0, 4.0, 6.0]);
        assert_eq!(bin.mad, [1.0, 2.0, 3.0]);
        let green = bins.channel(1);
        assert_eq!((green.bins()[0].median, green.outside()), ([4.0], 2));
        let mean = Direction::from_vec3(bin.light.map(f64::from));
        assert!((mean.theta_deg() - 40.17).abs() < 0.01, "{mean:?}");
        assert!(mean.phi_deg() < 1e-3 || mean.phi_deg() > 359.999);
    }

    #[test]
    fn logarithms_of_noisy_bins_have_the_mean_of_the_truth() {
        let mut random = Random::new(1);
        for count in [1, 2, 5] {
            let samples: Vec<Sample> = (0..7920 * 4)
                .flat_map(|k| vec![k; count])
                .chain((0..7920).flat_map(|_| vec![0; 6]))
                .map(|k| {
                    let normal = random.normal() as f32;
                    let (row, column) = (k / 180, k % 180);
                    Sample {
                        theta_v_deg: 2.0 * (row % 40 + 1) as f32,
                        phi_v_deg: 2.0 * column as f32,
                        ..sample(2.0 * (row / 40) as f32, 0.0, 3.0 * (1.0 + 0.2 * normal), 0)
                    }
                })
                .collect();
            let bins = Bins::new(Grid::PAPER, &samples);
            let of_count = bins.bins().iter().filter(|b| b.count == count as u32);
            let logs: Vec<f32> = of_count
                .map(|b| bins.log_value(b, 0, 1e-3) - 3f32.natural_log())
                .collect();
            let mean = logs.iter().sum::<f32>() / logs.len() as f32;
            assert!(logs.len() > 20_000 && mean.abs() < 0.004, "{count}: {mean}");
        }
    }

    #[test]
    fn a_bin_of_two_frames_names_neither() {
        let bins = Bins::new(
            Grid::PAPER,
            &[sample(40.0, 0.0, 1.0, 1), sample(40.0, 0.0, 1.0, 2)],
        );
        assert_eq!(bins.bins()[0].frame, Sample::NO_FRAME);
    }

    #[test]
    fn bins_come_in_order_whatever_the_pieces() {
        let samples: Vec<Sample> = (0..5000)
            .map(|k| sample((k * 7 % 86) as f32, (k * 13 % 360) as f32, k as f32, k))
            .collect();
        let bins = Bins::new(Grid::PAPER, &samples);
        assert!(bins.bins().windows(2).all(|w| w[0].cell < w[1].cell));
        let total: u32 = bins.bins().iter().map(|b| b.count).sum();
        assert_eq!(total, 5000);
    }

    #[test]
    fn mean_directions_are_those_of_the_vectors() {
        for step in [1.0, 2.0, 30.0] {
            let grid = Grid::with_step_deg(step).unwrap();
            for k in 0..3000u16 {
                let mut s = sample(f32::from(k % 73) + 0.37, f32::from(k % 359) + 0.91, 1.0, 0);
                s.theta_v_deg = f32::from(k % 73) * 0.01;
                s.phi_v_deg = f32::from(k % 36) * 10.0 + 0.02;
                let bin = Bins::new(grid, &[s]).bins()[0];
                let angle = |got: [f32; 3], theta: f32, phi: f32| {
                    let wanted = Direction::from_deg(theta.into(), phi.into()).to_vec3();
                    crate::direction::angle_between(got.map(f64::from), wanted).to_degrees()
                };
                assert!(angle(bin.light, s.theta_i_deg, s.phi_i_deg) < 1e-5);
                assert!(angle(bin.view, s.theta_v_deg, s.phi_v_deg) < 1e-5);
            }
        }
    }

    #[test]
    fn azimuths_of_another_turn_and_angles_that_are_none() {
        let mut turned = sample(40.0, 350.5, 1.0, 0);
        turned.phi_i_deg -= 720.0;
        let mut none = turned;
        none.phi_v_deg = f32::NAN;
        let bins = Bins::new(Grid::PAPER, &[turned, none]);
        assert_eq!((bins.bins().len(), bins.outside()), (1, 1));
        let light = Direction::from_vec3(bins.bins()[0].light.map(f64::from));
        assert!((light.phi_deg() - 350.5).abs() < 1e-4, "{light:?}");
    }
}
