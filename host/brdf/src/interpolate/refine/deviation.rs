//! Where a coarse block is enough: by how much a fine one would differ from it, and whether its cells
//! follow from its corners.

use super::Refiner;
use super::places::{corners_in, evenly_spread, pairs_of_parts};
use crate::interpolate::FillSettings;
use crate::interpolate::from_corners::weights_of;
use crate::interpolate::hierarchy::Neighbours;
use crate::interpolate::patches::{Part, Patch};

/// Cells may differ from what the corners give by this many standard deviations of a sample, times the
/// tolerance …
const SMOOTH: f32 = 0.15;
/// … and by no more than this.
const SMOOTH_MAX: f32 = 1.0;

/// The limit of a coarse block's own variance, as a share of what would be tolerated. Below it no fine block
/// is fitted to compare: hardly any of the blocks that must be refined have so little variance, and
/// comparing all would cost as much again as the coarse blocks.
const VARIANCE_LIMIT: f32 = 0.1;

impl<const N: usize> Refiner<N> {
    /// By how many standard deviations of a sample the coarse block of a pair may be off in each pair of
    /// parts, as far as one fine block tells; none where its variance is below the limit.
    pub fn deviations(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        pair: (&Patch, &Patch),
    ) -> &[f32] {
        self.fit_coarse(data, settings, pair);
        self.estimate_deviations(data, settings, pair);
        &self.deviations
    }

    /// Whether any part of the pair needs a block of its own beside the coarse one that was fitted last.
    pub(super) fn needs_refinement(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        pair: (&Patch, &Patch),
    ) -> bool {
        let (p, q) = pair;
        settings.refines() && !p.parts.is_empty() && {
            self.estimate_deviations(data, settings, pair);
            let parts = p.parts.len() * q.parts.len();
            (0..parts).any(|number| self.exceeds_tolerance(settings, number))
        }
    }

    /// Whether a pair of parts needs a block of its own.
    pub(super) fn exceeds_tolerance(&self, settings: &FillSettings, number: usize) -> bool {
        settings.tolerance == 0.0
            || self
                .deviations
                .get(number)
                .is_some_and(|deviation| *deviation > settings.tolerance)
    }

    /// [`Self::deviations`] of the coarse block that was fitted last.
    fn estimate_deviations(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        (p, q): (&Patch, &Patch),
    ) {
        self.deviations.clear();
        if settings.tolerance == 0.0 {
            return;
        }
        let changes = pairs_of_parts(p, q).map(|(a, b)| change(&self.corners, corners_in(a, b, q)));
        self.deviations.extend(changes);
        let steepest = pairs_of_parts(p, q)
            .zip(&self.deviations)
            .max_by(|a, b| a.1.total_cmp(b.1));
        let Some(((a, b), most)) = steepest else {
            return;
        };
        let most = most.max(f32::MIN_POSITIVE);
        let deviation = self.deviation_in(data, settings, (a, b));
        // In proportion to the change, parts that bend without much change would be passed over.
        self.deviations
            .iter_mut()
            .for_each(|d| *d = deviation * (*d / most).sqrt());
    }

    /// By how many standard deviations of a sample a fine block differs from the coarse one in a pair of
    /// parts; 0 where the coarse one's variance is below the limit.
    fn deviation_in(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        (a, b): (&Part, &Part),
    ) -> f32 {
        let (lights, views) = (&a.patch.vectors, &b.patch.vectors);
        self.places.clear();
        for light in evenly_spread(lights) {
            for view in evenly_spread(views) {
                let point = settings.coordinates.point(lights[light], views[view]);
                self.places.push(point);
            }
        }
        let noise = settings.noise_sigma();
        let part = &mut self.part;
        part.variances.clear();
        self.coarse.variances_at(&self.places, &mut part.variances);
        let variance =
            part.variances.iter().flatten().sum::<f32>() / (N * part.variances.len()).max(1) as f32;
        if variance < VARIANCE_LIMIT * (settings.tolerance * noise).powi(2) {
            return 0.0;
        }
        self.logs.clear();
        self.coarse.evaluate(&self.places, &mut self.logs);
        let at = (a.patch.centre, b.patch.centre);
        self.fit_fine(data, settings, at);
        self.part.logs.clear();
        self.fine.evaluate(&self.places, &mut self.part.logs);
        std::mem::swap(&mut self.fine, &mut self.compared);
        (self.fine_at, self.compared_at) = (None, Some(at));
        let logs = &self.part.logs;
        let pairs = self.logs.iter().flatten().zip(logs.iter().flatten());
        let squares: f32 = pairs.map(|(x, y)| (x - y).powi(2)).sum();
        (squares / (N * logs.len()).max(1) as f32).sqrt() / noise
    }

    /// Whether the cells of the coarse block that was fitted last follow from its corners: some cells are
    /// evaluated to see.
    pub(super) fn follows_from_corners(
        &mut self,
        settings: &FillSettings,
        (p, q): (&Patch, &Patch),
    ) -> bool {
        let Some(weights) = weights_of(p, q) else {
            return false;
        };
        let (lights, views) = (evenly_spread(&p.vectors), evenly_spread(&q.vectors));
        self.places.clear();
        for light in lights.clone() {
            for view in views.clone() {
                let point = settings
                    .coordinates
                    .point(p.vectors[light], q.vectors[view]);
                self.places.push(point);
            }
        }
        let cells = &mut self.part.logs;
        cells.clear();
        self.coarse.evaluate(&self.places, cells);
        self.from_corners.load(&self.corners, q.corners.len());
        let difference = self
            .from_corners
            .largest_difference(weights, lights, views, cells);
        let tolerated = (SMOOTH * settings.tolerance.max(1.0)).min(SMOOTH_MAX);
        difference <= tolerated * settings.noise_sigma()
    }
}

/// By how much values change among some corners, summed over the channels.
fn change<const N: usize>(values: &[[f32; N]], corners: impl Iterator<Item = usize>) -> f32 {
    let mut low = [f32::INFINITY; N];
    let mut high = [f32::NEG_INFINITY; N];
    for corner in corners {
        for c in 0..N {
            low[c] = low[c].min(values[corner][c]);
            high[c] = high[c].max(values[corner][c]);
        }
    }
    (0..N).map(|c| high[c] - low[c]).sum()
}
