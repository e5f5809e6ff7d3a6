//! Pictures of a BRDF in linear light: a sphere and a draped cylinder under directional lights.
//!
//! Camera space: x right, y up, z towards the viewer, who is far away (parallel projection). There
//! are no cast shadows and no inter-reflections; what is seen is f · E · cos θi.

mod bent;
mod cylinder;
mod environment;
mod light;
mod picture;
mod sphere;

pub use bent::bent;
pub use cylinder::cylinder;
pub use environment::Environment;
pub use light::{Light, from_above, single, studio};
pub use picture::Picture;
pub use sphere::sphere;

use gonia_brdf::Brdf;
use gonia_brdf::direction::{Vec3, dot};

/// Towards the viewer.
const VIEW: Vec3 = [0.0, 0.0, 1.0];
/// Cosines below this are too near the horizon for a table that ends at 86°.
const LEAST_COSINE: f64 = 1e-3;

/// A point of a surface: its frame in camera space.
struct Frame {
    /// Along the material's x axis.
    tangent: Vec3,
    /// Along its y axis.
    bitangent: Vec3,
    normal: Vec3,
}

impl Frame {
    fn to_local(&self, v: Vec3) -> Vec3 {
        [
            dot(self.tangent, v),
            dot(self.bitangent, v),
            dot(self.normal, v),
        ]
    }

    /// The radiance towards the viewer.
    fn shade(&self, brdf: &dyn Brdf, lights: &[Light]) -> [f64; 3] {
        let view = self.to_local(VIEW);
        if view[2] < LEAST_COSINE {
            return [0.0; 3];
        }
        let local: Vec<(Vec3, [f64; 3])> = lights
            .iter()
            .map(|light| (self.to_local(light.towards), light.irradiance))
            .filter(|(towards, _)| towards[2] > LEAST_COSINE)
            .map(|(towards, irradiance)| (towards, irradiance.map(|e| e * towards[2])))
            .collect();
        brdf.radiance(&local, view)
    }
}
