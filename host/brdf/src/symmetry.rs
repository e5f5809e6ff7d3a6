//! Symmetries that a material may have about its normal, beside reciprocity.

use crate::direction::wrap_deg;
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;
use crate::sample::Sample;
use std::fmt;

/// A plane through the normal of the sample, on whose two sides a material is alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MirrorPlane {
    azimuth_mdeg: u32,
}

impl MirrorPlane {
    /// The plane with directions of this azimuth, degrees, to a thousandth.
    pub fn at_deg(azimuth_deg: f64) -> Self {
        let mdeg = (1000.0 * wrap_deg(azimuth_deg)).round() as u32;
        Self {
            azimuth_mdeg: mdeg % 180_000,
        }
    }

    /// Its azimuth, 0 ..180 degrees.
    pub fn azimuth_deg(self) -> f64 {
        f64::from(self.azimuth_mdeg) / 1000.0
    }

    /// What takes places to their images on its other side.
    pub(crate) fn reflection(self) -> Reflection {
        let (sin, cos) = (2.0 * self.azimuth_deg()).to_radians().sine_cosine();
        Reflection([cos, sin])
    }
}

/// Takes places to the other side of a plane: cosine and sine of twice its azimuth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reflection([f64; 2]);

impl Reflection {
    /// The image of a place.
    #[inline]
    pub fn of(self, p: &Pair) -> Pair {
        let Self([cos, sin]) = self;
        [
            cos * p[0] + sin * p[1],
            sin * p[0] - cos * p[1],
            p[2],
            cos * p[3] + sin * p[4],
            sin * p[3] - cos * p[4],
            p[5],
        ]
    }
}

/// A symmetry of a BRDF about the normal of its sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// None: the BRDF depends on all four angles.
    None,
    /// The two sides of a plane through the normal are alike.
    Bilateral(MirrorPlane),
    /// Half a turn about the normal changes nothing, as of many weaves.
    HalfTurn,
    /// Both: a second plane stands upright on the first, as of a plain weave or a brushed metal.
    HalfTurnBilateral(MirrorPlane),
    /// No turn about the normal changes anything; the two sides of the plane of incidence may differ.
    Turns,
    /// No turn about the normal changes anything, and the two sides of the plane of incidence are alike.
    Isotropic,
}

/// A [`Symmetry`] whose plane, and whether sides are alike where turns do not matter, is to be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SymmetryKind {
    /// [`Symmetry::None`].
    None,
    /// [`Symmetry::Bilateral`].
    Bilateral,
    /// [`Symmetry::HalfTurn`].
    HalfTurn,
    /// [`Symmetry::HalfTurnBilateral`].
    HalfTurnBilateral,
    /// [`Symmetry::Turns`] or [`Symmetry::Isotropic`].
    Isotropic,
}

impl SymmetryKind {
    /// All, from the least to the most.
    pub const ALL: [SymmetryKind; 5] = [
        SymmetryKind::None,
        SymmetryKind::Bilateral,
        SymmetryKind::HalfTurn,
        SymmetryKind::HalfTurnBilateral,
        SymmetryKind::Isotropic,
    ];

    /// Its word in files.
    pub fn name(self) -> &'static str {
        match self {
            SymmetryKind::None => "none",
            SymmetryKind::Bilateral => "bilateral",
            SymmetryKind::HalfTurn => "half-turn",
            SymmetryKind::HalfTurnBilateral => "half-turn-bilateral",
            SymmetryKind::Isotropic => "isotropic",
        }
    }

    /// The one of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// What is taken of data that are too few to find a plane in: planes at azimuth 0, sides alike.
    pub(crate) fn untested(self) -> Symmetry {
        let plane = MirrorPlane { azimuth_mdeg: 0 };
        match self {
            SymmetryKind::None => Symmetry::None,
            SymmetryKind::Bilateral => Symmetry::Bilateral(plane),
            SymmetryKind::HalfTurn => Symmetry::HalfTurn,
            SymmetryKind::HalfTurnBilateral => Symmetry::HalfTurnBilateral(plane),
            SymmetryKind::Isotropic => Symmetry::Isotropic,
        }
    }
}

impl Symmetry {
    /// Samples with their images, of symmetries that leave the azimuth of the sample: [`Self::order`] times as many.
    pub fn completed<const N: usize>(self, samples: Vec<Sample<N>>) -> Vec<Sample<N>> {
        let turned = |phi: f32| wrap_deg(f64::from(phi) + 180.0) as f32;
        let image = |samples: &[Sample<N>], of: &dyn Fn(f32) -> f32| -> Vec<Sample<N>> {
            let phi = |phi: f32| {
                // In single precision too, where 359.99999 rounds to 360.
                let phi = of(phi);
                if phi < 360.0 { phi } else { 0.0 }
            };
            let image = |s: &Sample<N>| Sample {
                phi_i_deg: phi(s.phi_i_deg),
                phi_v_deg: phi(s.phi_v_deg),
                ..*s
            };
            samples.iter().map(image).collect()
        };
        let mut all = samples;
        if let Some(plane) = self.plane() {
            let twice = 2.0 * plane.azimuth_deg();
            let images = image(&all, &|phi| wrap_deg(twice - f64::from(phi)) as f32);
            all.extend(images);
        }
        if self.has_half_turn() {
            let images = image(&all, &turned);
            all.extend(images);
        }
        all
    }

    /// How many images a sample has, itself among them, where the azimuth of the sample matters.
    pub fn order(self) -> usize {
        match self {
            Symmetry::None | Symmetry::Turns | Symmetry::Isotropic => 1,
            Symmetry::Bilateral(_) | Symmetry::HalfTurn => 2,
            Symmetry::HalfTurnBilateral(_) => 4,
        }
    }

    /// The plane, where it has one of its own.
    pub fn plane(self) -> Option<MirrorPlane> {
        match self {
            Symmetry::Bilateral(plane) | Symmetry::HalfTurnBilateral(plane) => Some(plane),
            _ => None,
        }
    }

    /// Whether the azimuth of the sample matters, but half a turn does not.
    pub fn has_half_turn(self) -> bool {
        matches!(self, Symmetry::HalfTurn | Symmetry::HalfTurnBilateral(_))
    }

    /// Whether the azimuth of the sample does not matter: three angles are left of four.
    pub fn is_isotropic(self) -> bool {
        matches!(self, Symmetry::Turns | Symmetry::Isotropic)
    }

    /// How many images of a pair are places of their own, turns by any angle aside, itself among them.
    pub(crate) fn image_count(self) -> usize {
        match self {
            Symmetry::None | Symmetry::Turns => 1,
            Symmetry::HalfTurn | Symmetry::Isotropic | Symmetry::Bilateral(_) => 2,
            Symmetry::HalfTurnBilateral(_) => 4,
        }
    }

    /// One of these images; 0 is the pair itself. Each is its own inverse.
    pub(crate) fn image(self, pair: Pair, number: usize) -> Pair {
        let other = |plane: MirrorPlane| plane.reflection().of(&pair);
        match (self, number) {
            (_, 0) | (Symmetry::None | Symmetry::Turns, _) => pair,
            (Symmetry::HalfTurn, _) | (Symmetry::HalfTurnBilateral(_), 1) => turned(pair, HALF),
            (Symmetry::Isotropic, _) => Reflection([1.0, 0.0]).of(&pair),
            (Symmetry::Bilateral(plane), _) | (Symmetry::HalfTurnBilateral(plane), 2) => {
                other(plane)
            }
            (Symmetry::HalfTurnBilateral(plane), _) => turned(other(plane), HALF),
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

/// Cosine and sine of half a turn.
const HALF: [f64; 2] = [-1.0, 0.0];

impl fmt::Display for Symmetry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Symmetry::None => f.write_str("none"),
            Symmetry::HalfTurn => f.write_str("half-turn"),
            Symmetry::Bilateral(plane) => {
                write!(f, "bilateral about azimuth {:.1}", plane.azimuth_deg())
            }
            Symmetry::HalfTurnBilateral(plane) => {
                let azimuth = plane.azimuth_deg();
                write!(f, "half-turn and bilateral about azimuth {azimuth:.1}")
            }
            Symmetry::Turns => f.write_str("isotropic, sides apart"),
            Symmetry::Isotropic => f.write_str("isotropic"),
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::Direction;
    use crate::interpolate::Coordinates;

    #[test]
    fn images_of_samples_are_those_of_their_pairs() {
        let plane = MirrorPlane::at_deg(205.0);
        assert_eq!(plane.azimuth_deg(), 25.0);
        let sample = Sample::new(
            Direction::from_deg(40.0, 10.0),
            Direction::from_deg(60.0, 350.0),
            [1.0; 3],
        );
        let coordinates = Coordinates::sum_difference(1.0);
        let pair = |s: &Sample| {
            let direction =
                |theta: f32, phi: f32| Direction::from_deg(theta.into(), phi.into()).to_vec3();
            coordinates.pair(
                direction(s.theta_i_deg, s.phi_i_deg),
                direction(s.theta_v_deg, s.phi_v_deg),
            )
        };
        for symmetry in [
            Symmetry::None,
            Symmetry::HalfTurn,
            Symmetry::Bilateral(plane),
            Symmetry::HalfTurnBilateral(plane),
        ] {
            let completed = symmetry.completed(vec![sample]);
            let images: Vec<Pair> = (0..symmetry.image_count())
                .map(|k| symmetry.image(pair(&sample), k))
                .collect();
            assert_eq!(
                (completed.len(), images.len()),
                (symmetry.order(), symmetry.order())
            );
            for s in &completed {
                let near =
                    |image: &Pair| image.iter().zip(pair(s)).all(|(a, b)| (a - b).abs() < 1e-6);
                assert!(images.iter().any(near), "{symmetry}: {s:?}");
            }
        }
        assert_eq!(
            Symmetry::Bilateral(plane).completed(vec![sample])[1].phi_i_deg,
            40.0
        );
    }
}
