//! What the values' uncertainty is made of: the inputs of the measurement equation whose errors no frame tells.
//!
//! `rig.toml` states them in `[reference]` and `[uncertainty]`; those that it leaves out have deliberately
//! cautious defaults. All are standard uncertainties (k = 1). The equation itself is `gonia_pipeline::budget`.

use crate::reference::Reference;
use crate::reference::Reflectance;
use crate::rig_error::{RigError, within};
use serde::{Deserialize, Serialize};

/// `[uncertainty]` of `rig.toml`; what is left out has its default ([`Input::default_value`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Uncertainties {
    /// Of the lamp between material and reference, as a share.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift: Option<f64>,
    /// Of counts as a measure of light, as a share, where they differ from the reference's by a factor of ten.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linearity: Option<f64>,
    /// Of the black level, as a share of the reference's signal under light from straight above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Of the share of the frame's mean light that lens and room spread over every pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stray_light: Option<f64>,
    /// Of the light's direction, along and across its meridian, degrees; where the rig was calibrated, the
    /// calibration says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_deg: Option<f64>,
    /// Of the camera's direction, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view_deg: Option<f64>,
    /// Diameter of the lamp, mm: the values are means over the cone that it subtends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_diameter_mm: Option<f64>,
    /// Diameter of the lens' opening, mm, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens_diameter_mm: Option<f64>,
}

/// An input of the measurement equation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Input {
    /// The reference's reflectance, a share.
    Reference = 0,
    /// Its departure from a Lambertian one, a share over (1 − cos θ)².
    ReferenceAngle,
    /// Its tilt against the sample's plane, degrees.
    ReferenceTilt,
    /// Its height over the sample's plane, mm.
    ReferenceHeight,
    /// The lamp between material and reference, a share.
    Drift,
    /// Counts over light, a share a factor of ten.
    Linearity,
    /// The black level, a share of the reference's signal.
    Offset,
    /// Stray light, a share of the frame's mean.
    StrayLight,
    /// The light's direction, degrees a component.
    LightDirection,
    /// The camera's direction, degrees a component.
    ViewDirection,
    /// The lamp's diameter, mm.
    LightDiameter,
    /// The lens' diameter, mm.
    LensDiameter,
}

/// Whence an input's value is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownFrom {
    /// `rig.toml` states it.
    Stated,
    /// The calibration of the geometry found it.
    Calibration,
    /// Nobody stated it.
    Default,
}

impl KnownFrom {
    pub(crate) const ALL: [Self; 3] = [Self::Stated, Self::Calibration, Self::Default];

    /// Its name, for people and in a record.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stated => "stated",
            Self::Calibration => "calibration",
            Self::Default => "default",
        }
    }
}

impl Input {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 12] = [
        Self::Reference,
        Self::ReferenceAngle,
        Self::ReferenceTilt,
        Self::ReferenceHeight,
        Self::Drift,
        Self::Linearity,
        Self::Offset,
        Self::StrayLight,
        Self::LightDirection,
        Self::ViewDirection,
        Self::LightDiameter,
        Self::LensDiameter,
    ];

    /// Its key in `rig.toml`.
    pub fn key(self) -> &'static str {
        match self {
            Self::Reference => "reference.u",
            Self::ReferenceAngle => "reference.u_angle",
            Self::ReferenceTilt => "reference.tilt_u_deg",
            Self::ReferenceHeight => "reference.height_u_mm",
            Self::Drift => "uncertainty.drift",
            Self::Linearity => "uncertainty.linearity",
            Self::Offset => "uncertainty.offset",
            Self::StrayLight => "uncertainty.stray_light",
            Self::LightDirection => "uncertainty.light_deg",
            Self::ViewDirection => "uncertainty.view_deg",
            Self::LightDiameter => "uncertainty.light_diameter_mm",
            Self::LensDiameter => "uncertainty.lens_diameter_mm",
        }
    }

    /// Its unit, for people; empty for a share.
    pub fn unit(self) -> &'static str {
        match self {
            Self::ReferenceTilt | Self::LightDirection | Self::ViewDirection => "degrees",
            Self::ReferenceHeight | Self::LightDiameter | Self::LensDiameter => "mm",
            _ => "",
        }
    }

    /// What it is taken for where nobody states it. Sintered PTFE departs from a Lambertian reflector by 4 % at
    /// 60°, 8 % at 70° and 18 % at 80° (NIST, 532 nm, light from above); a rig that was set up with care and not
    /// calibrated had directions .3° to .5° off.
    pub fn default_value(self) -> f64 {
        match self {
            Self::Reference => 0.02,
            Self::ReferenceAngle => 0.2,
            Self::ReferenceTilt => 0.1,
            Self::ReferenceHeight => 0.5,
            Self::Drift => 0.005,
            Self::Linearity => 0.005,
            Self::Offset => 0.0005,
            Self::StrayLight => 0.005,
            Self::LightDirection => 0.4,
            Self::ViewDirection => 0.25,
            Self::LightDiameter | Self::LensDiameter => 10.0,
        }
    }

    /// What the file states of it.
    fn stated(self, reference: Option<&Reference>, keys: &Uncertainties) -> Option<f64> {
        let certificate = reference.map(|of| &of.certificate);
        match self {
            Self::Reference => certificate?.u,
            Self::ReferenceAngle => certificate?.u_angle,
            Self::ReferenceTilt => certificate?.tilt_u_deg,
            Self::ReferenceHeight => certificate?.height_u_mm,
            Self::Drift => keys.drift,
            Self::Linearity => keys.linearity,
            Self::Offset => keys.offset,
            Self::StrayLight => keys.stray_light,
            Self::LightDirection => keys.light_deg,
            Self::ViewDirection => keys.view_deg,
            Self::LightDiameter => keys.light_diameter_mm,
            Self::LensDiameter => keys.lens_diameter_mm,
        }
    }

    /// Its value in a rig with this reference that states this, but for what a calibration says of directions.
    pub fn of(self, reference: Option<&Reference>, keys: &Uncertainties) -> (f64, KnownFrom) {
        match self.stated(reference, keys) {
            Some(value) => (value, KnownFrom::Stated),
            // A table holds the angles.
            None if self == Self::ReferenceAngle && is_tabled(reference) => {
                (0.0, KnownFrom::Stated)
            }
            None => (self.default_value(), KnownFrom::Default),
        }
    }

    /// Whether this value of it is possible.
    fn check(self, value: f64) -> Result<(), RigError> {
        let range = match self {
            Self::LightDiameter | Self::LensDiameter => {
                return within(self.key(), value, 0.0..=1000.0, "mm");
            }
            Self::ReferenceTilt | Self::LightDirection | Self::ViewDirection => 10.0,
            Self::ReferenceHeight => 100.0,
            _ => 1.0,
        };
        let (least, unit) = (f64::MIN_POSITIVE, self.unit());
        within(self.key(), value, least..=range, unit).map_err(|mut error| {
            error.remedy = format!(
                "{}, or leave it out for the default of {}",
                error.remedy,
                self.default_value()
            );
            error
        })
    }
}

fn is_tabled(reference: Option<&Reference>) -> bool {
    let reflectance = reference.map(|reference| &reference.reflectance);
    matches!(reflectance, Some(Reflectance::Table { .. }))
}

/// Checks what a rig states of its uncertainties.
pub(crate) fn check_uncertainties(
    reference: Option<&Reference>,
    keys: &Uncertainties,
) -> Result<(), RigError> {
    for input in Input::ALL {
        if let Some(value) = input.stated(reference, keys) {
            input.check(value)?;
        }
    }
    let certificate = reference.map(|of| &of.certificate);
    match certificate.and_then(|of| of.valid_until.as_deref()) {
        Some(day) if !is_day(day) => Err(RigError::new(
            "reference.valid_until",
            format!("\"{day}\" is no day"),
            "write it as 2027-03-31",
        )),
        _ => Ok(()),
    }
}

/// Whether a text is a day, as `2027-03-31`: such days stand in the order of their letters.
fn is_day(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let [year, month, day] = parts[..] else {
        return false;
    };
    let number = |text: &str, digits: usize| {
        let is_plain = text.len() == digits && text.bytes().all(|b| b.is_ascii_digit());
        is_plain.then(|| text.parse::<u32>().ok()).flatten()
    };
    let (Some(year), Some(month), Some(day)) = (number(year, 4), number(month, 2), number(day, 2))
    else {
        return false;
    };
    let leap = u32::from(year % 4 == 0 && (year % 100 != 0 || year % 400 == 0));
    let days = match month {
        2 => 28 + leap,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return false,
    };
    (1..=days).contains(&day)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::Certificate;

    fn with_u(u: f64) -> Reference {
        let mut reference = Reference::lambertian([0.99; 3]);
        reference.certificate = Certificate {
            u: Some(u),
            ..Certificate::default()
        };
        reference
    }

    #[test]
    fn inputs_stand_at_their_numbers_and_defaults_are_possible() {
        for (at, input) in Input::ALL.into_iter().enumerate() {
            assert_eq!(input as usize, at);
            assert_eq!(input.check(input.default_value()), Ok(()));
        }
    }

    #[test]
    fn an_uncertainty_of_zero_or_above_one_is_refused_and_the_default_named() {
        let none = Uncertainties::default();
        assert_eq!(check_uncertainties(Some(&with_u(0.004)), &none), Ok(()));
        for wrong in [0.0, -0.1, 1.5, f64::NAN] {
            let error = check_uncertainties(Some(&with_u(wrong)), &none).unwrap_err();
            assert_eq!(error.key, "reference.u");
            assert!(error.remedy.contains("default of 0.02"), "{error}");
            let keys = Uncertainties {
                drift: Some(wrong),
                ..none
            };
            let error = check_uncertainties(None, &keys).unwrap_err();
            assert_eq!(error.key, "uncertainty.drift");
        }
    }

    #[test]
    fn what_is_stated_is_used_and_what_is_not_has_its_default() {
        let none = Uncertainties::default();
        let reference = with_u(0.004);
        let of = |input: Input, reference| input.of(Some(reference), &none);
        assert_eq!(of(Input::Reference, &reference), (0.004, KnownFrom::Stated));
        assert_eq!(of(Input::Drift, &reference), (0.005, KnownFrom::Default));
        let by_angle = of(Input::ReferenceAngle, &reference);
        assert_eq!(by_angle, (0.2, KnownFrom::Default));
        let tabled = Reference::from(Reflectance::Table {
            file: "white.csv".into(),
            table: crate::reference::ReflectanceTable::ByIncidence(Vec::new()),
        });
        assert_eq!(of(Input::ReferenceAngle, &tabled).0, 0.0);
    }

    #[test]
    fn days_are_days() {
        for day in ["2027-03-31", "2028-02-29", "2000-02-29"] {
            assert!(is_day(day), "{day}");
        }
        for none in [
            "2027-3-31",
            "31.03.2027",
            "2027-02-29",
            "1900-02-29",
            "2027-13-01",
            "2027-00-10",
            "soon",
            "",
        ] {
            assert!(!is_day(none), "{none}");
        }
    }
}
