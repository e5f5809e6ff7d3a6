//! Many points of a surface under many lights, from a table.
//!
//! A picture of 512² pixels under 512 lights is fifty million lookups of sixteen cells in a table
//! that no cache holds. Points whose view lies between the same four nodes read the same four rows
//! of it, so these are gathered once, the values of a light's node side by side (64 bytes, a cache
//! line), for all such points.

use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::model::shading::{LEAST_COSINE, Light, TangentFrame};
use gonia_brdf::{DenseBrdf, Direction, Grid};
use rayon::prelude::*;

/// Groups of points a thread takes at a time, so that neighbouring rows are read together.
const GROUPS_AT_ONCE: usize = 64;

/// Which of a cell's two directions is the row to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// The view: the table is reciprocal, and its rows lie together in memory.
    View,
    /// The light, as the table has it.
    Light,
}

/// The radiance of each point towards the viewer, times a factor.
pub fn shade(
    table: &DenseBrdf,
    rows: Rows,
    factor: f32,
    points: &[TangentFrame],
    lights: &[Light],
    viewer: Vec3,
) -> Vec<[f32; 3]> {
    let grid = table.grid();
    let turned = Lights::new(lights);
    // The first of the four nodes around the view stands for all of them.
    let mut seen: Vec<(u32, u32)> = points
        .par_iter()
        .enumerate()
        .filter(|(_, point)| dot(point.normal, viewer) >= LEAST_COSINE)
        .map(|(k, point)| {
            let view = Direction::from_vec3(point.to_local(viewer));
            (grid.corners(view)[0].0 as u32, k as u32)
        })
        .collect();
    seen.par_sort_unstable();
    let groups: Vec<&[(u32, u32)]> = seen.chunk_by(|a, b| a.0 == b.0).collect();
    let shaded: Vec<(u32, [f32; 3])> = groups
        .par_chunks(GROUPS_AT_ONCE)
        .map_init(
            || Gathered::new(grid),
            |gathered, groups| {
                let mut found = Vec::new();
                for group in groups {
                    // Four nodes a light and point: if those are few, all nodes are too many.
                    if 4 * group.len() * lights.len() < grid.n_directions() {
                        found.extend(group.iter().map(|(_, point)| {
                            let frame = &points[*point as usize];
                            let rgb = look_up(table, rows, frame, lights, viewer);
                            (*point, rgb.map(|v| factor * v))
                        }));
                        continue;
                    }
                    for (k, (_, point)) in group.iter().enumerate() {
                        let frame = &points[*point as usize];
                        let view = Direction::from_vec3(frame.to_local(viewer));
                        let corners = grid.corners(view);
                        if k == 0 {
                            gathered.fill(table, rows, corners.map(|corner| corner.0));
                        }
                        let weights = corners.map(|corner| factor * corner.1 as f32);
                        found.push((*point, gathered.radiance(frame, &turned, weights)));
                    }
                }
                found
            },
        )
        .flatten_iter()
        .collect();
    let mut radiance = vec![[0.0; 3]; points.len()];
    for (point, rgb) in shaded {
        radiance[point as usize] = rgb;
    }
    radiance
}

/// The radiance of one point, light by light.
fn look_up(
    table: &DenseBrdf,
    rows: Rows,
    frame: &TangentFrame,
    lights: &[Light],
    viewer: Vec3,
) -> [f32; 3] {
    let view = Direction::from_vec3(frame.to_local(viewer));
    let mut sum = [0.0; 3];
    for light in lights {
        let towards = frame.to_local(light.towards);
        if towards[2] <= LEAST_COSINE {
            continue;
        }
        let at = Direction::from_vec3(towards);
        let f = match rows {
            Rows::View => table.lookup(view, at),
            Rows::Light => table.lookup(at, view),
        };
        for c in 0..3 {
            sum[c] += f64::from(f[c]) * light.irradiance[c] * towards[2];
        }
    }
    sum.map(|v| v as f32)
}

/// Lights, an array each quantity, so that several are turned at once.
struct Lights {
    towards: [Vec<f32>; 3],
    irradiance: Vec<[f32; 4]>,
}

impl Lights {
    fn new(lights: &[Light]) -> Self {
        let axis = |k: usize| lights.iter().map(|light| light.towards[k] as f32).collect();
        let rgb0 = |light: &Light| {
            let [r, g, b] = light.irradiance.map(|e| e as f32);
            [r, g, b, 0.0]
        };
        Self {
            towards: [axis(0), axis(1), axis(2)],
            irradiance: lights.iter().map(rgb0).collect(),
        }
    }
}

/// The values of one node in four rows: red, green, blue and nothing, row after row.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Values([f32; 16]);

/// Four rows of the table, and the lights as a point sees them.
struct Gathered {
    grid: Grid,
    nodes: Vec<Values>,
    local: [Vec<f32>; 3],
}

impl Gathered {
    fn new(grid: Grid) -> Self {
        Self {
            grid,
            nodes: vec![Values([0.0; 16]); grid.n_directions()],
            local: Default::default(),
        }
    }

    /// Brings four rows together, node by node: each cache line is written once.
    fn fill(&mut self, table: &DenseBrdf, rows: Rows, corners: [usize; 4]) {
        let n = self.grid.n_directions();
        let planes = table.planes().each_ref().map(Vec::as_slice);
        match rows {
            Rows::View => {
                let rows = corners.map(|row| planes.map(|plane| &plane[row * n..(row + 1) * n]));
                for (node, values) in self.nodes.iter_mut().enumerate() {
                    for (lanes, row) in values.0.chunks_exact_mut(4).zip(&rows) {
                        for c in 0..3 {
                            lanes[c] = row[c][node];
                        }
                    }
                }
            }
            Rows::Light => {
                for (values, first) in self.nodes.iter_mut().zip((0..).step_by(n)) {
                    for (lanes, column) in values.0.chunks_exact_mut(4).zip(corners) {
                        for c in 0..3 {
                            lanes[c] = planes[c][first + column];
                        }
                    }
                }
            }
        }
    }

    /// The radiance of a point whose view has these weights in the four rows.
    fn radiance(&mut self, frame: &TangentFrame, lights: &Lights, weights: [f32; 4]) -> [f32; 3] {
        let sum = self.lit(frame, lights);
        [0, 1, 2].map(|c| (0..4).map(|row| weights[row] * sum[4 * row + c]).sum())
    }

    /// The sum over the lights of irradiance times value, in the four rows.
    fn lit(&mut self, frame: &TangentFrame, lights: &Lights) -> [f32; 16] {
        let Gathered { grid, nodes, local } = self;
        turn(*grid, frame, lights, local);
        let (last, n_phi) = (grid.n_theta() - 1, grid.n_phi());
        let [cosines, polar_angles, azimuths] = local;
        let irradiance = &lights.irradiance;
        let mut sum = [0.0f32; 16];
        for light in 0..irradiance.len() {
            let cosine = cosines[light];
            if cosine <= LEAST_COSINE as f32 {
                continue;
            }
            let t = polar_angles[light].min(last as f32);
            let (t0, p0) = (t as i32, azimuths[light] as i32);
            let (ft, fp) = (t - t0 as f32, azimuths[light] - p0 as f32);
            let (t0, p0) = (t0 as usize, p0 as usize);
            // An angle just below zero may be rounded up to a whole turn.
            let p0 = if p0 < n_phi { p0 } else { 0 };
            let t1 = (t0 + 1).min(last);
            let p1 = if p0 + 1 == n_phi { 0 } else { p0 + 1 };
            let (ring0, ring1) = (t0 * n_phi, t1 * n_phi);
            let corners = [ring0 + p0, ring0 + p1, ring1 + p0, ring1 + p1];
            let [a, b, c, d] = corners.map(|node| &nodes[node].0);
            let (upper, lower) = (cosine * (1.0 - ft), cosine * ft);
            let (wa, wb) = (upper * (1.0 - fp), upper * fp);
            let (wc, wd) = (lower * (1.0 - fp), lower * fp);
            let e = irradiance[light];
            for k in 0..16 {
                let value = wa * a[k] + wb * b[k] + wc * c[k] + wd * d[k];
                sum[k] += e[k % 4] * value;
            }
        }
        sum
    }
}

/// The lights in a point's frame: cosine, and polar angle and azimuth in steps of the grid.
#[inline(always)]
fn turn(grid: Grid, frame: &TangentFrame, lights: &Lights, local: &mut [Vec<f32>; 3]) {
    let n = lights.irradiance.len();
    for array in &mut *local {
        array.resize(n, 0.0);
    }
    let axes = [frame.tangent, frame.bitangent, frame.normal].map(|axis| axis.map(|v| v as f32));
    let steps_from_radians = 1.0 / (grid.step_deg() as f32).to_radians();
    let [xs, ys, zs] = lights.towards.each_ref().map(|axis| &axis[..n]);
    let [cosines, polar_angles, azimuths] = local.each_mut().map(|array| &mut array[..n]);
    for k in 0..n {
        let along = |axis: [f32; 3]| axis[0] * xs[k] + axis[1] * ys[k] + axis[2] * zs[k];
        let (u, v, w) = (along(axes[0]), along(axes[1]), along(axes[2]));
        cosines[k] = w;
        polar_angles[k] = steps_from_radians * arc((u * u + v * v).sqrt(), w);
        azimuths[k] = steps_from_radians * arc(v, u);
    }
}

/// `atan2(y, x)` in 0 ..= 2π, within 1e-6, without a branch: several are computed at once.
/// The polynomial is Abramowitz and Stegun's 4.4.49.
#[inline(always)]
fn arc(y: f32, x: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, PI, TAU};
    let (a, b) = (y.abs(), x.abs());
    let (least, most) = if a < b { (a, b) } else { (b, a) };
    let r = least / (most + 1e-30);
    let q = r * r;
    let terms = [
        0.002_866_226,
        -0.016_165_737,
        0.042_909_614,
        -0.075_289_64,
        0.106_562_64,
        -0.142_089,
        0.199_935_51,
        -0.333_331_45,
        1.0,
    ];
    let arc = r * terms.into_iter().fold(0.0, |sum, term| sum * q + term);
    let arc = if a < b { arc } else { FRAC_PI_2 - arc };
    let arc = if x < 0.0 { PI - arc } else { arc };
    if y < 0.0 { TAU - arc } else { arc }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Elementary;

    #[test]
    fn the_arc_is_that_of_every_quarter() {
        for k in 0..3600 {
            let angle = f64::from(k) * 1e-1f64.to_radians();
            let (s, c) = angle.sine_cosine();
            let found = f64::from(arc(s as f32, c as f32));
            let off = (found - angle).abs();
            assert!(off.min(std::f64::consts::TAU - off) < 2e-6, "{k}: {found}");
        }
        assert_eq!(arc(0.0, 0.0), std::f32::consts::FRAC_PI_2);
    }
}
