//! A slice through the bins as it grows: light and view go round at one polar angle each.

use gonia_brdf::{Grid, Pose};
use gonia_render::{png, tone};
use std::collections::VecDeque;

/// Of the polar angles of a plan the slice is at those nearest to this, degrees.
const LIKED_DEG: f64 = 30.0;
/// An empty bin shows the nearest filled one within this many bins, dimmed.
const REACH: i32 = 8;
const DIMMED: u8 = 130;
/// The brightest bins that may be clipped, as a share.
const CLIPPED: f64 = 0.02;

/// Mean values of the bins of one pair of polar angles.
#[derive(Clone)]
pub struct Slice {
    grid: Grid,
    /// The polar angles' places in the grid.
    rings: [usize; 2],
    sums: Vec<[f32; 3]>,
    counts: Vec<u32>,
}

impl Slice {
    /// The slice that a plan is likely to fill.
    pub fn of_plan(grid: Grid, plan: &[Pose]) -> Self {
        let nearest = |theta_deg: &dyn Fn(&Pose) -> f64| {
            let liked = plan
                .iter()
                .map(theta_deg)
                .min_by(|a, b| (a - LIKED_DEG).abs().total_cmp(&(b - LIKED_DEG).abs()))
                .unwrap_or(LIKED_DEG);
            // Not the pole, which is one bin.
            ((liked / grid.step_deg()).round() as usize).clamp(1, grid.n_theta() - 1)
        };
        let n = grid.n_phi() * grid.n_phi();
        Self {
            grid,
            rings: [
                nearest(&|pose| pose.light.theta_deg()),
                nearest(&|pose| pose.view.theta_deg()),
            ],
            sums: vec![[0.0; 3]; n],
            counts: vec![0; n],
        }
    }

    /// Polar angles of light and view, degrees.
    pub fn theta_deg(&self) -> [f64; 2] {
        self.rings.map(|ring| ring as f64 * self.grid.step_deg())
    }

    /// Takes in a sample at two direction indices of the grid. Whether it lies in the slice.
    pub fn add(&mut self, light: usize, view: usize, rgb: [f32; 3]) -> bool {
        let n = self.grid.n_phi();
        if [light / n, view / n] != self.rings || !rgb.iter().all(|v| v.is_finite()) {
            return false;
        }
        let at = (light % n) * n + view % n;
        for c in 0..3 {
            self.sums[at][c] += rgb[c];
        }
        self.counts[at] += 1;
        true
    }

    /// Share of its bins that are filled.
    pub fn filled(&self) -> f64 {
        let filled = self.counts.iter().filter(|n| **n > 0).count();
        filled as f64 / self.counts.len() as f64
    }

    /// A picture: φ of the light upwards, φ of the view to the right. What nothing is known of is
    /// transparent.
    pub fn png(&self) -> Vec<u8> {
        let n = self.grid.n_phi();
        let exposure = self.exposure();
        let nearest = self.nearest();
        let mut pixels = Vec::with_capacity(n * n);
        for row in (0..n).rev() {
            for column in 0..n {
                let at = row * n + column;
                pixels.push(match nearest[at] {
                    None => [0; 4],
                    Some(from) => {
                        let [r, g, b] = tone::rgb8(self.mean(from), exposure);
                        [r, g, b, if from == at { 255 } else { DIMMED }]
                    }
                });
            }
        }
        png::rgba(&pixels, n, n)
    }

    fn mean(&self, at: usize) -> [f32; 3] {
        self.sums[at].map(|v| v / self.counts[at] as f32)
    }

    fn exposure(&self) -> f32 {
        let filled = (0..self.counts.len()).filter(|at| self.counts[*at] > 0);
        let mut values: Vec<f32> = filled
            .map(|at| self.mean(at).iter().copied().fold(0.0, f32::max))
            .collect();
        if values.is_empty() {
            return 1.0;
        }
        let place = ((1.0 - CLIPPED) * (values.len() - 1) as f64) as usize;
        let white = *values.select_nth_unstable_by(place, f32::total_cmp).1;
        if white > 0.0 { 1.0 / white } else { 1.0 }
    }

    /// For each bin the nearest filled one (in steps to its four neighbours), if it is near. Both
    /// azimuths go round.
    fn nearest(&self) -> Vec<Option<usize>> {
        let n = self.grid.n_phi();
        let mut nearest = vec![None; n * n];
        let mut front = VecDeque::new();
        for at in 0..n * n {
            if self.counts[at] > 0 {
                nearest[at] = Some(at);
                front.push_back((at, 0));
            }
        }
        while let Some((at, steps)) = front.pop_front() {
            if steps == REACH {
                continue;
            }
            let (row, column) = (at / n, at % n);
            let neighbours = [
                (row + 1) % n * n + column,
                (row + n - 1) % n * n + column,
                row * n + (column + 1) % n,
                row * n + (column + n - 1) % n,
            ];
            for to in neighbours {
                if nearest[to].is_none() {
                    nearest[to] = nearest[at];
                    front.push_back((to, steps + 1));
                }
            }
        }
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;

    fn slice() -> Slice {
        let pose = |i, v| Pose {
            light: Direction::from_deg(i, 10.0),
            view: Direction::from_deg(v, 0.0),
        };
        Slice::of_plan(Grid::PAPER, &[pose(0.0, 75.0), pose(45.0, 60.0)])
    }

    #[test]
    fn a_plan_has_its_slice_and_only_samples_of_it_fill_it() {
        let mut slice = slice();
        assert_eq!(slice.theta_deg(), [46.0, 60.0]);
        let at = |theta, phi| Grid::PAPER.nearest(theta, phi).unwrap();
        assert!(!slice.add(at(44.0, 0.0), at(60.0, 0.0), [1.0; 3]));
        assert!(!slice.add(at(46.0, 0.0), at(60.0, 0.0), [f32::NAN; 3]));
        assert_eq!(slice.filled(), 0.0);
        assert!(slice.add(at(46.0, 2.0), at(60.0, 0.0), [1.0, 2.0, 3.0]));
        assert!(slice.add(at(46.0, 2.0), at(60.0, 0.0), [3.0, 2.0, 1.0]));
        assert!((slice.filled() - 1.0 / 32_400.0).abs() < 1e-12);
        assert_eq!(slice.mean(180), [2.0; 3]);
    }

    #[test]
    fn an_empty_bin_shows_its_nearest_neighbour_also_round_the_circle() {
        let mut slice = slice();
        let at = |theta, phi| Grid::PAPER.nearest(theta, phi).unwrap();
        slice.add(at(46.0, 358.0), at(60.0, 0.0), [1.0; 3]);
        let nearest = slice.nearest();
        let from = Some(179 * 180);
        assert_eq!(nearest[179 * 180], from);
        // One step up over the end, three to the left over the beginning.
        assert_eq!(nearest[177], from);
        assert_eq!(nearest[90 * 180 + 90], None);
        let reached = nearest.iter().flatten().count();
        // The bins within eight steps: 1 + 4·(1 + … + 8).
        assert_eq!(reached, 145);
    }
}
