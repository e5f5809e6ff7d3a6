//! The page that a reviewer asks for: what the values' uncertainty is made of, where, and what would make it smaller.

use crate::panels;
use crate::slices;
use gonia_brdf::DenseBrdf;
use gonia_brdf::interpolate::ErrorFall;
use gonia_formats::dense::{read_dense_channels, read_origins};
use gonia_formats::{FileError, Summary};
use gonia_pipeline::budget::{
    AlbedoUncertainty, CellBudget, Contribution, Holding, StratumBudget, albedo_uncertainty,
    budget_in, fall_in, not_stated, stated, summary, with_poses,
};
use gonia_pipeline::provenance::Provenance;
use gonia_rig::{Budget, Channels, DenseChannels, DenseFile, Scale, Stratum};
use maud::{Markup, html};
use std::collections::BTreeMap;
use std::path::Path;

/// The standard errors of a dense BRDF, as their file holds them.
#[derive(Clone, Debug)]
pub struct ErrorBars {
    /// A standard error a value, in its unit.
    pub errors: DenseBrdf,
    /// Of bands the one that they are shown of; `None` of colours.
    pub band: Option<ShownBand>,
    /// Where each cell's value is from ([`Origin`](gonia_brdf::interpolate::Origin)); empty where that is not said.
    pub origins: Vec<u8>,
    /// Where they came from; with their budget, if they hold one.
    pub provenance: Provenance,
}

/// The band of a spectrum that stands for all where one channel is shown.
#[derive(Clone, Debug)]
pub struct ShownBand {
    /// Nanometres.
    pub wavelength: f64,
    /// Its values, as a grey.
    pub values: DenseBrdf,
}

/// Where the eye is most sensitive, nanometres.
const MOST_VISIBLE_NM: f64 = 555.0;

impl ShownBand {
    /// The band nearest to 555 nm; `None` of what has no bands.
    pub fn of(file: &DenseChannels) -> Option<Self> {
        let Channels::Bands(wavelengths) = &file.channels else {
            return None;
        };
        let from_most_visible = |nm: f64| (nm - MOST_VISIBLE_NM).abs();
        let nearest = wavelengths.iter().zip(&file.planes).min_by(|a, b| {
            let [a, b] = [a.0, b.0].map(|nm| from_most_visible(*nm));
            a.total_cmp(&b)
        });
        let (wavelength, plane) = nearest?;
        Some(Self {
            wavelength: *wavelength,
            values: DenseBrdf::new(file.grid, [0, 1, 2].map(|_| plane.clone()))?,
        })
    }
}

impl ErrorBars {
    /// Reads what `gonia fill --error` wrote; of bands, the errors of the one that is shown. `None` where the two are not of
    /// the same channels.
    ///
    /// # Errors
    /// A file that cannot be read, or is none.
    pub fn read(path: &Path, band: Option<&ShownBand>) -> Result<Option<Self>, FileError> {
        let file = read_dense_channels(path)?;
        let provenance = file.provenance.clone();
        let errors = match (ShownBand::of(&file), band) {
            (None, None) => file.into_rgb().map(|DenseFile { brdf, .. }| brdf),
            (Some(own), Some(shown)) if own.wavelength == shown.wavelength => Some(own.values),
            _ => None,
        };
        let Some(errors) = errors else {
            return Ok(None);
        };
        Ok(Some(Self {
            errors,
            band: band.cloned(),
            origins: read_origins(path)?.unwrap_or_default(),
            provenance,
        }))
    }

    /// The values that these are the errors of, with colours as they are.
    pub fn values<'a>(&'a self, colours: &'a DenseBrdf) -> &'a DenseBrdf {
        self.band.as_ref().map_or(colours, |band| &band.values)
    }

    /// What the page calls the channel that it is about.
    fn channel(&self) -> String {
        match &self.band {
            Some(band) => format!("{}nm", band.wavelength),
            None => "green".to_owned(),
        }
    }
}

/// The part of the page.
pub fn section(bars: &ErrorBars, dense: &DenseBrdf, summary: &Summary) -> Markup {
    let budget = budget_in(&bars.provenance).ok().flatten();
    html! {
        h2 { "Uncertainty" }
        @match &budget {
            Some(budget) => { (of_budget(bars, dense, summary.scale, budget)) }
            None => p.soft {
                "The error bars hold noise and interpolation alone: the samples say nothing of the rig that they came \
                 from. Samples of gonia process carry its uncertainties."
            }
        }
    }
}

/// The channel that the page is about: green, or of a band, which is a grey, any.
const CHANNEL: usize = 1;

fn of_budget(bars: &ErrorBars, dense: &DenseBrdf, scale: Scale, budget: &Budget) -> Markup {
    let errors = (&bars.errors.planes()[CHANNEL][..], Holding::All);
    let plane = &bars.values(dense).planes()[CHANNEL];
    let Some(cells) = CellBudget::new(dense.grid(), plane, errors, &bars.origins, budget) else {
        return html! {};
    };
    let parts = summary(&cells);
    let albedos = [0.0, 30.0, 60.0].map(|theta| albedo_uncertainty(&cells, theta));
    html! {
        p.soft {
            "Standard uncertainties (k = 1) of the " (bars.channel()) " values as shares of them: medians over the cells of a part of \
             the domain that are not extrapolated. Contributions are independent, and combine as the root of the sum of \
             their squares."
        }
        (table(&parts, budget))
        (sentence(&parts, &albedos, bars, budget, scale))
        div.sheets { (map(&cells)) }
        (worth(&parts, &poses(&cells, &bars.provenance)))
    }
}

fn percent(share: f64) -> String {
    match 100.0 * share {
        p if p >= 9.95 => format!("{p:.0} %"),
        p if p >= 0.995 => format!("{p:.1} %"),
        p if p > 0.0 && p < 0.005 => "< 0.01 %".to_owned(),
        p => format!("{p:.2} %"),
    }
}

/// The budget: contributions by rows, parts of the domain by columns.
fn table(parts: &[StratumBudget], budget: &Budget) -> Markup {
    let whence = |part: Contribution| match part {
        Contribution::Noise => "scatter of the samples (type A)",
        Contribution::Patch => "the rig's geometry",
        Contribution::Input(input) => budget.known_from(input).name(),
    };
    let counts = |part: &Contribution| parts.iter().any(|of| of.of(*part) > 0.0);
    let all = Contribution::all().into_iter().filter(counts);
    html! {
        div.wide { table {
            thead { tr {
                th { "contribution" } th.num { "its own" } th { "known from" }
                @for of in parts { th.num { (of.stratum.name()) } }
            } }
            tbody {
                @for part in all { tr {
                    td { (part.name()) }
                    td.num { (stated(part, budget)) }
                    td { (whence(part)) }
                    @for of in parts { td.num { (percent(of.of(part))) } }
                } }
                tr {
                    td { b { "combined, u" } } td {} td {}
                    @for of in parts { td.num { b { (percent(of.combined)) } } }
                }
                tr {
                    td { b { "expanded, U (k = 2)" } } td {} td {}
                    @for of in parts { td.num { b { (percent(2.0 * of.combined)) } } }
                }
            }
        } }
    }
}

/// What a paper says of it, to be copied.
fn sentence(
    parts: &[StratumBudget],
    albedos: &[AlbedoUncertainty],
    bars: &ErrorBars,
    budget: &Budget,
    scale: Scale,
) -> Markup {
    let of = |stratum| parts.iter().find(|of| of.stratum == stratum);
    let values = match scale {
        Scale::Absolute => "BRDF values (1/sr)",
        Scale::Relative => "Relative BRDF values",
    };
    let largest = |of: &StratumBudget| {
        let names = of.sorted().into_iter().take(2).map(|(part, _)| part.name());
        names.collect::<Vec<_>>().join(" and ")
    };
    let of_part = |stratum, text: &str| {
        of(stratum).map(|of| {
            format!(
                "{} {text} (mostly {})",
                percent(2.0 * of.combined),
                largest(of)
            )
        })
    };
    let said = [
        of_part(Stratum::Interior, "at polar angles up to 75°"),
        of_part(Stratum::Grazing, "at larger ones"),
        of_part(
            Stratum::Highlight,
            "in the brightest per cent of the domain",
        ),
    ];
    let said: Vec<String> = said.into_iter().flatten().collect();
    let albedos: Vec<String> = albedos
        .iter()
        .map(|of| {
            let (albedo, expanded) = (of.albedo, 2.0 * of.u);
            format!("{albedo:.3} ± {expanded:.3} at {:.0}°", of.theta_i_deg)
        })
        .collect();
    let certificate = bars
        .provenance
        .iter()
        .find(|(name, _)| name.rsplit('.').next() == Some("certificate"));
    let counts = |part: &&Contribution| parts.iter().any(|of| of.of(**part) > 0.0);
    let unknown = not_stated(budget);
    let unknown: Vec<&str> = unknown.iter().filter(counts).map(|of| of.name()).collect();
    let inputs = match scale {
        Scale::Absolute => "directions, apertures, the camera's response and the reference",
        Scale::Relative => "directions, apertures and the camera's response",
    };
    html! {
        h3 { "For a paper" }
        blockquote {
            (values) " carry an expanded uncertainty U = k·u with k = 2 (a coverage of about 95 %), u combined by the "
            "measurement equation from noise, interpolation, " (inputs) ". The median U is " (said.join(", ")) ". The directional albedo in " (bars.channel()) " is "
            (albedos.join(", ")) " (U, k = 2)."
            @if let Some((_, certificate)) = certificate { " Reference: certificate " (certificate) "." }
        }
        @if !unknown.is_empty() {
            p.soft {
                "Nobody stated " (unknown.join(", ")) ": cautious defaults stand for them, which a paper should say, or "
                "better replace (keys of rig.toml)."
            }
        }
    }
}

/// Colours of the map, the most frequent contribution first.
const COLOURS: [[u8; 3]; 7] = [
    [38, 112, 104],
    [214, 160, 60],
    [70, 110, 170],
    [180, 72, 60],
    [128, 96, 150],
    [120, 140, 70],
    [150, 150, 150],
];

/// Which contribution is the largest, cell by cell of the slices.
fn map(cells: &CellBudget<'_>) -> Markup {
    let all = Contribution::all();
    let slices = slices::each(cells.grid(), |light, view| {
        let shares = cells.shares(cells.grid().cell(light, view))?;
        (0..all.len()).max_by(|a, b| shares[*a].total_cmp(&shares[*b]))
    });
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    for place in slices.iter().flat_map(|slice| &slice.values).flatten() {
        *counts.entry(*place).or_default() += 1;
    }
    let mut order: Vec<(usize, usize)> = counts.into_iter().collect();
    order.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let total = order.iter().map(|(_, n)| n).sum::<usize>().max(1) as f64;
    let colour = |place: usize| {
        let rank = order.iter().position(|(of, _)| *of == place);
        COLOURS[rank.map_or(COLOURS.len() - 1, |rank| rank.min(COLOURS.len() - 1))]
    };
    let paint = |place: &Option<usize>| place.map_or([255; 3], colour);
    html! {
        figure {
            (panels::kinds(&slices, paint))
            figcaption {
                b { "The largest contribution" } " · "
                @for (place, n) in &order {
                    @let [r, g, b] = colour(*place);
                    span style=(format!("color:rgb({r},{g},{b})")) { "■" }
                    " " (all[*place].name()) " " (percent(*n as f64 / total)) " of these cells  "
                }
            }
        }
    }
}

/// The parts' uncertainties with more poses; `None` where nobody knows.
type OfPoses = Vec<(Stratum, Option<f64>)>;

/// What more poses buy, by the fall of the errors that the fill found: so many times as many.
fn poses(cells: &CellBudget<'_>, provenance: &Provenance) -> Vec<(&'static str, OfPoses)> {
    let fall = fall_in(provenance).filter(|fall| *fall != ErrorFall::default());
    let with = |fall| {
        [("twice the poses", 2.0), ("four times the poses", 4.0)]
            .map(|(name, times)| (name, with_poses(cells, &fall, times)))
            .to_vec()
    };
    fall.map(with).unwrap_or_default()
}

/// What halving a contribution is worth, and what more poses.
fn worth(parts: &[StratumBudget], poses: &[(&'static str, OfPoses)]) -> Markup {
    let Some(of_all) = parts.iter().find(|of| of.stratum == Stratum::All) else {
        return html! {};
    };
    let mut rows: Vec<(usize, Contribution)> =
        Contribution::all().into_iter().enumerate().collect();
    rows.sort_by(|a, b| of_all.halved[a.0].total_cmp(&of_all.halved[b.0]));
    // What changes nothing that is shown is left out.
    let counts = |place: &usize| {
        let less = |of: &StratumBudget| of.halved[*place] < 0.99 * of.combined;
        parts.iter().any(less)
    };
    rows.retain(|(place, _)| counts(place));
    html! {
        h3 { "What would make it better" }
        p.soft {
            "The median U (k = 2) of each part, now and with one contribution half as large. Four times the exposure \
             halves noise. "
            @if poses.is_empty() {
                "What more poses buy is in the chart of gonia chart SAMPLES, which leaves frames out and measures it."
            } @else {
                "What more poses buy is predicted from the errors at frames that were left out, by all other frames and by \
                 half of them; of highlights it cannot be predicted."
            }
        }
        div.wide { table {
            thead { tr {
                th { "halved" }
                @for of in parts { th.num { (of.stratum.name()) } }
                th { "by" }
            } }
            tbody {
                tr {
                    td { b { "as it is" } }
                    @for of in parts { td.num { b { (percent(2.0 * of.combined)) } } }
                    td {}
                }
                @for (place, part) in &rows { tr {
                    td { (part.name()) }
                    @for of in parts { td.num { (percent(2.0 * of.halved[*place])) } }
                    td.soft { (part.remedy()) }
                } }
                @for (name, of_parts) in poses { tr {
                    td { (name) }
                    @for of in parts {
                        @let u = of_parts.iter().find(|(part, _)| *part == of.stratum).and_then(|(_, u)| *u);
                        td.num { (u.map_or("–".to_owned(), |u| percent(2.0 * u))) }
                    }
                    td.soft { "gonia plan --adaptive says where" }
                } }
            }
        } }
    }
}
