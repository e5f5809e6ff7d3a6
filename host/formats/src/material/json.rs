//! JSON: names and values of a fitted model, with uncertainties and error.

use super::{colour, remarks};
use crate::fit_toml::FitNote;
use gonia_rig::Stratum;
use serde_json::{Map, Value, json};

/// The file's text.
pub(super) fn text(note: &FitNote, program: &str) -> Option<String> {
    serde_json::to_string_pretty(&of(note, program))
        .ok()
        .map(|text| text + "\n")
}

/// A fit as JSON: colours are lists of three.
pub(super) fn of(note: &FitNote, program: &str) -> Value {
    let (mut values, mut uncertainties) = (Map::new(), Map::new());
    for p in &note.parameters {
        let name = match p.name.strip_suffix(['r', 'g', 'b']) {
            Some(name) if name.ends_with('_') => name.trim_end_matches('_'),
            _ => "",
        };
        if let Some(three) = colour(note, name) {
            values.insert(name.to_owned(), json!(three));
            let of = |channel: &str| {
                let named =
                    |q: &&crate::fit_toml::FittedNumber| q.name == format!("{name}_{channel}");
                note.parameters
                    .iter()
                    .find(named)
                    .and_then(|q| q.uncertainty)
            };
            uncertainties.insert(name.to_owned(), json!(["r", "g", "b"].map(of)));
        } else {
            values.insert(p.name.clone(), json!(p.value));
            uncertainties.insert(p.name.clone(), json!(p.uncertainty));
        }
    }
    let at_bound = note.parameters.iter().filter(|p| p.at_bound);
    let units = note.parameters.iter().filter(|p| !p.unit.is_empty());
    json!({
        "model": note.model,
        "parameters": values,
        "standard_uncertainties": uncertainties,
        "units": units.map(|p| (p.name.clone(), json!(p.unit))).collect::<Map<_, _>>(),
        "at_bound": at_bound.map(|p| &p.name).collect::<Vec<_>>(),
        "converged": note.converged,
        "error": {
            "log_rms": log_rms(note, Stratum::All),
            "log_rms_interior": log_rms(note, Stratum::Interior),
            "log_rms_highlight": log_rms(note, Stratum::Highlight),
            "delta_e00_sphere": note.figures.sphere_delta_e,
            "delta_e00_cylinder": note.figures.cylinder_delta_e,
        },
        "remarks": remarks(note, program),
    })
}

fn log_rms(note: &FitNote, stratum: Stratum) -> Option<f64> {
    note.figures.stratum(stratum).map(|of| of.log_rms)
}
