//! glTF 2.0: an asset that holds one material, with the extensions that its model has.

use super::{colour, json, number};
use crate::fit_toml::FitNote;
use gonia_brdf::fit::AZIMUTH;
use serde_json::json;

/// The file's text.
pub(super) fn text(note: &FitNote, program: &str) -> Option<String> {
    let get = |name: &str| number(note, name);
    let [r, g, b] = colour(note, "base_color")?;
    let extensions = json!({
        "KHR_materials_specular": { "specularFactor": get("specular")? },
        "KHR_materials_anisotropy": {
            "anisotropyStrength": get("anisotropy_strength")?,
            "anisotropyRotation": get(AZIMUTH)?.to_radians(),
        },
        "KHR_materials_sheen": {
            "sheenColorFactor": colour(note, "sheen_color")?,
            "sheenRoughnessFactor": get("sheen_roughness")?,
        },
        "KHR_materials_clearcoat": {
            "clearcoatFactor": get("clearcoat")?,
            "clearcoatRoughnessFactor": get("clearcoat_roughness")?,
        },
    });
    let used: Vec<&String> = extensions.as_object()?.keys().collect();
    let asset = json!({
        "asset": { "version": "2.0", "generator": program },
        "extensionsUsed": used,
        "materials": [{
            "name": "material",
            "pbrMetallicRoughness": {
                "baseColorFactor": [r, g, b, 1.0],
                "metallicFactor": get("metallic")?,
                "roughnessFactor": get("roughness")?,
            },
            "extensions": extensions,
            "extras": { "gonia": json::of(note, program) },
        }],
    });
    serde_json::to_string_pretty(&asset)
        .ok()
        .map(|text| text + "\n")
}
