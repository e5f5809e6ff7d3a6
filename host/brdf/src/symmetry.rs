//! Symmetries that a material may have about its normal, beside reciprocity.

use crate::interpolate::coordinates::Pair;
use crate::sample::Sample;
use std::fmt;

/// A symmetry of a BRDF about the normal of its sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// None: the BRDF depends on all four angles.
    None,
    /// Half a turn about the normal changes nothing, as of a weave.
    HalfTurn,
    /// No turn about the normal changes anything; the two sides of the plane of incidence may differ.
    Turns,
    /// No turn about the normal changes anything, and the two sides of the plane of incidence are alike.
    Isotropic,
}

impl Symmetry {
    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Symmetry::None => "none",
            Symmetry::HalfTurn => "half-turn",
            Symmetry::Turns => "isotropic, sides apart",
            Symmetry::Isotropic => "isotropic",
        }
    }

    /// Samples with their images under half a turn, where the symmetry has it.
    pub fn completed(self, samples: Vec<Sample>) -> Vec<Sample> {
        if self != Symmetry::HalfTurn {
            return samples;
        }
        let half = |phi: f32| {
            if phi < 180.0 {
                phi + 180.0
            } else {
                phi - 180.0
            }
        };
        let turned = |s: &Sample| Sample {
            phi_i_deg: half(s.phi_i_deg),
            phi_v_deg: half(s.phi_v_deg),
            ..*s
        };
        let images: Vec<Sample> = samples.iter().map(turned).collect();
        [samples, images].concat()
    }

    /// Whether the azimuth of the sample does not matter: three angles are left of four.
    pub fn is_isotropic(self) -> bool {
        matches!(self, Symmetry::Turns | Symmetry::Isotropic)
    }

    /// The images of a pair that are other places than itself, turns by any angle aside, itself first.
    pub(crate) fn images(self, pair: Pair) -> Vec<Pair> {
        match self {
            Symmetry::None | Symmetry::Turns => vec![pair],
            Symmetry::HalfTurn => vec![pair, turned(pair, [-1.0, 0.0])],
            Symmetry::Isotropic => vec![pair, reflected(pair)],
        }
    }

    /// The pair turned about the normal so that it lies nearest to `to`, where any turn is allowed.
    pub(crate) fn aligned(self, pair: Pair, to: Pair) -> Pair {
        if !self.is_isotropic() {
            return pair;
        }
        // As complex numbers, Σ conj(p) q: its argument is the angle of least squares.
        let (mut re, mut im) = (0.0, 0.0);
        for k in [0, 3] {
            re += pair[k] * to[k] + pair[k + 1] * to[k + 1];
            im += pair[k] * to[k + 1] - pair[k + 1] * to[k];
        }
        let length = (re * re + im * im).sqrt();
        if length < 1e-12 {
            return pair;
        }
        turned(pair, [re / length, im / length])
    }

    /// Where a pair is looked for: what is the same but for turns has one place, and what is near to each other
    /// up to turns has near places.
    pub(crate) fn search_place(self, p: Pair) -> [f32; 6] {
        if !self.is_isotropic() {
            return p.map(|x| x as f32);
        }
        // Hopf's map of the planar parts (two complex numbers less one angle are a cone over a sphere).
        let across = 2.0 * (p[0] * p[3] + p[1] * p[4]);
        let along = 2.0 * (p[0] * p[4] - p[1] * p[3]);
        let [first, second] = [0, 3].map(|k| p[k] * p[k] + p[k + 1] * p[k + 1]);
        let radius = (first + second).sqrt().max(1e-12);
        // Half of the sphere's angle is that of the pairs.
        [
            across / radius,
            along / radius,
            (first - second) / radius,
            p[2],
            p[5],
            0.0,
        ]
        .map(|x| x as f32)
    }
}

impl fmt::Display for Symmetry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Turned about the normal by the angle with this cosine and sine.
fn turned(p: Pair, [cos, sin]: [f64; 2]) -> Pair {
    [
        cos * p[0] - sin * p[1],
        sin * p[0] + cos * p[1],
        p[2],
        cos * p[3] - sin * p[4],
        sin * p[3] + cos * p[4],
        p[5],
    ]
}

fn reflected(p: Pair) -> Pair {
    [p[0], -p[1], p[2], p[3], -p[4], p[5]]
}
