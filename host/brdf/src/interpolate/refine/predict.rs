//! What the block of some places predicts there: for cross-validation.

use super::Refiner;
use crate::direction::{Vec3, dot};
use crate::interpolate::FillSettings;
use crate::interpolate::hierarchy::Neighbours;
use crate::interpolate::patches::{Part, Patch};

/// What a block gives at some places.
#[derive(Clone, Copy, Debug)]
pub struct Predicted<'a, const N: usize = 3> {
    /// Natural logarithms.
    pub logs: &'a [[f32; N]],
    /// Variance of the first.
    pub variance: [f32; N],
    /// Variance of their mean.
    pub variance_of_mean: [f32; N],
}

/// So many places, about, tell the variance of the mean of more.
const MEAN_OF: usize = 8;

impl<const N: usize> Refiner<N> {
    /// Fits the coarse block of a pair and finds which of its parts get one of their own, for any number of calls of
    /// [`Self::predict`].
    pub fn prepare(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        pair: (&Patch, &Patch),
    ) {
        self.fit_coarse(data, settings, pair);
        self.refines = self.needs_refinement(data, settings, pair);
    }

    /// The natural logarithms at places of the pair that [`Self::prepare`] was called with: what [`Self::solve`] would
    /// give for cells there. The block is that of the first of them; of the others those are kept that it serves for too.
    /// Variances are not calibrated. Calls one after the other in the same [`part_of`] the pair share its block.
    pub fn predict(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        pair: (&Patch, &Patch),
        places: &mut Vec<impl AsRef<(Vec3, Vec3)>>,
    ) -> Predicted<'_, N> {
        let has_own = |number: Option<usize>| {
            self.refines && number.is_some_and(|number| self.exceeds_tolerance(settings, number))
        };
        let first = places
            .first()
            .and_then(|place| part_of(pair, *place.as_ref()));
        let is_fine = has_own(first);
        places.retain(|place| {
            let part = part_of(pair, *place.as_ref());
            if is_fine {
                part == first
            } else {
                !has_own(part)
            }
        });
        let block = match first {
            Some(number) if is_fine => {
                let (p, q) = pair;
                let (a, b) = (number / q.parts.len(), number % q.parts.len());
                let at = (p.parts[a].patch.centre, q.parts[b].patch.centre);
                self.make_fine(data, settings, at);
                &mut self.fine
            }
            _ => &mut self.coarse,
        };
        self.places.clear();
        let points = places.iter().map(|place| {
            let (light, view) = place.as_ref();
            settings.coordinates.point(*light, *view)
        });
        self.places.extend(points);
        let part = &mut self.part;
        part.logs.clear();
        block.evaluate(&self.places, &mut part.logs);
        part.variances.clear();
        block.variances_at(&self.places[..1.min(places.len())], &mut part.variances);
        let step = places.len().div_ceil(MEAN_OF).max(1);
        self.places = self.places.iter().copied().step_by(step).collect();
        Predicted {
            logs: &part.logs,
            variance: part.variances.first().copied().unwrap_or([0.0; N]),
            variance_of_mean: block.variance_of_mean(&self.places),
        }
    }
}

/// The number of the pair of parts that a pair of directions is in; `None` where patches have no parts.
pub fn part_of((p, q): (&Patch, &Patch), (light, view): (Vec3, Vec3)) -> Option<usize> {
    Some(nearest_part(p, light)? * q.parts.len() + nearest_part(q, view)?)
}

/// The number of the part of a patch whose centre is nearest to a direction.
fn nearest_part(patch: &Patch, direction: Vec3) -> Option<usize> {
    let along = |part: &Part| dot(part.patch.centre, direction);
    let parts = 0..patch.parts.len();
    parts.max_by(|a, b| along(&patch.parts[*a]).total_cmp(&along(&patch.parts[*b])))
}
