//! A table as a BRDF of any two directions.

use crate::shade::{Rows, shade};
use gonia_brdf::direction::Vec3;
use gonia_brdf::model::shading::{Light, TangentFrame};
use gonia_brdf::{Brdf, DenseBrdf, Direction};

/// A dense BRDF looked up between its nodes, times a factor.
#[derive(Clone, Copy, Debug)]
pub struct Tabulated<'a> {
    dense: &'a DenseBrdf,
    factor: f64,
    is_reciprocal: bool,
}

/// About how many cells reciprocity is looked at.
const PROBES: usize = 1000;
/// Differences below this share are rounding, as in the table of a reciprocal model.
const ROUNDING: f32 = 1e-5;

impl<'a> Tabulated<'a> {
    /// The table as it is.
    pub fn new(dense: &'a DenseBrdf) -> Self {
        Self::scaled(dense, 1.0)
    }

    /// The table times a factor, to bring a relative one to another's scale.
    pub fn scaled(dense: &'a DenseBrdf, factor: f64) -> Self {
        let grid = dense.grid();
        // Odd, so that they spread over rows and columns.
        let stride = (grid.n_cells() / PROBES) | 1;
        let is_reciprocal = (0..grid.n_cells()).step_by(stride).all(|cell| {
            let (light, view) = grid.light_and_view(cell);
            let (there, back) = (dense.at(light, view), dense.at(view, light));
            (0..3).all(|c| (there[c] - back[c]).abs() <= ROUNDING * there[c].abs())
        });
        Self {
            dense,
            factor,
            is_reciprocal,
        }
    }
}

impl Brdf for Tabulated<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        self.dense
            .lookup(Direction::from_vec3(light), Direction::from_vec3(view))
            .map(|value| self.factor * f64::from(value))
    }

    /// What pictures are made of. Of a reciprocal table the view is taken as the row, so that all of a
    /// point's values are near each other in memory.
    fn shade(&self, points: &[TangentFrame], lights: &[Light], viewer: Vec3) -> Vec<[f32; 3]> {
        let rows = if self.is_reciprocal {
            Rows::View
        } else {
            Rows::Light
        };
        let factor = self.factor as f32;
        shade(self.dense, rows, factor, points, lights, viewer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Elementary;
    use gonia_brdf::Grid;
    use gonia_brdf::model::shading::shade_one_by_one;

    #[test]
    fn light_and_view_are_told_apart_where_it_matters() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let n = grid.n_directions();
        let plane: Vec<f32> = (0..grid.n_cells()).map(|c| (c / n) as f32).collect();
        let skewed = DenseBrdf::new(grid, [plane.clone(), plane.clone(), plane]).unwrap();
        let at = |k| grid.direction(k).to_vec3();
        let table = Tabulated::scaled(&skewed, 2.0);
        assert!((table.eval(at(14), at(27))[0] - 28.0).abs() < 1e-3);
        let sum: Vec<f32> = (0..grid.n_cells())
            .map(|c| (c / n + c % n) as f32)
            .collect();
        let even = DenseBrdf::new(grid, [sum.clone(), sum.clone(), sum]).unwrap();
        assert!(Tabulated::new(&even).is_reciprocal && !table.is_reciprocal);
        assert!((Tabulated::new(&even).eval(at(14), at(27))[0] - 41.0).abs() < 1e-3);
    }

    /// A table with noise between neighbours, so that a wrong node shows; not reciprocal.
    fn rough(grid: Grid) -> DenseBrdf {
        let n = grid.n_directions();
        let value = |i: usize, v: usize, c: usize| 1.0 + ((i * 7 + v * 13 + c) % 11) as f32 / 11.0;
        DenseBrdf::from_fn(grid, |i, v| {
            // A pole is one direction.
            let [i, v] = [i, v].map(|node| if node < n / grid.n_theta() { 0 } else { node });
            [0, 1, 2].map(|c| value(i, v, c))
        })
    }

    #[test]
    fn points_shaded_together_are_those_shaded_one_by_one() {
        let grid = Grid::with_step_deg(6.0).unwrap();
        let skewed = rough(grid);
        let even = DenseBrdf::from_fn(grid, |i, v| skewed.at(i.min(v), i.max(v)));
        let at = |t: f64, p: f64| Direction::from_deg(t, p).to_vec3();
        // Six points near each other, at a hundred places.
        let points: Vec<TangentFrame> = (0..600)
            .map(|k| {
                let (place, beside) = (k / 6, f64::from(k % 6));
                let t = f64::from(place % 60) * 1.7 + 0.1 * beside;
                let p = f64::from(place) * 77.7 + 0.2 * beside;
                // A frame turned by p about its normal, which leans by t towards x.
                let (lean, across) = (t.to_radians().sine_cosine(), p.to_radians().sine_cosine());
                let down = [lean.1, 0.0, -lean.0];
                let mix = |a: f64, b: f64| [a * down[0], b, a * down[2]];
                TangentFrame {
                    tangent: mix(across.1, across.0),
                    bitangent: mix(-across.0, across.1),
                    normal: [lean.0, 0.0, lean.1],
                }
            })
            .collect();
        let lights: Vec<Light> = (0..50)
            .map(|k| Light {
                towards: at(f64::from(k) * 2.3, f64::from(k) * 47.7),
                irradiance: [1.0, 0.5, 2.0],
            })
            .collect();
        let viewer = [0.0, 0.0, 1.0];
        // Many lights, for which rows are gathered, and few.
        let many = lights.repeat(20);
        for (dense, lights) in [
            (&skewed, &many),
            (&even, &many),
            (&skewed, &lights),
            (&even, &lights),
        ] {
            let table = Tabulated::scaled(dense, 1.5);
            let together = table.shade(&points, lights, viewer);
            let each = shade_one_by_one(&table, &points, lights, viewer);
            for (k, (a, b)) in together.iter().zip(&each).enumerate() {
                for c in 0..3 {
                    assert!((a[c] - b[c]).abs() <= 1e-4 * b[c], "{k}: {a:?} {b:?}");
                }
            }
            assert!(each.iter().filter(|rgb| rgb[0] == 0.0).count() > 20);
        }
    }
}
