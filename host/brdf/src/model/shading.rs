//! Many points of a surface under the same directional lights, seen by one viewer: what pictures
//! are made of.

use super::Brdf;
use crate::direction::{Vec3, dot};
use rayon::prelude::*;

/// Cosines below this are too near the horizon for a table that ends at 86°.
pub const LEAST_COSINE: f64 = 1e-3;

/// How the material lies at a point of a surface: three unit vectors at right angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentFrame {
    /// Along the material's x axis.
    pub tangent: Vec3,
    /// Along its y axis.
    pub bitangent: Vec3,
    /// Its normal.
    pub normal: Vec3,
}

impl TangentFrame {
    /// A vector in the material's own axes.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        [
            dot(self.tangent, v),
            dot(self.bitangent, v),
            dot(self.normal, v),
        ]
    }
}

/// A light at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector towards it.
    pub towards: Vec3,
    /// Irradiance it gives a surface that faces it, per channel. π makes a white Lambertian one.
    pub irradiance: [f64; 3],
}

/// The radiance of each point, one evaluation a light; what [`Brdf::shade`] is held to.
pub fn shade_one_by_one<B: Brdf + ?Sized>(
    brdf: &B,
    points: &[TangentFrame],
    lights: &[Light],
    viewer: Vec3,
) -> Vec<[f32; 3]> {
    let radiance = |point: &TangentFrame| {
        let mut sum = [0.0; 3];
        let view = point.to_local(viewer);
        if view[2] < LEAST_COSINE {
            return [0.0; 3];
        }
        for light in lights {
            let towards = point.to_local(light.towards);
            if towards[2] > LEAST_COSINE {
                let f = brdf.eval(towards, view);
                for c in 0..3 {
                    sum[c] += f[c] * light.irradiance[c] * towards[2];
                }
            }
        }
        sum.map(|v| v as f32)
    };
    points.par_iter().map(radiance).collect()
}
