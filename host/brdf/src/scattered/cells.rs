//! A fit of an anisotropic material on every cell of a grid: few systems where data are few, and few places
//! evaluated where the values between them follow from these.

use super::ScatteredFit;
use super::local::{Local, Predicted, Work};
use super::narrow::Narrow;
use super::patches::{PatchPair, pairs};
use super::places::{Near, distance2, exchanged, radius_of};
use super::planes::{Block, Rows, of_all, planes_of};
use super::quadratic::{By, Cells, Determined, Few, Stages, weights};
use super::wide::exponentials;
use crate::dense::DenseBrdf;
use crate::direction::Direction;
use crate::elementary::Elementary;
use crate::grid::Grid;
use crate::interpolate::coordinates::Pair;
use crate::interpolate::planes::spread_poles;
use crate::symmetry::{MirrorPlane, Reflection};
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;

/// Cells whose middle is within this share of the radius of a neighbourhood of each other share the system.
const SHARED: f64 = 1.0;
/// Quarters of the neighbours of one place that a system of many has.
const NEIGHBOURS: usize = 7;
/// So many images of the data, or fewer, make one system for all cells.
const ONE_SYSTEM: usize = 192;
/// Cells are interpolated where that is off by less than this share of the standard error …
const TOLERANCE: f64 = 0.25;
/// … or than this share of the value.
const TOLERANCE_MIN: f64 = 1e-3;
/// So much of the tolerance may be due to single precision.
const NARROW: f64 = 0.2;
/// So many cells are not worth a test.
const DIRECT: usize = 40;
/// Cells whose reach is beyond so many times what they may share, by the radius around those that they are half of, are
/// halved again without a search.
const HALVED_AGAIN: f64 = 1.15;
/// Places between cells are so many parts of a step apart.
const PARTS: f64 = 4.0;

/// The systems of some cells: of their places, and where data contradict reciprocity, of the reciprocal ones.
struct Systems<const N: usize> {
    own: Local<N>,
    reciprocal: Option<Local<N>>,
}

impl<const N: usize> Systems<N> {
    fn logs_at(&self, place: &Pair, work: &mut Work) -> [f64; N] {
        match self.reciprocal {
            None => self.own.logs_at(place, work),
            Some(_) => self.at(place, false, work).value.map(f64::natural_log),
        }
    }

    fn at(&self, place: &Pair, with_error: bool, work: &mut Work) -> Predicted<N> {
        match &self.reciprocal {
            None => self.own.at_with(place, with_error, work),
            Some(reciprocal) => super::averaged(
                &self.own.at_with(place, true, work),
                &reciprocal.at_with(&exchanged(*place), true, work),
            ),
        }
    }
}

/// Systems, and how near their values are needed.
struct Solved<'a, const N: usize> {
    systems: &'a Systems<N>,
    /// The same in single precision, where that is near enough.
    narrow: Option<Narrow<N>>,
    /// What logarithms may be off by.
    tolerance: f64,
}

/// Cells that share systems, and what holds for all of them.
struct Shares<'a, const N: usize> {
    solved: &'a Solved<'a, N>,
    /// The pair of patches that they are of.
    pair: &'a Cells,
    cells: Cells,
    /// The plane of symmetry, where the systems are of the cells beyond it.
    beyond: Option<Reflection>,
    /// Relative standard errors at the nodes, channel by channel, where errors are wanted.
    errors: Vec<Vec<f64>>,
}

impl<const N: usize> Shares<'_, N> {
    fn logs_at(&self, place: &Pair, work: &mut Work) -> [f64; N] {
        let place = &self.beyond.map_or(*place, |plane| plane.of(place));
        match &self.solved.narrow {
            Some(narrow) => self.solved.systems.own.logs_of(narrow.sums(place)),
            None => self.solved.systems.logs_at(place, work),
        }
    }
}

/// Values and errors of a pair of patches.
#[derive(Default)]
struct Blocks {
    values: Block,
    errors: Block,
}

/// Memory of one thread.
#[derive(Default)]
struct Memory {
    work: Work,
    stages: Stages,
    relative: Vec<f64>,
    /// The pair of patches that is worked on, and the one beyond the plane of symmetry.
    blocks: [Blocks; 2],
}

struct Filler<'a, const N: usize> {
    fit: &'a ScatteredFit<N>,
    grid: Grid,
    channels: usize,
    with_errors: bool,
    /// The system of all data, where they are few.
    one: Option<Systems<N>>,
    arch: Arch,
    plane: Option<Reflection>,
    /// Sine and cosine of every quarter of a step, up to two turns.
    angles: Vec<(f64, f64)>,
}

/// Logarithms on lines through the middle of a part.
struct Lines<const N: usize> {
    middle: [f64; N],
    /// First and last along each axis, where that is longer than its nodes.
    ends: [[[f64; N]; 2]; 4],
    /// How far logarithms are from quadratic, axis by axis, up to the one with which that is too far.
    bends: [f64; 4],
    /// Whether they are near enough.
    are_quadratic: bool,
}

impl<const N: usize> ScatteredFit<N> {
    /// [`Self::dense`] of a fit that depends on all four angles.
    pub(super) fn dense_by_cells(
        &self,
        grid: Grid,
        with_errors: bool,
    ) -> (DenseBrdf<N>, Option<[Vec<f32>; N]>) {
        let all = 0..grid.n_theta();
        let (values, errors) = self.planes_by_cells(grid, all, with_errors);
        let dense = DenseBrdf::from_planes(grid, of_all(values));
        (dense, with_errors.then(|| of_all(errors)))
    }

    /// Values of cells of lights on some rings, a plane a channel, or one for all channels that are alike; and their
    /// standard errors.
    pub(super) fn planes_by_cells(
        &self,
        grid: Grid,
        rings: Range<usize>,
        with_errors: bool,
    ) -> (Vec<Vec<f32>>, Vec<Vec<f32>>) {
        let channels = self.channels();
        let symmetry = self.choice.settings.symmetry;
        let turn = PARTS as usize * grid.n_phi();
        let mut filler = Filler {
            fit: self,
            grid,
            channels,
            with_errors,
            one: None,
            arch: Arch::new(),
            plane: symmetry.plane().map(MirrorPlane::reflection),
            angles: (0..=2 * turn)
                .map(|k| {
                    ((k % turn) as f64 / PARTS * grid.step_deg())
                        .to_radians()
                        .sine_cosine()
                })
                .collect(),
        };
        if self.places.images() <= ONE_SYSTEM {
            let pole = Direction::from_deg(0.0, 0.0).to_vec3();
            let place = self.choice.settings.coordinates.pair(pole, pole);
            let near = filler.near(place, self.places.images());
            filler.one = filler.systems(&near);
        }
        let mut values = planes_of(grid, rings.len(), channels);
        let errors_of = if with_errors { channels } else { 0 };
        let mut errors = planes_of(grid, rings.len(), errors_of);
        let rows = Rows::of(grid, rings.start, &mut values);
        let rows_of_errors = Rows::of(grid, rings.start, &mut errors);
        let is_wanted = |pair: &PatchPair| {
            let cells = &pair.cells;
            [0, 2]
                .iter()
                .any(|axis| cells.start[*axis] < rings.end && rings.start < cells.end[*axis])
        };
        // What shares one system anyway need not lie side by side.
        pairs(grid, symmetry, filler.one.is_none())
            .par_iter()
            .with_max_len(8)
            .filter(|pair| is_wanted(pair))
            .for_each_init(Memory::default, |memory, pair| {
                let beyond = pair.beyond.map(|beyond| beyond.cells);
                let both = || std::iter::once(pair.cells).chain(beyond);
                for (cells, blocks) in both().zip(&mut memory.blocks) {
                    blocks.values.clear(&cells, channels);
                    blocks.errors.clear(&cells, errors_of);
                }
                filler.fill(pair, pair.cells, f64::INFINITY, memory);
                for (cells, blocks) in both().zip(&mut memory.blocks) {
                    blocks.values.store(&cells, grid, &rows);
                    blocks.errors.store(&cells, grid, &rows_of_errors);
                }
            });
        for plane in values.iter_mut().chain(&mut errors) {
            spread_poles(grid, rings.start == 0, plane);
        }
        (values, errors)
    }
}

/// Puts values at nodes in the order that the nodes beyond a plane have: those of azimuths are turned over.
fn turn_over(values: &mut [f64], nodes: [usize; 4]) {
    for views in values.chunks_exact_mut(nodes[1] * nodes[2] * nodes[3]) {
        // All four axes from the last to the first, …
        views.reverse();
        let rows = views.chunks_exact_mut(nodes[2] * nodes[3]);
        for views in rows {
            // … and the polar angle of view back.
            let (mut low, mut high) = (0, nodes[2] - 1);
            while low < high {
                let (first, last) = views.split_at_mut(high * nodes[3]);
                first[low * nodes[3]..][..nodes[3]].swap_with_slice(&mut last[..nodes[3]]);
                (low, high) = (low + 1, high - 1);
            }
        }
    }
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

impl<const N: usize> Filler<'_, N> {
    fn place(&self, [i, phi_i, v, phi_v]: [f64; 4]) -> Pair {
        let of = |x: f64| self.angles[(PARTS * x).round() as usize];
        let direction = |theta: f64, phi: f64| {
            let ((sin_theta, cos_theta), (sin_phi, cos_phi)) = (of(theta), of(phi));
            [sin_theta * cos_phi, sin_theta * sin_phi, cos_theta]
        };
        let coordinates = self.fit.choice.settings.coordinates;
        coordinates.pair(direction(i, phi_i), direction(v, phi_v))
    }

    fn near(&self, place: Pair, many: usize) -> Neighbourhood {
        let settings = &self.fit.choice.settings;
        let around = |place| self.fit.places.around(place, many, settings, |_| true);
        Neighbourhood {
            own: around(place),
            reciprocal: (!settings.reciprocal_data).then(|| around(exchanged(place))),
        }
    }

    fn systems(&self, near: &Neighbourhood) -> Option<Systems<N>> {
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
    /// `around` is the radius around those that they are half of.
    fn fill(&self, pair: &PatchPair, cells: Cells, around: f64, memory: &mut Memory) {
        let number = |row: usize, column: usize| row * self.grid.n_phi() + column;
        let first_light = number(cells.start[0], cells.start[1]);
        if cells.is_own && first_light > number(cells.end[2] - 1, cells.end[3] - 1) {
            // Their reciprocal ones serve for them.
            return;
        }
        if let Some(one) = &self.one {
            return self.share(one, pair, (cells, f64::INFINITY), memory);
        }
        let middle = self.place(cells.middle());
        let reach = self.reach_from(&middle, pair, &cells);
        let halve = |radius: f64, memory: &mut Memory| {
            for half in cells.halves(self.longest(&cells)) {
                self.fill(pair, half, radius, memory);
            }
        };
        if cells.count() > 1 && reach > HALVED_AGAIN * SHARED * around {
            return halve(around, memory);
        }
        let near = self.near(middle, NEIGHBOURS * self.fit.choice.settings.neighbours / 4);
        if cells.count() > 1 && reach > SHARED * near.radius() {
            halve(near.radius(), memory);
        } else if let Some(systems) = self.systems(&near) {
            self.share(&systems, pair, (cells, reach), memory);
        }
    }

    /// How far corners of cells are from a place, and corners of those beyond the plane of symmetry from its image.
    fn reach_from(&self, middle: &Pair, pair: &PatchPair, cells: &Cells) -> f64 {
        let corners = |cells: Cells| (0..16).map(move |bits| self.place(cells.corner(bits)));
        let beyond = self.plane.zip(pair.beyond).map(|(plane, beyond)| {
            let image = plane.of(middle);
            corners(beyond.of(cells)).map(move |corner| distance2(&corner, &image))
        });
        corners(*cells)
            .map(|corner| distance2(&corner, middle))
            .chain(beyond.into_iter().flatten())
            .fold(0.0, f64::max)
            .sqrt()
    }

    /// The axes of more than two cells, that along which they reach farthest first.
    fn by_length(&self, cells: &Cells) -> Vec<usize> {
        let mut axes: Vec<usize> = (0..4).filter(|axis| cells.length(*axis) > 2).collect();
        let length = |axis: &usize| self.reach(cells, *axis);
        axes.sort_by(|a, b| length(b).total_cmp(&length(a)));
        axes
    }

    /// How far cells reach along an axis, steps of the grid.
    fn reach(&self, cells: &Cells, axis: usize) -> f64 {
        let steps = (cells.length(axis) - 1) as f64;
        let theta = (cells.middle()[axis & 2] * self.grid.step_deg()).to_radians();
        steps * if axis & 1 == 0 { 1.0 } else { theta.sine() }
    }

    /// The axis along which cells reach farthest.
    fn longest(&self, cells: &Cells) -> usize {
        let length = |axis: usize| self.reach(cells, axis);
        let axes = (0..4).filter(|axis| cells.length(*axis) > 1);
        let longest = axes.max_by(|a, b| length(*a).total_cmp(&length(*b)));
        longest.unwrap_or(0)
    }

    /// Fills cells, all within their reach of their middle, and those beyond the plane of symmetry, by
    /// systems that they share.
    fn share(
        &self,
        systems: &Systems<N>,
        pair: &PatchPair,
        (cells, reach): (Cells, f64),
        memory: &mut Memory,
    ) {
        let at = self.place(cells.middle());
        let middle = systems.at(&at, true, &mut memory.work);
        let relative = middle
            .relative
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        let errors = match self.with_errors {
            true => self.errors(systems, &cells, &mut memory.work),
            false => vec![Vec::new(); self.channels],
        };
        let tolerance = TOLERANCE * self.fit.choice.error_factor * relative;
        let tolerance = tolerance.max(TOLERANCE_MIN);
        let narrow = || systems.own.narrow((at, reach), NARROW * tolerance);
        let solved = Solved {
            systems,
            narrow: systems.reciprocal.is_none().then(narrow).flatten(),
            tolerance,
        };
        let mut shares = Shares {
            solved: &solved,
            pair: &pair.cells,
            cells,
            beyond: None,
            errors,
        };
        self.refine(&shares, cells, memory);
        let Some(beyond) = &pair.beyond else {
            return;
        };
        // Errors change little over the half a step, at most, by which these cells miss the images of the others.
        let nodes = [0, 1, 2, 3].map(|axis| cells.length(axis).min(3));
        shares.errors.iter_mut().for_each(|e| turn_over(e, nodes));
        shares.pair = &beyond.cells;
        shares.cells = beyond.of(&cells);
        shares.beyond = self.plane;
        self.refine(&shares, shares.cells, memory);
    }

    /// Logarithms of relative standard errors at all nodes of cells, channel by channel. Between the few that are computed
    /// they stay within these.
    fn errors(&self, systems: &Systems<N>, cells: &Cells, work: &mut Work) -> Vec<Vec<f64>> {
        let (mut low, mut high) = ([f64::INFINITY; N], [f64::NEG_INFINITY; N]);
        let mut logs = |place: Pair| {
            let relative = systems.at(&place, true, work).relative;
            let logs = relative.map(|r| (self.fit.choice.error_factor * r).natural_log());
            low = std::array::from_fn(|c| low[c].min(logs[c]));
            high = std::array::from_fn(|c| high[c].max(logs[c]));
            logs
        };
        let mut nodes = if (0..4).all(|axis| cells.length(axis) > 2) {
            let at = cells.middle();
            let middle = logs(self.place(at));
            let ends = [0, 1, 2, 3].map(|axis| {
                [0.0, 1.0].map(|share| {
                    let mut place = at;
                    place[axis] = cells.at(axis, share);
                    logs(self.place(place))
                })
            });
            let few = self.few_nodes(cells, (middle, ends), &mut logs);
            few.iter().map(|few| few.all(self.arch)).collect()
        } else {
            self.all_nodes(cells, &mut logs)
        };
        for (c, nodes) in nodes.iter_mut().enumerate() {
            for log in nodes {
                *log = log.clamp(low[c], high[c]);
            }
        }
        nodes
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
    fn refine(&self, shares: &Shares<'_, N>, part: Cells, memory: &mut Memory) {
        if part.count() <= DIRECT {
            let mut channels = vec![Vec::new(); self.channels];
            let [lights, views] = [0, 2].map(|axis| part.directions(axis, self.grid, 0));
            for light in &lights {
                for view in &views {
                    let n_phi = self.grid.n_phi();
                    let [l, v] = [*light, *view].map(|d| [d / n_phi, d % n_phi].map(|x| x as f64));
                    let place = self.place([l[0], l[1], v[0], v[1]]);
                    let logs = shares.logs_at(&place, &mut memory.work);
                    for (values, log) in channels.iter_mut().zip(logs) {
                        values.push(log);
                    }
                }
            }
            for values in &mut channels {
                exponentials(self.arch, values);
            }
            return self.store(shares, part, &channels, memory);
        }
        let lines = self.lines(shares, &part, &mut memory.work);
        let bends = lines.bends;
        if lines.are_quadratic {
            let (by, mut channels) = self.nodes(shares, &part, &lines, &mut memory.work);
            if self.meets_between(shares, &part, (by, &channels), &mut memory.work) {
                for values in &mut channels {
                    let of = Determined {
                        cells: &part,
                        by,
                        values,
                    };
                    let mut found = Vec::with_capacity(part.count());
                    of.between(self.arch, &part, &mut memory.stages, &mut found);
                    exponentials(self.arch, &mut found);
                    *values = found;
                }
                return self.store(shares, part, &channels, memory);
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

    /// What determines the logarithms of a part, channel by channel.
    fn nodes(
        &self,
        shares: &Shares<'_, N>,
        part: &Cells,
        lines: &Lines<N>,
        work: &mut Work,
    ) -> (By, Vec<Vec<f64>>) {
        let mut logs = |place: Pair| shares.logs_at(&place, work);
        if (0..4).all(|axis| part.length(axis) > 2) {
            let few = self.few_nodes(part, (lines.middle, lines.ends), &mut logs);
            let powers = few.iter().map(|few| few.powers().to_vec());
            (By::Powers, powers.collect())
        } else {
            (By::Nodes, self.all_nodes(part, &mut logs))
        }
    }

    /// Of cells of more than two along each axis, values in the middle, at the ends of the lines through it, and at the
    /// corners, channel by channel.
    fn few_nodes(
        &self,
        cells: &Cells,
        (middle, ends): ([f64; N], [[[f64; N]; 2]; 4]),
        at: &mut impl FnMut(Pair) -> [f64; N],
    ) -> Vec<Few> {
        let corners: [[f64; N]; 16] =
            std::array::from_fn(|bits| at(self.place(cells.corner(bits))));
        let few = |c: usize| Few {
            middle: middle[c],
            ends: ends.map(|ends| ends.map(|end| end[c])),
            corners: corners.map(|corner| corner[c]),
        };
        (0..self.channels).map(few).collect()
    }

    /// Values at all nodes of cells, each computed.
    fn all_nodes(&self, cells: &Cells, at: &mut impl FnMut(Pair) -> [f64; N]) -> Vec<Vec<f64>> {
        let mut nodes = vec![Vec::new(); self.channels];
        self.each_node(cells, |place| {
            for (nodes, value) in nodes.iter_mut().zip(at(place)) {
                nodes.push(value);
            }
        });
        nodes
    }

    fn lines(&self, shares: &Shares<'_, N>, part: &Cells, work: &mut Work) -> Lines<N> {
        let mut logs = |at: [f64; 4]| shares.logs_at(&self.place(at), work);
        let at = part.middle();
        let middle = logs(at);
        let mut ends = [[middle; 2]; 4];
        let mut bends = [0.0; 4];
        let mut are_quadratic = true;
        // Two cells are nodes themselves, and so are three. Where parts reach far they bend most.
        for axis in self.by_length(part) {
            let mut along = |share: f64| {
                let mut place = at;
                place[axis] = part.at(axis, share);
                logs(place)
            };
            ends[axis] = [along(0.0), along(1.0)];
            if part.length(axis) == 3 {
                continue;
            }
            for share in [0.25, 0.75] {
                let (found, w) = (along(share), weights(share));
                for c in 0..self.channels {
                    let [first, last] = ends[axis].map(|end| end[c]);
                    let between = w[0] * first + w[1] * middle[c] + w[2] * last;
                    bends[axis] = (found[c] - between).abs().max(bends[axis]);
                }
            }
            are_quadratic = bends.iter().sum::<f64>() <= shares.solved.tolerance;
            if !are_quadratic {
                break;
            }
        }
        Lines {
            middle,
            ends,
            are_quadratic,
            bends,
        }
    }

    /// Whether the nodes of a part determine its values aside of the middles, too.
    fn meets_between(
        &self,
        shares: &Shares<'_, N>,
        part: &Cells,
        (by, channels): (By, &[Vec<f64>]),
        work: &mut Work,
    ) -> bool {
        // Half of the corners of a box of half the size.
        let asides = (0..16usize).filter(|bits| bits.count_ones() % 2 == 0);
        asides.into_iter().all(|bits| {
            let cell = [0, 1, 2, 3].map(|axis| {
                let quarter = part.length(axis) / 4;
                match bits >> axis & 1 {
                    0 => part.start[axis] + quarter,
                    _ => part.end[axis] - 1 - quarter,
                }
            });
            let found = shares.logs_at(&self.place(cell.map(|x| x as f64)), work);
            channels.iter().zip(found).all(|(values, found)| {
                let of = Determined {
                    cells: part,
                    by,
                    values,
                };
                (of.at(cell) - found).abs() <= shares.solved.tolerance
            })
        })
    }

    fn store(
        &self,
        shares: &Shares<'_, N>,
        part: Cells,
        channels: &[Vec<f64>],
        memory: &mut Memory,
    ) {
        for (c, values) in channels.iter().enumerate() {
            let blocks = &mut memory.blocks[usize::from(shares.beyond.is_some())];
            blocks.values.put(shares.pair, &part, c, values);
            if !self.with_errors {
                continue;
            }
            let of = Determined {
                cells: &shares.cells,
                by: By::Nodes,
                values: &shares.errors[c],
            };
            let (stages, relative) = (&mut memory.stages, &mut memory.relative);
            of.between(self.arch, &part, stages, relative);
            exponentials(self.arch, &mut memory.relative);
            for (error, value) in memory.relative.iter_mut().zip(values) {
                *error *= value;
            }
            blocks.errors.put(shares.pair, &part, c, &memory.relative);
        }
    }
}
