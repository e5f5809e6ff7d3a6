//! One block: a Gaussian process through the data around a place, evaluated at many cells.
//!
//! Ordinary kriging with a [`Kernel`], its range a fixed multiple of the neighbourhood's radius, and a
//! nugget on the diagonal. The constant mean is estimated with the rest (generalised least squares),
//! and so is the slope of an external drift. One factorisation serves all cells and all channels.

mod distances;
mod evaluate;
mod fit;
pub mod kernel;
mod variance;

use super::cholesky::{Columns, PANEL};
use super::coordinates::{Drift, Point};
use super::datum::Datum;
use evaluate::Evaluate;
use fit::Fit;
use kernel::Kernel;
use pulp::Arch;
use variance::Variance;

/// What a block is fitted with.
#[derive(Clone, Copy, Debug)]
pub struct BlockSettings {
    /// Range of the kernel in radii of the neighbourhood.
    pub range: f32,
    /// Anisotropy ratio of the kernel: what the second half of a point counts in its distances, over what
    /// it counts in the coordinates.
    pub anisotropy: f32,
    /// Variance of the logarithm of one sample.
    pub noise_variance: f32,
    /// Smallest nugget (noise over signal variance): single precision needs one.
    pub nugget_min: f32,
    /// External drift: the process is that of the logarithms less this.
    pub drift: Drift,
    /// By what share of their range values may lie beyond the data's, and by twice as many natural logarithms at most.
    pub beyond: f32,
}

/// The widest vectors in use hold 16 numbers; buffers are padded to it.
const PAD: usize = 16;
/// A datum that counts less than this is as good as absent.
const COUNT_MIN: f32 = 1e-3;
const _: () = assert!(PAD.is_multiple_of(PANEL));

/// A block of any kernel, which is fitted and then evaluated; it is used again for one neighbourhood
/// after the other.
pub trait Block<const N: usize = 3>: Send {
    /// Fits the process to data that lie within `radius` of `middle`: the radius that the range is
    /// measured in. Returns the nugget that was used.
    ///
    /// With fewer than two data the mean is all there is.
    fn fit(
        &mut self,
        data: &[Datum<N>],
        middle: Point,
        radius: f32,
        settings: &BlockSettings,
    ) -> f32;

    /// Appends the logarithm at places, per channel, which stays near the data's range: beyond them the
    /// process is no more than a guess, and must not run away.
    fn evaluate(&self, places: &[Point], out: &mut Vec<[f32; N]>);

    /// Appends the variance of the fitted process about its true value at places, per channel, as far as
    /// the data around can tell: the kriging variance times the variance that the data's values show;
    /// where [`Self::fit`] fell back to the mean, the variance of the data's values.
    fn variances_at(&mut self, places: &[Point], out: &mut Vec<[f32; N]>);

    /// The variance of the mean of the fitted process over some places, as [`Self::variances_at`] has it
    /// for each.
    fn variance_of_mean(&self, places: &[Point]) -> [f32; N];
}

/// A block of one kernel.
pub struct KrigingBlock<K: 'static, const N: usize = 3> {
    kernel: &'static K,
    process: Process<N>,
}

impl<K: Kernel, const N: usize> KrigingBlock<K, N> {
    /// A block that is not fitted to anything yet.
    pub fn new(kernel: &'static K) -> Self {
        Self {
            kernel,
            process: Process::default(),
        }
    }
}

impl<K: Kernel, const N: usize> Block<N> for KrigingBlock<K, N> {
    fn fit(
        &mut self,
        data: &[Datum<N>],
        middle: Point,
        radius: f32,
        settings: &BlockSettings,
    ) -> f32 {
        let process = &mut self.process;
        let n = data.len();
        let padded = n.next_multiple_of(PAD);
        process.middle = middle;
        process.drift = settings.drift;
        let range = settings.range.max(self.kernel.range_min());
        // The longer axes decide how far apart data are at most.
        let stretch = settings.anisotropy.max(1.0);
        let scale = self.kernel.scale() / (range * radius.max(1e-6) * stretch);
        let second = scale * settings.anisotropy;
        process.scale = [scale, scale, scale, second, second, second];
        process.load(data, padded);
        process.limits =
            std::array::from_fn(|c| limits_of(&process.log_values[c][..n], settings.beyond));
        if n >= 2 {
            let mut nugget = None;
            // A pivot lost to rounding is mended by a larger nugget; the last of these makes any
            // kernel matrix diagonally dominant enough.
            for attempt in 0..8 {
                let used = process.arch.dispatch(Fit {
                    kernel: self.kernel,
                    process,
                    n,
                    padded,
                    settings,
                    nugget,
                });
                match used {
                    Ok(nugget) => {
                        process.factored = true;
                        return nugget;
                    }
                    Err(tried) => nugget = Some(tried * if attempt < 3 { 4.0 } else { 32.0 }),
                }
            }
        }
        process.fall_back_to_mean(n);
        process.factored = false;
        1.0
    }

    fn evaluate(&self, places: &[Point], out: &mut Vec<[f32; N]>) {
        self.process.arch.dispatch(Evaluate {
            kernel: self.kernel,
            process: &self.process,
            places,
            out,
        });
    }

    fn variances_at(&mut self, places: &[Point], out: &mut Vec<[f32; N]>) {
        let process = &mut self.process;
        if !process.factored {
            out.extend(places.iter().map(|_| process.signal));
            return;
        }
        process.arch.dispatch(Variance {
            kernel: self.kernel,
            process,
            places,
            out,
        });
    }

    fn variance_of_mean(&self, places: &[Point]) -> [f32; N] {
        if !self.process.factored || places.is_empty() {
            return self.process.signal;
        }
        self.process.variance_of_mean(self.kernel, places)
    }
}

/// A process fitted to data, and room to work in.
struct Process<const N: usize> {
    matrix: Columns,
    /// Coordinates of the data from the middle, axis by axis, times √3 over the range.
    axes: [Vec<f32>; 6],
    /// Squared length of these coordinates.
    norms: Vec<f32>,
    /// The middle: where the coordinates count from. Distances come from scalar products, which
    /// single precision only bears near the origin.
    middle: Point,
    log_values: [Vec<f32>; N],
    counts: Vec<f32>,
    /// `K⁻¹ (y − μ)`, channel by channel.
    weights: [Vec<f32>; N],
    mean: [f32; N],
    /// Values stay between these, channel by channel.
    limits: [(f32, f32); N],
    /// Variance of the process, channel by channel, by maximum likelihood.
    signal: [f32; N],
    /// Nodes in the factor.
    n: usize,
    /// Whether the matrix holds a factor.
    factored: bool,
    /// Kernel of a few places with all data, and what the factor makes of it.
    columns: Vec<f32>,
    /// √3 over the range, axis by axis.
    scale: Point,
    drift: Drift,
    /// The drift at the data less that in the middle.
    drifts: Vec<f32>,
    /// Variance of the drift's slope over that of the process.
    slope_variance: f32,
    /// By how much the slope is off, channel by channel.
    slopes: [f32; N],
    arch: Arch,
}

impl<const N: usize> Default for Process<N> {
    fn default() -> Self {
        Self {
            matrix: Columns::default(),
            axes: Default::default(),
            norms: Vec::new(),
            middle: Point::default(),
            log_values: std::array::from_fn(|_| Vec::new()),
            counts: Vec::new(),
            weights: std::array::from_fn(|_| Vec::new()),
            mean: [0.0; N],
            limits: [(0.0, 0.0); N],
            signal: [0.0; N],
            n: 0,
            factored: false,
            columns: Vec::new(),
            scale: Point::default(),
            drift: Drift::default(),
            drifts: Vec::new(),
            slope_variance: 0.0,
            slopes: [0.0; N],
            arch: Arch::default(),
        }
    }
}

impl<const N: usize> Process<N> {
    /// Takes the data, in units of the range.
    fn load(&mut self, data: &[Datum<N>], padded: usize) {
        for buffer in self
            .axes
            .iter_mut()
            .chain(&mut self.log_values)
            .chain(&mut self.weights)
            .chain([&mut self.counts, &mut self.norms, &mut self.drifts])
        {
            buffer.clear();
            buffer.resize(padded, 0.0);
        }
        let in_middle = self.drift.at(&self.middle);
        for (row, datum) in data.iter().enumerate() {
            for k in 0..6 {
                let x = (datum.point[k] - self.middle[k]) * self.scale[k];
                self.axes[k][row] = x;
                self.norms[row] += x * x;
            }
            let drift = self.drift.at(&datum.point);
            self.drifts[row] = drift - in_middle;
            for c in 0..N {
                self.log_values[c][row] = datum.log_value[c] - drift;
            }
            self.counts[row] = datum.count;
        }
    }

    fn fall_back_to_mean(&mut self, n: usize) {
        for c in 0..N {
            self.mean[c] = self.log_values[c].iter().sum::<f32>() / n.max(1) as f32;
            self.weights[c].fill(0.0);
            self.slopes[c] = 0.0;
            let squares = self.log_values[c][..n]
                .iter()
                .map(|v| (v - self.mean[c]).powi(2));
            self.signal[c] = squares.sum::<f32>() / n.max(1) as f32;
        }
    }
}

/// A value may lie beyond those around by this in any case, in natural logarithms …
const BEYOND_LEAST: f32 = 0.1;
/// … and by no more than the share of their range that settings allow, times this.
const BEYOND_MOST: f32 = 2.0;

fn limits_of(values: &[f32], share: f32) -> (f32, f32) {
    let low = values.iter().copied().fold(f32::INFINITY, f32::min);
    let high = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    if low > high {
        // Of no data.
        return (f32::NEG_INFINITY, f32::INFINITY);
    }
    let beyond = (share * (high - low))
        .min(BEYOND_MOST * share)
        .max(BEYOND_LEAST);
    (low - beyond, high + beyond)
}

#[cfg(test)]
mod tests {
    use super::super::coordinates::Coordinates;
    use super::kernel::Matern32;
    use super::*;
    use crate::elementary::Elementary;

    const SETTINGS: BlockSettings = BlockSettings {
        range: 8.0,
        anisotropy: 1.0,
        noise_variance: 1e-6,
        nugget_min: 1e-4,
        drift: Drift::NONE,
        beyond: 0.5,
    };

    fn datum(x: f32, y: f32, count: f32) -> Datum {
        let v = (3.0 * x).sine() + 0.5 * y;
        Datum {
            point: [x, y, 0.0, 0.0, 0.0, 0.0],
            log_value: [v, 2.0 * v, -v],
            count,
            source: 0,
        }
    }

    fn scattered(n: usize) -> Vec<Datum> {
        // The golden-ratio sequence fills the square evenly.
        (0..n)
            .map(|k| {
                let f = |a: f64| ((k as f64 * a) % 1.0) as f32 - 0.5;
                datum(f(0.754_877_666), f(0.569_840_291), 1.0)
            })
            .collect()
    }

    fn at(block: &dyn Block, place: &Point) -> [f32; 3] {
        let mut out = Vec::new();
        block.evaluate(&[*place], &mut out);
        out[0]
    }

    #[test]
    fn a_smooth_function_is_found_again_between_its_data() {
        for n in [48, 64, 185] {
            let data = scattered(n);
            let mut block = KrigingBlock::new(&Matern32);
            block.fit(&data, [0.0; 6], 0.7, &SETTINGS);
            for (x, y) in [(0.1, 0.2), (-0.3, 0.33), (0.0, 0.0)] {
                let truth = datum(x, y, 1.0);
                let got = at(&block, &truth.point);
                for c in 0..3 {
                    let off = (got[c] - truth.log_value[c]).abs();
                    assert!(off < 0.03, "{n} {x} {y} {c}: {off}");
                }
            }
        }
    }

    #[test]
    fn the_solution_satisfies_the_kriging_equations() {
        let data = scattered(50);
        let mut block = KrigingBlock::new(&Matern32);
        let nugget = f64::from(block.fit(&data, [0.0; 6], 0.7, &SETTINGS));
        let scale = 3f64.sqrt() / (8.0 * 0.7);
        let k = |a: &Datum, b: &Datum| {
            let s = (0..6)
                .map(|i| f64::from(a.point[i] - b.point[i]).powi(2))
                .sum::<f64>()
                .sqrt()
                * scale;
            (1.0 + s) * (-s).exponential()
        };
        for c in 0..3 {
            // (K + λ I) w + μ = y, and the weights sum to zero.
            let total: f32 = block.process.weights[c].iter().sum();
            let largest = block.process.weights[c]
                .iter()
                .fold(0f32, |m, w| m.max(w.abs()));
            assert!(total.abs() < 2e-3 * largest, "{total} {largest}");
            for (i, a) in data.iter().enumerate() {
                let row: f64 = data
                    .iter()
                    .zip(&block.process.weights[c])
                    .map(|(b, w)| k(a, b) * f64::from(*w))
                    .sum();
                let left = row
                    + nugget * f64::from(block.process.weights[c][i])
                    + f64::from(block.process.mean[c]);
                assert!((left - f64::from(a.log_value[c])).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn the_variance_is_what_kriging_says() {
        // Against a dense solve in double precision, at places off the data and on one.
        let data = scattered(40);
        let mut block = KrigingBlock::new(&Matern32);
        let nugget = f64::from(block.fit(&data, [0.0; 6], 0.7, &SETTINGS));
        let scale = 3f64.sqrt() / (8.0 * 0.7);
        let k = |a: &Point, b: &Point| {
            let squares = (0..6).map(|i| f64::from(a[i] - b[i]).powi(2));
            let s = squares.sum::<f64>().sqrt() * scale;
            (1.0 + s) * (-s).exponential()
        };
        let places: Vec<Point> = (0..20)
            .map(|i| datum(0.05 * i as f32 - 0.5, 0.3, 1.0).point)
            .chain([data[7].point])
            .collect();
        let mut got = Vec::new();
        block.variances_at(&places, &mut got);
        // Ordinary kriging: K and a border of ones.
        let n = data.len();
        let matrix: Vec<Vec<f64>> = (0..=n)
            .map(|i| {
                (0..=n)
                    .map(|j| match (i < n, j < n) {
                        (true, true) => {
                            k(&data[i].point, &data[j].point) + if i == j { nugget } else { 0.0 }
                        }
                        (false, false) => 0.0,
                        _ => 1.0,
                    })
                    .collect()
            })
            .collect();
        for (place, got) in places.iter().zip(&got) {
            let mut rhs: Vec<f64> = data.iter().map(|b| k(place, &b.point)).collect();
            rhs.push(1.0);
            let x = gauss(matrix.clone(), rhs.clone());
            let kriging: f64 = 1.0 - x.iter().zip(&rhs).map(|(a, b)| a * b).sum::<f64>();
            for c in 0..3 {
                let off = f64::from(got[c] / block.process.signal[c]) - kriging;
                assert!(off.abs() < 2e-5 + 0.02 * kriging, "{off} {kriging}");
            }
        }
    }

    #[test]
    fn an_anisotropy_ratio_is_a_kernel_of_shorter_axes() {
        // Once by the settings, once by the points; data and places off both halves' axes.
        let moved = |datum: &Datum, by: f32| {
            let mut datum = *datum;
            datum.point[4] = by * datum.point[1];
            datum
        };
        let place = |by: f32| moved(&datum(0.13, -0.21, 1.0), by).point;
        let with_range = |by: f32, anisotropy: f32, range: f32| {
            let data: Vec<Datum> = scattered(60).iter().map(|n| moved(n, by)).collect();
            let settings = BlockSettings {
                anisotropy,
                range,
                ..SETTINGS
            };
            let mut block = KrigingBlock::new(&Matern32);
            block.fit(&data, [0.0; 6], 0.7, &settings);
            let mut variance = Vec::new();
            block.variances_at(&[place(by)], &mut variance);
            let of_mean = block.variance_of_mean(&[place(by)]);
            [at(&block, &place(by))[0], variance[0][0], of_mean[0]]
        };
        let predicted = |by, anisotropy| with_range(by, anisotropy, SETTINGS.range);
        let (by_settings, by_points, plain) = (
            predicted(2.0, 0.5),
            predicted(1.0, 1.0),
            predicted(2.0, 1.0),
        );
        for k in 0..3 {
            let near = (by_settings[k] / by_points[k] - 1.0).abs();
            let far = (plain[k] / by_points[k] - 1.0).abs();
            assert!(near < 1e-3 && far > 3.0 * near, "{k}: {near} {far}");
        }
        // Above 1, the range is that of the longer axes: the kernel's polynomial ends soon behind it.
        let long = with_range(0.125, 8.0, SETTINGS.range);
        let all_long = with_range(1.0, 1.0, 8.0 * SETTINGS.range);
        for k in 0..3 {
            let off = (long[k] / all_long[k] - 1.0).abs();
            assert!(off < 1e-2, "{k}: {long:?} {all_long:?}");
        }
    }

    /// Nodes along the second half's first axis, whose values follow the drift of half/difference
    /// coordinates so many times.
    fn along_the_drift(times: f32) -> (BlockSettings, Vec<Datum>) {
        let drift = Coordinates::half_difference(0.5).drift();
        let settings = BlockSettings { drift, ..SETTINGS };
        let data = (0..60)
            .map(|k| {
                let mut datum = datum(0.002 * (k % 7) as f32, 0.0, 1.0);
                datum.point[3] = 0.4 + 0.004 * k as f32;
                datum.log_value = [times * drift.at(&datum.point); 3];
                datum
            })
            .collect();
        (settings, data)
    }

    #[test]
    fn a_drift_goes_on_beyond_the_data_with_the_slope_that_they_show() {
        let beyond: Point = [0.0, 0.0, 0.0, 0.68, 0.0, 0.0];
        let middle: Point = [0.0, 0.0, 0.0, 0.52, 0.0, 0.0];
        for times in [0.5, 1.0, 1.5] {
            let (settings, data) = along_the_drift(times);
            let expected = times * settings.drift.at(&beyond);
            let off = |settings: &BlockSettings| {
                let mut block = KrigingBlock::new(&Matern32);
                block.fit(&data, middle, 0.12, settings);
                (at(&block, &beyond)[0] - expected).abs()
            };
            let (with, without) = (off(&settings), off(&SETTINGS));
            assert!(
                with < 0.1 * expected && with < 0.5 * without,
                "{times}: {with} {without}"
            );
        }
    }

    #[test]
    fn the_variance_of_a_mean_is_that_of_its_place_and_less_of_several() {
        let (with_drift, along) = along_the_drift(1.2);
        let place = |x, y| datum(x, y, 1.0).point;
        let cases = [
            (SETTINGS, scattered(60), place(0.9, 0.7), place(-0.9, 0.7)),
            (
                with_drift,
                along,
                [0.0, 0.0, 0.0, 0.68, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.36, 0.0, 0.0],
            ),
        ];
        for (settings, data, a, b) in cases {
            let mut block = KrigingBlock::new(&Matern32);
            block.fit(&data, [0.0; 6], 0.7, &settings);
            let mut single = Vec::new();
            block.variances_at(&[a, b], &mut single);
            let [of_a, of_b] = [a, b].map(|p| block.variance_of_mean(&[p])[0]);
            assert!(
                (of_a / single[0][0] - 1.0).abs() < 0.03,
                "{of_a} {single:?}"
            );
            assert!(
                (of_b / single[1][0] - 1.0).abs() < 0.03,
                "{of_b} {single:?}"
            );
            // Far apart they know little of each other's error.
            let both = block.variance_of_mean(&[a, b])[0];
            assert!(
                both < 0.9 * of_a.max(of_b) && both > 0.0,
                "{both} {of_a} {of_b}"
            );
        }
    }

    /// Solves a small dense system by elimination with pivots.
    fn gauss(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
        let n = b.len();
        for j in 0..n {
            let pivot = (j..n)
                .max_by(|x, y| a[*x][j].abs().total_cmp(&a[*y][j].abs()))
                .unwrap();
            a.swap(j, pivot);
            b.swap(j, pivot);
            for i in j + 1..n {
                let f = a[i][j] / a[j][j];
                for k in j..n {
                    a[i][k] -= f * a[j][k];
                }
                b[i] -= f * b[j];
            }
        }
        for j in (0..n).rev() {
            for k in j + 1..n {
                b[j] -= a[j][k] * b[k];
            }
            b[j] /= a[j][j];
        }
        b
    }

    #[test]
    fn duplicates_a_single_datum_and_none_give_finite_values() {
        let mut block = KrigingBlock::new(&Matern32);
        let same = vec![datum(0.2, 0.1, 1.0); 40];
        block.fit(&same, [0.0; 6], 0.0, &SETTINGS);
        let value = at(&block, &same[0].point);
        assert!((value[0] - same[0].log_value[0]).abs() < 1e-3, "{value:?}");
        block.fit(&same[..1], [0.0; 6], 0.0, &SETTINGS);
        let value = at(&block, &[1.0; 6]);
        assert!((value[0] - same[0].log_value[0]).abs() < 1e-3, "{value:?}");
        block.fit(&same[..0], [0.0; 6], 0.0, &SETTINGS);
        assert!(at(&block, &[1.0; 6]).iter().all(|v| v.is_finite()));
    }

    #[test]
    fn far_from_its_data_a_block_does_not_run_away() {
        // A slope of 2 over data a tenth apart; the place is thirty radii away.
        let data: Vec<Datum> = (0..20)
            .map(|k| {
                let mut datum = datum(0.1 * k as f32, 0.0, 1.0);
                datum.log_value = [0.2 * k as f32; 3];
                datum
            })
            .collect();
        let mut block = KrigingBlock::new(&Matern32);
        block.fit(&data, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, &SETTINGS);
        let between = at(&block, &datum(1.05, 0.0, 1.0).point)[0];
        assert!((between - 2.1).abs() < 0.05, "{between}");
        for x in [-4.0, 6.0, 30.0] {
            let far = at(&block, &datum(x, 0.0, 1.0).point)[0];
            assert!((-1.0..=4.8).contains(&far), "{x}: {far}");
        }
    }

    #[test]
    fn more_noise_means_a_larger_nugget_and_a_smoother_fit() {
        let data = scattered(100);
        let mut block = KrigingBlock::new(&Matern32);
        let quiet = block.fit(&data, [0.0; 6], 0.7, &SETTINGS);
        let noisy = BlockSettings {
            noise_variance: 0.4,
            ..SETTINGS
        };
        assert!(block.fit(&data, [0.0; 6], 0.7, &noisy) > 10.0 * quiet);
    }
}
