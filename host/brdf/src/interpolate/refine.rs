//! The cells of a pair of patches: fitted as one coarse block, and cut into fine ones where that is
//! not enough.
//!
//! The coarse block goes through merged nodes. Where its values change most, one fine block is
//! fitted through the bins' own nodes; if the two agree on that block's cells within what the
//! samples' noise explains, the coarse one stands. Else every part gets a block of its own, and
//! these are blended.

use super::Settings;
use super::blend::{Shifts, difference, limit_of};
use super::block::BlockSolver;
use super::coordinates::Point;
use super::levels::{Detail, Found, Levels, keep_nearest};
use super::patches::{Child, Patch};
use crate::direction::{Vec3, dot};

/// What a thread keeps from pair to pair.
#[derive(Default)]
pub struct Refiner {
    solver: BlockSolver,
    /// Merged nodes whose bins are looked at.
    near: Vec<Found>,
    found: Vec<Found>,
    places: Vec<Point>,
    /// Logarithms of the pair's cells, light by light.
    logs: Vec<[f32; 3]>,
    /// The same at the pair's corners, corner by corner of the first patch.
    corners: Vec<[f32; 3]>,
    /// Logarithms of the cells of one part.
    part: Vec<[f32; 3]>,
    /// The corners of all parts, one part after the other.
    part_corners: Vec<[f32; 3]>,
    /// How many parts a corner of the pair is in.
    parts_at: Vec<u32>,
    /// What the parts differ from each other by, at their corners.
    differences: Vec<f32>,
    shifts: Shifts,
    /// Whether variances are wanted too.
    pub with_variances: bool,
    /// Variances of the logarithms, where wanted.
    variances: Vec<[f32; 3]>,
    part_variances: Vec<[f32; 3]>,
    /// Blocks solved so far.
    pub count: Count,
}

/// Numbers of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Pairs of patches.
    pub pairs: usize,
    /// Pairs that were cut.
    pub cut: usize,
    /// Blocks fitted, coarse and fine, trials included.
    pub blocks: usize,
}

impl Count {
    /// Adds another thread's numbers.
    pub fn add(&mut self, other: Count) {
        self.pairs += other.pairs;
        self.cut += other.cut;
        self.blocks += other.blocks;
    }
}

impl Refiner {
    /// Interpolates the cells of a pair: see [`Self::logs`] and [`Self::variances`].
    pub fn solve(&mut self, levels: &Levels, settings: &Settings, p: &Patch, q: &Patch) {
        if self.solve_whole(levels, settings, p, q) {
            self.solve_parts(levels, settings, p, q);
        }
    }

    /// All parts of a pair, each in a block of its own, and no seams between them.
    fn solve_parts(&mut self, levels: &Levels, settings: &Settings, p: &Patch, q: &Patch) {
        let mut logs = std::mem::take(&mut self.logs);
        self.part_corners.clear();
        self.parts_at.clear();
        self.parts_at.resize(self.corners.len(), 0);
        self.corners.fill([0.0; 3]);
        for (a, b) in pairs_of_parts(p, q) {
            self.solve_part(levels, settings, a, b);
            for (k, place) in places_in(a, b, q).enumerate() {
                logs[place] = self.part[k];
                if self.with_variances {
                    self.variances[place] = self.part_variances[k];
                }
            }
            let first = self.part_corners.len();
            self.evaluate_corners(settings, &a.patch, &b.patch);
            for (k, corner) in corners_in(a, b, q).enumerate() {
                self.parts_at[corner] += 1;
                for c in 0..3 {
                    self.corners[corner][c] += self.part_corners[first + k][c];
                }
            }
        }
        for (sum, count) in self.corners.iter_mut().zip(&self.parts_at) {
            *sum = sum.map(|s| s / (*count).max(1) as f32);
        }
        self.differences.clear();
        let places = pairs_of_parts(p, q).flat_map(|(a, b)| corners_in(a, b, q));
        for (corner, own) in places.zip(&self.part_corners) {
            self.differences
                .push(difference(*own, self.corners[corner]));
        }
        let limit = limit_of(&mut self.differences, settings.blend_limit());
        let mut first = 0;
        for (a, b) in pairs_of_parts(p, q) {
            self.shifts.clear();
            for corner in corners_in(a, b, q) {
                let (own, mean) = (self.part_corners[first], self.corners[corner]);
                self.shifts.push(own, mean, limit);
                first += 1;
            }
            self.part.clear();
            self.part
                .extend(places_in(a, b, q).map(|place| logs[place]));
            self.shifts.apply(&a.patch, &b.patch, &mut self.part);
            for (k, place) in places_in(a, b, q).enumerate() {
                logs[place] = self.part[k];
            }
        }
        self.logs = logs;
    }

    /// The pair as one coarse block; whether it must be cut.
    fn solve_whole(&mut self, levels: &Levels, settings: &Settings, p: &Patch, q: &Patch) -> bool {
        self.count.pairs += 1;
        self.fit_whole(levels, settings, p, q);
        let mut logs = std::mem::take(&mut self.logs);
        self.evaluate(settings, p, q, &mut logs);
        if self.with_variances {
            self.variances.clear();
            self.solver.variances_at(&self.places, &mut self.variances);
        }
        self.part_corners.clear();
        self.evaluate_corners(settings, p, q);
        std::mem::swap(&mut self.corners, &mut self.part_corners);
        let mut cut = false;
        if let Some((a, b)) = steepest(&logs, p, q).filter(|_| settings.cuts()) {
            self.solve_part(levels, settings, a, b);
            let limit = settings.tolerance * settings.noise_variance.sqrt().max(NOISE_MIN);
            cut = self.rms_from(&logs, q, a, b) > limit;
        }
        self.count.cut += usize::from(cut);
        self.logs = logs;
        cut
    }

    /// Natural logarithms of the cells of the last pair, light by light.
    pub fn logs(&self) -> &[[f32; 3]] {
        &self.logs
    }

    /// The same at the pair's corners, corner by corner of the first patch.
    pub fn corners(&self) -> &[[f32; 3]] {
        &self.corners
    }

    /// Variances of these logarithms, not calibrated; none unless [`Self::with_variances`] is set.
    pub fn variances(&self) -> &[[f32; 3]] {
        &self.variances
    }

    /// The natural logarithm at one place of a pair, and its variance, each per channel: what
    /// [`Self::solve`] would give for a cell there.
    pub fn predict(
        &mut self,
        levels: &Levels,
        settings: &Settings,
        (p, q): (&Patch, &Patch),
        (light, view): (Vec3, Vec3),
    ) -> ([f32; 3], [f32; 3]) {
        // Only where a pair may be cut must its cells be known.
        let cut = settings.cuts() && self.solve_whole(levels, settings, p, q);
        let nearest = |patch: &'_ Patch, direction: Vec3| {
            let along = |c: &Child| dot(c.patch.centre, direction);
            let parts = 0..patch.children.len();
            parts.max_by(|a, b| along(&patch.children[*a]).total_cmp(&along(&patch.children[*b])))
        };
        match (nearest(p, light), nearest(q, view)) {
            (Some(a), Some(b)) if cut => {
                let centre = (p.children[a].patch.centre, q.children[b].patch.centre);
                self.fit_part(levels, settings, centre.0, centre.1);
            }
            _ => self.fit_whole(levels, settings, p, q),
        }
        let place = [settings.coordinates.point(light, view)];
        self.part.clear();
        self.solver.evaluate(&place, &mut self.part);
        let log = self.part[0];
        self.part.clear();
        self.solver.variances_at(&place, &mut self.part);
        (log, self.part[0])
    }

    /// A coarse block, through merged nodes.
    fn fit_whole(&mut self, levels: &Levels, settings: &Settings, p: &Patch, q: &Patch) {
        let centre = settings.coordinates.point(p.centre, q.centre);
        levels.around(&centre, settings.nodes, &mut self.found);
        self.fit(levels, settings, Detail::Merged, centre);
    }

    /// A fine block around a pair of directions, through the bins' own nodes.
    fn fit_part(&mut self, levels: &Levels, settings: &Settings, light: Vec3, view: Vec3) {
        let centre = settings.coordinates.point(light, view);
        levels.around(&centre, settings.nodes / 2, &mut self.near);
        levels.expand(&centre, &self.near, &mut self.found);
        self.fit(levels, settings, Detail::Bins, centre);
    }

    /// Fits the nearest of `found` around a place.
    fn fit(&mut self, levels: &Levels, settings: &Settings, detail: Detail, centre: Point) {
        self.count.blocks += 1;
        let radius = keep_nearest(&mut self.found, settings.nodes);
        let nodes = levels.nodes(detail);
        self.solver.fit(
            self.found.iter().map(|(_, k)| &nodes[*k as usize]),
            centre,
            radius,
            &settings.block(),
        );
    }

    fn evaluate(&mut self, settings: &Settings, p: &Patch, q: &Patch, logs: &mut Vec<[f32; 3]>) {
        self.places.clear();
        for light in &p.vectors {
            for view in &q.vectors {
                self.places.push(settings.coordinates.point(*light, *view));
            }
        }
        logs.clear();
        self.solver.evaluate(&self.places, logs);
    }

    /// Appends what the block gives at the corners of a pair.
    fn evaluate_corners(&mut self, settings: &Settings, p: &Patch, q: &Patch) {
        self.places.clear();
        for light in &p.corner_vectors {
            for view in &q.corner_vectors {
                self.places.push(settings.coordinates.point(*light, *view));
            }
        }
        self.solver.evaluate(&self.places, &mut self.part_corners);
    }

    /// A pair of parts in a fine block.
    fn solve_part(&mut self, levels: &Levels, settings: &Settings, a: &Child, b: &Child) {
        self.fit_part(levels, settings, a.patch.centre, b.patch.centre);
        let mut part = std::mem::take(&mut self.part);
        self.evaluate(settings, &a.patch, &b.patch, &mut part);
        self.part = part;
        if self.with_variances {
            self.part_variances.clear();
            self.solver
                .variances_at(&self.places, &mut self.part_variances);
        }
    }

    /// RMS difference of the part from the whole.
    fn rms_from(&self, logs: &[[f32; 3]], q: &Patch, a: &Child, b: &Child) -> f32 {
        let mut sum = 0.0;
        for (k, place) in places_in(a, b, q).enumerate() {
            for c in 0..3 {
                sum += (self.part[k][c] - logs[place][c]).powi(2);
            }
        }
        (sum / (3 * self.part.len().max(1)) as f32).sqrt()
    }
}

/// Two fits through different nodes never agree better than this, whatever the samples' noise.
pub(super) const NOISE_MIN: f32 = 0.003;

/// Where the cells of a pair of parts stand among those of the whole.
fn places_in(a: &Child, b: &Child, q: &Patch) -> impl Iterator<Item = usize> {
    let width = q.directions.len();
    a.places.iter().flat_map(move |i| {
        b.places
            .iter()
            .map(move |j| *i as usize * width + *j as usize)
    })
}

/// Where the corners of a pair of parts stand among those of the whole.
fn corners_in(a: &Child, b: &Child, q: &Patch) -> impl Iterator<Item = usize> {
    let width = q.corners.len();
    a.corner_places.iter().flat_map(move |i| {
        b.corner_places
            .iter()
            .map(move |j| *i as usize * width + *j as usize)
    })
}

fn pairs_of_parts<'a>(
    p: &'a Patch,
    q: &'a Patch,
) -> impl Iterator<Item = (&'a Child, &'a Child)> + use<'a> {
    p.children
        .iter()
        .flat_map(|a| q.children.iter().map(move |b| (a, b)))
}

/// The pair of parts over which the values change most; `None` where there are no parts.
fn steepest<'a>(logs: &[[f32; 3]], p: &'a Patch, q: &'a Patch) -> Option<(&'a Child, &'a Child)> {
    let mut best = None;
    let mut steepest = f32::NEG_INFINITY;
    for a in &p.children {
        for b in &q.children {
            let mut low = [f32::INFINITY; 3];
            let mut high = [f32::NEG_INFINITY; 3];
            for place in places_in(a, b, q) {
                for c in 0..3 {
                    low[c] = low[c].min(logs[place][c]);
                    high[c] = high[c].max(logs[place][c]);
                }
            }
            let change: f32 = (0..3).map(|c| high[c] - low[c]).sum();
            if change > steepest {
                steepest = change;
                best = Some((a, b));
            }
        }
    }
    best
}
