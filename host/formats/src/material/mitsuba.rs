//! Mitsuba 3: a scene that holds the BSDF `principled`, with the identity `material`.

use super::{colour, digits, number, remarks, triple, xml_comment};
use crate::fit_toml::FitNote;
use gonia_brdf::fit::AZIMUTH;
use std::fmt::Write as _;

/// Numbers that Mitsuba's `principled` has under the same names.
const NUMBERS: [&str; 10] = [
    "roughness",
    "anisotropic",
    "metallic",
    "specular",
    "spec_tint",
    "sheen",
    "sheen_tint",
    "flatness",
    "clearcoat",
    "clearcoat_gloss",
];

/// The file's text.
pub(super) fn text(note: &FitNote, program: &str) -> Option<String> {
    let mut said = remarks(note, program);
    // Mitsuba has no parameter for it: the tangent is that of the shape.
    said.push(format!(
        "the shape's tangent (dp/du) has to lie at the azimuth {} degrees of the sample",
        digits(number(note, AZIMUTH)?)
    ));
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n{}\n<scene version=\"3.0.0\">\n  <bsdf type=\"principled\" id=\"material\">\n",
        xml_comment(&said)
    );
    let base = triple(colour(note, "base_color")?);
    let _ = writeln!(text, "    <rgb name=\"base_color\" value=\"{base}\"/>");
    for name in NUMBERS {
        let value = digits(number(note, name)?);
        let _ = writeln!(text, "    <float name=\"{name}\" value=\"{value}\"/>");
    }
    text += "  </bsdf>\n</scene>\n";
    Some(text)
}
