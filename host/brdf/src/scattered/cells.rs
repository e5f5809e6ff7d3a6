//! A fit of an anisotropic material on every cell of a grid: few systems where data are few, and few places
//! evaluated where the values between them follow from these.

use super::ScatteredFit;
use super::local::{Local, Predicted, Work};
use super::places::{Near, distance2, exchanged, radius_of};
use super::quadratic::{Cells, Nodes, weights};
use super::wide::exponentials;
use crate::dense::DenseBrdf;
use crate::direction::Direction;
use crate::elementary::Elementary;
use crate::grid::Grid;
use crate::interpolate::coordinates::Pair;
use crate::interpolate::planes::spread_poles;
use crate::symmetry::Symmetry;
use pulp::Arch;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Side of the patches of directions that the work begins with, degrees.
const PATCH_DEG: f64 = 16.0;
/// Cells whose middle is within this share of the radius of a neighbourhood of each other share the system.
const SHARED: f64 = 0.8;
/// Quarters of the neighbours of one place that a system of many has.
const NEIGHBOURS: usize = 6;
/// So many images of the data, or fewer, make one system for all cells.
const ONE_SYSTEM: usize = 192;
/// Cells are interpolated where that is off by less than this share of the standard error …
const TOLERANCE: f64 = 0.1;
/// … or than this share of the value.
const TOLERANCE_MIN: f64 = 1e-3;
/// So many cells are not worth a test.
const DIRECT: usize = 100;

/// Planes that many threads write to, each cell once.
struct Shared(Vec<Vec<AtomicU32>>);

impl Shared {
    fn new(grid: Grid, channels: usize) -> Self {
        let plane = || {
            let cells = (0..grid.n_cells()).into_par_iter();
            cells.map(|_| AtomicU32::new(0)).collect()
        };
        Self((0..channels).map(|_| plane()).collect())
    }

    /// Stores cells and, with light and view exchanged, their reciprocal ones. Of two that are each other's, the
    /// one whose light has the lower number serves for both.
    fn store(&self, grid: Grid, channel: usize, cells: &Cells, values: &[f64]) {
        let plane = &self.0[channel];
        let first = [0, 2].map(|axis| cells.directions(axis, grid, 0));
        let serves = |l: usize, v: usize| !cells.is_own || first[0][l] <= first[1][v];
        let turns: &[usize] = match cells.is_turned {
            true => &[0, grid.n_phi() / 2],
            false => &[0],
        };
        for turn in turns {
            let [lights, views] = [0, 2].map(|axis| cells.directions(axis, grid, *turn));
            let put = |light: usize, view: usize, value: f64| {
                plane[grid.cell(light, view)].store((value as f32).to_bits(), Relaxed);
            };
            for (l, light) in lights.iter().enumerate() {
                for (v, view) in views.iter().enumerate() {
                    if serves(l, v) {
                        put(*light, *view, values[l * views.len() + v]);
                    }
                }
            }
            for (v, view) in views.iter().enumerate() {
                for (l, light) in lights.iter().enumerate() {
                    if serves(l, v) {
                        put(*view, *light, values[l * views.len() + v]);
                    }
                }
            }
        }
    }

    /// All three planes: of one channel, that one in each.
    fn into_planes(self, grid: Grid) -> [Vec<f32>; 3] {
        let mut planes = self.0.into_iter().map(|plane| {
            let bits = plane.into_iter().map(AtomicU32::into_inner);
            let mut plane: Vec<f32> = bits.map(f32::from_bits).collect();
            spread_poles(grid, &mut plane);
            plane
        });
        let first = planes.next().unwrap_or_default();
        match (planes.next(), planes.next()) {
            (Some(second), Some(third)) => [first, second, third],
            _ => [first.clone(), first.clone(), first],
        }
    }
}

/// The systems of some cells: of their places, and where data contradict reciprocity, of the reciprocal ones.
struct Systems {
    own: Local,
    reciprocal: Option<Local>,
}

impl Systems {
    fn at(&self, place: &Pair, with_error: bool, work: &mut Work) -> Predicted {
        match &self.reciprocal {
            None => self.own.at_with(place, with_error, work),
            Some(reciprocal) => super::averaged(
                &self.own.at_with(place, true, work),
                &reciprocal.at_with(&exchanged(*place), true, work),
            ),
        }
    }
}

/// Cells that share systems, and what holds for all of them.
struct Shares<'a> {
    systems: &'a Systems,
    cells: Cells,
    /// What logarithms may be off by.
    tolerance: f64,
    /// Relative standard errors at the nodes, channel by channel, where errors are wanted.
    errors: Vec<Vec<f64>>,
}

/// Memory of one thread.
#[derive(Default)]
struct Memory {
    work: Work,
    values: Vec<f64>,
    relative: Vec<f64>,
}

struct Filler<'a> {
    fit: &'a ScatteredFit,
    grid: Grid,
    channels: usize,
    values: Shared,
    /// Standard errors, where wanted.
    errors: Option<Shared>,
    /// The system of all data, where they are few.
    one: Option<Systems>,
    arch: Arch,
}

impl ScatteredFit {
    /// [`Self::dense`] of a fit that depends on all four angles.
    pub(super) fn dense_by_cells(
        &self,
        grid: Grid,
        with_errors: bool,
    ) -> (DenseBrdf, Option<[Vec<f32>; 3]>) {
        let is_grey = |v: &[f64; 3]| v[0] == v[1] && v[1] == v[2];
        let channels = match self.data.iter().all(|d| is_grey(&d.value)) {
            true => 1,
            false => 3,
        };
        let mut filler = Filler {
            fit: self,
            grid,
            channels,
            values: Shared::new(grid, channels),
            errors: with_errors.then(|| Shared::new(grid, channels)),
            one: None,
            arch: Arch::new(),
        };
        if self.places.images() <= ONE_SYSTEM {
            let pole = Direction::from_deg(0.0, 0.0).to_vec3();
            let place = self.choice.settings.coordinates.pair(pole, pole);
            let near = filler.near(place, self.places.images());
            filler.one = filler.systems(&near);
        }
        pairs(grid, self.choice.settings.symmetry)
            .par_iter()
            .with_max_len(8)
            .for_each_init(Memory::default, |memory, cells| filler.fill(*cells, memory));
        let errors = filler.errors.map(|errors| errors.into_planes(grid));
        (
            DenseBrdf::from_planes(grid, filler.values.into_planes(grid)),
            errors,
        )
    }
}

/// The first row and column of a patch of directions, and their ends.
type Patch = [[usize; 2]; 2];

/// The pairs of patches that all others follow from.
fn pairs(grid: Grid, symmetry: Symmetry) -> Vec<Cells> {
    let rings = rings(grid);
    let patches: Vec<Patch> = rings.iter().flatten().copied().collect();
    // Half a turn on lies the patch half a ring further.
    let mut turned = Vec::with_capacity(patches.len());
    for ring in &rings {
        let (first, n) = (turned.len(), ring.len());
        turned.extend((0..n).map(|k| first + (k + n / 2) % n));
    }
    let mut pairs = Vec::new();
    for p in 0..patches.len() {
        for q in p..patches.len() {
            let other = (turned[p].min(turned[q]), turned[p].max(turned[q]));
            let is_half_turn = symmetry.has_half_turn();
            if is_half_turn && other < (p, q) {
                continue;
            }
            let ([a, b], [c, d]) = (patches[p], patches[q]);
            pairs.push(Cells {
                start: [a[0], a[1], c[0], c[1]],
                end: [b[0], b[1], d[0], d[1]],
                is_own: p == q,
                is_turned: is_half_turn && other != (p, q),
            });
        }
    }
    pairs
}

/// Patches of directions, about as wide as high, ring by ring: the pole, then even numbers of them.
fn rings(grid: Grid) -> Vec<Vec<Patch>> {
    let (n_theta, n_phi) = (grid.n_theta(), grid.n_phi());
    let count = ((n_theta - 1) as f64 * grid.step_deg() / PATCH_DEG).ceil() as usize;
    let count = count.clamp(1, (n_theta - 1).max(1));
    // All azimuths of the pole are one direction.
    let mut rings = vec![vec![[[0, 0], [1, 1]]]];
    for ring in 0..count {
        let [first, end] = [ring, ring + 1].map(|r| 1 + r * (n_theta - 1) / count);
        let theta = (0.5 * (first + end - 1) as f64 * grid.step_deg()).to_radians();
        let across = 2 * (180.0 * theta.sine() / PATCH_DEG).ceil() as usize;
        let across = across.clamp(4, n_phi);
        let patch = |k: usize| {
            let [left, right] = [k, k + 1].map(|k| k * n_phi / across);
            [[first, left], [end, right]]
        };
        rings.push((0..across).map(patch).collect());
    }
    rings
}

/// The data around a place, and where they contradict reciprocity, around the reciprocal one.
struct Neighbourhood {
    own: Vec<Near>,
    reciprocal: Option<Vec<Near>>,
}

impl Neighbourhood {
    fn radius(&self) -> f64 {
        let reciprocal = self.reciprocal.iter().map(|near| radius_of(near));
        reciprocal.fold(radius_of(&self.own), f64::min)
    }
}

impl Filler<'_> {
    fn place(&self, [i, phi_i, v, phi_v]: [f64; 4]) -> Pair {
        let step = self.grid.step_deg();
        let light = Direction::from_deg(i * step, phi_i * step).to_vec3();
        let view = Direction::from_deg(v * step, phi_v * step).to_vec3();
        self.fit.choice.settings.coordinates.pair(light, view)
    }

    fn near(&self, place: Pair, many: usize) -> Neighbourhood {
        let settings = &self.fit.choice.settings;
        let around = |place| self.fit.places.around(place, many, settings, |_| true);
        Neighbourhood {
            own: around(place),
            reciprocal: (!settings.reciprocal_data).then(|| around(exchanged(place))),
        }
    }

    fn systems(&self, near: &Neighbourhood) -> Option<Systems> {
        let system = |near: &Vec<Near>| Local::fit(&self.fit.data, near, &self.fit.choice.settings);
        Some(Systems {
            own: system(&near.own)?,
            reciprocal: match &near.reciprocal {
                Some(near) => Some(system(near)?),
                None => None,
            },
        })
    }

    /// Fills cells: by one system where they are small against its neighbourhood, else half by half.
    fn fill(&self, cells: Cells, memory: &mut Memory) {
        let number = |row: usize, column: usize| row * self.grid.n_phi() + column;
        let first_light = number(cells.start[0], cells.start[1]);
        if cells.is_own && first_light > number(cells.end[2] - 1, cells.end[3] - 1) {
            // Their reciprocal ones serve for them.
            return;
        }
        if let Some(one) = &self.one {
            return self.share(one, cells, memory);
        }
        let middle = self.place(cells.middle());
        let reach = (0..16)
            .map(|bits| distance2(&self.place(cells.corner(bits)), &middle))
            .fold(0.0, f64::max)
            .sqrt();
        let near = self.near(middle, NEIGHBOURS * self.fit.choice.settings.neighbours / 4);
        if cells.count() > 1 && reach > SHARED * near.radius() {
            for half in cells.halves(self.longest(&cells)) {
                self.fill(half, memory);
            }
        } else if let Some(systems) = self.systems(&near) {
            self.share(&systems, cells, memory);
        }
    }

    /// The axis along which cells reach farthest.
    fn longest(&self, cells: &Cells) -> usize {
        let middle = cells.middle();
        let length = |axis: usize| {
            let steps = cells.length(axis) - 1;
            let theta = (middle[axis & 2] * self.grid.step_deg()).to_radians();
            let per_step = if axis & 1 == 0 { 1.0 } else { theta.sine() };
            steps as f64 * per_step
        };
        let axes = (0..4).filter(|axis| cells.length(*axis) > 1);
        let longest = axes.max_by(|a, b| length(*a).total_cmp(&length(*b)));
        longest.unwrap_or(0)
    }

    fn share(&self, systems: &Systems, cells: Cells, memory: &mut Memory) {
        let middle = systems.at(&self.place(cells.middle()), true, &mut memory.work);
        let relative = middle
            .relative
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        let mut errors = vec![Vec::new(); self.channels];
        if self.errors.is_some() {
            self.each_node(&cells, |place| {
                let at = systems.at(&place, true, &mut memory.work);
                for (errors, relative) in errors.iter_mut().zip(at.relative) {
                    errors.push((self.fit.choice.error_factor * relative).natural_log());
                }
            });
        }
        let shares = Shares {
            systems,
            cells,
            tolerance: (TOLERANCE * relative).max(TOLERANCE_MIN),
            errors,
        };
        self.refine(&shares, cells, memory);
    }

    /// The places of the nodes of a box, those of the last axis next to each other.
    fn each_node(&self, cells: &Cells, mut each: impl FnMut(Pair)) {
        let nodes = [0, 1, 2, 3].map(|axis| cells.nodes(axis));
        for i in &nodes[0] {
            for phi_i in &nodes[1] {
                for v in &nodes[2] {
                    for phi_v in &nodes[3] {
                        each(self.place([*i, *phi_i, *v, *phi_v]));
                    }
                }
            }
        }
    }

    /// Fills a part of cells that share systems: between its nodes where that is near enough.
    fn refine(&self, shares: &Shares<'_>, part: Cells, memory: &mut Memory) {
        if part.count() <= DIRECT {
            let mut channels = vec![Vec::new(); self.channels];
            let [lights, views] = [0, 2].map(|axis| part.directions(axis, self.grid, 0));
            for light in &lights {
                for view in &views {
                    let [l, v] = [light, view].map(|d| self.grid.direction(*d).to_vec3());
                    let place = self.fit.choice.settings.coordinates.pair(l, v);
                    let at = shares.systems.at(&place, false, &mut memory.work);
                    for (values, value) in channels.iter_mut().zip(at.value) {
                        values.push(value);
                    }
                }
            }
            return self.store(shares, part, &channels, memory);
        }
        let bends = self.bends(shares, &part, &mut memory.work);
        if bends.iter().sum::<f64>() <= shares.tolerance {
            let mut nodes = vec![Vec::with_capacity(81); self.channels];
            self.each_node(&part, |place| {
                let at = shares.systems.at(&place, false, &mut memory.work);
                for (nodes, value) in nodes.iter_mut().zip(at.value) {
                    nodes.push(value.natural_log());
                }
            });
            if self.meets_between(shares, &part, &nodes, &mut memory.work) {
                for values in &mut nodes {
                    memory.values.clear();
                    let between = Nodes {
                        cells: &part,
                        values,
                    };
                    between.between(&part, &mut memory.values);
                    exponentials(self.arch, &mut memory.values);
                    std::mem::swap(values, &mut memory.values);
                }
                return self.store(shares, part, &nodes, memory);
            }
        }
        let sharpest = (0..4).max_by(|a, b| bends[*a].total_cmp(&bends[*b]));
        let axis = match sharpest {
            Some(axis) if bends[axis] > 0.0 => axis,
            _ => self.longest(&part),
        };
        for half in part.halves(axis) {
            self.refine(shares, half, memory);
        }
    }

    /// How far logarithms through the middle of a part are from quadratic, axis by axis.
    fn bends(&self, shares: &Shares<'_>, part: &Cells, work: &mut Work) -> [f64; 4] {
        let mut logs = |at: [f64; 4]| {
            let at = shares.systems.at(&self.place(at), false, work);
            at.value.map(f64::natural_log)
        };
        let middle = part.middle();
        let of_middle = logs(middle);
        std::array::from_fn(|axis| {
            // Three cells are nodes themselves.
            if part.length(axis) <= 3 {
                return 0.0;
            }
            let mut along = |share: f64| {
                let mut place = middle;
                place[axis] = part.at(axis, share);
                logs(place)
            };
            let (first, last) = (along(0.0), along(1.0));
            [0.25, 0.75]
                .map(|share| {
                    let (found, w) = (along(share), weights(share));
                    let between = |c: usize| w[0] * first[c] + w[1] * of_middle[c] + w[2] * last[c];
                    let off = (0..self.channels).map(|c| (found[c] - between(c)).abs());
                    off.fold(0.0, f64::max)
                })
                .into_iter()
                .fold(0.0, f64::max)
        })
    }

    /// Whether the nodes of a part determine its values aside of the middles, too.
    fn meets_between(
        &self,
        shares: &Shares<'_>,
        part: &Cells,
        nodes: &[Vec<f64>],
        work: &mut Work,
    ) -> bool {
        // Half of the corners of a box of half the size.
        let asides = (0..16usize).filter(|bits| bits.count_ones() % 2 == 0);
        asides.into_iter().all(|bits| {
            let mut aside = *part;
            for axis in 0..4 {
                let quarter = part.length(axis) / 4;
                aside.start[axis] = match bits >> axis & 1 {
                    0 => part.start[axis] + quarter,
                    _ => part.end[axis] - 1 - quarter,
                };
                aside.end[axis] = aside.start[axis] + 1;
            }
            let found = shares.systems.at(&self.place(aside.middle()), false, work);
            nodes.iter().zip(found.value).all(|(values, found)| {
                let mut between = Vec::with_capacity(1);
                let nodes = Nodes {
                    cells: part,
                    values,
                };
                nodes.between(&aside, &mut between);
                let off = |between: &f64| (between - found.natural_log()).abs();
                between.iter().all(|b| off(b) <= shares.tolerance)
            })
        })
    }

    fn store(&self, shares: &Shares<'_>, part: Cells, channels: &[Vec<f64>], memory: &mut Memory) {
        for (c, values) in channels.iter().enumerate() {
            self.values.store(self.grid, c, &part, values);
            let Some(planes) = &self.errors else {
                continue;
            };
            memory.relative.clear();
            let between = Nodes {
                cells: &shares.cells,
                values: &shares.errors[c],
            };
            between.between(&part, &mut memory.relative);
            exponentials(self.arch, &mut memory.relative);
            for (error, value) in memory.relative.iter_mut().zip(values) {
                *error *= value;
            }
            planes.store(self.grid, c, &part, &memory.relative);
        }
    }
}
