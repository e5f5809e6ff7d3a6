//! Sums over cells, and the figures made of them.

use gonia_rig::stratum::StratumBits;
use gonia_rig::{Stratum, StratumFigures};

/// Sums of the cells that lie in exactly the same strata; a stratum is the sum of its classes.
/// So a cell is added once, however many strata it is in.
#[derive(Default)]
pub(super) struct Sums {
    classes: Vec<Option<Box<Class>>>,
    /// Values of a and of b that no logarithm could be taken of.
    pub floored: [u64; 2],
}

/// What one cell contributes.
pub(super) struct Cell {
    /// ln(a/b) per channel.
    pub log: [f32; 3],
    /// |a − b|·cosθi·cosθv per channel.
    pub cos_error: [f32; 3],
    /// b·cosθi·cosθv, summed over the channels.
    pub cos_value: f32,
    /// ln(a(i, v)/a(v, i)) squared, summed over the channels.
    pub reciprocity_a: f32,
    /// The same of b.
    pub reciprocity_b: f32,
    /// ΔE2000, for the share of cells where it is taken.
    pub delta_e: Option<f32>,
}

struct Class {
    cells: u64,
    log: f64,
    log_squared: f64,
    cos_error: f64,
    cos_value: f64,
    reciprocity_a: f64,
    reciprocity_b: f64,
    delta_e: f64,
    delta_e_cells: u64,
    /// Counts of cosine-weighted errors by the first bits of their f32: 64 classes an octave.
    errors: Vec<u64>,
}

/// Bits of an f32 that do not count for its class.
const CLASS_SHIFT: u32 = 17;
/// Classes of all finite positive numbers.
const ERROR_CLASSES: usize = 0x7f80_0000 >> CLASS_SHIFT;

impl Class {
    fn new() -> Self {
        Self {
            cells: 0,
            log: 0.0,
            log_squared: 0.0,
            cos_error: 0.0,
            cos_value: 0.0,
            reciprocity_a: 0.0,
            reciprocity_b: 0.0,
            delta_e: 0.0,
            delta_e_cells: 0,
            errors: vec![0; ERROR_CLASSES],
        }
    }

    fn add(&mut self, cell: &Cell) {
        self.cells += 1;
        for c in 0..3 {
            let log = f64::from(cell.log[c]);
            self.log += log;
            self.log_squared += log * log;
            self.cos_error += f64::from(cell.cos_error[c]);
            let class = (cell.cos_error[c].to_bits() >> CLASS_SHIFT) as usize;
            self.errors[class.min(ERROR_CLASSES - 1)] += 1;
        }
        self.cos_value += f64::from(cell.cos_value);
        self.reciprocity_a += f64::from(cell.reciprocity_a);
        self.reciprocity_b += f64::from(cell.reciprocity_b);
        if let Some(delta_e) = cell.delta_e {
            self.delta_e += f64::from(delta_e);
            self.delta_e_cells += 1;
        }
    }

    fn merge(&mut self, other: &Class) {
        self.cells += other.cells;
        self.log += other.log;
        self.log_squared += other.log_squared;
        self.cos_error += other.cos_error;
        self.cos_value += other.cos_value;
        self.reciprocity_a += other.reciprocity_a;
        self.reciprocity_b += other.reciprocity_b;
        self.delta_e += other.delta_e;
        self.delta_e_cells += other.delta_e_cells;
        for (a, b) in self.errors.iter_mut().zip(&other.errors) {
            *a += b;
        }
    }
}

impl Sums {
    /// Adds a cell that lies in these strata.
    pub fn add(&mut self, strata: StratumBits, cell: &Cell) {
        self.class(strata).add(cell);
    }

    /// Adds the sums of another part of the cells.
    pub fn merge(mut self, other: Sums) -> Sums {
        for (strata, class) in other.classes.into_iter().enumerate() {
            if let Some(class) = class {
                self.class(strata as StratumBits).merge(&class);
            }
        }
        self.floored[0] += other.floored[0];
        self.floored[1] += other.floored[1];
        self
    }

    /// The number of cells, and of those whose ΔE was taken.
    pub fn counts(&self) -> (u64, u64) {
        let classes = self.classes.iter().flatten();
        classes.fold((0, 0), |(cells, colour), class| {
            (cells + class.cells, colour + class.delta_e_cells)
        })
    }

    /// The figures of a stratum, `None` without a cell.
    pub fn figures(&self, stratum: Stratum, b_is_table: bool) -> Option<StratumFigures> {
        let mut sum = Class::new();
        for (strata, class) in self.classes.iter().enumerate() {
            if let Some(class) = class
                && strata >> (stratum as usize) & 1 == 1
            {
                sum.merge(class);
            }
        }
        if sum.cells == 0 {
            return None;
        }
        let values = 3.0 * sum.cells as f64;
        let mean_value = sum.cos_value / values;
        Some(StratumFigures {
            stratum,
            cells: sum.cells,
            log_rms: (sum.log_squared / values).sqrt(),
            log_mean: sum.log / values,
            cos_error_mean: sum.cos_error / values / mean_value,
            cos_error_p99: percentile(&sum.errors, 0.99) / mean_value,
            delta_e: (sum.delta_e_cells > 0).then(|| sum.delta_e / sum.delta_e_cells as f64),
            reciprocity_a: (sum.reciprocity_a / values).sqrt(),
            reciprocity_b: b_is_table.then(|| (sum.reciprocity_b / values).sqrt()),
        })
    }

    fn class(&mut self, strata: StratumBits) -> &mut Class {
        let strata = usize::from(strata);
        if self.classes.len() <= strata {
            self.classes.resize_with(strata + 1, || None);
        }
        self.classes[strata].get_or_insert_with(|| Box::new(Class::new()))
    }
}

/// The value below which a share of the counted errors lies, linear within its class.
fn percentile(counts: &[u64], share: f64) -> f64 {
    let target = share * counts.iter().sum::<u64>() as f64;
    let mut below = 0.0;
    for (class, count) in counts.iter().enumerate() {
        let count = *count as f64;
        if count > 0.0 && below + count >= target {
            let edge = |class: usize| f64::from(f32::from_bits((class as u32) << CLASS_SHIFT));
            let (from, to) = (edge(class), edge(class + 1).min(f64::from(f32::MAX)));
            return from + (to - from) * (target - below) / count;
        }
        below += count;
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(error: f32) -> Cell {
        Cell {
            log: [0.1, -0.1, 0.2],
            cos_error: [error; 3],
            cos_value: 6.0,
            reciprocity_a: 0.03,
            reciprocity_b: 0.0,
            delta_e: (error > 0.5).then_some(2.0),
        }
    }

    #[test]
    fn a_stratum_is_the_sum_of_its_classes() {
        let all = 1 << (Stratum::All as u8);
        let interior = all | 1 << (Stratum::Interior as u8);
        let mut first = Sums::default();
        let mut second = Sums::default();
        for k in 0..1000 {
            let sums = if k % 2 == 0 { &mut first } else { &mut second };
            sums.add(
                if k < 250 { interior } else { all },
                &cell(k as f32 / 1000.0),
            );
        }
        let sums = first.merge(second);
        assert_eq!(sums.counts(), (1000, 499));
        let whole = sums.figures(Stratum::All, false).unwrap();
        assert_eq!(
            (whole.cells, whole.delta_e, whole.reciprocity_b),
            (1000, Some(2.0), None)
        );
        assert!((whole.log_rms - 0.02f64.sqrt()).abs() < 1e-6);
        assert!((whole.cos_error_mean - 0.4995 / 2.0).abs() < 1e-6);
        assert!((whole.cos_error_p99 - 0.99 / 2.0).abs() < 2e-3);
        assert!((whole.reciprocity_a - 0.1).abs() < 1e-6);
        let part = sums.figures(Stratum::Interior, true).unwrap();
        assert_eq!(
            (part.cells, part.delta_e, part.reciprocity_b),
            (250, None, Some(0.0))
        );
        assert!((part.cos_error_p99 - 0.2475 / 2.0).abs() < 2e-3);
        assert_eq!(sums.figures(Stratum::Unmeasured, false), None);
    }
}
