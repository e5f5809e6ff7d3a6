//! Isotropic BRDFs of the MERL database (Matusik et al. 2003), `.binary`.
//!
//! Three 32-bit integers 90, 90, 180, then three planes R, G, B of 64-bit floats, little-endian, over
//! θh (uneven: its index grows with its square root), θd and φd (0 ..= π, the rest by reciprocity).
//! Values are scaled by 1/1500, 1.15/1500 and 1.66/1500; negative ones were not measured. Most of those
//! lie where light or view would be below the surface, some at grazing angles: they are interpolated
//! from their neighbours in the table, ring by ring, and counted where they are used.

use crate::FileError;
use crate::format::{Content, ForeignBrdf, ForeignContent, ForeignFormat, Format, Gaps};
use crate::read_at::read_of_length;
use gonia_brdf::Brdf;
use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot, normalize};
use gonia_rig::Scale;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

pub(crate) const N_HALF: usize = 90;
pub(crate) const N_DIFF: usize = 90;
pub(crate) const N_PHI: usize = 180;
pub(crate) const PLANE: usize = N_HALF * N_DIFF * N_PHI;
pub(crate) const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// The database's format.
pub(super) static FORMAT: Format = Format {
    name: "MERL",
    endings: &["binary"],
    magic: &[90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0],
    content: Content::Foreign(ForeignFormat {
        name: "MERL .binary",
        content: ForeignContent::Brdf {
            scale: Some(Scale::Absolute),
            read,
        },
    }),
};

/// A material of the database, 1/sr.
struct Merl {
    values: Vec<f64>,
    /// Whether a place of the table was measured.
    measured: Vec<bool>,
    /// Evaluations at a place that was not.
    interpolated: AtomicU64,
}

/// Reads a file.
///
/// # Errors
/// One line naming it: of another size, or without a measurement.
pub(crate) fn read(path: &Path) -> Result<Box<dyn ForeignBrdf>, FileError> {
    Ok(Box::new(read_merl(path)?))
}

fn read_merl(path: &Path) -> Result<Merl, FileError> {
    let remedy = "a MERL .binary begins with 90, 90, 180 and holds 34,992,012 bytes";
    let bytes = read_of_length(path, &[12 + 24 * PLANE], remedy)?;
    let (header, rest) = bytes.split_at(12);
    let (sizes, _) = header.as_chunks::<4>();
    let sizes: Vec<i32> = sizes.iter().map(|b| i32::from_le_bytes(*b)).collect();
    if sizes != [N_HALF as i32, N_DIFF as i32, N_PHI as i32] {
        return Err(FileError::new(
            path,
            format_args!("begins with {sizes:?}"),
            remedy,
        ));
    }
    let (words, _) = rest.as_chunks::<8>();
    let mut values: Vec<f64> = words.iter().map(|w| f64::from_le_bytes(*w)).collect();
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        return Err(FileError::new(
            path,
            format_args!("value {at} is {}", values[at]),
            "copy the file again",
        ));
    }
    let is_measured = |at: usize| (0..3).all(|c| values[c * PLANE + at] >= 0.0);
    let measured: Vec<bool> = (0..PLANE).map(is_measured).collect();
    if !measured.contains(&true) {
        return Err(FileError::new(
            path,
            "holds no measurement: every value is negative",
            "copy the file again",
        ));
    }
    interpolate(&mut values, &measured);
    Ok(Merl {
        values,
        measured,
        interpolated: AtomicU64::new(0),
    })
}

/// Gives every place that was not measured the mean of its neighbours that have a value, those next to
/// measured ones first.
fn interpolate(values: &mut [f64], measured: &[bool]) {
    let mut has_value = measured.to_vec();
    let mut without: Vec<usize> = (0..PLANE).filter(|at| !measured[*at]).collect();
    while !without.is_empty() {
        let mut found = Vec::new();
        for at in &without {
            let near: Vec<usize> = neighbours(*at).filter(|near| has_value[*near]).collect();
            if !near.is_empty() {
                let mean = |c: usize| {
                    let sum: f64 = near.iter().map(|near| values[c * PLANE + near]).sum();
                    sum / near.len() as f64
                };
                found.push((*at, [0, 1, 2].map(mean)));
            }
        }
        for (at, rgb) in &found {
            has_value[*at] = true;
            for c in 0..3 {
                values[c * PLANE + at] = rgb[c];
            }
        }
        // One place has a value from the beginning, and the table is connected.
        without.retain(|at| !has_value[*at]);
    }
}

/// The places next to one: φd goes round, by reciprocity.
fn neighbours(at: usize) -> impl Iterator<Item = usize> {
    let (half, diff, phi) = (at / (N_DIFF * N_PHI), at / N_PHI % N_DIFF, at % N_PHI);
    let place = |half: usize, diff: usize, phi: usize| phi + N_PHI * (diff + N_DIFF * half);
    [
        Some(place(half, diff, (phi + 1) % N_PHI)),
        Some(place(half, diff, (phi + N_PHI - 1) % N_PHI)),
        (half + 1 < N_HALF).then(|| place(half + 1, diff, phi)),
        half.checked_sub(1).map(|half| place(half, diff, phi)),
        (diff + 1 < N_DIFF).then(|| place(half, diff + 1, phi)),
        diff.checked_sub(1).map(|diff| place(half, diff, phi)),
    ]
    .into_iter()
    .flatten()
}

impl ForeignBrdf for Merl {
    fn gaps(&self) -> Option<Gaps> {
        let missing = self.measured.iter().filter(|is| !**is).count() as u64;
        (missing > 0).then(|| Gaps {
            missing,
            of: PLANE as u64,
            instead: "not measured; interpolated from their neighbours",
            evaluations: self.interpolated.load(Ordering::Relaxed),
        })
    }
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
        if !self.measured[at] {
            self.interpolated.fetch_add(1, Ordering::Relaxed);
        }
        [0, 1, 2].map(|c| self.values[c * PLANE + at] * SCALE[c])
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

    #[test]
    fn what_was_not_measured_is_interpolated_from_its_neighbours_and_counted() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.binary");
        let at = |t, p| Direction::from_deg(t, p).to_vec3();
        // Light and view together at 22.6°: a place of θh 45, θd 0; and all that it borders on but one.
        let here = N_PHI * N_DIFF * 45;
        let write = |is_hole: &dyn Fn(usize) -> bool| {
            let header = [90i32, 90, 180].map(i32::to_le_bytes);
            let mut bytes = header.as_flattened().to_vec();
            for _ in 0..3 {
                for k in 0..PLANE {
                    let value = if is_hole(k / N_PHI) {
                        -1.0
                    } else {
                        1500.0 * (2 + k / N_PHI) as f64
                    };
                    bytes.extend(value.to_le_bytes());
                }
            }
            std::fs::write(&path, &bytes).unwrap();
        };
        write(&|ring| ring == here / N_PHI);
        let merl = read_merl(&path).unwrap();
        let found = merl.eval(at(22.6, 70.0), at(22.6, 70.0))[0];
        let ring = (here / N_PHI) as f64;
        // The mean of θh one less, one more and θd one more.
        let mean = ((2.0 + ring - 90.0) + (2.0 + ring + 90.0) + (3.0 + ring)) / 3.0;
        assert!((found - mean).abs() < 1e-6, "{found} {mean}");
        merl.eval(at(10.0, 70.0), at(40.0, 70.0));
        let gaps = merl.gaps().unwrap();
        assert_eq!(
            (gaps.missing, gaps.of, gaps.evaluations),
            (180, PLANE as u64, 1)
        );
        write(&|_| true);
        let error = read_merl(&path).err().unwrap().to_string();
        assert!(error.contains("holds no measurement"), "{error}");
    }
}
