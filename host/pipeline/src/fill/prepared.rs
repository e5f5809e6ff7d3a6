//! Samples, read for what they are: sorted out, in bins, with the symmetry that they have.

use super::FillCounts;
use super::groups::spread_over;
use super::options::FillOptions;
use super::origins::Origins;
use super::symmetry::{is_seen_from_all_around, scattered_fit, symmetry_of_many};
use crate::Error;
use crate::progress::{Progress, Step, step};
use crate::provenance::{Provenance, of_this_program};
use crate::warnings::{self, Isotropy};
use gonia_brdf::interpolate::OriginCounts;
use gonia_brdf::scattered::{Reason, ScatteredFit, is_few};
use gonia_brdf::{Bin, Bins, Grid, Symmetry};
use gonia_formats::fit_source::{FIT_SYMMETRY, fit_symmetry};
use gonia_rig::{Remark, SampleValues};

/// Samples in their bins, by three channels that stand for all, and what is to be said of them. Warnings, symmetry
/// and, of up to three channels, the values rest on these.
pub(super) struct Prepared {
    pub bins: Bins,
    samples: usize,
    /// Whether a fit is of the samples, and not of what shares cells of many.
    are_few: bool,
    /// How many of a sample are in the bins: with its images.
    images: usize,
    /// The fit of few samples, or of those of an isotropic material: it takes the place of the bins.
    pub fit: Option<ScatteredFit>,
    /// The symmetry, for people and for the provenance …
    pub symmetry: String,
    /// … and the images that the bins hold.
    pub completed_by: Symmetry,
    pub origins: OriginCounts,
    /// Whether the material is isotropic and filled without that: the mean over turns is taken then.
    pub turns: bool,
    /// Cells into which samples fell themselves, where the bins hold their images too.
    pub own: Option<Vec<u64>>,
    pub remarks: Vec<Remark>,
}

impl Prepared {
    /// Leaves out of the samples what cannot stand. Of an isotropic material a `whole` table may be filled first, and
    /// its mean over turns be taken; of rows none can.
    pub fn new(
        all: &mut SampleValues,
        grid: Grid,
        options: &FillOptions,
        whole: bool,
        progress: &Progress<'_>,
    ) -> Result<Self, Error> {
        let count = all.len();
        let mut remarks = warnings::of_oddities(&all.keep_sound());
        let samples = all.three(spread_over(all.channels().count()));
        remarks.extend(warnings::of_samples(&samples)?);
        let fit = scattered_fit(&samples, grid, options, progress)?;
        let (symmetry, reason) = match &fit {
            Some(fit) => (fit.choice().settings.symmetry, fit.choice().reason),
            None if options.symmetry.is_some() => {
                let (symmetry, said) = symmetry_of_many(&samples, options);
                remarks.extend(said);
                (symmetry, Reason::Asked)
            }
            None => (Symmetry::None, Reason::Untested),
        };
        let turns = whole
            && fit.is_some()
            && symmetry.is_isotropic()
            && reason == Reason::Asked
            && !is_few(&samples)
            && is_seen_from_all_around(&samples);
        let fit = fit.filter(|fit| {
            let takes_place = !turns && (symmetry.is_isotropic() || !options.asks_for_blocks());
            let choice = fit.choice();
            let is_odd = choice.contradicted_by.is_some() || choice.plane_undetermined;
            if takes_place || turns || is_odd {
                remarks.extend(warnings::remarks_on_symmetry(fit));
            }
            takes_place
        });
        let bins = step(progress, Step::Binning, |_| {
            Ok::<_, Error>(Bins::new(grid, &samples))
        })?;
        remarks.extend(warnings::of_bins(&samples, &bins));
        let isotropy = match (symmetry.is_isotropic(), reason) {
            (false, _) => Isotropy::No,
            (_, Reason::Asked) => Isotropy::Asked,
            (_, Reason::Assumed | Reason::TooFew) => Isotropy::Assumed,
            _ => Isotropy::Shown,
        };
        let images = symmetry.order();
        let (bins, own) = if images > 1 {
            let own = bins.bins().iter().map(|bin| bin.cell).collect::<Vec<u64>>();
            let completed = Bins::new(grid, &symmetry.completed(samples.to_vec()));
            (completed, Some(own))
        } else {
            (bins, None)
        };
        let origins = Origins::of(&bins, own.as_deref(), fit.as_ref()).counts();
        remarks.extend(warnings::remark_on_layout(&samples, &origins, isotropy));
        Ok(Self {
            bins,
            samples: count,
            are_few: is_few(&samples),
            images,
            fit,
            symmetry: format!("{symmetry}, {reason}"),
            completed_by: symmetry,
            turns,
            origins,
            own,
            remarks,
        })
    }

    /// What a BRDF that is filled from these says of its making.
    pub fn provenance(&self, settings: &str, options: &FillOptions) -> Provenance {
        let mut facts = of_this_program();
        facts.insert("interpolation".into(), settings.to_owned());
        facts.insert("symmetry".into(), self.symmetry.clone());
        // A fit of the samples as they are: with their file and this it can be made again.
        if self.fit.is_some() && self.are_few {
            let plane = options.symmetry_of_plane().map(|(_, plane)| plane);
            let symmetry = fit_symmetry(options.symmetry, plane);
            facts.insert(FIT_SYMMETRY.into(), symmetry);
        }
        facts
    }

    /// The largest polar angle of light, or by reciprocity of view, that was measured.
    pub fn highest_deg(&self) -> f64 {
        let grid = self.bins.grid();
        let ring = |bin: &Bin| {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            light.max(view) / grid.n_phi()
        };
        let highest = self.bins.bins().iter().map(ring).max().unwrap_or(0);
        highest as f64 * grid.step_deg()
    }

    pub fn counts(&self) -> FillCounts {
        let in_bins: usize = self.bins.bins().iter().map(|bin| bin.count as usize).sum();
        let binned = in_bins / self.images;
        FillCounts {
            binned,
            outside: self.samples - binned,
            bins: self.bins.bins().len(),
            failed: 0,
            raised: 0,
        }
    }
}
