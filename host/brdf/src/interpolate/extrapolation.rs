//! Pairs of patches that lie wholly beyond all measured pairs of polar angles, as both grazing ones do on the paper's plan:
//! no data surround them, so that a trend has to be carried on.
//!
//! Three things differ there, measured on materials of many kinds (docs/src/explanation/interpolation.md). A block takes three
//! times the data: few of them lie all on the edge of what was measured, and a trend hardly shows. Its coordinates
//! are near those of the half vector whatever the interior prefers, because lobes go on along it. And its values may rise
//! twice as far beyond its data's, as lobes do towards the horizon.

use super::FillSettings;
use super::coordinates::Coordinates;
use super::data::{Data, SORTED_IN};
use super::hierarchy::Hierarchy;
use super::origin::rows_within_reach;
use super::patches::Patch;

/// The data that many are sorted in serve as they are.
const COORDINATES: Coordinates = SORTED_IN;
/// A block takes so many times the data …
const TIMES_THE_DATA: usize = 3;
/// … but no more than this, or what the settings say.
const MOST_DATA: usize = 384;
/// By what the limit of values beyond the data's is multiplied.
const TIMES_BEYOND: f32 = 2.0;
/// Blocks of three times the data are some five times as dear, so that one pair in so many may be beyond at most: on the paper's
/// plan one in 45 is. With more, as where light came from one direction, all pairs are solved alike.
const ONE_IN: usize = 30;

/// How such pairs are solved.
pub(super) struct Extrapolation<'a, const N: usize> {
    data: &'a Data<'a, N>,
    moved: Option<Hierarchy<N>>,
    settings: FillSettings,
    /// Data of a block elsewhere.
    usual_data: usize,
    /// See [`rows_within_reach`].
    rows: Vec<usize>,
}

impl<'a, const N: usize> Extrapolation<'a, N> {
    /// `None` where no pairs of these patches are beyond, too many are, or the settings do not refine: a preview is quick.
    pub(super) fn new(
        data: &'a Data<'a, N>,
        settings: &FillSettings,
        patches: &[Patch],
    ) -> Option<Self> {
        if !settings.refines() {
            return None;
        }
        let rows = rows_within_reach(data.bins());
        let beyond: usize = (0..patches.len())
            .map(|p| {
                let partners = patches[p..].iter();
                partners
                    .filter(|q| are_beyond(&rows, &patches[p], q))
                    .count()
            })
            .sum();
        let pairs = patches.len() * (patches.len() + 1) / 2;
        (beyond > 0 && ONE_IN * beyond <= pairs).then(|| Self {
            data,
            moved: data.moved(COORDINATES),
            settings: FillSettings {
                coordinates: COORDINATES,
                neighbours: (TIMES_THE_DATA * settings.neighbours)
                    .min(MOST_DATA.max(settings.neighbours)),
                beyond: TIMES_BEYOND * settings.beyond,
                ..*settings
            },
            usual_data: settings.neighbours.max(1),
            rows,
        })
    }

    /// Whether a pair of patches lies wholly beyond.
    pub(super) fn is_beyond(&self, (p, q): (&Patch, &Patch)) -> bool {
        are_beyond(&self.rows, p, q)
    }

    /// The data, in the coordinates of [`Self::settings`].
    pub(super) fn hierarchy(&self) -> &Hierarchy<N> {
        self.moved.as_ref().unwrap_or(self.data.hierarchy())
    }

    /// By what standard errors are multiplied there: the variance of a mean falls with the number of its data, that of a trend which is
    /// carried on does not.
    pub(super) fn error_factor(&self) -> f32 {
        (self.settings.neighbours as f32 / self.usual_data as f32).sqrt()
    }

    /// What these pairs are solved with.
    pub(super) fn settings(&self) -> &FillSettings {
        &self.settings
    }
}

/// Whether even the lowest rows of two patches were not measured together, nor any higher ones.
fn are_beyond(rows: &[usize], p: &Patch, q: &Patch) -> bool {
    rows.get(p.rows.start)
        .is_some_and(|end| q.rows.start >= *end)
}
