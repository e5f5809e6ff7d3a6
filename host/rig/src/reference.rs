//! `[reference]` of `rig.toml`: what a reference reflects, and how well that is known.

use gonia_brdf::Pose;
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt::{self, Formatter};
use toml_datetime::Datetime;

/// A reference of known reflectance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ReferenceKeys", into = "ReferenceKeys")]
pub struct Reference {
    /// What it reflects.
    pub reflectance: Reflectance,
    /// How well that is known, and since when.
    pub certificate: Certificate,
}

impl Reference {
    /// A Lambertian one of this reflectance factor per channel, without a certificate.
    pub fn lambertian(reflectance: [f64; 3]) -> Self {
        Self::from(Reflectance::Lambertian(reflectance))
    }
}

impl From<Reflectance> for Reference {
    fn from(reflectance: Reflectance) -> Self {
        Self {
            reflectance,
            certificate: Certificate::default(),
        }
    }
}

/// What a reference reflects: either `reflectance` or `table` in `rig.toml`.
#[derive(Clone, Debug, PartialEq)]
pub enum Reflectance {
    /// The same under all directions: reflectance factor per channel, 0 < ρ ≤ 1.1.
    Lambertian([f64; 3]),
    /// By direction.
    Table {
        /// The table's CSV, relative to the rig's folder.
        file: String,
        /// Its rows, once `gonia_formats::rig_toml::read_rig` has read them.
        table: ReflectanceTable,
    },
}

/// What a reference's certificate says beside its reflectance. Uncertainties are standard ones (k = 1).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certificate {
    /// Of its reflectance, as a share of it: half of a certificate's U (k = 2).
    pub u: Option<f64>,
    /// Of its departure from a Lambertian one, as a share at a polar angle θ of light or view over
    /// (1 − cos θ)².
    pub u_angle: Option<f64>,
    /// Of its tilt against the sample's plane, degrees.
    pub tilt_u_deg: Option<f64>,
    /// Of its height over the sample's plane, mm.
    pub height_u_mm: Option<f64>,
    /// Its certificate, by name or number.
    pub certificate: Option<String>,
    /// The last day on which it may be relied on, as `2027-03-31`.
    pub valid_until: Option<String>,
}

/// Reflectance factors (π times the BRDF) by direction; never empty in a rig that was read.
#[derive(Clone, Debug, PartialEq)]
pub enum ReflectanceTable {
    /// By θi in degrees, in order.
    ByIncidence(Vec<(f64, [f64; 3])>),
    /// By light and view. A reference is taken as isotropic and reciprocal.
    ByPose(Vec<(Pose, [f64; 3])>),
}

/// A reflectance that all channels share, or one for each.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "reflectance: give one number, or three of them as [red, green, blue]"
)]
enum OneOrThree {
    One(f64),
    Three([f64; 3]),
}

fn one_or_three<'de, D: Deserializer<'de>>(of: D) -> Result<Option<[f64; 3]>, D::Error> {
    OneOrThree::deserialize(of).map(|read| match read {
        OneOrThree::One(rho) => Some([rho; 3]),
        OneOrThree::Three(rho) => Some(rho),
    })
}

/// The keys of `[reference]`.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ReferenceKeys {
    #[serde(
        default,
        deserialize_with = "one_or_three",
        skip_serializing_if = "Option::is_none"
    )]
    reflectance: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    table: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    u: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    u_angle: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    tilt_u_deg: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    height_u_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    certificate: Option<String>,
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "day"
    )]
    valid_until: Option<String>,
}

/// A day as a text or as TOML's own date, without quotes. Whether it is one is checked with the rest of the rig.
fn day<'de, D: Deserializer<'de>>(from: D) -> Result<Option<String>, D::Error> {
    struct Day;

    impl<'de> Visitor<'de> for Day {
        type Value = String;

        fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
            f.write_str("a day, as 2027-03-31")
        }

        fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<String, E> {
            Ok(text.into())
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<String, A::Error> {
            let date = Datetime::deserialize(MapAccessDeserializer::new(map));
            date.map(|date| date.to_string())
                .map_err(|_| serde::de::Error::invalid_type(Unexpected::Map, &self))
        }
    }

    from.deserialize_any(Day).map(Some)
}

impl TryFrom<ReferenceKeys> for Reference {
    type Error = &'static str;

    fn try_from(keys: ReferenceKeys) -> Result<Self, Self::Error> {
        let reflectance = match (keys.reflectance, keys.table) {
            (Some(rho), None) => Reflectance::Lambertian(rho),
            (None, Some(file)) => Reflectance::Table {
                file,
                table: ReflectanceTable::ByIncidence(Vec::new()),
            },
            _ => return Err("[reference] needs either reflectance or table"),
        };
        Ok(Self {
            reflectance,
            certificate: Certificate {
                u: keys.u,
                u_angle: keys.u_angle,
                tilt_u_deg: keys.tilt_u_deg,
                height_u_mm: keys.height_u_mm,
                certificate: keys.certificate,
                valid_until: keys.valid_until,
            },
        })
    }
}

impl From<Reference> for ReferenceKeys {
    fn from(reference: Reference) -> Self {
        let (reflectance, table) = match reference.reflectance {
            Reflectance::Lambertian(rho) => (Some(rho), None),
            Reflectance::Table { file, .. } => (None, Some(file)),
        };
        let Certificate {
            u,
            u_angle,
            tilt_u_deg,
            height_u_mm,
            certificate,
            valid_until,
        } = reference.certificate;
        Self {
            reflectance,
            table,
            u,
            u_angle,
            tilt_u_deg,
            height_u_mm,
            certificate,
            valid_until,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn read(day: &str) -> Result<Option<String>, String> {
        let text = format!("reflectance = [0.9, 0.9, 0.9]\nvalid_until = {day}\n");
        let read: Result<Reference, _> = toml::from_str(&text);
        read.map(|of| of.certificate.valid_until)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn a_day_may_stand_with_quotes_or_without() {
        for day in ["2026-01-01", "\"2026-01-01\""] {
            assert_eq!(read(day).unwrap().as_deref(), Some("2026-01-01"), "{day}");
        }
        // No day, which the check of the whole rig says.
        assert_eq!(read("07:32:00").unwrap().as_deref(), Some("07:32:00"));
        for other in ["2026", "{ year = 2026 }"] {
            let error = read(other).unwrap_err();
            assert!(error.contains("expected a day, as 2027-03-31"), "{error}");
        }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let mut reference = Reference::lambertian([0.9; 3]);
        reference.certificate.valid_until = Some("2026-01-01".into());
        let text = toml::to_string(&reference).unwrap();
        assert_eq!(toml::from_str::<Reference>(&text).unwrap(), reference);
    }
}
