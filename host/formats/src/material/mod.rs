//! A fitted model as a material of another program: its parameters under the names that the program has for them.
//!
//! | ending | what it is | models |
//! |---|---|---|
//! | `.mtlx` | MaterialX 1.39, a surface material | `principled`, `gltf`, `openpbr` |
//! | `.xml` | Mitsuba 3, a scene of one BSDF | `principled` |
//! | `.gltf` | glTF 2.0, an asset of one material | `gltf` |
//! | `.json` | names and values, with uncertainties and error | every model |
//!
//! A file means 1/sr: there is none of a fit to relative values, whose parameters hold a factor over all. Each says how
//! far the model is from its data. A new form is a row in [`FORMS`].

mod gltf;
mod json;
mod materialx;
mod mitsuba;
#[cfg(test)]
mod tests;

use crate::fit_toml::FitNote;
use crate::{FileError, table, write_whole_bytes};
use gonia_rig::Stratum;
use std::path::Path;

/// A kind of file that a fitted model is written as.
struct Form {
    /// The ending of its files, in lower case.
    ending: &'static str,
    /// What it is, for messages.
    title: &'static str,
    /// Names of the models that it has; `None` where it has every one.
    models: Option<&'static [&'static str]>,
    /// Its text. A note without a parameter of its model gives none.
    text: fn(&FitNote, &str) -> Option<String>,
}

static FORMS: [Form; 4] = [
    Form {
        ending: "mtlx",
        title: "MaterialX",
        models: Some(&["principled", "gltf", "openpbr"]),
        text: materialx::text,
    },
    Form {
        ending: "xml",
        title: "Mitsuba",
        models: Some(&["principled"]),
        text: mitsuba::text,
    },
    Form {
        ending: "gltf",
        title: "glTF",
        models: Some(&["gltf"]),
        text: gltf::text,
    },
    Form {
        ending: "json",
        title: "JSON",
        models: None,
        text: json::text,
    },
];

/// Name of the factor over all of a fit to relative values.
pub const SCALE: &str = "scale";

/// Whether a name has the ending of a material.
pub fn is_material_name(path: &Path) -> bool {
    form_of(path).is_some()
}

/// The endings of materials with what they are, for messages: `.mtlx (MaterialX)`.
pub fn material_endings() -> String {
    table::listed(
        FORMS
            .iter()
            .map(|form| format!(".{} ({})", form.ending, form.title)),
    )
}

/// Whether a fit of this model can be written under a name, before the work is done.
///
/// # Errors
/// One line: no such ending, with the list of what there is; or a form that does not have the model.
pub fn check_material(path: &Path, model: &str) -> Result<(), FileError> {
    form_for(path, model).map(|_| ())
}

/// Writes a fitted model as a material, whole. `program` is what wrote it.
///
/// # Errors
/// As [`check_material`]; the fit has a factor over all, so that its numbers are not 1/sr; or the file cannot be
/// written.
pub fn write_material(path: &Path, note: &FitNote, program: &str) -> Result<(), FileError> {
    let form = form_for(path, &note.model)?;
    if form.models.is_some() && note.parameters.iter().any(|p| p.name == SCALE) {
        return Err(relative(path, form.title));
    }
    let text = (form.text)(note, program).ok_or_else(|| {
        let problem =
            format_args!("a parameter of {} is missing in the fit", note.model).to_string();
        FileError::new(path, problem, "fit the model again")
    })?;
    write_whole_bytes(path, text.as_bytes())
}

/// What is wrong with writing a fit to relative values as a material.
fn relative(path: &Path, title: &str) -> FileError {
    FileError::new(
        path,
        format_args!("a material of {title} means 1/sr, and the dense BRDF is relative"),
        "give --assume-scale FACTOR",
    )
}

/// Whether the form of a name takes a fit to relative values.
///
/// # Errors
/// One line where it means 1/sr.
pub fn check_relative(path: &Path) -> Result<(), FileError> {
    match form_of(path).filter(|form| form.models.is_some()) {
        Some(form) => Err(relative(path, form.title)),
        None => Ok(()),
    }
}

fn form_of(path: &Path) -> Option<&'static Form> {
    let ending = path.extension()?;
    FORMS
        .iter()
        .find(|form| ending.eq_ignore_ascii_case(form.ending))
}

fn form_for(path: &Path, model: &str) -> Result<&'static Form, FileError> {
    let form = form_of(path).ok_or_else(|| {
        let problem = "has not the ending of a material";
        FileError::new(path, problem, format_args!("give {}", material_endings()))
    })?;
    match form.models {
        Some(models) if !models.contains(&model) => {
            let known = table::listed(models.iter().map(|name| (*name).to_owned()));
            Err(FileError::new(
                path,
                format_args!("{} has no material of the model {model}", form.title),
                format_args!("fit --model {known}, or write .json"),
            ))
        }
        _ => Ok(form),
    }
}

/// A value by its name.
fn number(note: &FitNote, name: &str) -> Option<f64> {
    let found = note.parameters.iter().find(|p| p.name == name)?;
    Some(found.value)
}

/// The values of `name_r`, `name_g` and `name_b`.
fn colour(note: &FitNote, name: &str) -> Option<[f64; 3]> {
    let [r, g, b] = ["r", "g", "b"].map(|channel| number(note, &format!("{name}_{channel}")));
    Some([r?, g?, b?])
}

/// A value in the fewest digits that single precision keeps.
fn digits(value: f64) -> String {
    (value as f32).to_string()
}

/// Three values, as XML lists them.
fn triple(values: [f64; 3]) -> String {
    values.map(digits).join(", ")
}

/// What a file says of itself, a line each: what made it, of what, and how far it is from that.
fn remarks(note: &FitNote, program: &str) -> Vec<String> {
    let mut lines = vec![format!(
        "{program}: {} fitted to {}",
        note.model, note.figures.b
    )];
    if !note.converged {
        lines.push("NOT CONVERGED: the best so far".to_owned());
    }
    if let Some(checksum) = &note.dense {
        lines.push(format!("checksum of the dense BRDF: {checksum}"));
    }
    let mut error: Vec<String> = [Stratum::All, Stratum::Interior, Stratum::Highlight]
        .into_iter()
        .filter_map(|stratum| {
            let of = note.figures.stratum(stratum)?;
            Some(format!("RMS of ln {:.4} ({})", of.log_rms, stratum.name()))
        })
        .collect();
    let figures = &note.figures;
    error.push(format!(
        "mean CIEDE2000 {:.2} of a sphere",
        figures.sphere_delta_e
    ));
    error.push(format!("{:.2} of a cylinder", figures.cylinder_delta_e));
    lines.push(error.join(", "));
    lines
}

/// Remarks as one comment of XML, which may hold no two hyphens in a row.
fn xml_comment(lines: &[String]) -> String {
    let text = lines.join("\n     ").replace("--", "- -");
    format!("<!-- {text} -->")
}
