//! Isotropic BRDFs of the MERL database (Matusik et al. 2003), `.binary`.
//!
//! Three 32-bit integers 90, 90, 180, then three planes R, G, B of 64-bit floats, little-endian, over
//! θh (uneven: its index grows with its square root), θd and φd (0 ..= π, the rest by reciprocity).
//! Values are scaled by 1/1500, 1.15/1500 and 1.66/1500; negative ones were not measured.

use crate::FileError;
use crate::format::{Content, ForeignContent, ForeignFormat, Format};
use gonia_brdf::Brdf;
use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot, normalize};
use gonia_rig::Scale;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

const N_HALF: usize = 90;
const N_DIFF: usize = 90;
const N_PHI: usize = 180;
const PLANE: usize = N_HALF * N_DIFF * N_PHI;
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// The database's format.
pub(super) static FORMAT: Format = Format {
    name: "MERL",
    endings: &["binary"],
    magic: &[90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0],
    content: Content::Foreign(ForeignFormat {
        name: "MERL .binary",
        content: ForeignContent::Brdf {
            scale: Scale::Absolute,
            read: |path| Ok(Box::new(read_merl(path)?)),
        },
    }),
};

/// A material of the database, 1/sr.
struct Merl {
    values: Vec<f64>,
}

fn read_merl(path: &Path) -> Result<Merl, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    let (header, rest) = bytes.split_at(bytes.len().min(12));
    let (sizes, _) = header.as_chunks::<4>();
    let sizes: Vec<i32> = sizes.iter().map(|b| i32::from_le_bytes(*b)).collect();
    if sizes != [N_HALF as i32, N_DIFF as i32, N_PHI as i32] || rest.len() != 24 * PLANE {
        return Err(FileError::new(
            path,
            format_args!("holds {} bytes, begun with {sizes:?}", bytes.len()),
            "a MERL .binary begins with 90, 90, 180 and holds 34,992,012 bytes",
        ));
    }
    let (words, _) = rest.as_chunks::<8>();
    Ok(Merl {
        values: words.iter().map(|w| f64::from_le_bytes(*w)).collect(),
    })
}

impl Brdf for Merl {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let h = normalize([light[0] + view[0], light[1] + view[1], light[2] + view[2]]);
        let theta_h = h[2].clamp(-1.0, 1.0).arc_cosine();
        let theta_d = dot(light, h).clamp(-1.0, 1.0).arc_cosine();
        // The light in the frame of the half vector: x along the normal's fall.
        let in_plane = h[0].hypotenuse(h[1]).max(1e-12);
        let (cos_phi, sin_phi) = (h[0] / in_plane, h[1] / in_plane);
        let turned = [
            light[0] * cos_phi + light[1] * sin_phi,
            light[1] * cos_phi - light[0] * sin_phi,
        ];
        let (sin_h, cos_h) = theta_h.sine_cosine();
        let phi_d = turned[1].arc_tangent2(turned[0] * cos_h - light[2] * sin_h);
        let phi_d = if phi_d < 0.0 { phi_d + PI } else { phi_d };
        let index = |value: f64, n: usize| (value as usize).min(n - 1);
        let half = index(
            (theta_h / FRAC_PI_2).max(0.0).sqrt() * N_HALF as f64,
            N_HALF,
        );
        let diff = index(theta_d / FRAC_PI_2 * N_DIFF as f64, N_DIFF);
        let phi = index(phi_d / PI * N_PHI as f64, N_PHI);
        let at = phi + N_PHI * (diff + N_DIFF * half);
        [0, 1, 2].map(|c| (self.values[c * PLANE + at] * SCALE[c]).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;

    #[test]
    fn a_value_is_found_at_its_half_and_difference_angles() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.binary");
        let mut bytes: Vec<u8> = [90i32, 90, 180]
            .iter()
            .flat_map(|n| n.to_le_bytes())
            .collect();
        for _ in 0..3 {
            for k in 0..PLANE {
                bytes.extend((1500.0 * k as f64).to_le_bytes());
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        let merl = read_merl(&path).unwrap();
        // Mirror at 40.5°: θh = 0, θd = 40.5° is index 40.
        let at = |t, p| Direction::from_deg(t, p).to_vec3();
        let found = merl.eval(at(40.5, 10.0), at(40.5, 190.0));
        assert_eq!((found[0] as usize) / N_PHI, 40);
        // Light and view together at 22.6°: θd = 0, θh index √(22.6/90)·90 = 45.1.
        let found = merl.eval(at(22.6, 70.0), at(22.6, 70.0));
        assert_eq!((found[0] as usize) / (N_PHI * N_DIFF), 45);
        assert!((found[1] / found[0] - 1.15).abs() < 1e-9);
        // Turning both changes nothing, nor does swapping them.
        let (a, b) = (
            merl.eval(at(30.2, 11.0), at(52.7, 95.3)),
            merl.eval(at(52.7, 135.3), at(30.2, 51.0)),
        );
        assert_eq!(a, b);
        std::fs::write(&path, &bytes[..1000]).unwrap();
        assert!(read_merl(&path).is_err());
    }
}
