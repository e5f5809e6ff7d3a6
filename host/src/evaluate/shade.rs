//! Many points of a surface under many lights, from a table.
//!
//! A picture of 512² pixels under 512 lights is fifty million lookups of sixteen cells in a table
//! that no cache holds. Points whose view lies between the same four nodes read the same four rows
//! of it, so these are gathered once, the values of a light's node side by side (64 bytes, a cache
//! line), for all such points.

use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::shading::{Frame, LEAST_COSINE, Light};
use gonia_brdf::{DenseBrdf, Direction, Grid};
use pulp::{Arch, Simd, WithSimd};
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
    points: &[Frame],
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
                    gathered.fill(table, rows, group[0].0 as usize);
                    let frames = group.iter().map(|(_, point)| points[*point as usize]);
                    let lit = gathered.light(frames.clone(), &turned);
                    for (((_, point), frame), sum) in group.iter().zip(frames).zip(lit) {
                        let view = Direction::from_vec3(frame.to_local(viewer));
                        let weights = grid.corners(view).map(|corner| factor * corner.1 as f32);
                        let rgb = [0, 1, 2].map(|c| {
                            let rows = weights.iter().zip(sum.0.chunks_exact(4));
                            rows.map(|(weight, row)| weight * row[c]).sum()
                        });
                        found.push((*point, rgb));
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
    frame: &Frame,
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

/// Lights that are turned at once.
const LANES: usize = 16;

/// Lights by [`LANES`], an array each quantity; the last ones are filled up with darkness.
struct Lights(Vec<LightBlock>);

struct LightBlock {
    towards: [[f32; LANES]; 3],
    /// Red, green, blue and nothing.
    irradiance: [[f32; 4]; LANES],
}

impl Lights {
    fn new(lights: &[Light]) -> Self {
        let block = |lights: &[Light]| {
            let mut block = LightBlock {
                towards: [[0.0; LANES]; 3],
                irradiance: [[0.0; 4]; LANES],
            };
            for (lane, light) in lights.iter().enumerate() {
                for k in 0..3 {
                    block.towards[k][lane] = light.towards[k] as f32;
                    block.irradiance[lane][k] = light.irradiance[k] as f32;
                }
            }
            block
        };
        Self(lights.chunks(LANES).map(block).collect())
    }
}

/// The values of one node in four rows: red, green, blue and nothing, row after row.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Values([f32; 16]);

const NOTHING: Values = Values([0.0; 16]);

/// Four rows of the table. A ring of nodes begins again at its end, and the last one is there twice,
/// so that the four nodes around a light are always a node, the next one, and the same a ring on.
struct Gathered {
    grid: Grid,
    nodes: Vec<Values>,
    sums: Vec<Values>,
    frames: Vec<[[f32; 3]; 3]>,
    arch: Arch,
}

impl Gathered {
    fn new(grid: Grid) -> Self {
        Self {
            grid,
            nodes: vec![NOTHING; (grid.n_theta() + 1) * (grid.n_phi() + 1)],
            sums: Vec::new(),
            frames: Vec::new(),
            arch: Arch::new(),
        }
    }

    /// Brings the four rows around a view together, whose first is given: each cache line is written
    /// once.
    fn fill(&mut self, table: &DenseBrdf, rows: Rows, first: usize) {
        let (n, n_phi) = (self.grid.n_directions(), self.grid.n_phi());
        let (ring, phi) = (first / n_phi, first % n_phi);
        let next_ring = (ring + 1).min(self.grid.n_theta() - 1);
        let next_phi = (phi + 1) % n_phi;
        let corners = [
            first,
            ring * n_phi + next_phi,
            next_ring * n_phi + phi,
            next_ring * n_phi + next_phi,
        ];
        let planes = table.planes().each_ref().map(Vec::as_slice);
        let rings = self.nodes.chunks_exact_mut(n_phi + 1);
        for (nodes, first) in rings.zip((0..n).step_by(n_phi)) {
            match rows {
                Rows::View => {
                    let rows =
                        corners.map(|row| planes.map(|plane| &plane[row * n + first..][..n_phi]));
                    for (node, values) in nodes[..n_phi].iter_mut().enumerate() {
                        for (lanes, row) in values.0.chunks_exact_mut(4).zip(&rows) {
                            for c in 0..3 {
                                lanes[c] = row[c][node];
                            }
                        }
                    }
                }
                Rows::Light => {
                    let rows = ((first * n)..).step_by(n);
                    for (values, row) in nodes[..n_phi].iter_mut().zip(rows) {
                        for (lanes, column) in values.0.chunks_exact_mut(4).zip(corners) {
                            for c in 0..3 {
                                lanes[c] = planes[c][row + column];
                            }
                        }
                    }
                }
            }
            nodes[n_phi] = nodes[0];
        }
        let last = self.nodes.len() - (n_phi + 1);
        self.nodes.copy_within(last - (n_phi + 1)..last, last);
    }

    /// For each point the sum over the lights of irradiance times cosine times value, in the four rows.
    fn light(&mut self, frames: impl Iterator<Item = Frame>, lights: &Lights) -> &[Values] {
        self.frames.clear();
        self.frames.extend(frames.map(|frame| {
            [frame.tangent, frame.bitangent, frame.normal].map(|axis| axis.map(|v| v as f32))
        }));
        self.sums.clear();
        self.sums.resize(self.frames.len(), NOTHING);
        self.arch.dispatch(Lit {
            grid: self.grid,
            nodes: &self.nodes,
            frames: &self.frames,
            lights,
            sums: &mut self.sums,
        });
        &self.sums
    }
}

/// What [`Gathered::light`] does, for whatever vectors the processor has.
struct Lit<'a> {
    grid: Grid,
    nodes: &'a [Values],
    /// Tangent, bitangent and normal of each point.
    frames: &'a [[[f32; 3]; 3]],
    lights: &'a Lights,
    sums: &'a mut [Values],
}

impl WithSimd for Lit<'_> {
    type Output = ();

    /// Plain loops: what the processor has of vectors is the compiler's business. Lights are the outer
    /// loop, since all these points see one of them between the same few nodes.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let ring = self.grid.n_phi() + 1;
        for block in &self.lights.0 {
            for (frame, sum) in self.frames.iter().zip(&mut *self.sums) {
                let turned = turn(self.grid, frame, block);
                for lane in 0..LANES {
                    if turned.cosines[lane] <= LEAST_COSINE as f32 {
                        continue;
                    }
                    let [wa, wb, wc, wd] = turned.weights.map(|weights| weights[lane]);
                    let first = turned.nodes[lane] as usize;
                    let around = &self.nodes[first..first + ring + 2];
                    let (a, b) = (&around[0].0, &around[1].0);
                    let (c, d) = (&around[ring].0, &around[ring + 1].0);
                    let e = block.irradiance[lane];
                    for k in 0..16 {
                        let value = wa * a[k] + wb * b[k] + wc * c[k] + wd * d[k];
                        sum.0[k] += e[k % 4] * value;
                    }
                }
            }
        }
    }
}

/// Lights as a point sees them.
struct Turned {
    cosines: [f32; LANES],
    /// The first of the four nodes around each, see [`Gathered`].
    nodes: [u32; LANES],
    /// Cosine times share of each of the four nodes.
    weights: [[f32; LANES]; 4],
}

/// Some lights in a point's frame.
#[inline(always)]
fn turn(grid: Grid, frame: &[[f32; 3]; 3], lights: &LightBlock) -> Turned {
    let mut turned = Turned {
        cosines: [0.0; LANES],
        nodes: [0; LANES],
        weights: [[0.0; LANES]; 4],
    };
    let (last, n_phi) = (grid.n_theta() as i32 - 1, grid.n_phi() as i32);
    let steps_from_radians = 1.0 / (grid.step_deg() as f32).to_radians();
    let [xs, ys, zs] = &lights.towards;
    for k in 0..LANES {
        let along = |axis: [f32; 3]| axis[0] * xs[k] + axis[1] * ys[k] + axis[2] * zs[k];
        let (u, v, w) = (along(frame[0]), along(frame[1]), along(frame[2]));
        let t = (steps_from_radians * arc((u * u + v * v).sqrt(), w)).min(last as f32);
        let p = steps_from_radians * arc(v, u);
        let t0 = t as i32;
        // An angle just below zero may be rounded up to a whole turn, which is the ring's last node.
        let p0 = (p as i32).min(n_phi - 1);
        let (ft, fp) = (t - t0 as f32, p - p0 as f32);
        let (upper, lower) = (w * (1.0 - ft), w * ft);
        turned.cosines[k] = w;
        turned.nodes[k] = (t0 * (n_phi + 1) + p0) as u32;
        turned.weights[0][k] = upper * (1.0 - fp);
        turned.weights[1][k] = upper * fp;
        turned.weights[2][k] = lower * (1.0 - fp);
        turned.weights[3][k] = lower * fp;
    }
    turned
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

    #[test]
    fn the_arc_is_that_of_every_quarter() {
        for k in 0..3600 {
            let angle = f64::from(k) * 1e-1f64.to_radians();
            let (s, c) = angle.sin_cos();
            let found = f64::from(arc(s as f32, c as f32));
            let off = (found - angle).abs();
            assert!(off.min(std::f64::consts::TAU - off) < 2e-6, "{k}: {found}");
        }
        assert_eq!(arc(0.0, 0.0), std::f32::consts::FRAC_PI_2);
    }
}
