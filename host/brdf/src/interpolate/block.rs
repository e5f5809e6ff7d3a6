//! One block: a Gaussian process through the nodes around a place, evaluated at many cells.
//!
//! Ordinary kriging with a Matérn-3/2 kernel `k(d) = (1 + s) e^{−s}`, `s = √3 d / range`, the range
//! a fixed multiple of the neighbourhood's radius, and a nugget on the diagonal. The constant mean
//! is estimated with the rest (generalised least squares). One factorisation serves all cells and
//! all channels.

use super::cholesky::{Columns, PANEL};
use super::coordinates::Point;
use super::nodes::Node;
use pulp::{Arch, Simd, WithSimd};

/// What a block is fitted with.
#[derive(Clone, Copy, Debug)]
pub struct BlockSettings {
    /// Range of the kernel in radii of the neighbourhood.
    pub range: f32,
    /// Variance of the logarithm of one sample.
    pub noise_variance: f32,
    /// Smallest nugget (noise over signal variance): single precision needs one.
    pub nugget_min: f32,
}

/// The widest vectors in use hold 16 numbers; buffers are padded to it.
const PAD: usize = 16;
/// Right-hand sides: three channels and the constant.
const RHS: usize = 4;

/// Working memory of one thread, used again for block after block.
#[derive(Default)]
pub struct BlockSolver {
    matrix: Columns,
    /// Coordinates of the nodes, axis by axis.
    axes: [Vec<f32>; 6],
    log_values: [Vec<f32>; 3],
    counts: Vec<f32>,
    /// `K⁻¹ (y − μ)`, channel by channel.
    weights: [Vec<f32>; 3],
    mean: [f32; 3],
    /// √3 over the range.
    scale: f32,
    arch: Arch,
}

impl BlockSolver {
    /// Fits the process to nodes that lie within `radius` of each other's middle: the radius that the
    /// range is measured in. Returns the nugget that was used.
    ///
    /// With fewer than two nodes the mean is all there is.
    pub fn fit<'a>(
        &mut self,
        nodes: impl ExactSizeIterator<Item = &'a Node>,
        radius: f32,
        settings: &BlockSettings,
    ) -> f32 {
        let n = nodes.len();
        let padded = n.next_multiple_of(PAD);
        self.load(nodes, padded);
        self.scale = 3f32.sqrt() / (settings.range * radius.max(1e-6));
        if n >= 2 {
            let mut nugget = None;
            // A pivot lost to rounding is mended by a larger nugget; the last of these makes any
            // kernel matrix diagonally dominant enough.
            for attempt in 0..8 {
                let used = self.arch.dispatch(Fit {
                    solver: self,
                    n,
                    padded,
                    settings,
                    nugget,
                });
                match used {
                    Ok(nugget) => return nugget,
                    Err(tried) => nugget = Some(tried * if attempt < 3 { 4.0 } else { 32.0 }),
                }
            }
        }
        self.fall_back_to_mean(n);
        1.0
    }

    /// Evaluates the fitted process at places; appends the logarithm per channel.
    pub fn evaluate(&self, places: &[Point], out: &mut Vec<[f32; 3]>) {
        self.arch.dispatch(Evaluate {
            solver: self,
            places,
            out,
        });
    }

    fn load<'a>(&mut self, nodes: impl ExactSizeIterator<Item = &'a Node>, padded: usize) {
        for buffer in self
            .axes
            .iter_mut()
            .chain(&mut self.log_values)
            .chain(&mut self.weights)
            .chain([&mut self.counts])
        {
            buffer.clear();
            buffer.resize(padded, 0.0);
        }
        for (row, node) in nodes.enumerate() {
            for k in 0..6 {
                self.axes[k][row] = node.point[k];
            }
            for c in 0..3 {
                self.log_values[c][row] = node.log_value[c];
            }
            self.counts[row] = node.count;
        }
    }

    fn fall_back_to_mean(&mut self, n: usize) {
        for c in 0..3 {
            self.mean[c] = self.log_values[c].iter().sum::<f32>() / n.max(1) as f32;
            self.weights[c].fill(0.0);
        }
    }
}

struct Fit<'a> {
    solver: &'a mut BlockSolver,
    n: usize,
    padded: usize,
    settings: &'a BlockSettings,
    nugget: Option<f32>,
}

impl WithSimd for Fit<'_> {
    /// The nugget used, or the one that failed.
    type Output = Result<f32, f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let (n, padded) = (self.n, self.padded);
        let s = self.solver;
        s.matrix.resize(padded, padded + PAD);
        let correlations = s.fill_matrix(simd, n, padded);
        let (variance, noise) = s.variances(n, self.settings);
        // Under the process, the expected variance of n values is σ_f² (1 − mean correlation) +
        // σ_n². Never believe that all is noise: a tenth of the variance is signal.
        let pairs = (n * (n - 1) / 2) as f32;
        let decorrelation = (1.0 - correlations / pairs).max(1e-6);
        let signal = (variance - noise).max(0.1 * variance).max(1e-12) / decorrelation;
        let nugget = self.nugget.unwrap_or_else(|| {
            (self.settings.noise_variance / signal).clamp(self.settings.nugget_min, 1.0)
        });
        for j in 0..n {
            s.matrix.column_mut(j)[j] = 1.0 + nugget / s.counts[j].max(1.0);
        }
        if !s.matrix.factor(simd, padded) {
            return Err(nugget);
        }
        s.solve_back(simd, n, padded);
        Ok(nugget)
    }
}

impl BlockSolver {
    /// The kernel matrix, padded by the unit matrix, with the right-hand sides below. Returns the
    /// sum of the correlations of all pairs.
    #[inline(always)]
    fn fill_matrix<S: Simd>(&mut self, simd: S, n: usize, padded: usize) -> f32 {
        let mut total = 0.0f32;
        for j in 0..n {
            let mut place = [simd.splat_f32s(0.0); 6];
            for k in 0..6 {
                place[k] = simd.splat_f32s(self.axes[k][j]);
            }
            let first = j / S::F32_LANES * S::F32_LANES;
            let column = self.matrix.column_mut(j);
            let (target, _) = S::as_mut_simd_f32s(&mut column[first..padded]);
            let axes = vectors::<S>(&self.axes, first..padded);
            let mut sum = simd.splat_f32s(0.0);
            for (r, t) in target.iter_mut().enumerate() {
                *t = kernel(simd, &place, &axes, r, self.scale);
                sum = simd.add_f32s(sum, *t);
            }
            // What the whole vectors hold too much: rows up to the diagonal, and the padding.
            let mut surplus = 0.0;
            for row in (first..=j).chain(n..padded) {
                surplus += column[row];
            }
            total += simd.reduce_sum_f32s(sum) - surplus;
            column[n..].fill(0.0);
            for c in 0..3 {
                column[padded + c] = self.log_values[c][j];
            }
            column[padded + 3] = 1.0;
        }
        for j in n..padded {
            let column = self.matrix.column_mut(j);
            column.fill(0.0);
            column[j] = 1.0;
        }
        total
    }

    /// Variance of the nodes' values, mean over the channels, and the share of it that is noise.
    fn variances(&self, n: usize, settings: &BlockSettings) -> (f32, f32) {
        let mut variance = 0.0;
        for values in &self.log_values {
            let (mut sum, mut squares) = (0.0f64, 0.0f64);
            for value in &values[..n] {
                sum += f64::from(*value);
                squares += f64::from(*value) * f64::from(*value);
            }
            variance += (squares - sum * sum / n as f64).max(0.0) / (3 * (n - 1)) as f64;
        }
        let per_sample: f32 = self.counts[..n].iter().map(|c| 1.0 / c.max(1.0)).sum();
        (
            variance as f32,
            settings.noise_variance * per_sample / n as f32,
        )
    }

    /// Mean and weights from the factor and `L⁻¹ b` in the extra rows.
    #[inline(always)]
    fn solve_back<S: Simd>(&mut self, simd: S, n: usize, padded: usize) {
        let mut with_ones = [0.0f32; RHS];
        for j in 0..n {
            let z = &self.matrix.column(j)[padded..padded + RHS];
            for k in 0..RHS {
                with_ones[k] += z[3] * z[k];
            }
        }
        for c in 0..3 {
            self.mean[c] = with_ones[c] / with_ones[3];
        }
        for j in (0..n).rev() {
            let column = self.matrix.column(j);
            // Weights of rows up to j are still zero, so a whole vector may hold them; what stands
            // above the diagonal of L is zero but for rounding.
            let first = (j + 1) / S::F32_LANES * S::F32_LANES;
            let (l, _) = S::as_simd_f32s(&column[first..padded]);
            let mut dots = [simd.splat_f32s(0.0); 3];
            for c in 0..3 {
                let (w, _) = S::as_simd_f32s(&self.weights[c][first..padded]);
                for (a, b) in l.iter().zip(w) {
                    dots[c] = simd.mul_add_e_f32s(*a, *b, dots[c]);
                }
            }
            let z = &column[padded..padded + RHS];
            let inverse = 1.0 / column[j];
            for c in 0..3 {
                let dot = simd.reduce_sum_f32s(dots[c]);
                self.weights[c][j] = (z[c] - self.mean[c] * z[3] - dot) * inverse;
            }
        }
    }
}

struct Evaluate<'a> {
    solver: &'a BlockSolver,
    places: &'a [Point],
    out: &'a mut Vec<[f32; 3]>,
}

impl WithSimd for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let s = self.solver;
        let axes = vectors::<S>(&s.axes, 0..s.axes[0].len());
        let weights = [
            S::as_simd_f32s(&s.weights[0]).0,
            S::as_simd_f32s(&s.weights[1]).0,
            S::as_simd_f32s(&s.weights[2]).0,
        ];
        for point in self.places {
            let mut place = [simd.splat_f32s(0.0); 6];
            for k in 0..6 {
                place[k] = simd.splat_f32s(point[k]);
            }
            let mut sums = [simd.splat_f32s(0.0); 3];
            for r in 0..axes[0].len() {
                let k = kernel(simd, &place, &axes, r, s.scale);
                for c in 0..3 {
                    sums[c] = simd.mul_add_e_f32s(k, weights[c][r], sums[c]);
                }
            }
            let mut result = s.mean;
            for c in 0..3 {
                result[c] += simd.reduce_sum_f32s(sums[c]);
            }
            self.out.push(result);
        }
    }
}

/// A range of the six axes as vectors. Spelt out, like all that is below `with_simd`: a closure
/// there would be compiled without the instruction set.
#[inline(always)]
fn vectors<S: Simd>(axes: &[Vec<f32>; 6], range: std::ops::Range<usize>) -> [&[S::f32s]; 6] {
    [
        S::as_simd_f32s(&axes[0][range.clone()]).0,
        S::as_simd_f32s(&axes[1][range.clone()]).0,
        S::as_simd_f32s(&axes[2][range.clone()]).0,
        S::as_simd_f32s(&axes[3][range.clone()]).0,
        S::as_simd_f32s(&axes[4][range.clone()]).0,
        S::as_simd_f32s(&axes[5][range]).0,
    ]
}

/// Matérn 3/2 of the distances from `place` to vector `r` of the axes, times `scale` (√3 over the
/// range).
#[inline(always)]
fn kernel<S: Simd>(
    simd: S,
    place: &[S::f32s; 6],
    axes: &[&[S::f32s]; 6],
    r: usize,
    scale: f32,
) -> S::f32s {
    let mut d2 = simd.splat_f32s(0.0);
    for k in 0..6 {
        let d = simd.sub_f32s(place[k], axes[k][r]);
        d2 = simd.mul_add_e_f32s(d, d, d2);
    }
    let s = simd.mul_f32s(simd.sqrt_f32s(d2), simd.splat_f32s(scale));
    let one = simd.splat_f32s(1.0);
    simd.mul_f32s(simd.add_f32s(one, s), exp_minus(simd, s))
}

/// `e^{−s}` for `0 ≤ s`: a Taylor polynomial of s/8, raised to the eighth. Accurate to 1e-6 for
/// s ≤ 4; the neighbourhood is smaller than the range, so s stays below 2. Beyond, it is cut off at
/// s = 8 and still positive and falling.
#[inline(always)]
fn exp_minus<S: Simd>(simd: S, s: S::f32s) -> S::f32s {
    let u = simd.mul_f32s(
        simd.min_f32s(s, simd.splat_f32s(8.0)),
        simd.splat_f32s(-0.125),
    );
    let mut p = simd.splat_f32s(1.0 / 5040.0);
    for coefficient in [
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        p = simd.mul_add_e_f32s(p, u, simd.splat_f32s(coefficient));
    }
    for _ in 0..3 {
        p = simd.mul_f32s(p, p);
    }
    p
}

const _: () = assert!(PAD.is_multiple_of(PANEL));

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: BlockSettings = BlockSettings {
        range: 8.0,
        noise_variance: 1e-6,
        nugget_min: 1e-4,
    };

    fn node(x: f32, y: f32, count: f32) -> Node {
        let v = (3.0 * x).sin() + 0.5 * y;
        Node {
            point: [x, y, 0.0, 0.0, 0.0, 0.0],
            log_value: [v, 2.0 * v, -v],
            count,
        }
    }

    fn scattered(n: usize) -> Vec<Node> {
        // The golden-ratio sequence fills the square evenly.
        (0..n)
            .map(|k| {
                let f = |a: f64| ((k as f64 * a) % 1.0) as f32 - 0.5;
                node(f(0.754_877_666), f(0.569_840_291), 1.0)
            })
            .collect()
    }

    fn at(solver: &BlockSolver, place: &Point) -> [f32; 3] {
        let mut out = Vec::new();
        solver.evaluate(&[*place], &mut out);
        out[0]
    }

    #[test]
    fn a_smooth_function_is_found_again_between_its_nodes() {
        for n in [48, 64, 185] {
            let nodes = scattered(n);
            let mut solver = BlockSolver::default();
            solver.fit(nodes.iter(), 0.7, &SETTINGS);
            for (x, y) in [(0.1, 0.2), (-0.3, 0.33), (0.0, 0.0)] {
                let truth = node(x, y, 1.0);
                let got = at(&solver, &truth.point);
                for c in 0..3 {
                    let off = (got[c] - truth.log_value[c]).abs();
                    assert!(off < 0.03, "{n} {x} {y} {c}: {off}");
                }
            }
        }
    }

    #[test]
    fn the_solution_satisfies_the_kriging_equations() {
        let nodes = scattered(50);
        let mut solver = BlockSolver::default();
        let nugget = f64::from(solver.fit(nodes.iter(), 0.7, &SETTINGS));
        let scale = 3f64.sqrt() / (8.0 * 0.7);
        let k = |a: &Node, b: &Node| {
            let s = (0..6)
                .map(|i| f64::from(a.point[i] - b.point[i]).powi(2))
                .sum::<f64>()
                .sqrt()
                * scale;
            (1.0 + s) * (-s).exp()
        };
        for c in 0..3 {
            // (K + λ I) w + μ = y, and the weights sum to zero.
            let total: f32 = solver.weights[c].iter().sum();
            let largest = solver.weights[c].iter().fold(0f32, |m, w| m.max(w.abs()));
            assert!(total.abs() < 2e-3 * largest, "{total} {largest}");
            for (i, a) in nodes.iter().enumerate() {
                let row: f64 = nodes
                    .iter()
                    .zip(&solver.weights[c])
                    .map(|(b, w)| k(a, b) * f64::from(*w))
                    .sum();
                let left =
                    row + nugget * f64::from(solver.weights[c][i]) + f64::from(solver.mean[c]);
                assert!((left - f64::from(a.log_value[c])).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn duplicates_a_single_node_and_none_give_finite_values() {
        let mut solver = BlockSolver::default();
        let same = vec![node(0.2, 0.1, 1.0); 40];
        solver.fit(same.iter(), 0.0, &SETTINGS);
        let value = at(&solver, &same[0].point);
        assert!((value[0] - same[0].log_value[0]).abs() < 1e-3, "{value:?}");
        solver.fit(same[..1].iter(), 0.0, &SETTINGS);
        let value = at(&solver, &[1.0; 6]);
        assert!((value[0] - same[0].log_value[0]).abs() < 1e-3, "{value:?}");
        solver.fit(same[..0].iter(), 0.0, &SETTINGS);
        assert!(at(&solver, &[1.0; 6]).iter().all(|v| v.is_finite()));
    }

    #[test]
    fn more_noise_means_a_larger_nugget_and_a_smoother_fit() {
        let nodes = scattered(100);
        let mut solver = BlockSolver::default();
        let quiet = solver.fit(nodes.iter(), 0.7, &SETTINGS);
        let noisy = BlockSettings {
            noise_variance: 0.4,
            ..SETTINGS
        };
        assert!(solver.fit(nodes.iter(), 0.7, &noisy) > 10.0 * quiet);
    }
}
