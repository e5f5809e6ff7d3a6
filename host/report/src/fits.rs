//! Fitted models as a table, with their numbers to unfold.

use gonia_formats::fit_toml::{FitNote, FittedNumber};
use gonia_rig::Stratum;
use maud::{Markup, html};

/// The part of the page; empty without fits.
pub fn section(fits: &[FitNote]) -> Markup {
    if fits.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Models fitted" }
        p.soft {
            "Each against the dense data: RMS of the log ratio, cosine-weighted error, mean ΔE00 of a rendered sphere. \
             Uncertainties are standard ones, from how much the residuals vary together over patches of 30°."
        }
        div.wide { table {
            thead { tr {
                th { "model" } th.num { "numbers" } th.num { "interior" } th.num { "grazing" }
                th.num { "highlight" } th.num { "cos-weighted" } th.num { "sphere ΔE" } th.num { "time" }
            } }
            tbody { @for fit in fits { (row(fit)) } }
        } }
        @for fit in fits {
            details {
                summary { "Numbers of " (fit.model) }
                div.wide { table { tbody {
                    @for p in &fit.parameters { (number(p)) }
                } } }
            }
        }
    }
}

fn row(fit: &FitNote) -> Markup {
    let log_rms = |stratum| match fit.figures.stratum(stratum) {
        Some(row) => format!("{:.3}", row.log_rms),
        None => "–".to_owned(),
    };
    let cosine = fit.figures.stratum(Stratum::All);
    html! {
        tr {
            td { (fit.model) @if !fit.converged { " (not converged, the best so far)" } }
            td.num { (fit.parameters.len()) }
            @for stratum in [Stratum::Interior, Stratum::Grazing, Stratum::Highlight] {
                td.num { (log_rms(stratum)) }
            }
            td.num { @if let Some(all) = cosine { (format!("{:.1} %", 100.0 * all.cos_error_mean)) } }
            td.num { (format!("{:.2}", fit.figures.sphere_delta_e)) }
            td.num { (super::charts::seconds(fit.seconds)) }
        }
    }
}

fn number(p: &FittedNumber) -> Markup {
    html! {
        tr {
            td { (p.name) }
            td.num { (format!("{:.4}", p.value)) }
            td.num {
                @match p.uncertainty {
                    Some(u) => { "± " (format!("{u:.1e}")) }
                    None => { "not determined" }
                }
            }
            td { (p.unit) @if p.at_bound { " at its bound" } }
        }
    }
}
