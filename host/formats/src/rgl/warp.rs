//! A density on the unit square, bilinear between its nodes, and the map that makes it uniform: the
//! marginal distribution along the second coordinate, then the conditional one along the first.

use gonia_brdf::Elementary;

/// Densities of many slices with the same nodes.
pub struct Densities {
    /// Nodes along the first coordinate and the second.
    size: [usize; 2],
    /// Of each slice, row by row (the second coordinate is slow); with a mean of one.
    values: Vec<f32>,
    /// Integral of each row from its first node to each, in cells.
    along: Vec<f64>,
    /// Integral over the rows from the first one to each, in cells; its last is the whole.
    across: Vec<f64>,
}

/// A slice and its share.
pub type Share = (usize, f64);

impl Densities {
    /// From slices of `size[0]` × `size[1]` values (at least two each way), none negative, none all
    /// zero. `None` where they are not so.
    pub fn new(size: [usize; 2], mut values: Vec<f32>) -> Option<Self> {
        let [width, height] = size;
        let is_density = values.iter().all(|v| *v >= 0.0 && v.is_finite());
        if width < 2 || height < 2 || !is_density || !values.len().is_multiple_of(width * height) {
            return None;
        }
        let mut all = Self {
            size,
            values: Vec::new(),
            along: Vec::with_capacity(values.len()),
            across: Vec::new(),
        };
        for slice in values.chunks_exact_mut(width * height) {
            let whole = all.integrate(slice)?;
            // The integral over the unit square becomes one.
            let scale = ((width - 1) * (height - 1)) as f64 / whole;
            slice
                .iter_mut()
                .for_each(|v| *v = (f64::from(*v) * scale) as f32);
            let (along, across) = (all.along.len(), all.across.len());
            all.along[along - width * height..]
                .iter_mut()
                .for_each(|v| *v *= scale);
            all.across[across - height..]
                .iter_mut()
                .for_each(|v| *v *= scale);
        }
        all.values = values;
        Some(all)
    }

    /// Appends the integrals of a slice; the whole, where that is more than zero.
    fn integrate(&mut self, slice: &[f32]) -> Option<f64> {
        let [width, _] = self.size;
        let (mut whole, mut before) = (0.0, None);
        for row in slice.chunks_exact(width) {
            let mut sum = 0.0;
            self.along.push(0.0);
            for pair in row.windows(2) {
                sum += 0.5 * (f64::from(pair[0]) + f64::from(pair[1]));
                self.along.push(sum);
            }
            whole += before.map_or(0.0, |before: f64| 0.5 * (before + sum));
            self.across.push(whole);
            before = Some(sum);
        }
        (whole > 0.0).then_some(whole)
    }

    /// Where a place goes on the square on which the density of mixed slices is uniform.
    pub fn to_uniform(&self, place: [f64; 2], shares: &[Share]) -> [f64; 2] {
        let [width, height] = self.size;
        let ([x, y], [u, v]) = self.cell(place);
        let node = |dx, dy| self.mixed(&self.values, [x + dx, y + dy], shares);
        let column = |dx| node(dx, 0) + v * (node(dx, 1) - node(dx, 0));
        let (a, b) = (column(0), column(1));
        let total = |dy| self.mixed64(&self.along, [width - 1, y + dy], shares);
        let (below, above) = (total(0), total(1));
        let here = below + v * (above - below);
        let start = |dy| self.mixed64(&self.along, [x, y + dy], shares);
        let start = start(0) + v * (start(1) - start(0));
        let first = (start + u * (a + 0.5 * u * (b - a))) / here.max(f64::MIN_POSITIVE);
        let across = |row: usize| -> f64 {
            let mix = |(slice, share): &Share| share * self.across[slice * height + row];
            shares.iter().map(mix).sum()
        };
        let second = (across(y) + v * (below + 0.5 * v * (above - below))) / across(height - 1);
        [first.clamp(0.0, 1.0), second.clamp(0.0, 1.0)]
    }

    /// The place that [`Self::to_uniform`] takes to `uniform`, of one slice.
    pub fn place_of(&self, uniform: [f64; 2], slice: usize) -> [f64; 2] {
        let [width, height] = self.size;
        let across = &self.across[slice * height..][..height];
        let wanted = uniform[1].clamp(0.0, 1.0) * across[height - 1];
        let y = across[1..height - 1].partition_point(|sum| *sum <= wanted);
        let row = |dy: usize| (slice * height + y + dy) * width;
        let total = |dy| self.along[row(dy) + width - 1];
        let v = part_of_cell(total(0), total(1), wanted - across[y]);
        let mixed = |of: &dyn Fn(usize) -> f64| of(row(0)) + v * (of(row(1)) - of(row(0)));
        let start = |x: usize| mixed(&|row| self.along[row + x]);
        let wanted = uniform[0].clamp(0.0, 1.0) * start(width - 1);
        let x = (1..width - 1).take_while(|x| start(*x) <= wanted).count();
        let node = |x: usize| mixed(&|row| f64::from(self.values[row + x]));
        let u = part_of_cell(node(x), node(x + 1), wanted - start(x));
        [
            (x as f64 + u) / (width - 1) as f64,
            (y as f64 + v) / (height - 1) as f64,
        ]
    }

    /// The density at a place of the unit square, of slices mixed.
    pub fn at(&self, place: [f64; 2], shares: &[Share]) -> f64 {
        let ([x, y], [u, v]) = self.cell(place);
        let row = |dy: usize| {
            let [a, b] = [0, 1].map(|dx| self.mixed(&self.values, [x + dx, y + dy], shares));
            a + u * (b - a)
        };
        row(0) + v * (row(1) - row(0))
    }

    /// The cell of a place, and where in it.
    fn cell(&self, place: [f64; 2]) -> ([usize; 2], [f64; 2]) {
        cell(self.size, place)
    }

    fn mixed(&self, values: &[f32], [x, y]: [usize; 2], shares: &[Share]) -> f64 {
        let [width, height] = self.size;
        let value =
            |(slice, share): &Share| share * f64::from(values[(slice * height + y) * width + x]);
        shares.iter().map(value).sum()
    }

    fn mixed64(&self, values: &[f64], [x, y]: [usize; 2], shares: &[Share]) -> f64 {
        let [width, height] = self.size;
        let value = |(slice, share): &Share| share * values[(slice * height + y) * width + x];
        shares.iter().map(value).sum()
    }
}

/// How far into a cell, whose density goes from `a` to `b`, its integral comes to `wanted`.
fn part_of_cell(a: f64, b: f64, wanted: f64) -> f64 {
    // The root of a·u + (b − a)·u²/2 = wanted, in the form that holds with b = a, too.
    let root = (a * a + 2.0 * (b - a) * wanted).max(0.0).sqrt();
    (2.0 * wanted / (a + root).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

/// The cell of a lattice in which a place of the unit square lies, and where in the cell.
pub fn cell(size: [usize; 2], place: [f64; 2]) -> ([usize; 2], [f64; 2]) {
    let scaled = [0, 1].map(|i| place[i].clamp(0.0, 1.0) * (size[i] - 1) as f64);
    let first = [0, 1].map(|i: usize| (scaled[i] as usize).min(size[i] - 2));
    (first, [0, 1].map(|i| scaled[i] - first[i] as f64))
}

/// Place of a polar angle on the unit interval: denser about the normal.
pub fn place_of_theta(theta: f64) -> f64 {
    (theta * std::f64::consts::FRAC_2_PI).max(0.0).sqrt()
}

/// The polar angle of such a place.
pub fn theta_of_place(place: f64) -> f64 {
    place * place * std::f64::consts::FRAC_PI_2
}

/// Place of an azimuth (radians, any turn) on the unit interval.
pub fn place_of_phi(x: f64, y: f64) -> f64 {
    let place = (y.arc_tangent2(x) + std::f64::consts::PI) / std::f64::consts::TAU;
    place - place.floor()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_density_is_how_the_uniform_square_is_stretched() {
        let values: Vec<f32> = (0..24).map(|k| 1.0 + ((k * 5) % 7) as f32).collect();
        let densities = Densities::new([4, 3], values).unwrap();
        let shares = [(0, 0.3), (1, 0.7)];
        let step = 1e-5;
        for place in [[0.2, 0.3], [0.5, 0.8], [0.9, 0.1]] {
            let to =
                |dx: f64, dy: f64| densities.to_uniform([place[0] + dx, place[1] + dy], &shares);
            let (o, x, y) = (to(0.0, 0.0), to(step, 0.0), to(0.0, step));
            let area = (x[0] - o[0]) * (y[1] - o[1]) - (x[1] - o[1]) * (y[0] - o[0]);
            let density = densities.at(place, &shares);
            assert!((area / (step * step) / density - 1.0).abs() < 1e-3);
        }
        assert_eq!(densities.to_uniform([1.0, 1.0], &shares), [1.0, 1.0]);
    }

    #[test]
    fn a_place_goes_there_and_back() {
        let values: Vec<f32> = (0..24).map(|k| ((k * 5) % 7) as f32).collect();
        let densities = Densities::new([4, 3], values).unwrap();
        for slice in 0..2 {
            for place in [[0.0, 0.0], [0.2, 0.3], [0.5, 0.8], [0.9, 0.1], [1.0, 1.0]] {
                let there = densities.to_uniform(place, &[(slice, 1.0)]);
                let back = densities.place_of(there, slice);
                for (a, b) in place.iter().zip(back) {
                    assert!((a - b).abs() < 1e-7, "{place:?} {back:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_density_is_refused() {
        assert!(Densities::new([2, 2], vec![0.0; 4]).is_none());
        assert!(Densities::new([2, 2], vec![1.0, -1.0, 1.0, 1.0]).is_none());
        assert!(Densities::new([1, 4], vec![1.0; 4]).is_none());
        assert!(Densities::new([2, 2], vec![1.0; 5]).is_none());
    }
}
