//! The cells of a pair of patches: fitted as one coarse block, and cut into fine ones where that is
//! not enough.
//!
//! The coarse block goes through merged nodes. Where its values change most, its own variance is
//! looked at; if that is more than what noise explains, one fine block is fitted there through the
//! bins' own nodes. By how much the two differ there, the other parts are doubted by the root of
//! their share in that change; parts that are doubted beyond the tolerance get a block of their own,
//! the others keep the coarse one, and all are blended.

use super::Settings;
use super::blend::{Shifts, difference, limit_of};
use super::block::BlockSolver;
use super::coordinates::Point;
use super::from_corners::{FromCorners, weights_of};
use super::levels::{Detail, Found, Neighbours, keep_nearest};
use super::patches::{Child, Patch};
use crate::direction::{Vec3, dot};

/// What a thread keeps from pair to pair.
#[derive(Default)]
pub struct Refiner {
    /// The block of the pair, and the one of a part.
    whole: BlockSolver,
    fine: BlockSolver,
    /// The block that a doubt was settled by, and around what it was fitted: should the pair be cut, it
    /// serves again.
    trial: BlockSolver,
    trial_at: Option<(Vec3, Vec3)>,
    /// By how many standard deviations of a sample the coarse block may be off in each pair of parts; none
    /// where it is sure of itself.
    doubts: Vec<f32>,
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
    /// What the coarse block gives at the pair's corners, where parts may give something else.
    whole_corners: Vec<[f32; 3]>,
    /// The corners of all parts, one part after the other.
    part_corners: Vec<[f32; 3]>,
    /// How many parts a corner of the pair is in.
    parts_at: Vec<u32>,
    /// What the parts differ from each other by, at their corners.
    differences: Vec<f32>,
    shifts: Shifts,
    from_corners: FromCorners,
    /// Whether the cells of the last pair follow from its corners.
    smooth: bool,
    /// Whether variances are wanted too.
    pub with_variances: bool,
    /// Variances of the logarithms, where wanted.
    variances: Vec<[f32; 3]>,
    part_variances: Vec<[f32; 3]>,
    /// Blocks solved so far.
    pub count: Count,
}

/// What a block makes of some places.
pub struct Predicted<'a> {
    /// Natural logarithms.
    pub logs: &'a [[f32; 3]],
    /// Variance of the first.
    pub variance: [f32; 3],
    /// Variance of their mean.
    pub variance_of_mean: [f32; 3],
}

/// So many places, about, tell the variance of the mean of more.
const MEAN_OF: usize = 8;

/// Numbers of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Pairs of patches.
    pub pairs: usize,
    /// Pairs that were cut.
    pub cut: usize,
    /// Pairs of parts that got a block of their own.
    pub parts: usize,
}

impl Refiner {
    /// Interpolates the cells of a pair: see [`Self::logs`] and [`Self::variances`].
    pub fn solve(&mut self, levels: &impl Neighbours, settings: &Settings, p: &Patch, q: &Patch) {
        self.fit_whole(levels, settings, p, q);
        if self.is_to_be_cut(levels, settings, p, q) {
            self.smooth = false;
            self.solve_parts(levels, settings, p, q);
            return;
        }
        self.smooth = self.whole_is_smooth(settings, p, q);
        if self.smooth && !self.with_variances {
            return;
        }
        write_places(settings, p, q, &mut self.places);
        self.logs.clear();
        self.whole.evaluate(&self.places, &mut self.logs);
        if self.with_variances {
            self.variances.clear();
            self.whole.variances_at(&self.places, &mut self.variances);
        }
    }

    /// By how many standard deviations of a sample a fine block may differ from the coarse one in each
    /// pair of parts; none where the coarse one is sure enough of itself.
    pub fn doubts(
        &mut self,
        levels: &impl Neighbours,
        settings: &Settings,
        p: &Patch,
        q: &Patch,
    ) -> &[f32] {
        self.fit_whole(levels, settings, p, q);
        self.doubt_whole(levels, settings, p, q);
        &self.doubts
    }

    /// All parts of a pair, those that are doubted in a block of their own, and no seams between them.
    fn solve_parts(&mut self, levels: &impl Neighbours, settings: &Settings, p: &Patch, q: &Patch) {
        let mut logs = std::mem::take(&mut self.logs);
        let cells = p.directions.len() * q.directions.len();
        logs.resize(cells, [0.0; 3]);
        if self.with_variances {
            self.variances.resize(cells, [0.0; 3]);
        }
        self.part_corners.clear();
        self.parts_at.clear();
        self.parts_at.resize(self.corners.len(), 0);
        self.whole_corners.clone_from(&self.corners);
        self.corners.fill([0.0; 3]);
        for (number, (a, b)) in pairs_of_parts(p, q).enumerate() {
            let first = self.part_corners.len();
            if self.is_part_doubted(settings, number) {
                self.count.parts += 1;
                self.solve_part(levels, settings, a, b);
            } else {
                self.keep_part(settings, a, b, q);
            }
            for (k, place) in places_in(a, b, q).enumerate() {
                logs[place] = self.part[k];
                if self.with_variances {
                    self.variances[place] = self.part_variances[k];
                }
            }
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

    /// Whether the coarse block that was fitted last does not do.
    fn is_to_be_cut(
        &mut self,
        levels: &impl Neighbours,
        settings: &Settings,
        p: &Patch,
        q: &Patch,
    ) -> bool {
        self.count.pairs += 1;
        let cut = settings.cuts() && !p.children.is_empty() && {
            self.doubt_whole(levels, settings, p, q);
            let parts = p.children.len() * q.children.len();
            (0..parts).any(|number| self.is_part_doubted(settings, number))
        };
        self.count.cut += usize::from(cut);
        cut
    }

    /// Whether a pair of parts needs a block of its own.
    fn is_part_doubted(&self, settings: &Settings, number: usize) -> bool {
        settings.tolerance == 0.0
            || self
                .doubts
                .get(number)
                .is_some_and(|doubt| *doubt > settings.tolerance)
    }

    /// [`Self::doubts`] of the coarse block that was fitted last.
    fn doubt_whole(&mut self, levels: &impl Neighbours, settings: &Settings, p: &Patch, q: &Patch) {
        self.doubts.clear();
        if settings.tolerance == 0.0 {
            return;
        }
        let changes = pairs_of_parts(p, q).map(|(a, b)| change(&self.corners, corners_in(a, b, q)));
        self.doubts.extend(changes);
        let steepest = pairs_of_parts(p, q)
            .zip(&self.doubts)
            .max_by(|a, b| a.1.total_cmp(b.1));
        let Some(((a, b), most)) = steepest else {
            return;
        };
        let most = most.max(f32::MIN_POSITIVE);
        let doubt = self.doubt_between(levels, settings, a, b);
        // In proportion to the change, parts that bend without much change would be passed over.
        self.doubts
            .iter_mut()
            .for_each(|d| *d = doubt * (*d / most).sqrt());
    }

    /// By how many standard deviations of a sample a fine block differs from the coarse one in a pair of
    /// parts; 0 where the coarse one is sure enough of itself.
    fn doubt_between(
        &mut self,
        levels: &impl Neighbours,
        settings: &Settings,
        a: &Child,
        b: &Child,
    ) -> f32 {
        self.places.clear();
        for light in some_of(&a.patch.vectors) {
            for view in some_of(&b.patch.vectors) {
                self.places.push(settings.coordinates.point(*light, *view));
            }
        }
        let noise = settings.noise_sigma();
        self.part_variances.clear();
        self.whole
            .variances_at(&self.places, &mut self.part_variances);
        let variance = self.part_variances.iter().flatten().sum::<f32>()
            / (3 * self.part_variances.len()).max(1) as f32;
        if variance < SURE * (settings.tolerance * noise).powi(2) {
            return 0.0;
        }
        self.logs.clear();
        self.whole.evaluate(&self.places, &mut self.logs);
        self.fit_part(levels, settings, a.patch.centre, b.patch.centre);
        self.part.clear();
        self.fine.evaluate(&self.places, &mut self.part);
        std::mem::swap(&mut self.fine, &mut self.trial);
        self.trial_at = Some((a.patch.centre, b.patch.centre));
        let pairs = self.logs.iter().flatten().zip(self.part.iter().flatten());
        let squares: f32 = pairs.map(|(x, y)| (x - y).powi(2)).sum();
        (squares / (3 * self.part.len()).max(1) as f32).sqrt() / noise
    }

    /// Whether the coarse block that was fitted last tells its cells by its corners: at some cells it is
    /// asked.
    fn whole_is_smooth(&mut self, settings: &Settings, p: &Patch, q: &Patch) -> bool {
        let Some(weights) = weights_of(p, q) else {
            return false;
        };
        let (lights, views) = (places_of_some(&p.vectors), places_of_some(&q.vectors));
        self.places.clear();
        for light in lights.clone() {
            for view in views.clone() {
                let point = settings
                    .coordinates
                    .point(p.vectors[light], q.vectors[view]);
                self.places.push(point);
            }
        }
        self.part.clear();
        self.whole.evaluate(&self.places, &mut self.part);
        self.from_corners.load(&self.corners, q.corners.len());
        let difference = self
            .from_corners
            .largest_difference(weights, lights, views, &self.part);
        let tolerated = (SMOOTH * settings.tolerance.max(1.0)).min(SMOOTH_MAX);
        difference <= tolerated * settings.noise_sigma()
    }

    /// Whether the last pair needs no cells: they follow from its corners.
    pub fn is_smooth(&self) -> bool {
        self.smooth
    }

    /// Natural logarithms of the cells of the last pair, light by light; none where it
    /// [is smooth](Self::is_smooth), unless variances are wanted.
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

    /// The natural logarithms at places of a pair: what [`Self::solve`] would give for cells there. The
    /// block is that of the first of them; of the others those are kept that it serves for too.
    /// Variances are not calibrated.
    pub fn predict(
        &mut self,
        levels: &impl Neighbours,
        settings: &Settings,
        (p, q): (&Patch, &Patch),
        places: &mut Vec<impl AsRef<(Vec3, Vec3)>>,
    ) -> Predicted<'_> {
        self.fit_whole(levels, settings, p, q);
        let cut = self.is_to_be_cut(levels, settings, p, q);
        let nearest = |patch: &'_ Patch, direction: Vec3| {
            let along = |c: &Child| dot(c.patch.centre, direction);
            let parts = 0..patch.children.len();
            parts.max_by(|a, b| along(&patch.children[*a]).total_cmp(&along(&patch.children[*b])))
        };
        let part_of = |(light, view): (Vec3, Vec3)| {
            Some(nearest(p, light)? * q.children.len() + nearest(q, view)?)
        };
        let doubted = |number: Option<usize>| {
            cut && number.is_some_and(|number| self.is_part_doubted(settings, number))
        };
        let first = places.first().and_then(|place| part_of(*place.as_ref()));
        let is_fine = doubted(first);
        places.retain(|place| {
            let part = part_of(*place.as_ref());
            if is_fine {
                part == first
            } else {
                !doubted(part)
            }
        });
        let block = match first {
            Some(number) if is_fine => {
                let (a, b) = (number / q.children.len(), number % q.children.len());
                let centre = (p.children[a].patch.centre, q.children[b].patch.centre);
                self.fit_part(levels, settings, centre.0, centre.1);
                &mut self.fine
            }
            _ => &mut self.whole,
        };
        self.places.clear();
        let points = places.iter().map(|place| {
            let (light, view) = place.as_ref();
            settings.coordinates.point(*light, *view)
        });
        self.places.extend(points);
        self.part.clear();
        block.evaluate(&self.places, &mut self.part);
        self.part_variances.clear();
        block.variances_at(
            &self.places[..1.min(places.len())],
            &mut self.part_variances,
        );
        let step = places.len().div_ceil(MEAN_OF).max(1);
        self.places = self.places.iter().copied().step_by(step).collect();
        Predicted {
            logs: &self.part,
            variance: self.part_variances.first().copied().unwrap_or_default(),
            variance_of_mean: block.variance_of_mean(&self.places),
        }
    }

    /// A coarse block, through merged nodes, and what it gives at the corners.
    fn fit_whole(&mut self, levels: &impl Neighbours, settings: &Settings, p: &Patch, q: &Patch) {
        let centre = settings.coordinates.point(p.centre, q.centre);
        let nodes = settings.coarse_nodes();
        levels.around(&centre, nodes, &mut self.found);
        self.trial_at = None;
        let radius = keep_nearest(&mut self.found, nodes);
        let nodes = self.found.iter();
        let nodes = nodes.map(|(_, k)| levels.node(Detail::Merged, *k));
        self.whole.fit(nodes, centre, radius, &settings.block());
        write_corners(settings, p, q, &mut self.places);
        self.corners.clear();
        self.whole.evaluate(&self.places, &mut self.corners);
    }

    /// A fine block around a pair of directions, through the bins' own nodes.
    fn fit_part(&mut self, levels: &impl Neighbours, settings: &Settings, light: Vec3, view: Vec3) {
        let centre = settings.coordinates.point(light, view);
        levels.around(&centre, settings.nodes / 2, &mut self.near);
        keep_nearest(&mut self.near, settings.nodes / 2);
        levels.expand(&centre, &self.near, &mut self.found);
        let radius = keep_nearest(&mut self.found, settings.nodes);
        let nodes = self.found.iter();
        let nodes = nodes.map(|(_, k)| levels.node(Detail::Bins, *k));
        self.fine.fit(nodes, centre, radius, &settings.block());
    }

    /// A pair of parts in a fine block: its cells and, appended, its corners.
    fn solve_part(&mut self, levels: &impl Neighbours, settings: &Settings, a: &Child, b: &Child) {
        let at = (a.patch.centre, b.patch.centre);
        if self.trial_at == Some(at) {
            std::mem::swap(&mut self.fine, &mut self.trial);
            self.trial_at = None;
        } else {
            self.fit_part(levels, settings, at.0, at.1);
        }
        write_corners(settings, &a.patch, &b.patch, &mut self.places);
        self.fine.evaluate(&self.places, &mut self.part_corners);
        write_places(settings, &a.patch, &b.patch, &mut self.places);
        self.part.clear();
        self.fine.evaluate(&self.places, &mut self.part);
        if self.with_variances {
            self.part_variances.clear();
            self.fine
                .variances_at(&self.places, &mut self.part_variances);
        }
    }

    /// The same in the coarse block.
    fn keep_part(&mut self, settings: &Settings, a: &Child, b: &Child, q: &Patch) {
        let corners = corners_in(a, b, q).map(|corner| self.whole_corners[corner]);
        self.part_corners.extend(corners);
        write_places(settings, &a.patch, &b.patch, &mut self.places);
        self.part.clear();
        self.whole.evaluate(&self.places, &mut self.part);
        if self.with_variances {
            self.part_variances.clear();
            self.whole
                .variances_at(&self.places, &mut self.part_variances);
        }
    }
}

/// The cells of a pair of patches, light by light.
fn write_places(settings: &Settings, p: &Patch, q: &Patch, places: &mut Vec<Point>) {
    write_pairs(settings, &p.vectors, &q.vectors, places);
}

/// Their corners, corner by corner of the first.
fn write_corners(settings: &Settings, p: &Patch, q: &Patch, places: &mut Vec<Point>) {
    write_pairs(settings, &p.corner_vectors, &q.corner_vectors, places);
}

fn write_pairs(settings: &Settings, lights: &[Vec3], views: &[Vec3], places: &mut Vec<Point>) {
    places.clear();
    for light in lights {
        for view in views {
            places.push(settings.coordinates.point(*light, *view));
        }
    }
}

/// Up to four of some directions, evenly spread.
fn some_of(directions: &[Vec3]) -> impl Iterator<Item = &Vec3> {
    places_of_some(directions).map(|place| &directions[place])
}

/// Where they stand.
fn places_of_some(directions: &[Vec3]) -> impl Iterator<Item = usize> + Clone + use<> {
    (0..directions.len()).step_by(directions.len().div_ceil(4).max(1))
}

/// Cells may differ from what the corners give by this many standard deviations of a sample, times the
/// tolerance …
const SMOOTH: f32 = 0.15;
/// … and by no more than this.
const SMOOTH_MAX: f32 = 1.0;

/// A coarse block whose own variance is less than this share of what would be tolerated is not doubted:
/// hardly any of those that must be cut are as sure of themselves, and asking all would cost as much
/// again as the coarse blocks.
const SURE: f32 = 0.1;

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

/// By how much values change among some corners, summed over the channels.
fn change(values: &[[f32; 3]], corners: impl Iterator<Item = usize>) -> f32 {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for corner in corners {
        for c in 0..3 {
            low[c] = low[c].min(values[corner][c]);
            high[c] = high[c].max(values[corner][c]);
        }
    }
    (0..3).map(|c| high[c] - low[c]).sum()
}
