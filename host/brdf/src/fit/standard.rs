//! The families of this crate's own models.

use super::artist::{AZIMUTH, ArtistModel};
use super::family::{ModelFamily, Parameter, ParameterValues};
use super::range::Range;
use crate::direction::Vec3;
use crate::model::{Brdf, Ggx, Kurt, KurtLobe, Lambert, Microcylinder, Reciprocal, Thread, Ward};
use crate::random::Random;
use std::fmt;
use std::str::FromStr;

/// A kind of model that this crate has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandardFamily {
    /// Diffuse only.
    Lambert,
    /// One anisotropic GGX lobe on a diffuse base.
    Ggx,
    /// One Gaussian lobe of Ward's on a diffuse base.
    Ward,
    /// Lobes of Kurt's model, each with its azimuth, on a diffuse base.
    Kurt {
        /// How many, 1 ..= 4.
        lobes: usize,
    },
    /// The microcylinder model with two threads, each with two tilts ±t; made reciprocal.
    Sadeghi {
        /// Whether a factor over all is fitted too, for values that are not 1/sr.
        scaled: bool,
    },
    /// A model of artists' programs.
    Artist {
        /// Which.
        model: ArtistModel,
        /// Whether a factor over all is fitted too, for values that are not 1/sr.
        scaled: bool,
    },
}

/// A name that is no model's.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "\"{0}\" is no model: choose lambert, ward, ggx, kurt1 to kurt4, sadeghi, principled, gltf or openpbr"
)]
pub struct UnknownFamily(String);

impl FromStr for StandardFamily {
    type Err = UnknownFamily;

    fn from_str(text: &str) -> Result<Self, UnknownFamily> {
        Ok(match text {
            "lambert" => StandardFamily::Lambert,
            "ggx" => StandardFamily::Ggx,
            "ward" => StandardFamily::Ward,
            "kurt1" => StandardFamily::Kurt { lobes: 1 },
            "kurt" | "kurt2" => StandardFamily::Kurt { lobes: 2 },
            "kurt3" => StandardFamily::Kurt { lobes: 3 },
            "kurt4" => StandardFamily::Kurt { lobes: 4 },
            "sadeghi" => StandardFamily::Sadeghi { scaled: false },
            _ => StandardFamily::Artist {
                model: text.parse().map_err(|()| UnknownFamily(text.to_owned()))?,
                scaled: false,
            },
        })
    }
}

impl fmt::Display for StandardFamily {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StandardFamily::Lambert => f.write_str("lambert"),
            StandardFamily::Ggx => f.write_str("ggx"),
            StandardFamily::Ward => f.write_str("ward"),
            StandardFamily::Kurt { lobes } => write!(f, "kurt{lobes}"),
            StandardFamily::Sadeghi { .. } => f.write_str("sadeghi"),
            StandardFamily::Artist { model, .. } => model.fmt(f),
        }
    }
}

impl StandardFamily {
    /// The family for values in 1/sr, or for values that are so only up to a factor.
    #[must_use]
    pub fn for_values(self, are_relative: bool) -> Self {
        match self {
            StandardFamily::Sadeghi { .. } => StandardFamily::Sadeghi {
                scaled: are_relative,
            },
            StandardFamily::Artist { model, .. } => StandardFamily::Artist {
                model,
                scaled: are_relative,
            },
            other => other,
        }
    }
}

impl ModelFamily for StandardFamily {
    fn parameters(&self) -> Vec<Parameter> {
        match *self {
            StandardFamily::Lambert => amplitude("diffuse", 1e2, (0.3, 1.0)).to_vec(),
            StandardFamily::Ggx => {
                let mut list = base_and_lobe();
                list.push(Parameter::share("f0", (0.02, 0.6)));
                list.extend(roughness("alpha_x", "alpha_y"));
                list.push(Parameter::azimuth("azimuth"));
                list
            }
            StandardFamily::Ward => {
                let mut list = base_and_lobe();
                list.extend(roughness("alpha_x", "alpha_y"));
                list.push(Parameter::azimuth("azimuth"));
                list
            }
            StandardFamily::Kurt { lobes } => {
                let mut list = amplitude("diffuse", 1e2, (0.2, 0.9)).to_vec();
                (1..=lobes).for_each(|k| list.extend(lobe_parameters(k)));
                list
            }
            StandardFamily::Sadeghi { scaled } => {
                let mut list: Vec<Parameter> = (1..=2).flat_map(thread_parameters).collect();
                list.push(Parameter::new("cover", Range::Linear(0.05, 1.0)).starting((0.5, 0.98)));
                list.push(Parameter::share("cover_share1", (0.2, 0.8)));
                list.extend(scaled.then(Parameter::scale));
                list
            }
            StandardFamily::Artist { model, scaled } => {
                let mut list = model.parameters();
                list.extend(scaled.then(Parameter::scale));
                list
            }
        }
    }

    fn model(&self, values: &ParameterValues) -> Option<Box<dyn Brdf>> {
        Some(match *self {
            StandardFamily::Lambert => Box::new(Lambert {
                albedo: values.colour("diffuse")?,
            }),
            StandardFamily::Ggx => Box::new(Ggx {
                diffuse: values.colour("diffuse")?,
                specular: values.colour("specular")?,
                f0: values.get("f0")?,
                alpha_x: values.get("alpha_x")?,
                alpha_y: values.get("alpha_y")?,
                azimuth_deg: values.get("azimuth")?,
            }),
            StandardFamily::Ward => Box::new(Ward {
                diffuse: values.colour("diffuse")?,
                specular: values.colour("specular")?,
                alpha_x: values.get("alpha_x")?,
                alpha_y: values.get("alpha_y")?,
                azimuth_deg: values.get("azimuth")?,
            }),
            StandardFamily::Kurt { lobes } => {
                let lobes: Option<Vec<KurtLobe>> = (1..=lobes).map(|k| lobe(values, k)).collect();
                Box::new(Kurt::new(values.colour("diffuse")?, &lobes?))
            }
            StandardFamily::Sadeghi { scaled } => {
                let (cover, share) = (values.get("cover")?, values.get("cover_share1")?);
                let threads = [
                    thread(values, 1, cover * share)?,
                    thread(values, 2, cover * (1.0 - share))?,
                ];
                let model = Box::new(Reciprocal(Microcylinder::new(&threads)));
                with_scale(model, scaled, values)?
            }
            StandardFamily::Artist { model, scaled } => {
                with_scale(model.model(values)?, scaled, values)?
            }
        })
    }

    /// A second thread mostly lies across the first.
    fn adjust_start(&self, values: &mut ParameterValues, random: &mut Random) {
        let has_two = match *self {
            StandardFamily::Kurt { lobes } => lobes > 1,
            StandardFamily::Sadeghi { .. } => true,
            _ => false,
        };
        if has_two
            && random.share() < 0.7
            && let Some(first) = values.get("azimuth1")
        {
            values.set("azimuth2", first + 90.0);
        }
    }

    /// The narrow axis of a lobe first, azimuths in 0 .. 180, the strongest lobe or thread first.
    fn canonical(&self, mut values: ParameterValues) -> ParameterValues {
        match *self {
            StandardFamily::Lambert => {}
            StandardFamily::Artist { .. } => values.half_turn(AZIMUTH),
            StandardFamily::Ggx | StandardFamily::Ward => {
                narrow_axis_first(&mut values, "alpha_x", "alpha_y", "azimuth");
            }
            StandardFamily::Kurt { lobes } => {
                for k in 1..=lobes {
                    let n = |name: &str| format!("{name}{k}");
                    narrow_axis_first(&mut values, &n("mx"), &n("my"), &n("azimuth"));
                }
                let weight = |k: usize| -> f64 {
                    values
                        .colour(&format!("specular{k}"))
                        .iter()
                        .flatten()
                        .sum()
                };
                let mut order: Vec<usize> = (1..=lobes).collect();
                order.sort_by(|a, b| weight(*b).total_cmp(&weight(*a)));
                let before = values.clone();
                for (k, from) in order.into_iter().enumerate() {
                    let pairs = lobe_parameters(k + 1)
                        .into_iter()
                        .zip(lobe_parameters(from));
                    for (to, from) in pairs {
                        let value = before.get(&from.name).unwrap_or(f64::NAN);
                        values.set(&to.name, value);
                    }
                }
            }
            StandardFamily::Sadeghi { .. } => {
                values.half_turn("azimuth1");
                values.half_turn("azimuth2");
                if let Some(share) = values.get("cover_share1").filter(|share| *share < 0.5) {
                    for (a, b) in thread_parameters(1).into_iter().zip(thread_parameters(2)) {
                        values.swap(&a.name, &b.name);
                    }
                    values.set("cover_share1", 1.0 - share);
                }
            }
        }
        values
    }
}

/// The smaller roughness first: the other one lies across it.
fn narrow_axis_first(values: &mut ParameterValues, x: &str, y: &str, azimuth: &str) {
    if values.get(x) > values.get(y) {
        values.swap(x, y);
        if let Some(value) = values.get(azimuth) {
            values.set(azimuth, value + 90.0);
        }
    }
    values.half_turn(azimuth);
}

/// Lobe number `k` of Kurt's model.
fn lobe(values: &ParameterValues, k: usize) -> Option<KurtLobe> {
    let get = |name: &str| values.get(&format!("{name}{k}"));
    Some(KurtLobe {
        specular: values.colour(&format!("specular{k}"))?,
        f0: get("f0")?,
        mx: get("mx")?,
        my: get("my")?,
        alpha: get("alpha")?,
        azimuth_deg: get("azimuth")?,
    })
}

/// Thread number `k` of the microcylinder model.
fn thread(values: &ParameterValues, k: usize, cover: f64) -> Option<Thread> {
    let get = |name: &str| values.get(&format!("{name}{k}"));
    let tilt = get("tilt")?;
    Some(Thread {
        albedo: values.colour(&format!("albedo{k}"))?,
        index: get("index")?,
        isotropic: get("isotropic")?,
        surface_width_deg: get("surface_width")?,
        volume_width_deg: get("volume_width")?,
        azimuth_deg: get("azimuth")?,
        tilts_deg: vec![-tilt, tilt],
        cover,
    })
}

/// A model, times the factor over all where there is one.
fn with_scale(
    model: Box<dyn Brdf>,
    scaled: bool,
    values: &ParameterValues,
) -> Option<Box<dyn Brdf>> {
    if !scaled {
        return Some(model);
    }
    let factor = values.get("scale")?;
    Some(Box::new(Scaled { model, factor }))
}

/// A model times a factor.
struct Scaled {
    model: Box<dyn Brdf>,
    factor: f64,
}

impl Brdf for Scaled {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        self.model.eval(light, view).map(|f| self.factor * f)
    }
}

fn lobe_parameters(k: usize) -> Vec<Parameter> {
    let n = |name: &str| format!("{name}{k}");
    let mut list = amplitude(&n("specular"), 1e3, (0.3, 10.0)).to_vec();
    list.push(Parameter::share(n("f0"), (0.02, 0.5)));
    list.extend(roughness(&n("mx"), &n("my")));
    list.push(Parameter::share(n("alpha"), (0.1, 0.6)));
    list.push(Parameter::azimuth(n("azimuth")));
    list
}

fn thread_parameters(k: usize) -> Vec<Parameter> {
    let n = |name: &str| format!("{name}{k}");
    let number = |name: &str, range, start| Parameter::new(n(name), range).starting(start);
    let degrees = |name: &str, range, start| Parameter {
        unit: "deg",
        ..number(name, range, start)
    };
    let albedo = Parameter::colour(&n("albedo"), Range::Logarithmic(1e-5, 3.0));
    let mut list = albedo.map(|p| p.starting((0.02, 0.4))).to_vec();
    list.extend([
        number("index", Range::Linear(1.1, 2.2), (1.3, 1.6)),
        Parameter::share(n("isotropic"), (0.1, 0.5)),
        degrees("surface_width", Range::Logarithmic(1.0, 90.0), (3.0, 25.0)),
        degrees("volume_width", Range::Logarithmic(2.0, 120.0), (6.0, 50.0)),
        Parameter::azimuth(n("azimuth")),
        degrees("tilt", Range::Linear(0.0, 60.0), (3.0, 40.0)),
    ]);
    list
}

fn base_and_lobe() -> Vec<Parameter> {
    let base = amplitude("diffuse", 1e2, (0.2, 0.9));
    let lobe = amplitude("specular", 1e3, (0.3, 10.0));
    base.into_iter().chain(lobe).collect()
}

/// A colour that grows with the unit of the values.
fn amplitude(name: &str, most: f64, start: (f64, f64)) -> [Parameter; 3] {
    Parameter::colour(name, Range::Logarithmic(1e-4, most)).map(|p| Parameter {
        is_amplitude: true,
        start,
        ..p
    })
}

/// Two roughnesses.
fn roughness(x: &str, y: &str) -> [Parameter; 2] {
    let one = |name, start| Parameter::new(name, Range::Logarithmic(0.005, 3.0)).starting(start);
    [one(x, (0.05, 0.4)), one(y, (0.1, 0.9))]
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [&str; 9] = [
        "lambert",
        "ggx",
        "ward",
        "kurt1",
        "kurt2",
        "sadeghi",
        "principled",
        "gltf",
        "openpbr",
    ];

    fn start(family: StandardFamily, seed: u64) -> ParameterValues {
        let mut random = Random::new(seed);
        let drawn = family
            .parameters()
            .iter()
            .map(|p| p.draw(&mut random))
            .collect();
        let mut values = family.values(drawn).unwrap();
        family.adjust_start(&mut values, &mut random);
        values
    }

    #[test]
    fn every_family_has_as_many_numbers_as_names_and_a_model_of_them() {
        for name in ALL {
            for are_relative in [false, true] {
                let family: StandardFamily = name.parse().unwrap();
                let family = family.for_values(are_relative);
                assert_eq!(family.to_string(), name);
                let start = start(family, 3);
                let names: std::collections::HashSet<String> =
                    family.parameters().into_iter().map(|p| p.name).collect();
                assert_eq!(names.len(), start.len());
                assert!(family.model(&start).is_some());
                assert_eq!(family.values(start[1..].to_vec()), None);
                let mut other = family.parameters();
                other[0].name = "another".to_owned();
                let without = ParameterValues::new(&other, start.to_vec()).unwrap();
                assert!(family.model(&without).is_none());
            }
        }
        let error = "phong".parse::<StandardFamily>().unwrap_err().to_string();
        assert!(error.contains("phong") && error.contains("sadeghi"));
    }

    #[test]
    fn the_canonical_numbers_are_the_same_model() {
        let (light, view) = ([0.36, 0.48, 0.8], [-0.6, 0.0, 0.8]);
        for name in ALL {
            let family: StandardFamily = name.parse().unwrap();
            for seed in 0..8 {
                let mut p = start(family, seed);
                for parameter in family.parameters() {
                    if parameter.range == Range::Azimuth {
                        p.set(&parameter.name, p.get(&parameter.name).unwrap() - 300.0);
                    }
                }
                let given = family.model(&p).unwrap().eval(light, view);
                let p = family.canonical(p);
                let found = family.model(&p).unwrap().eval(light, view);
                for c in 0..3 {
                    assert!((given[c] / found[c] - 1.0).abs() < 1e-9, "{name} {p:?}");
                }
                assert_eq!(family.canonical(p.clone()), p);
            }
        }
    }
}
