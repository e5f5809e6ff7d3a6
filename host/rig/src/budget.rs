//! The inputs of a data set's uncertainty, as its samples and its dense BRDF carry them.

use crate::uncertainty::{Input, KnownFrom};
use std::fmt;
use std::str::FromStr;

/// How light and beam were divided out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceCalibration {
    /// By a reference of known reflectance: f = (I/I_R)·ρ/π, in 1/sr.
    KnownReference,
    /// By an unknown reference measured over the whole plan: eq. (3), relative to the irradiance
    /// at the target's centre at normal incidence.
    UnknownReference,
    /// By an ideal point light over the rig's geometry: relative.
    GeometricModel,
}

impl ReferenceCalibration {
    const ALL: [Self; 3] = [
        Self::KnownReference,
        Self::UnknownReference,
        Self::GeometricModel,
    ];

    /// Whether values are in 1/sr.
    pub fn is_absolute(self) -> bool {
        self == Self::KnownReference
    }

    /// Its name in a record.
    fn name(self) -> &'static str {
        match self {
            Self::KnownReference => "known reference",
            Self::UnknownReference => "unknown reference",
            Self::GeometricModel => "ideal light",
        }
    }
}

/// What the uncertainty of a data set follows from, beside its own scatter. As a text (`Display`, `FromStr`) it is
/// one line of its provenance.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    /// How light and beam were divided out: it decides what cancels.
    pub calibration: ReferenceCalibration,
    /// The value whose counts the camera is compared at, in the unit of the values: the reference's ρ/π, else the
    /// samples' mean; > 0.
    pub level: f64,
    /// Distance of the light, mm.
    pub light_mm: f64,
    /// Distance of the camera, mm.
    pub camera_mm: f64,
    /// Side of the square that a sample is the median of, mm.
    pub patch_mm: f64,
    /// The share of a frame from straight above that shows the sample, above 0 to 1: stray light is of the whole frame.
    pub frame_share: f64,
    /// What the target's lines and the rest of the frame add to the mean of the sample, over its share of the frame, in
    /// the unit of the values; ≥ 0.
    pub surround: f64,
    inputs: [(f64, KnownFrom); Input::ALL.len()],
}

impl Budget {
    /// A budget of inputs as `of` gives them, with these lengths in mm: distances of light and camera, side of a
    /// patch.
    pub fn new(
        calibration: ReferenceCalibration,
        level: f64,
        [light_mm, camera_mm, patch_mm]: [f64; 3],
        of: impl Fn(Input) -> (f64, KnownFrom),
    ) -> Self {
        Self {
            calibration,
            level,
            light_mm,
            camera_mm,
            patch_mm,
            frame_share: 1.0,
            surround: 0.0,
            inputs: Input::ALL.map(of),
        }
    }

    /// The budget with a frame's share of the sample and what the rest adds to its mean; without it the sample fills
    /// frames.
    #[must_use]
    pub fn with_frame(mut self, [share, surround]: [f64; 2]) -> Self {
        (self.frame_share, self.surround) = (share, surround);
        self
    }

    /// The value of an input: a standard uncertainty, or a diameter.
    pub fn value(&self, input: Input) -> f64 {
        self.inputs[input as usize].0
    }

    /// Whence it is known.
    pub fn known_from(&self, input: Input) -> KnownFrom {
        self.inputs[input as usize].1
    }

    /// The budget with another value of an input.
    #[must_use]
    pub fn with(mut self, input: Input, value: f64) -> Self {
        self.inputs[input as usize] = (value, KnownFrom::Stated);
        self
    }
}

/// Between the parts of a record.
const BETWEEN: &str = "; ";

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}{BETWEEN}level {}{BETWEEN}light {} mm{BETWEEN}camera {} mm{BETWEEN}patch {} mm\
             {BETWEEN}frame {}{BETWEEN}surround {}",
            self.calibration.name(),
            self.level,
            self.light_mm,
            self.camera_mm,
            self.patch_mm,
            self.frame_share,
            self.surround
        )?;
        for input in Input::ALL {
            let (value, from) = self.inputs[input as usize];
            write!(f, "{BETWEEN}{} {value} {}", input.key(), from.name())?;
        }
        Ok(())
    }
}

/// A text that is no record of a budget: what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the record of its uncertainties has no sound \"{0}\"; make the samples again")]
pub struct NoBudget(String);

impl FromStr for Budget {
    type Err = NoBudget;

    fn from_str(text: &str) -> Result<Self, NoBudget> {
        let mut parts = text.split(BETWEEN);
        let name = parts.next().unwrap_or_default();
        let calibration = ReferenceCalibration::ALL.into_iter();
        let calibration = calibration.into_iter().find(|of| of.name() == name);
        let calibration = calibration.ok_or_else(|| NoBudget("reference".into()))?;
        let rest: Vec<Vec<&str>> = parts.map(|part| part.split(' ').collect()).collect();
        let found = |name: &str| {
            let words = rest.iter().find(|words| words[0] == name)?;
            let value: f64 = words.get(1)?.parse().ok()?;
            let sound = value.is_finite() && value >= 0.0;
            sound.then_some((value, words.get(2).copied().unwrap_or_default()))
        };
        let wrong = |name: &str| NoBudget(name.to_owned());
        let number = |name: &str| found(name).map(|of| of.0).ok_or_else(|| wrong(name));
        let mut inputs = [(0.0, KnownFrom::Default); Input::ALL.len()];
        for input in Input::ALL {
            let (value, from) = found(input.key()).ok_or_else(|| wrong(input.key()))?;
            let from = KnownFrom::ALL
                .into_iter()
                .find(|known| known.name() == from);
            inputs[input as usize] = (value, from.ok_or_else(|| wrong(input.key()))?);
        }
        Ok(Self {
            calibration,
            level: number("level")?,
            light_mm: number("light")?,
            camera_mm: number("camera")?,
            patch_mm: number("patch")?,
            // Records of before 28 November 2026 have neither.
            frame_share: found("frame").map_or(1.0, |of| of.0),
            surround: found("surround").map_or(0.0, |of| of.0),
            inputs,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rig;

    #[test]
    fn a_budget_comes_back_from_its_record_and_a_wrong_record_is_named() {
        let rig = Rig::paper(400);
        let known = ReferenceCalibration::KnownReference;
        let budget = Budget::new(known, 0.315, [1100.0, 1800.0, 14.0], |input| {
            rig.input(input)
        });
        let budget = budget.with(Input::Drift, 0.001).with_frame([0.25, 0.01]);
        let text = budget.to_string();
        assert_eq!(text.parse(), Ok(budget.clone()));
        let of_before = text.replace("; frame 0.25; surround 0.01", "").parse();
        assert_eq!(of_before, Ok(budget.with_frame([1.0, 0.0])));
        for (from, to, named) in [
            ("known reference", "some reference", "reference"),
            ("drift 0.001", "drift -0.001", "uncertainty.drift"),
            ("drift 0.001 stated", "drift 0.001", "uncertainty.drift"),
            ("; level 0.315", "", "level"),
            ("patch 14", "patch wide", "patch"),
        ] {
            let wrong: Result<Budget, NoBudget> = text.replace(from, to).parse();
            let said = wrong.unwrap_err().to_string();
            assert!(said.contains(&format!("\"{named}\"")), "{said}");
        }
    }
}
