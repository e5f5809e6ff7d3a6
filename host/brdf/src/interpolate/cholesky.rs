//! Cholesky factorisation of one small matrix in single precision, for any SIMD width.

use pulp::Simd;

/// Columns are factored this many at a time.
pub const PANEL: usize = 4;

/// A symmetric matrix of `n` columns with extra rows below, column by column. Column `j` holds
/// rows `0..rows`; only rows `≥ j` count. The extra rows (`n..rows`) are right-hand sides, and
/// leave the factorisation as `L⁻¹ b`: forward substitution costs nothing of its own.
#[derive(Default)]
pub struct Columns {
    data: Vec<f32>,
    rows: usize,
}

impl Columns {
    /// Makes room for `n` columns of `rows` rows each; what is inside is unspecified. Both are to be
    /// multiples of the SIMD width and of [`PANEL`].
    pub fn resize(&mut self, n: usize, rows: usize) {
        self.rows = rows;
        self.data.resize(n * rows, 0.0);
    }

    /// Column `j`.
    #[inline(always)]
    pub fn column(&self, j: usize) -> &[f32] {
        &self.data[j * self.rows..(j + 1) * self.rows]
    }

    /// Column `j`, to be written.
    #[inline(always)]
    pub fn column_mut(&mut self, j: usize) -> &mut [f32] {
        &mut self.data[j * self.rows..(j + 1) * self.rows]
    }

    /// Replaces the matrix in the first `n` rows by its factor L, and each extra row by `L⁻¹ b`.
    /// `false` when a pivot is not positive: the matrix is not positive definite in single
    /// precision, and its contents are spoilt.
    #[inline(always)]
    pub fn factor<S: Simd>(&mut self, simd: S, n: usize) -> bool {
        let rows = self.rows;
        for j in (0..n).step_by(PANEL) {
            let (done, panel) = self.data.split_at_mut(j * rows);
            let panel = &mut panel[..PANEL * rows];
            let first = j / S::F32_LANES * S::F32_LANES;
            update(simd, done, panel, rows, j, first);
            if !factor_panel(simd, panel, rows, j, first) {
                return false;
            }
        }
        true
    }

    /// `L⁻¹ b` of a factor's first `n` rows for `P` vectors of right-hand sides, which stand row by row in `b` and are
    /// replaced. `R` rows at a time take what the rows above give them while their sums stay in registers: `n` is to be a
    /// multiple of it.
    #[inline(always)]
    pub fn solve<S: Simd, const R: usize, const P: usize>(
        &self,
        simd: S,
        n: usize,
        b: &mut [[S::f32s; P]],
    ) {
        let zero = simd.splat_f32s(0.0);
        for i in (0..n).step_by(R) {
            let (above, rest) = b.split_at_mut(i);
            let panel = &mut rest[..R];
            let mut sums = [[zero; P]; R];
            for (column, x) in self.data.chunks_exact(self.rows).zip(above.iter()) {
                let l = &column[i..i + R];
                for r in 0..R {
                    let l = simd.splat_f32s(l[r]);
                    for p in 0..P {
                        sums[r][p] = simd.mul_add_e_f32s(l, x[p], sums[r][p]);
                    }
                }
            }
            for r in 0..R {
                for c in 0..r {
                    let l = simd.splat_f32s(self.column(i + c)[i + r]);
                    for p in 0..P {
                        sums[r][p] = simd.mul_add_e_f32s(l, panel[c][p], sums[r][p]);
                    }
                }
                let inverse = simd.splat_f32s(1.0 / self.column(i + r)[i + r]);
                for p in 0..P {
                    let left = simd.sub_f32s(panel[r][p], sums[r][p]);
                    panel[r][p] = simd.mul_f32s(left, inverse);
                }
            }
        }
    }
}

/// `panel −= L[.., ..j] · L[j..j+4, ..j]ᵀ` in rows `first..`.
#[inline(always)]
fn update<S: Simd>(simd: S, done: &[f32], panel: &mut [f32], rows: usize, j: usize, first: usize) {
    let lanes = S::F32_LANES;
    // Of 32 registers (vectors of 16) four strips of four columns take 16; of 16, three take 12.
    let most = if lanes >= 16 { 4 } else { 3 };
    let mut row = first;
    while row < rows {
        // Strips of even heights: one alone would wait for each of its products.
        let left = (rows - row) / lanes;
        let strips = left.div_ceil(left.div_ceil(most));
        match strips {
            4 => update_strip::<S, 4>(simd, done, panel, rows, j, row),
            3 => update_strip::<S, 3>(simd, done, panel, rows, j, row),
            2 => update_strip::<S, 2>(simd, done, panel, rows, j, row),
            _ => update_strip::<S, 1>(simd, done, panel, rows, j, row),
        }
        row += strips * lanes;
    }
}

/// The same in `R` vectors of rows from `row`: 4 R accumulators stay in registers.
#[inline(always)]
fn update_strip<S: Simd, const R: usize>(
    simd: S,
    done: &[f32],
    panel: &mut [f32],
    rows: usize,
    j: usize,
    row: usize,
) {
    let lanes = S::F32_LANES;
    let mut acc = [[simd.splat_f32s(0.0); R]; PANEL];
    for column in done.chunks_exact(rows) {
        let (strip, _) = S::as_simd_f32s(&column[row..row + R * lanes]);
        let pivots = &column[j..j + PANEL];
        for c in 0..PANEL {
            let pivot = simd.splat_f32s(pivots[c]);
            for r in 0..R {
                acc[c][r] = simd.mul_add_e_f32s(strip[r], pivot, acc[c][r]);
            }
        }
    }
    for c in 0..PANEL {
        let at = c * rows + row;
        let (target, _) = S::as_mut_simd_f32s(&mut panel[at..at + R * lanes]);
        for r in 0..R {
            target[r] = simd.sub_f32s(target[r], acc[c][r]);
        }
    }
}

/// Factors the panel's own four columns.
#[inline(always)]
fn factor_panel<S: Simd>(simd: S, panel: &mut [f32], rows: usize, j: usize, first: usize) -> bool {
    for c in 0..PANEL {
        let (left, right) = panel.split_at_mut(c * rows);
        let column = &mut right[..rows];
        for done in left.chunks_exact(rows) {
            let pivot = simd.splat_f32s(-done[j + c]);
            let (source, _) = S::as_simd_f32s(&done[first..]);
            let (target, _) = S::as_mut_simd_f32s(&mut column[first..]);
            for (t, s) in target.iter_mut().zip(source) {
                *t = simd.mul_add_e_f32s(*s, pivot, *t);
            }
        }
        let diagonal = column[j + c];
        if diagonal.is_nan() || diagonal <= 0.0 {
            return false;
        }
        let scale = simd.splat_f32s(1.0 / diagonal.sqrt());
        let (target, _) = S::as_mut_simd_f32s(&mut column[first..]);
        for t in target {
            *t = simd.mul_f32s(*t, scale);
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elementary::Elementary;
    use pulp::{Arch, WithSimd};

    struct Factor<'a>(&'a mut Columns, usize);
    impl WithSimd for Factor<'_> {
        type Output = bool;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> bool {
            self.0.factor(simd, self.1)
        }
    }

    fn matrix(n: usize, diagonal: f32) -> Columns {
        let mut m = Columns::default();
        m.resize(n, n + 16);
        for j in 0..n {
            for i in 0..n {
                let d = (i as f32 - j as f32).abs() / n as f32;
                m.column_mut(j)[i] = (-d).exponential() + if i == j { diagonal } else { 0.0 };
            }
            for extra in 0..16 {
                m.column_mut(j)[n + extra] = ((j + extra) % 7) as f32;
            }
        }
        m
    }

    #[test]
    fn the_factor_multiplies_back_to_the_matrix_and_solves_the_extra_rows() {
        for n in [16, 48, 192] {
            let original = matrix(n, 0.1);
            let mut l = matrix(n, 0.1);
            assert!(Arch::new().dispatch(Factor(&mut l, n)));
            for i in 0..n {
                for j in 0..=i {
                    let product: f64 = (0..=j)
                        .map(|k| f64::from(l.column(k)[i]) * f64::from(l.column(k)[j]))
                        .sum();
                    assert!((product - f64::from(original.column(j)[i])).abs() < 1e-5);
                }
                // Row i of L times the solved right-hand side is the right-hand side.
                let b: f64 = (0..=i)
                    .map(|k| f64::from(l.column(k)[i]) * f64::from(l.column(k)[n + 3]))
                    .sum();
                assert!((b - f64::from(original.column(i)[n + 3])).abs() < 1e-3);
            }
        }
    }

    struct Solve<'a>(&'a Columns, usize, &'a mut [f32]);
    impl WithSimd for Solve<'_> {
        type Output = usize;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> usize {
            let (vectors, _) = S::as_mut_simd_f32s(self.2);
            let (pairs, _) = vectors.as_chunks_mut::<2>();
            self.0.solve::<S, 4, 2>(simd, self.1, pairs);
            2 * S::F32_LANES
        }
    }

    #[test]
    fn many_right_hand_sides_are_solved_as_the_extra_rows_are() {
        for n in [16, 96] {
            let mut l = matrix(n, 0.1);
            assert!(Arch::new().dispatch(Factor(&mut l, n)));
            for simd in [true, false] {
                let mut b = vec![0.0; 32 * n];
                let lanes = match simd {
                    true => Arch::new().dispatch(Solve(&l, 0, &mut [])),
                    false => Solve(&l, 0, &mut []).with_simd(pulp::Scalar),
                };
                for j in 0..n {
                    for lane in 0..lanes {
                        b[j * lanes + lane] = ((j + lane % 16) % 7) as f32;
                    }
                }
                let b = &mut b[..n * lanes];
                match simd {
                    true => Arch::new().dispatch(Solve(&l, n, b)),
                    false => Solve(&l, n, b).with_simd(pulp::Scalar),
                };
                for j in 0..n {
                    for lane in 0..lanes {
                        let (x, y) = (b[j * lanes + lane], l.column(j)[n + lane % 16]);
                        assert!(
                            (x - y).abs() < 1e-4 * y.abs().max(1.0),
                            "{j} {lane}: {x} {y}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_factor() {
        let n = 48;
        let (mut a, mut b) = (matrix(n, 0.1), matrix(n, 0.1));
        assert!(Arch::new().dispatch(Factor(&mut a, n)));
        assert!(Factor(&mut b, n).with_simd(pulp::Scalar));
        for j in 0..n {
            for i in j..n + 16 {
                let (x, y) = (a.column(j)[i], b.column(j)[i]);
                assert!((x - y).abs() < 1e-4 * y.abs().max(1.0), "{i} {j}: {x} {y}");
            }
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused() {
        let mut m = matrix(16, -0.9);
        assert!(!Arch::new().dispatch(Factor(&mut m, 16)));
        let mut m = matrix(16, f32::NAN);
        assert!(!Arch::new().dispatch(Factor(&mut m, 16)));
    }
}
