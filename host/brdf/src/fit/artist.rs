//! The models that artists' programs have: their parameters, under their own names.

use super::family::{Parameter, ParameterValues};
use super::range::Range;
use crate::model::{Brdf, Gltf, OpenPbr, Principled};
use std::fmt;
use std::str::FromStr;

/// A model of artists' programs, on a surface of one material: no transmission, no texture, no light of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArtistModel {
    /// Disney's principled model as Mitsuba has it: [`Principled`].
    Principled,
    /// The material of glTF 2.0: [`Gltf`].
    Gltf,
    /// OpenPBR Surface 1.1: [`OpenPbr`].
    OpenPbr,
}

impl ArtistModel {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Principled, Self::Gltf, Self::OpenPbr];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Principled => "principled",
            Self::Gltf => "gltf",
            Self::OpenPbr => "openpbr",
        }
    }

    /// Its parameters; with the azimuth of the direction along which its highlight is longer, the tangent.
    pub fn parameters(self) -> Vec<Parameter> {
        let mut list = match self {
            Self::Principled => principled(),
            Self::Gltf => gltf(),
            Self::OpenPbr => openpbr(),
        };
        list.push(Parameter::azimuth(AZIMUTH));
        list
    }

    /// The model of some values. `None` where a parameter is missing.
    pub fn model(self, values: &ParameterValues) -> Option<Box<dyn Brdf>> {
        let get = |name: &str| values.get(name);
        Some(match self {
            Self::Principled => Box::new(Principled {
                base_color: values.colour("base_color")?,
                roughness: get("roughness")?,
                anisotropic: get("anisotropic")?,
                metallic: get("metallic")?,
                specular: get("specular")?,
                spec_tint: get("spec_tint")?,
                sheen: get("sheen")?,
                sheen_tint: get("sheen_tint")?,
                flatness: get("flatness")?,
                clearcoat: get("clearcoat")?,
                clearcoat_gloss: get("clearcoat_gloss")?,
                azimuth_deg: get(AZIMUTH)?,
            }),
            Self::Gltf => Box::new(Gltf {
                base_color: values.colour("base_color")?,
                metallic: get("metallic")?,
                roughness: get("roughness")?,
                specular: get("specular")?,
                anisotropy_strength: get("anisotropy_strength")?,
                sheen_color: values.colour("sheen_color")?,
                sheen_roughness: get("sheen_roughness")?,
                clearcoat: get("clearcoat")?,
                clearcoat_roughness: get("clearcoat_roughness")?,
                azimuth_deg: get(AZIMUTH)?,
            }),
            Self::OpenPbr => Box::new(OpenPbr {
                base_color: values.colour("base_color")?,
                base_diffuse_roughness: get("base_diffuse_roughness")?,
                base_metalness: get("base_metalness")?,
                specular_ior: get("specular_ior")?,
                specular_roughness: get("specular_roughness")?,
                specular_roughness_anisotropy: get("specular_roughness_anisotropy")?,
                coat_weight: get("coat_weight")?,
                coat_roughness: get("coat_roughness")?,
                fuzz_weight: get("fuzz_weight")?,
                fuzz_color: values.colour("fuzz_color")?,
                fuzz_roughness: get("fuzz_roughness")?,
                azimuth_deg: get(AZIMUTH)?,
            }),
        })
    }
}

impl fmt::Display for ArtistModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ArtistModel {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let found = Self::ALL.into_iter().find(|model| model.name() == text);
        found.ok_or(())
    }
}

/// Name of the tangent's azimuth.
pub const AZIMUTH: &str = "azimuth";

/// Below this a square root of roughness is a mirror to any table.
const LEAST_ROUGHNESS: f64 = 0.04;

fn principled() -> Vec<Parameter> {
    let mut list = base_colour();
    list.extend([
        roughness("roughness"),
        Parameter::share("anisotropic", (0.1, 0.9)),
        Parameter::share("metallic", (0.1, 0.9)),
        // At 0 the model has no lobe at all, of a metal neither.
        Parameter::new("specular", Range::Linear(0.001, 1.0)).starting((0.2, 0.8)),
        Parameter::share("spec_tint", (0.1, 0.9)),
        Parameter::share("sheen", (0.05, 0.6)),
        Parameter::share("sheen_tint", (0.1, 0.9)),
        Parameter::share("flatness", (0.05, 0.6)),
        Parameter::share("clearcoat", (0.05, 0.6)),
        Parameter::share("clearcoat_gloss", (0.1, 0.6)),
    ]);
    list
}

fn gltf() -> Vec<Parameter> {
    let mut list = base_colour();
    list.extend([
        roughness("roughness"),
        Parameter::share("anisotropy_strength", (0.1, 0.8)),
        Parameter::share("metallic", (0.1, 0.9)),
        Parameter::share("specular", (0.2, 0.9)),
    ]);
    let sheen = Parameter::colour("sheen_color", Range::Linear(0.0, 1.0));
    list.extend(sheen.map(|p| p.starting((0.02, 0.4))));
    list.extend([
        Parameter::new("sheen_roughness", Range::Linear(0.05, 1.0)).starting((0.2, 0.8)),
        Parameter::share("clearcoat", (0.05, 0.6)),
        roughness("clearcoat_roughness"),
    ]);
    list
}

fn openpbr() -> Vec<Parameter> {
    let mut list = base_colour();
    list.extend([
        Parameter::share("base_diffuse_roughness", (0.1, 0.9)),
        Parameter::share("base_metalness", (0.1, 0.9)),
        Parameter::new("specular_ior", Range::Linear(1.0, 3.0)).starting((1.2, 1.8)),
        roughness("specular_roughness"),
        Parameter::share("specular_roughness_anisotropy", (0.1, 0.8)),
        Parameter::share("coat_weight", (0.05, 0.6)),
        roughness("coat_roughness"),
        Parameter::share("fuzz_weight", (0.05, 0.6)),
    ]);
    let fuzz = Parameter::colour("fuzz_color", Range::Linear(0.0, 1.0));
    list.extend(fuzz.map(|p| p.starting((0.1, 0.9))));
    list.push(Parameter::share("fuzz_roughness", (0.2, 0.8)));
    list
}

fn base_colour() -> Vec<Parameter> {
    let colour = Parameter::colour("base_color", Range::Logarithmic(1e-4, 1.0));
    colour.map(|p| p.starting((0.05, 0.8))).to_vec()
}

fn roughness(name: &str) -> Parameter {
    Parameter::new(name, Range::Linear(LEAST_ROUGHNESS, 1.0)).starting((0.2, 0.8))
}
