//! What comes of a pose: where both arms were at its trigger pulses, or why it was given up.

use crate::capture::arms::Latched;
use gonia_brdf::Pose;
use gonia_brdf::direction::Direction;

/// A shot that is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Its pose's place in the list.
    pub index: usize,
    /// Where the arms were by encoder at the last pulse.
    pub encoder: Pose,
    /// The largest |commanded − encoder| of all axes and pulses, degrees.
    pub pointing_error_deg: f64,
    /// How often it had to be taken again.
    pub retakes: u32,
    /// When each pulse rose, by the clock of the controller that gave it, µs.
    pub pulse_times_us: Vec<u64>,
}

/// What came of a pose.
#[derive(Clone, Debug, PartialEq)]
pub enum ShotOutcome {
    /// Within the pointing limit, by encoder.
    Kept(Shot),
    /// Given up.
    Refused {
        /// Its pose's place in the list.
        index: usize,
        /// Why, in words for people.
        reason: String,
    },
}

/// The shot of a pose whose targets were `targets_udeg`, by what was captured at each pulse.
pub(super) fn shot_of(
    index: usize,
    retakes: u32,
    targets_udeg: [[i32; 2]; 2],
    pulses: &[Latched],
) -> Shot {
    let mut worst_udeg = 0;
    for pulse in pulses {
        for (target, encoder) in targets_udeg
            .as_flattened()
            .iter()
            .zip(pulse.encoder_udeg.as_flattened())
        {
            worst_udeg = worst_udeg.max(target.abs_diff(*encoder));
        }
    }
    let last = pulses
        .last()
        .map_or(targets_udeg, |pulse| pulse.encoder_udeg);
    let direction = |[theta, phi]: [i32; 2]| {
        Direction::from_deg(f64::from(theta) * 1e-6, f64::from(phi) * 1e-6)
    };
    Shot {
        index,
        encoder: Pose {
            light: direction(last[0]),
            view: direction(last[1]),
        },
        pointing_error_deg: f64::from(worst_udeg) * 1e-6,
        retakes,
        pulse_times_us: pulses.iter().map(|pulse| pulse.time_us).collect(),
    }
}
