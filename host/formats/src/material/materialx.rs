//! MaterialX 1.39: a surface material of the node that has the model.

use super::{colour, digits, number, remarks, triple, xml_comment};
use crate::fit_toml::FitNote;
use gonia_brdf::fit::AZIMUTH;
use std::fmt::Write as _;

/// A node of MaterialX, and which of its inputs has which parameter.
struct Node {
    name: &'static str,
    /// Colours: ours and its.
    colours: &'static [(&'static str, &'static str)],
    /// Numbers: ours and its.
    numbers: &'static [(&'static str, &'static str)],
    tangent: Tangent,
}

/// What a node has for the azimuth of the tangent.
enum Tangent {
    /// Nothing: the tangent of the surface.
    OfTheSurface,
    /// A rotation in radians, anticlockwise.
    Rotation(&'static str),
    /// The tangent itself, a vector of the world.
    Vector(&'static str),
}

fn node_of(model: &str) -> Option<Node> {
    Some(match model {
        "principled" => Node {
            name: "disney_principled",
            colours: &[("base_color", "baseColor")],
            numbers: &[
                ("metallic", "metallic"),
                ("roughness", "roughness"),
                ("anisotropic", "anisotropic"),
                ("specular", "specular"),
                ("spec_tint", "specularTint"),
                ("sheen", "sheen"),
                ("sheen_tint", "sheenTint"),
                ("clearcoat", "clearcoat"),
                ("clearcoat_gloss", "clearcoatGloss"),
                ("flatness", "subsurface"),
            ],
            tangent: Tangent::OfTheSurface,
        },
        "gltf" => Node {
            name: "gltf_pbr",
            colours: &[("base_color", "base_color"), ("sheen_color", "sheen_color")],
            numbers: &[
                ("metallic", "metallic"),
                ("roughness", "roughness"),
                ("specular", "specular"),
                ("anisotropy_strength", "anisotropy_strength"),
                ("sheen_roughness", "sheen_roughness"),
                ("clearcoat", "clearcoat"),
                ("clearcoat_roughness", "clearcoat_roughness"),
            ],
            tangent: Tangent::Rotation("anisotropy_rotation"),
        },
        "openpbr" => Node {
            name: "open_pbr_surface",
            colours: &[("base_color", "base_color"), ("fuzz_color", "fuzz_color")],
            numbers: &[
                ("base_diffuse_roughness", "base_diffuse_roughness"),
                ("base_metalness", "base_metalness"),
                ("specular_ior", "specular_ior"),
                ("specular_roughness", "specular_roughness"),
                (
                    "specular_roughness_anisotropy",
                    "specular_roughness_anisotropy",
                ),
                ("coat_weight", "coat_weight"),
                ("coat_roughness", "coat_roughness"),
                ("fuzz_weight", "fuzz_weight"),
                ("fuzz_roughness", "fuzz_roughness"),
            ],
            tangent: Tangent::Vector("geometry_tangent"),
        },
        _ => return None,
    })
}

/// The tangent of the surface, turned anticlockwise about its normal. MaterialX's `rotate3d` turns clockwise, seen from
/// the end of its axis: its own `gltf_pbr` negates the angle for it.
fn turned_tangent(azimuth_deg: f64) -> String {
    let of_surface = |node: &str| {
        format!(
            "  <{node} name=\"surface_{node}\" type=\"vector3\">\n    \
             <input name=\"space\" type=\"string\" value=\"world\" />\n  </{node}>\n"
        )
    };
    format!(
        "{}{}  <rotate3d name=\"turned_tangent\" type=\"vector3\">\n    \
         <input name=\"in\" type=\"vector3\" nodename=\"surface_tangent\" />\n    \
         <input name=\"amount\" type=\"float\" value=\"{}\" />\n    \
         <input name=\"axis\" type=\"vector3\" nodename=\"surface_normal\" />\n  </rotate3d>\n",
        of_surface("tangent"),
        of_surface("normal"),
        digits(-azimuth_deg)
    )
}

/// The file's text.
pub(super) fn text(note: &FitNote, program: &str) -> Option<String> {
    let node = node_of(&note.model)?;
    let azimuth = number(note, AZIMUTH)?;
    let mut said = remarks(note, program);
    let mut nodes = String::new();
    let mut inputs = String::new();
    let mut input = |name: &str, kind: &str, value: &str| {
        let _ = writeln!(
            inputs,
            "    <input name=\"{name}\" type=\"{kind}\" {value} />"
        );
    };
    let value = |text: String| format!("value=\"{text}\"");
    for (ours, theirs) in node.colours {
        input(theirs, "color3", &value(triple(colour(note, ours)?)));
    }
    for (ours, theirs) in node.numbers {
        input(theirs, "float", &value(digits(number(note, ours)?)));
    }
    match node.tangent {
        Tangent::OfTheSurface => said.push(format!(
            "the surface's tangent has to lie at the azimuth {} degrees of the sample",
            digits(azimuth)
        )),
        Tangent::Rotation(name) => input(name, "float", &value(digits(azimuth.to_radians()))),
        Tangent::Vector(name) => {
            nodes = turned_tangent(azimuth);
            input(name, "vector3", "nodename=\"turned_tangent\"");
        }
    }
    let comment = xml_comment(&said);
    let name = node.name;
    Some(format!(
        "<?xml version=\"1.0\"?>\n{comment}\n<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n{nodes}  \
         <{name} name=\"fitted\" type=\"surfaceshader\">\n{inputs}  </{name}>\n  \
         <surfacematerial name=\"material\" type=\"material\">\n    \
         <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"fitted\" />\n  \
         </surfacematerial>\n</materialx>\n"
    ))
}
