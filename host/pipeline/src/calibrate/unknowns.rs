//! The numbers of a rig that a calibration may find, and how far off each may be.

use gonia_rig::Rig;

/// One number of a rig.
pub struct Unknown {
    /// Its key in `rig.toml`.
    pub name: &'static str,
    /// Standard deviation of the true value about the rig's, in the key's unit.
    pub prior: fn(&Rig) -> f64,
    /// The number in a rig.
    pub of: fn(&mut Rig) -> &mut f64,
    /// What moves it from the rig's value.
    pub moves: Moves,
}

/// When a number leaves the rig's value.
#[derive(Clone, Copy, Debug)]
pub enum Moves {
    /// As soon as the frames determine it. No rig is built as it was drawn.
    WhenDetermined,
    /// Only when the frames speak for it (Bayes factor above 1), and only where it is larger than this, about
    /// the rig's value: less is what lines and shading are not trusted to. Most lenses and lamps have none.
    WhenNeeded(fn(&Rig) -> f64),
}

use Moves::{WhenDetermined, WhenNeeded};

const fn unknown(
    name: &'static str,
    moves: Moves,
    prior: fn(&Rig) -> f64,
    of: fn(&mut Rig) -> &mut f64,
) -> Unknown {
    Unknown {
        name,
        prior,
        of,
        moves,
    }
}

/// Millimetres in a share of the camera's distance.
fn of_camera(rig: &Rig, share: f64) -> f64 {
    1000.0 * share * rig.camera.distance_m
}

/// A lens term that moves no fiducial line by more than this, pixels, is none: what the model of their
/// brightness leaves is as large where lines are crowded by the material, and repeats from frame to frame.
const LENS_PX: f64 = 0.02;
/// A beam that changes the irradiance at the edge of the material by less than this share is none.
const BEAM: f64 = 1e-3;

/// The coefficient of a lens term that grows with this power of r and moves the end of a fiducial line, where it
/// crosses its neighbour straight from above, by [`LENS_PX`].
fn lens(rig: &Rig, power: i32) -> f64 {
    let r = std::f64::consts::SQRT_2 * 1e-3 * rig.target.line_offset_mm / rig.camera.distance_m;
    LENS_PX / (rig.camera.focal_px * r.powi(power))
}

/// The coefficient of a term of the beam that grows with this power of the tangent.
fn beam(rig: &Rig, power: i32) -> f64 {
    let tangent = 1e-3 * rig.target.material_half_mm / rig.light.distance_m;
    BEAM / tangent.powi(power)
}

/// The number of the target's place among [`CAMERA`]'s; they are its last ones.
pub const TARGET: usize = 5;

/// Camera, its arm and the target: what lines show. Turning the whole target about its normal is the same
/// as other zeros of φ; sliding the camera along its meridian as another zero of θ: neither has a number.
#[rustfmt::skip]
pub const CAMERA: [Unknown; 21] = [
    unknown("camera.focal_px", WhenDetermined, |r| 0.03 * r.camera.focal_px, |r| &mut r.camera.focal_px),
    unknown("camera.centre_px[0]", WhenDetermined, |r| 0.02 * r.camera.width_px as f64, |r| &mut r.camera.centre_px[0]),
    unknown("camera.centre_px[1]", WhenDetermined, |r| 0.02 * r.camera.width_px as f64, |r| &mut r.camera.centre_px[1]),
    unknown("camera.k1", WhenNeeded(|r| lens(r, 3)), |_| 0.1, |r| &mut r.camera.k1),
    unknown("camera.k2", WhenNeeded(|r| lens(r, 5)), |_| 0.2, |r| &mut r.camera.k2),
    unknown("camera.p1", WhenNeeded(|r| lens(r, 2)), |_| 0.005, |r| &mut r.camera.p1),
    unknown("camera.p2", WhenNeeded(|r| lens(r, 2)), |_| 0.005, |r| &mut r.camera.p2),
    unknown("camera.distance_m", WhenDetermined, |r| 0.03 * r.camera.distance_m, |r| &mut r.camera.distance_m),
    unknown("camera.mount.roll_deg", WhenDetermined, |_| 3.0, |r| &mut r.camera.mount.roll_deg),
    unknown("camera.mount.aim_mm[0]", WhenDetermined, |r| of_camera(r, 0.015), |r| &mut r.camera.mount.aim_mm[0]),
    unknown("camera.mount.aim_mm[1]", WhenDetermined, |r| of_camera(r, 0.015), |r| &mut r.camera.mount.aim_mm[1]),
    unknown("camera.arm.theta_zero_deg", WhenDetermined, |_| 1.2, |r| &mut r.camera.arm.theta_zero_deg),
    unknown("camera.arm.phi_zero_deg", WhenDetermined, |_| 1.2, |r| &mut r.camera.arm.phi_zero_deg),
    unknown("camera.arm.axis_miss_mm", WhenDetermined, |r| of_camera(r, 0.003), |r| &mut r.camera.arm.axis_miss_mm),
    unknown("camera.arm.axis_square_deg", WhenDetermined, |_| 0.2, |r| &mut r.camera.arm.axis_square_deg),
    unknown("camera.arm.right_mm", WhenDetermined, |r| of_camera(r, 0.003), |r| &mut r.camera.arm.right_mm),
    unknown("target.place.height_mm", WhenDetermined, |r| of_camera(r, 0.002), |r| &mut r.target.place.height_mm),
    unknown("target.place.tilt_deg[0]", WhenDetermined, |_| 0.3, |r| &mut r.target.place.tilt_deg[0]),
    unknown("target.place.tilt_deg[1]", WhenDetermined, |_| 0.3, |r| &mut r.target.place.tilt_deg[1]),
    unknown("target.place.offset_mm[0]", WhenDetermined, |r| of_camera(r, 0.003), |r| &mut r.target.place.offset_mm[0]),
    unknown("target.place.offset_mm[1]", WhenDetermined, |r| of_camera(r, 0.003), |r| &mut r.target.place.offset_mm[1]),
];

/// The light and its arm: what shading on the reference shows.
#[rustfmt::skip]
pub const LIGHT: [Unknown; 11] = [
    unknown("light.distance_m", WhenDetermined, |r| 0.03 * r.light.distance_m, |r| &mut r.light.distance_m),
    unknown("light.arm.theta_zero_deg", WhenDetermined, |_| 1.2, |r| &mut r.light.arm.theta_zero_deg),
    unknown("light.arm.phi_zero_deg", WhenDetermined, |_| 1.2, |r| &mut r.light.arm.phi_zero_deg),
    unknown("light.arm.axis_miss_mm", WhenDetermined, |r| 3.0 * r.light.distance_m, |r| &mut r.light.arm.axis_miss_mm),
    unknown("light.arm.axis_square_deg", WhenDetermined, |_| 0.2, |r| &mut r.light.arm.axis_square_deg),
    unknown("light.arm.right_mm", WhenDetermined, |r| 10.0 * r.light.distance_m, |r| &mut r.light.arm.right_mm),
    unknown("light.beam[0]", WhenNeeded(|r| beam(r, 1)), |_| 0.3, |r| &mut r.light.beam[0]),
    unknown("light.beam[1]", WhenNeeded(|r| beam(r, 1)), |_| 0.3, |r| &mut r.light.beam[1]),
    unknown("light.beam[2]", WhenNeeded(|r| beam(r, 2)), |_| 3.0, |r| &mut r.light.beam[2]),
    unknown("light.beam[3]", WhenNeeded(|r| beam(r, 2)), |_| 3.0, |r| &mut r.light.beam[3]),
    unknown("light.beam[4]", WhenNeeded(|r| beam(r, 2)), |_| 3.0, |r| &mut r.light.beam[4]),
];

/// The numbers of a rig.
pub fn values(unknowns: &[Unknown], rig: &Rig) -> Vec<f64> {
    let mut rig = rig.clone();
    unknowns.iter().map(|u| *(u.of)(&mut rig)).collect()
}

/// A rig with these numbers.
pub fn with_values(unknowns: &[Unknown], rig: &Rig, values: &[f64]) -> Rig {
    let mut rig = rig.clone();
    // Pixels that are not square stay as little square as they were.
    let aspect = rig.camera.focal_y_px.map(|y| y / rig.camera.focal_px);
    for (unknown, value) in unknowns.iter().zip(values) {
        *(unknown.of)(&mut rig) = *value;
    }
    rig.camera.focal_y_px = aspect.map(|aspect| aspect * rig.camera.focal_px);
    rig
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_the_key_of_its_number() {
        for unknown in CAMERA.iter().chain(&LIGHT) {
            let mut rig = Rig::paper(400);
            *rig.number_mut(unknown.name).unwrap() = 0.125;
            assert_eq!(*(unknown.of)(&mut rig), 0.125, "{}", unknown.name);
        }
    }
}
