//! Zemax `.bsdf` text: values about the specular direction.
//!
//! With e1 towards the light's azimuth and e2 = z × e1, a view is a·e1 + b·e2 + c·z. Turned by θi about e2, so that the
//! specular direction is the pole, a′ = a cos θi + c sin θi and c′ = c cos θi − a sin θi; the radial angle is acos c′,
//! the azimuth that of (a′, b): 0 on the side of the light. A turn of the sample by `SampleRotation` is read as the
//! light's azimuth, as libbsdf does; the format's description does not say which way it turns.

mod read;
mod write;

pub(crate) use read::FORMAT;

use super::{ExportFormat, Holds, How, Meaning, Resolution};
use gonia_brdf::direction::Vec3;
use gonia_brdf::{Direction, Elementary};

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "zemax",
    title: "Zemax .bsdf",
    ending: "bsdf",
    readers: "Zemax OpticStudio; `gonia import`",
    means: Meaning::Absolute,
    holds: Holds::ColoursOrOne,
    angles: "turns of the sample every 15°, incidences every 5° up to 85°; circles about the specular direction",
    provenance: Some("comments at the top"),
    is_folder: false,
    resolution: Some(Resolution {
        default: 36,
        least: 12,
        most: 120,
        of: "azimuths of each circle about the specular direction",
    }),
    step_deg: |azimuths| 360.0 / azimuths.max(1) as f64,
    how: How::Brdf {
        write: write::write,
        read: read::read,
    },
};

/// The view at a radial angle and an azimuth about the specular direction (radians); below the horizon z < 0.
fn view_at(light: Direction, radial: f64, azimuth: f64) -> Vec3 {
    let (sin_r, cos_r) = radial.sine_cosine();
    let (sin_a, cos_a) = azimuth.sine_cosine();
    let (sin_i, cos_i) = light.theta.sine_cosine();
    let (a, b) = (sin_r * cos_a, sin_r * sin_a);
    let (along, up) = (a * cos_i - cos_r * sin_i, a * sin_i + cos_r * cos_i);
    let (sin_p, cos_p) = light.phi.sine_cosine();
    [along * cos_p - b * sin_p, along * sin_p + b * cos_p, up]
}

/// The radial angle and the azimuth of a view, radians, the azimuth from −π to π.
fn about_specular(light: Direction, view: Vec3) -> [f64; 2] {
    let (sin_p, cos_p) = light.phi.sine_cosine();
    let (sin_i, cos_i) = light.theta.sine_cosine();
    let (a, b) = (
        view[0] * cos_p + view[1] * sin_p,
        view[1] * cos_p - view[0] * sin_p,
    );
    let (across, up) = (a * cos_i + view[2] * sin_i, view[2] * cos_i - a * sin_i);
    [
        across.hypotenuse(b).arc_tangent2(up),
        b.arc_tangent2(across),
    ]
}

#[cfg(test)]
mod tests;
