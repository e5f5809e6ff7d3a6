//! What the uncertainty of a value consists of, for people.

use gonia_rig::Input;

/// A part of a value's uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contribution {
    /// What the samples' own scatter shows.
    Noise,
    /// An input of the measurement equation.
    Input(Input),
    /// The square that a sample is the median of.
    Patch,
}

/// How many there are.
pub(crate) const CONTRIBUTIONS: usize = Input::ALL.len() + 2;

impl Contribution {
    /// All: noise first, then the inputs in their order.
    pub fn all() -> [Self; CONTRIBUTIONS] {
        let mut all = [Self::Noise; CONTRIBUTIONS];
        for (place, input) in all[1..].iter_mut().zip(Input::ALL) {
            *place = Self::Input(input);
        }
        all[CONTRIBUTIONS - 1] = Self::Patch;
        all
    }

    /// What it is, in a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Noise => "noise and interpolation",
            Self::Patch => "patch",
            Self::Input(Input::Reference) => "reference",
            Self::Input(Input::ReferenceAngle) => "reference by angle",
            Self::Input(Input::ReferenceTilt) => "reference's tilt",
            Self::Input(Input::ReferenceHeight) => "reference's height",
            Self::Input(Input::Drift) => "drift",
            Self::Input(Input::Linearity) => "linearity",
            Self::Input(Input::Offset) => "black level",
            Self::Input(Input::StrayLight) => "stray light",
            Self::Input(Input::LightDirection) => "direction of light",
            Self::Input(Input::ViewDirection) => "direction of view",
            Self::Input(Input::LightDiameter) => "lamp's size",
            Self::Input(Input::LensDiameter) => "lens' size",
        }
    }

    /// How a laboratory makes it smaller.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Noise => {
                "more poses where cells are interpolated (gonia plan --adaptive says which), a longer exposure \
                 or more brackets where they are measured"
            }
            Self::Patch => "smaller patches (sampling.patch_mm)",
            Self::Input(Input::Reference) => {
                "a reference with a certificate, its u stated as reference.u"
            }
            Self::Input(Input::ReferenceAngle) => {
                "the reference's table over angles (reference.table), or reference.u_angle from its certificate"
            }
            Self::Input(Input::ReferenceTilt) => {
                "the reference levelled against the sample, stated as reference.tilt_u_deg"
            }
            Self::Input(Input::ReferenceHeight) => {
                "the reference's surface set to the sample's, stated as reference.height_u_mm"
            }
            Self::Input(Input::Drift) => {
                "a lamp that has warmed up, and the reference measured beside the material; stated as uncertainty.drift"
            }
            Self::Input(Input::Linearity) => {
                "the camera's curve measured by exposures of one scene, stated as uncertainty.linearity"
            }
            Self::Input(Input::Offset) => {
                "dark frames at the session's exposures, stated as uncertainty.offset"
            }
            Self::Input(Input::StrayLight) => {
                "a dark surround, a lens hood, stray light measured on a black patch; stated as uncertainty.stray_light"
            }
            Self::Input(Input::LightDirection) => {
                "gonia calibrate with more frames, or mirror frames, for the light"
            }
            Self::Input(Input::ViewDirection) => "gonia calibrate with more frames of more pixels",
            Self::Input(Input::LightDiameter) => "a smaller or more distant lamp",
            Self::Input(Input::LensDiameter) => "a smaller aperture",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_contribution_is_there_once() {
        let all = Contribution::all();
        assert_eq!(
            (all[0], all[13]),
            (Contribution::Noise, Contribution::Patch)
        );
        for input in Input::ALL {
            let of = |c: &&Contribution| **c == Contribution::Input(input);
            assert_eq!(all.iter().filter(of).count(), 1);
        }
    }
}
