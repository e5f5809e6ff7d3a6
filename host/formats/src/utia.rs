//! Anisotropic BRDFs of the UTIA database (Filip and Vávra 2014), `.bin`.
//!
//! Three planes R, G, B of floats over light and view alike: θ = 0, 15 … 75°, φ = 0, 7.5 … 352.5°.
//! In a plane the light is the row (48·iθ + iφ), the view the column. Floats are of 64 bits; files of
//! 32 bits, known by their size, are read too.

use crate::FileError;
use crate::format::{Content, ForeignBrdf, ForeignContent, ForeignFormat, Format, Gaps};
use crate::read_at::read_of_length;
use gonia_brdf::direction::Vec3;
use gonia_brdf::{Brdf, Direction};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

const N_THETA: usize = 6;
pub(crate) const N_PHI: usize = 48;
pub(crate) const THETA_STEP_DEG: f64 = 15.0;
pub(crate) const PHI_STEP_DEG: f64 = 7.5;
pub(crate) const SIDE: usize = N_THETA * N_PHI;
const COUNT: usize = 3 * SIDE * SIDE;

/// The database's format. Public readers disagree on the scale of its values.
pub(super) static FORMAT: Format = Format {
    name: "UTIA",
    endings: &["bin"],
    magic: &[],
    content: Content::Foreign(ForeignFormat {
        name: "UTIA .bin",
        content: ForeignContent::Brdf { scale: None, read },
    }),
};

/// A material of the database, linear between its nodes; beyond 75° it keeps the last ring's value.
struct Utia {
    values: Vec<f64>,
    /// Values below 0.
    negative: u64,
    /// Evaluations with a channel that came out below 0.
    clipped: AtomicU64,
}

/// Reads a file.
///
/// # Errors
/// One line naming it: of another size, or without a value above 0.
pub(crate) fn read(path: &Path) -> Result<Box<dyn ForeignBrdf>, FileError> {
    Ok(Box::new(read_utia(path)?))
}

fn read_utia(path: &Path) -> Result<Utia, FileError> {
    let remedy = "a UTIA .bin of 15° and 7.5° steps holds 1,990,656 bytes (or 995,328)";
    let bytes = read_of_length(path, &[8 * COUNT, 4 * COUNT], remedy)?;
    let values: Vec<f64> = if bytes.len() == 8 * COUNT {
        let (words, _) = bytes.as_chunks::<8>();
        words.iter().map(|w| f64::from_le_bytes(*w)).collect()
    } else {
        let (words, _) = bytes.as_chunks::<4>();
        let value = |w: &[u8; 4]| f64::from(f32::from_le_bytes(*w));
        words.iter().map(value).collect()
    };
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        return Err(FileError::new(
            path,
            format_args!("value {at} is not finite"),
            "copy the file again",
        ));
    }
    if values.iter().all(|value| *value <= 0.0) {
        return Err(FileError::new(
            path,
            "holds no value above 0",
            "check that it is a UTIA .bin (little-endian)",
        ));
    }
    Ok(Utia {
        negative: values.iter().filter(|value| **value < 0.0).count() as u64,
        values,
        clipped: AtomicU64::new(0),
    })
}

/// The four nodes around a direction, with their weights.
fn corners(d: Direction) -> [(usize, f64); 4] {
    let t = (d.theta_deg() / THETA_STEP_DEG).clamp(0.0, (N_THETA - 1) as f64);
    let p = d.phi_deg().rem_euclid(360.0) / PHI_STEP_DEG;
    let (t0, p0) = (t as usize, p as usize % N_PHI);
    let (t1, p1) = ((t0 + 1).min(N_THETA - 1), (p0 + 1) % N_PHI);
    let (ft, fp) = (t - t.floor(), p - p.floor());
    [
        (t0 * N_PHI + p0, (1.0 - ft) * (1.0 - fp)),
        (t0 * N_PHI + p1, (1.0 - ft) * fp),
        (t1 * N_PHI + p0, ft * (1.0 - fp)),
        (t1 * N_PHI + p1, ft * fp),
    ]
}

impl Brdf for Utia {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let views = corners(Direction::from_vec3(view));
        for (i, wi) in corners(Direction::from_vec3(light)) {
            for (v, wv) in views {
                for c in 0..3 {
                    sum[c] += wi * wv * self.values[c * SIDE * SIDE + i * SIDE + v];
                }
            }
        }
        if sum.iter().any(|v| *v < 0.0) {
            self.clipped.fetch_add(1, Ordering::Relaxed);
        }
        sum.map(|v| v.max(0.0))
    }
}

impl ForeignBrdf for Utia {
    fn last_deg(&self) -> f64 {
        (N_THETA - 1) as f64 * THETA_STEP_DEG
    }

    fn gaps(&self) -> Option<Gaps> {
        (self.negative > 0).then(|| Gaps {
            missing: self.negative,
            of: COUNT as u64,
            instead: "negative; 0 where the interpolated value is below it",
            evaluations: self.clipped.load(Ordering::Relaxed),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_have_their_values_and_both_widths_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.bin");
        let at = |t, p| Direction::from_deg(t, p).to_vec3();
        let double: Vec<u8> = (0..COUNT).flat_map(|k| (k as f64).to_le_bytes()).collect();
        let single: Vec<u8> = (0..COUNT).flat_map(|k| (k as f32).to_le_bytes()).collect();
        for bytes in [double, single] {
            std::fs::write(&path, &bytes).unwrap();
            let utia = read_utia(&path).unwrap();
            let found = utia.eval(at(30.0, 15.0), at(75.0, 352.5));
            let cell = (2 * 48 + 2) * SIDE + 5 * 48 + 47;
            for c in 0..3 {
                assert!((found[c] - (cell + c * SIDE * SIDE) as f64).abs() < 0.1);
            }
            assert_eq!(
                utia.eval(at(30.0, 15.0), at(86.0, 352.5))[0].round(),
                found[0].round()
            );
        }
        std::fs::write(&path, "short").unwrap();
        assert!(read_utia(&path).unwrap_err_text().contains("holds 5 bytes"));
        std::fs::write(&path, vec![0; 4 * COUNT]).unwrap();
        assert!(
            read_utia(&path)
                .unwrap_err_text()
                .contains("no value above 0")
        );
    }

    #[test]
    fn negative_values_are_counted() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.bin");
        let at = |t, p| Direction::from_deg(t, p).to_vec3();
        let value = |k: usize| if k == 0 { -1.0f32 } else { 0.5 };
        let bytes: Vec<u8> = (0..COUNT).flat_map(|k| value(k).to_le_bytes()).collect();
        std::fs::write(&path, &bytes).unwrap();
        let utia = read_utia(&path).unwrap();
        assert_eq!(utia.eval(at(0.0, 0.0), at(0.0, 0.0)), [0.0, 0.5, 0.5]);
        utia.eval(at(30.0, 0.0), at(0.0, 0.0));
        let gaps = utia.gaps().unwrap();
        assert_eq!((gaps.missing, gaps.evaluations), (1, 1));
    }

    trait ErrorText {
        fn unwrap_err_text(self) -> String;
    }
    impl ErrorText for Result<Utia, FileError> {
        fn unwrap_err_text(self) -> String {
            self.err().unwrap().to_string()
        }
    }
}
