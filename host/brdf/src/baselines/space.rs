//! In which space the distance of two pairs of directions is taken.

use crate::direction::{Direction, Vec3};
use crate::interpolate::Coordinates;
use std::f64::consts::TAU;

/// A place in a space of up to six dimensions; unused ones are zero.
pub type Place = [f64; 6];

/// A space of pairs of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Space {
    /// (θi, φi, θv, φv) in radians. Azimuths close around 2π; at the poles they mean nothing.
    Angles,
    /// The two unit vectors: straight chords through the sphere. The paper's "distance of
    /// illumination and view directions".
    Chords,
    /// One of the systems of the default method.
    Symmetric(Coordinates),
}

/// How far across φ = 0 neighbours are seen, radians. Places this near to it are repeated on the other
/// side.
const SEAM: f64 = TAU / 4.0;

impl Space {
    /// The place of a pair of unit vectors.
    pub fn place(&self, light: Vec3, view: Vec3) -> Place {
        match self {
            Space::Angles => {
                let (i, v) = (Direction::from_vec3(light), Direction::from_vec3(view));
                [i.theta, i.phi, v.theta, v.phi, 0.0, 0.0]
            }
            Space::Chords => [light[0], light[1], light[2], view[0], view[1], view[2]],
            Space::Symmetric(coordinates) => coordinates.point(light, view).map(f64::from),
        }
    }

    /// A place moved by whole turns of the two azimuths.
    pub(super) fn turned(&self, place: Place, turns: [i8; 2]) -> Place {
        let mut turned = place;
        turned[1] += f64::from(turns[0]) * TAU;
        turned[3] += f64::from(turns[1]) * TAU;
        turned
    }

    /// The turns by which a place is to be repeated, none among them.
    pub(super) fn turns(&self, place: &Place) -> Vec<[i8; 2]> {
        if *self != Space::Angles {
            return vec![[0, 0]];
        }
        let of = |phi: f64| {
            if phi < SEAM {
                vec![0, 1]
            } else if phi > TAU - SEAM {
                vec![0, -1]
            } else {
                vec![0]
            }
        };
        let (light, view) = (of(place[1]), of(place[3]));
        light
            .iter()
            .flat_map(|i| view.iter().map(move |v| [*i, *v]))
            .collect()
    }
}

impl std::fmt::Display for Space {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Space::Angles => f.write_str("angles"),
            Space::Chords => f.write_str("chords"),
            Space::Symmetric(Coordinates { exponent, weight }) => {
                let name = if *exponent == 0.0 { "half" } else { "sum" };
                write!(f, "{name}={weight}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_near_azimuth_zero_are_repeated_on_the_other_side() {
        let place = |phi_i, phi_v| {
            Space::Angles.place(
                Direction::from_deg(30.0, phi_i).to_vec3(),
                Direction::from_deg(40.0, phi_v).to_vec3(),
            )
        };
        let seam = place(359.0, 1.0);
        let turns = Space::Angles.turns(&seam);
        assert_eq!(turns, [[0, 0], [0, 1], [-1, 0], [-1, 1]]);
        let moved = Space::Angles.turned(seam, [-1, 1]);
        assert!((moved[1].to_degrees() + 1.0).abs() < 1e-9);
        assert!((moved[3].to_degrees() - 361.0).abs() < 1e-9);
        assert_eq!(Space::Angles.turns(&place(180.0, 100.0)), [[0, 0]]);
        assert_eq!(Space::Chords.turns(&seam), [[0, 0]]);
    }
}
