//! The models that can be fitted, as lists of numbers.

use super::random::Random;
use super::range::Range;
use crate::model::{Brdf, Ggx, Kurt, KurtLobe, Lambert, Microcylinder, Reciprocal, Thread, Ward};
use std::fmt;
use std::str::FromStr;

/// A kind of model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
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
}

/// One number of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, with the lobe's or thread's number and the channel.
    pub name: String,
    /// Its unit, empty for a pure number.
    pub unit: &'static str,
    /// Its bounds.
    pub range: Range,
    /// Whether it grows with the unit of the values.
    pub is_amplitude: bool,
    /// Where in its range a search may start.
    start: (f64, f64),
}

/// A name that is no model's.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("\"{0}\" is no model: choose lambert, ward, ggx, kurt1 to kurt4 or sadeghi")]
pub struct UnknownFamily(String);

impl FromStr for Family {
    type Err = UnknownFamily;

    fn from_str(text: &str) -> Result<Self, UnknownFamily> {
        Ok(match text {
            "lambert" => Family::Lambert,
            "ggx" => Family::Ggx,
            "ward" => Family::Ward,
            "kurt1" => Family::Kurt { lobes: 1 },
            "kurt" | "kurt2" => Family::Kurt { lobes: 2 },
            "kurt3" => Family::Kurt { lobes: 3 },
            "kurt4" => Family::Kurt { lobes: 4 },
            "sadeghi" => Family::Sadeghi { scaled: false },
            _ => return Err(UnknownFamily(text.to_owned())),
        })
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Family::Lambert => f.write_str("lambert"),
            Family::Ggx => f.write_str("ggx"),
            Family::Ward => f.write_str("ward"),
            Family::Kurt { lobes } => write!(f, "kurt{lobes}"),
            Family::Sadeghi { .. } => f.write_str("sadeghi"),
        }
    }
}

const CHANNELS: [&str; 3] = ["r", "g", "b"];
/// Numbers a lobe of Kurt's: specular r, g, b, f0, mx, my, alpha, azimuth.
const LOBE: usize = 8;
/// Numbers a thread: albedo r, g, b, index, isotropic, γs, γv, azimuth, tilt.
const THREAD: usize = 9;

impl Family {
    /// The family for values in 1/sr, or for values that are so only up to a factor.
    #[must_use]
    pub fn for_values(self, are_relative: bool) -> Self {
        match self {
            Family::Sadeghi { .. } => Family::Sadeghi {
                scaled: are_relative,
            },
            other => other,
        }
    }

    /// Its numbers, in their order.
    pub fn parameters(self) -> Vec<Parameter> {
        let mut list = Vec::new();
        match self {
            Family::Lambert => colour(&mut list, "diffuse", true, (1e-4, 1e2), (0.3, 1.0)),
            Family::Ggx => {
                base_and_lobe(&mut list);
                add(&mut list, "f0", "", Range::Linear(0.0, 1.0), (0.02, 0.6));
                roughness(&mut list, "alpha_x", "alpha_y");
            }
            Family::Ward => {
                base_and_lobe(&mut list);
                roughness(&mut list, "alpha_x", "alpha_y");
            }
            Family::Kurt { lobes } => {
                colour(&mut list, "diffuse", true, (1e-4, 1e2), (0.2, 0.9));
                for k in 1..=lobes {
                    let n = |name: &str| format!("{name}{k}");
                    colour(&mut list, &n("specular"), true, (1e-4, 1e3), (0.3, 10.0));
                    add(
                        &mut list,
                        &n("f0"),
                        "",
                        Range::Linear(0.0, 1.0),
                        (0.02, 0.5),
                    );
                    roughness(&mut list, &n("mx"), &n("my"));
                    // Before the azimuth, as the lobe's numbers are ordered.
                    let azimuth = list.pop();
                    add(
                        &mut list,
                        &n("alpha"),
                        "",
                        Range::Linear(0.0, 1.0),
                        (0.1, 0.6),
                    );
                    list.extend(azimuth.map(|azimuth| Parameter {
                        name: n("azimuth"),
                        ..azimuth
                    }));
                }
            }
            Family::Sadeghi { scaled } => {
                for k in 1..=2 {
                    let n = |name: &str| format!("{name}{k}");
                    colour(&mut list, &n("albedo"), false, (1e-5, 3.0), (0.02, 0.4));
                    add(
                        &mut list,
                        &n("index"),
                        "",
                        Range::Linear(1.1, 2.2),
                        (1.3, 1.6),
                    );
                    add(
                        &mut list,
                        &n("isotropic"),
                        "",
                        Range::Linear(0.0, 1.0),
                        (0.1, 0.5),
                    );
                    let width = Range::Logarithmic(1.0, 90.0);
                    add(&mut list, &n("surface_width"), "deg", width, (3.0, 25.0));
                    let width = Range::Logarithmic(2.0, 120.0);
                    add(&mut list, &n("volume_width"), "deg", width, (6.0, 50.0));
                    add(
                        &mut list,
                        &n("azimuth"),
                        "deg",
                        Range::Azimuth,
                        (0.0, 180.0),
                    );
                    add(
                        &mut list,
                        &n("tilt"),
                        "deg",
                        Range::Linear(0.0, 60.0),
                        (3.0, 40.0),
                    );
                }
                add(
                    &mut list,
                    "cover",
                    "",
                    Range::Linear(0.05, 1.0),
                    (0.5, 0.98),
                );
                add(
                    &mut list,
                    "cover_share1",
                    "",
                    Range::Linear(0.0, 1.0),
                    (0.2, 0.8),
                );
                if scaled {
                    let range = Range::Logarithmic(1e-4, 1e3);
                    add(&mut list, "scale", "", range, (0.3, 10.0));
                    if let Some(scale) = list.last_mut() {
                        scale.is_amplitude = true;
                    }
                }
            }
        }
        list
    }

    /// The model of its numbers (as many as there are [`Family::parameters`]; `None` otherwise).
    pub fn model(self, p: &[f64]) -> Option<Box<dyn Brdf>> {
        if p.len() != self.parameters_len() {
            return None;
        }
        Some(match self {
            Family::Lambert => Box::new(Lambert { albedo: rgb(p) }),
            Family::Ggx => Box::new(Ggx {
                diffuse: rgb(p),
                specular: rgb(&p[3..]),
                f0: p[6],
                alpha_x: p[7],
                alpha_y: p[8],
                azimuth_deg: p[9],
            }),
            Family::Ward => Box::new(Ward {
                diffuse: rgb(p),
                specular: rgb(&p[3..]),
                alpha_x: p[6],
                alpha_y: p[7],
                azimuth_deg: p[8],
            }),
            Family::Kurt { .. } => {
                let lobe = |p: &[f64]| KurtLobe {
                    specular: rgb(p),
                    f0: p[3],
                    mx: p[4],
                    my: p[5],
                    alpha: p[6],
                    azimuth_deg: p[7],
                };
                let lobes: Vec<KurtLobe> = p[3..].chunks_exact(LOBE).map(lobe).collect();
                Box::new(Kurt::new(rgb(p), &lobes))
            }
            Family::Sadeghi { .. } => {
                let (cover, share) = (p[2 * THREAD], p[2 * THREAD + 1]);
                let thread = |p: &[f64], share: f64| Thread {
                    albedo: rgb(p),
                    index: p[3],
                    isotropic: p[4],
                    surface_width_deg: p[5],
                    volume_width_deg: p[6],
                    azimuth_deg: p[7],
                    tilts_deg: vec![-p[8], p[8]],
                    cover: cover * share,
                };
                let threads = [thread(p, share), thread(&p[THREAD..], 1.0 - share)];
                Box::new(Scaled {
                    model: Reciprocal(Microcylinder::new(&threads)),
                    factor: p.get(2 * THREAD + 2).copied().unwrap_or(1.0),
                })
            }
        })
    }

    fn parameters_len(self) -> usize {
        match self {
            Family::Lambert => 3,
            Family::Ggx => 10,
            Family::Ward => 9,
            Family::Kurt { lobes } => 3 + LOBE * lobes,
            Family::Sadeghi { scaled } => 2 * THREAD + 2 + usize::from(scaled),
        }
    }

    /// A random place to start from.
    pub(super) fn start(self, random: &mut Random) -> Vec<f64> {
        let mut p: Vec<f64> = self
            .parameters()
            .iter()
            .map(|parameter| {
                let (low, high) = parameter.start;
                match parameter.range {
                    Range::Logarithmic(..) => random.between(low.ln(), high.ln()).exp(),
                    _ => random.between(low, high),
                }
            })
            .collect();
        // A second thread mostly lies across the first.
        let across = random.share() < 0.7;
        let azimuths = match self {
            Family::Kurt { lobes } if lobes > 1 => Some((3 + 7, 3 + LOBE + 7)),
            Family::Sadeghi { .. } => Some((7, THREAD + 7)),
            _ => None,
        };
        if let (true, Some((first, second))) = (across, azimuths) {
            p[second] = p[first] + 90.0;
        }
        p
    }

    /// One of the many lists of numbers that are the same model: the narrow axis of a lobe first,
    /// azimuths in 0 .. 180, the strongest lobe or thread first.
    pub fn canonical(self, mut p: Vec<f64>) -> Vec<f64> {
        let turn = |azimuth: &mut f64| *azimuth = azimuth.rem_euclid(180.0);
        let lobe = |rough: &mut [f64], azimuth: usize| {
            if rough[0] > rough[1] {
                rough.swap(0, 1);
                rough[azimuth] += 90.0;
            }
            turn(&mut rough[azimuth]);
        };
        match self {
            Family::Lambert => {}
            Family::Ggx => lobe(&mut p[7..], 2),
            Family::Ward => lobe(&mut p[6..], 2),
            Family::Kurt { .. } => {
                for one in p[3..].chunks_exact_mut(LOBE) {
                    lobe(&mut one[4..], 3);
                }
                let mut lobes: Vec<Vec<f64>> =
                    p[3..].chunks_exact(LOBE).map(<[f64]>::to_vec).collect();
                let weight = |lobe: &[f64]| lobe[..3].iter().sum::<f64>();
                lobes.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
                p.truncate(3);
                p.extend(lobes.concat());
            }
            Family::Sadeghi { .. } => {
                turn(&mut p[7]);
                turn(&mut p[THREAD + 7]);
                if p[2 * THREAD + 1] < 0.5 {
                    for k in 0..THREAD {
                        p.swap(k, THREAD + k);
                    }
                    p[2 * THREAD + 1] = 1.0 - p[2 * THREAD + 1];
                }
            }
        }
        p
    }
}

/// A model times a factor.
struct Scaled {
    model: Reciprocal,
    factor: f64,
}

impl Brdf for Scaled {
    fn eval(&self, light: crate::direction::Vec3, view: crate::direction::Vec3) -> [f64; 3] {
        self.model.eval(light, view).map(|f| self.factor * f)
    }
}

fn rgb(p: &[f64]) -> [f64; 3] {
    [p[0], p[1], p[2]]
}

fn add(list: &mut Vec<Parameter>, name: &str, unit: &'static str, range: Range, start: (f64, f64)) {
    list.push(Parameter {
        name: name.to_owned(),
        unit,
        range,
        is_amplitude: false,
        start,
    });
}

fn colour(
    list: &mut Vec<Parameter>,
    name: &str,
    is_amplitude: bool,
    (low, high): (f64, f64),
    start: (f64, f64),
) {
    for channel in CHANNELS {
        list.push(Parameter {
            name: format!("{name}_{channel}"),
            unit: "",
            range: Range::Logarithmic(low, high),
            is_amplitude,
            start,
        });
    }
}

fn base_and_lobe(list: &mut Vec<Parameter>) {
    colour(list, "diffuse", true, (1e-4, 1e2), (0.2, 0.9));
    colour(list, "specular", true, (1e-4, 1e3), (0.3, 10.0));
}

/// Two roughnesses and the azimuth of the first.
fn roughness(list: &mut Vec<Parameter>, x: &str, y: &str) {
    add(list, x, "", Range::Logarithmic(0.005, 3.0), (0.05, 0.4));
    add(list, y, "", Range::Logarithmic(0.005, 3.0), (0.1, 0.9));
    add(list, "azimuth", "deg", Range::Azimuth, (0.0, 180.0));
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [&str; 6] = ["lambert", "ggx", "ward", "kurt1", "kurt2", "sadeghi"];

    #[test]
    fn every_family_has_as_many_numbers_as_names_and_a_model_of_them() {
        for name in ALL {
            for are_relative in [false, true] {
                let family: Family = name.parse().unwrap();
                let family = family.for_values(are_relative);
                assert_eq!(family.to_string(), name);
                let start = family.start(&mut Random::new(3));
                assert_eq!(start.len(), family.parameters().len());
                let names: std::collections::HashSet<String> =
                    family.parameters().into_iter().map(|p| p.name).collect();
                assert_eq!(names.len(), start.len());
                assert!(family.model(&start).is_some());
                assert!(family.model(&start[1..]).is_none());
            }
        }
        let error = "phong".parse::<Family>().unwrap_err().to_string();
        assert!(error.contains("phong") && error.contains("sadeghi"));
    }

    #[test]
    fn the_canonical_numbers_are_the_same_model() {
        let (light, view) = ([0.36, 0.48, 0.8], [-0.6, 0.0, 0.8]);
        for name in ALL {
            let family: Family = name.parse().unwrap();
            for seed in 0..8 {
                let mut p = family.start(&mut Random::new(seed));
                for (value, parameter) in p.iter_mut().zip(family.parameters()) {
                    if parameter.range == Range::Azimuth {
                        *value -= 300.0;
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
