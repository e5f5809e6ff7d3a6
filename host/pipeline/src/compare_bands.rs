//! How far one spectral dense BRDF is from another, band by band.

use gonia_brdf::{Elementary, Grid};
use gonia_rig::{Channels, DenseChannels, Scale};
use rayon::prelude::*;
use std::fmt;

/// Errors of bands over all cells, each weighted by the solid angles of its light and view.
#[derive(Clone, Debug, PartialEq)]
pub struct BandFigures {
    /// RMS of the natural logarithm of the ratio, over all bands.
    pub log_rms: f64,
    /// The band whose RMS is the largest.
    pub worst: String,
    /// That RMS.
    pub worst_log_rms: f64,
    /// The factor that was taken out, where either is relative.
    pub factor: Option<f64>,
    /// Values that are not positive in either, and were left out.
    pub left_out: usize,
}

/// Compares bands; `None` of other channels, of bands or grids that differ, and of bands without a positive value.
pub fn compare_bands(a: &DenseChannels, b: &DenseChannels) -> Option<BandFigures> {
    let is_spectral = matches!(a.channels, Channels::Bands(_));
    if !is_spectral || a.channels != b.channels || a.grid != b.grid {
        return None;
    }
    let weights = weights_of(a.grid);
    let pairs: Vec<(&Vec<f32>, &Vec<f32>)> = a.planes.iter().zip(&b.planes).collect();
    let sums: Vec<Sums> = pairs
        .par_iter()
        .map(|(a, b)| Sums::of(&weights, a, b))
        .collect();
    let mut all = Sums::default();
    for band in &sums {
        all.weight += band.weight;
        all.sum += band.sum;
        all.squares += band.squares;
        all.left_out += band.left_out;
    }
    if all.weight <= 0.0 {
        return None;
    }
    let mean = all.sum / all.weight;
    let is_relative = [a.scale, b.scale].contains(&Scale::Relative);
    let taken = if is_relative { mean } else { 0.0 };
    let of_band = sums.iter().map(|band| band.rms_about(taken)).enumerate();
    let (worst, worst_log_rms) = of_band.max_by(|x, y| x.1.total_cmp(&y.1))?;
    Some(BandFigures {
        log_rms: all.rms_about(taken),
        worst: a.channels.names().get(worst)?.clone(),
        worst_log_rms,
        factor: is_relative.then(|| mean.exponential()),
        left_out: all.left_out,
    })
}

/// The solid angle of a node of each direction, but for a factor.
fn weights_of(grid: Grid) -> Vec<f64> {
    let of = |direction: usize| {
        let theta = grid.direction(direction).theta_deg();
        theta.max(0.25 * grid.step_deg()).to_radians().sine()
    };
    (0..grid.n_directions()).map(of).collect()
}

/// Weighted sums of logarithms of ratios.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weight: f64,
    sum: f64,
    squares: f64,
    left_out: usize,
}

impl Sums {
    fn of(weights: &[f64], a: &[f32], b: &[f32]) -> Self {
        let mut sums = Self::default();
        let n = weights.len();
        let rows = a.chunks_exact(n).zip(b.chunks_exact(n)).zip(weights);
        for ((a, b), of_light) in rows {
            for ((a, b), of_view) in a.iter().zip(b).zip(weights) {
                if *a <= 0.0 || *b <= 0.0 {
                    sums.left_out += 1;
                    continue;
                }
                let weight = of_light * of_view;
                let log = f64::from((a / b).natural_log());
                sums.weight += weight;
                sums.sum += weight * log;
                sums.squares += weight * log * log;
            }
        }
        sums
    }

    fn rms_about(&self, mean: f64) -> f64 {
        let Self {
            weight,
            sum,
            squares,
            ..
        } = self;
        let square = (squares - 2.0 * mean * sum + mean * mean * weight) / weight;
        square.max(0.0).sqrt()
    }
}

impl fmt::Display for BandFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "bands      |ln| RMS {:.4} over all cells, worst {:.4} ({})",
            self.log_rms, self.worst_log_rms, self.worst
        )?;
        if let Some(factor) = self.factor {
            write!(f, ", a factor of {factor:.6} taken out")?;
        }
        if self.left_out > 0 {
            write!(f, "; {} values are not positive", self.left_out)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn dense(values: [f32; 2], scale: Scale) -> DenseChannels {
        let grid = Grid::with_step_deg(30.0).unwrap();
        DenseChannels {
            channels: Channels::Bands(vec![400.0, 500.0]),
            grid,
            planes: values.map(|v| vec![v; grid.n_cells()]).to_vec(),
            scale,
            provenance: BTreeMap::new(),
        }
    }

    #[test]
    fn the_band_that_is_off_is_named_and_levels_count_where_they_are_absolute() {
        let truth = dense([0.1, 0.2], Scale::Absolute);
        let off = dense([0.1, 0.22], Scale::Absolute);
        let figures = compare_bands(&off, &truth).unwrap();
        assert_eq!(figures.worst, "500nm");
        assert!((figures.worst_log_rms - 0.0953).abs() < 1e-3, "{figures}");
        let twice = dense([0.2, 0.4], Scale::Relative);
        let figures = compare_bands(&twice, &truth).unwrap();
        assert!(figures.log_rms < 1e-6 && (figures.factor.unwrap() - 2.0).abs() < 1e-6);
        let mut grey = truth.clone();
        grey.channels = Channels::Single;
        assert_eq!(compare_bands(&grey, &truth), None);
    }
}
