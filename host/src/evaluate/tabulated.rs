//! A table as a BRDF of any two directions.

use gonia_brdf::direction::Vec3;
use gonia_brdf::{Brdf, DenseBrdf, Direction, Grid};

/// A dense BRDF looked up between its nodes, times a factor.
#[derive(Clone, Copy, Debug)]
pub struct Tabulated<'a> {
    dense: &'a DenseBrdf,
    factor: f64,
    is_reciprocal: bool,
}

/// About how many cells reciprocity is looked at.
const PROBES: usize = 1000;

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
            dense.at(light, view) == dense.at(view, light)
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

    /// What pictures are made of: hundreds of lights a point. Of a reciprocal table the view is taken
    /// as the row, so that all of a point's values are near each other in memory.
    fn radiance(&self, lights: &[(Vec3, [f64; 3])], view: Vec3) -> [f64; 3] {
        let mut sum = [0.0; 3];
        if !self.is_reciprocal {
            for (light, irradiance) in lights {
                let f = self.eval(*light, view);
                for c in 0..3 {
                    sum[c] += f[c] * irradiance[c];
                }
            }
            return sum;
        }
        let grid = self.dense.grid();
        let n = grid.n_directions();
        let rows = grid
            .corners(Direction::from_vec3(view))
            .map(|(row, weight)| {
                let planes = self.dense.planes();
                let cells = row * n..(row + 1) * n;
                let row = [0, 1, 2].map(|c| &planes[c][cells.clone()]);
                (row, weight as f32)
            });
        for (light, irradiance) in lights {
            let mut f = [0.0f32; 3];
            for (column, weight) in corners(grid, *light) {
                for (row, share) in &rows {
                    let weight = weight * share;
                    for c in 0..3 {
                        f[c] += weight * row[c][column];
                    }
                }
            }
            for c in 0..3 {
                sum[c] += f64::from(f[c]) * irradiance[c];
            }
        }
        sum.map(|v| self.factor * v)
    }
}

/// [`Grid::corners`] of a unit vector in single precision, which is a third of the time.
fn corners(grid: Grid, v: Vec3) -> [(usize, f32); 4] {
    let [x, y, z] = v.map(|v| v as f32);
    let (step, n_phi) = (grid.step_deg() as f32, grid.n_phi());
    let last = (grid.n_theta() - 1) as f32;
    let t = (z.clamp(-1.0, 1.0).acos().to_degrees() / step).min(last);
    let p = y.atan2(x).to_degrees() / step;
    let p = if p < 0.0 { p + n_phi as f32 } else { p };
    let (t0, p0) = (t as usize, p as usize % n_phi);
    let t1 = (t0 + 1).min(grid.n_theta() - 1);
    let p1 = (p0 + 1) % n_phi;
    let (ft, fp) = (t.fract(), p.fract());
    [
        (t0 * n_phi + p0, (1.0 - ft) * (1.0 - fp)),
        (t0 * n_phi + p1, (1.0 - ft) * fp),
        (t1 * n_phi + p0, ft * (1.0 - fp)),
        (t1 * n_phi + p1, ft * fp),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::model::Kurt;

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

    #[test]
    fn many_lights_at_once_are_the_sum_of_each() {
        let grid = Grid::with_step_deg(6.0).unwrap();
        let fabric = Kurt::two_thread_fabric();
        let dense = DenseBrdf::tabulate(grid, &fabric);
        // The model's own rounding makes its table reciprocal only nearly.
        let mirrored = DenseBrdf::from_fn(grid, |i, v| dense.at(i.min(v), i.max(v)));
        let table = Tabulated::scaled(&mirrored, 1.5);
        assert!(table.is_reciprocal);
        let at = |t, p| Direction::from_deg(t, p).to_vec3();
        let view = at(37.0, 203.0);
        let lights: Vec<(Vec3, [f64; 3])> = (0..50)
            .map(|k| {
                (
                    at(f64::from(k) * 1.79, f64::from(k) * 77.7),
                    [1.0, 0.5, 2.0],
                )
            })
            .collect();
        let together = table.radiance(&lights, view);
        for c in 0..3 {
            let each = lights.iter().map(|(l, e)| table.eval(*l, view)[c] * e[c]);
            let sum: f64 = each.sum();
            assert!((together[c] / sum - 1.0).abs() < 1e-4, "{together:?} {sum}");
        }
    }
}
