//! Anisotropic measurements of Ngan, Durand and Matusik (2005), `.dat`.
//!
//! Sixteen integers of 32 bits, then floats of 32 bits, all little-endian. Integers 0 to 3: how many
//! bins there are in θi, θv, φv − φi and φi; 6: the parameterisation (1); 7: the binning (0, even); 9:
//! whether φv − φi runs to 180° (1) or 360° (0); 10: channels (3). A channel is a plane in which φi
//! runs fastest and θi slowest; θ runs to 90°, φi to 360°. A bin without a measurement is negative.
//! Known from the authors' description as it stands in BRDF Explorer, and from the order in which
//! that program reads the values; no file was at hand.

use crate::FileError;
use crate::format::{Content, ForeignContent, ForeignFormat, Format};
use gonia_brdf::Sample;
use gonia_brdf::direction::wrap_deg;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

const HEADER_BYTES: usize = 64;
/// More bins along an axis than this is no measurement.
const MOST_BINS: i32 = 10_000;

/// The authors' format.
pub(super) static FORMAT: Format = Format {
    name: "Ngan, Durand, Matusik",
    endings: &["dat"],
    magic: &[],
    content: Content::Foreign(ForeignFormat {
        name: "Ngan, Durand and Matusik .dat",
        content: ForeignContent::Samples {
            scale: None,
            read: read_ngan,
        },
    }),
};

/// The numbers of bins, and how far φv − φi runs.
struct Layout {
    bins: [usize; 4],
    between_max_deg: f64,
}

/// Reads the bins that hold a measurement, each as a sample at its middle.
fn read_ngan(path: &Path) -> Result<Vec<Sample>, FileError> {
    let failed = |error| FileError::reading(path, &error);
    let mut file = File::open(path).map_err(failed)?;
    let mut header = [0; HEADER_BYTES];
    let length = file.metadata().map_err(failed)?.len();
    if file.read_exact(&mut header).is_err() {
        return Err(FileError::new(
            path,
            format_args!("holds {length} bytes"),
            "give a .dat of Ngan, Durand and Matusik, which begins with 16 integers",
        ));
    }
    let Layout {
        bins,
        between_max_deg,
    } = layout(&header).ok_or_else(|| {
        FileError::new(
            path,
            "does not begin with the header of an anisotropic measurement",
            "give a .dat of Ngan, Durand and Matusik (standard parameterisation, even bins, RGB)",
        )
    })?;
    let [n_light, n_view, n_between, n_azimuth] = bins;
    let n: usize = bins.iter().product();
    let expected = (HEADER_BYTES + 3 * 4 * n) as u64;
    if length != expected {
        return Err(FileError::new(
            path,
            format_args!(
                "holds {length} bytes, but {n_light} × {n_view} × {n_between} × {n_azimuth} bins need {expected}"
            ),
            "copy the file again",
        ));
    }
    let mut planes = Vec::with_capacity(3);
    for channel in 0..3 {
        let mut plane = File::open(path).map_err(failed)?;
        let start = (HEADER_BYTES + 4 * n * channel) as u64;
        plane.seek(SeekFrom::Start(start)).map_err(failed)?;
        planes.push(BufReader::with_capacity(1 << 18, plane));
    }
    let middle = |k: usize, n: usize, range: f64| (k as f64 + 0.5) * range / n as f64;
    let mut samples = Vec::new();
    for bin in 0..n {
        let mut rgb = [0.0; 3];
        for (value, plane) in rgb.iter_mut().zip(&mut planes) {
            let mut four = [0; 4];
            plane.read_exact(&mut four).map_err(failed)?;
            *value = f32::from_le_bytes(four);
        }
        // Not finite is no measurement either.
        if !rgb.iter().all(|v| v.is_finite() && *v >= 0.0) {
            continue;
        }
        let (rest, azimuth) = (bin / n_azimuth, bin % n_azimuth);
        let (rest, between) = (rest / n_between, rest % n_between);
        let (light, view) = (rest / n_view, rest % n_view);
        let phi_i = middle(azimuth, n_azimuth, 360.0);
        let phi_v = wrap_deg(phi_i + middle(between, n_between, between_max_deg));
        samples.push(Sample {
            theta_i_deg: middle(light, n_light, 90.0) as f32,
            phi_i_deg: phi_i as f32,
            theta_v_deg: middle(view, n_view, 90.0) as f32,
            phi_v_deg: phi_v as f32,
            rgb,
            frame: Sample::NO_FRAME,
        });
    }
    if samples.is_empty() {
        return Err(FileError::new(
            path,
            "holds no measurement: every bin is negative",
            "copy the file again",
        ));
    }
    Ok(samples)
}

fn layout(header: &[u8; HEADER_BYTES]) -> Option<Layout> {
    let (words, _) = header.as_chunks::<4>();
    let number = |k: usize| i32::from_le_bytes(words[k]);
    let are_sound = (0..4).all(|k| (1..=MOST_BINS).contains(&number(k)));
    let is_standard = (number(6), number(7), number(10)) == (1, 0, 3);
    let between_max_deg = match number(9) {
        0 => 360.0,
        1 => 180.0,
        _ => return None,
    };
    (are_sound && is_standard).then(|| Layout {
        bins: [0, 1, 2, 3].map(|k| number(k) as usize),
        between_max_deg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 × 2 × 4 × 6 bins, of which one holds a measurement.
    fn file(half: i32, bin: [usize; 4]) -> Vec<u8> {
        let mut header = [0i32; 16];
        header[..4].copy_from_slice(&[3, 2, 4, 6]);
        (header[6], header[9], header[10]) = (1, half, 3);
        let n = 3 * 2 * 4 * 6;
        let at = bin[3] + 6 * (bin[2] + 4 * (bin[1] + 2 * bin[0]));
        let mut values = vec![-1f32; 3 * n];
        for c in 0..3 {
            values[c * n + at] = 0.5 + c as f32;
        }
        let words = header.iter().flat_map(|v| v.to_le_bytes());
        words
            .chain(values.iter().flat_map(|v| v.to_le_bytes()))
            .collect()
    }

    #[test]
    fn a_measured_bin_is_a_sample_at_its_middle() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.dat");
        // The fourth of four bins of φv − φi lies at 315° or 157.5° from the light at 330°.
        for (half, phi_v) in [(0, 285.0), (1, 127.5)] {
            std::fs::write(&path, file(half, [2, 1, 3, 5])).unwrap();
            let samples = read_ngan(&path).unwrap();
            assert_eq!(samples.len(), 1);
            let s = samples[0];
            assert_eq!((s.theta_i_deg, s.theta_v_deg), (75.0, 67.5));
            assert_eq!((s.phi_i_deg, s.phi_v_deg), (330.0, phi_v));
            assert_eq!(s.rgb, [0.5, 1.5, 2.5]);
        }
    }

    #[test]
    fn what_is_no_such_file_is_refused_in_a_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.dat");
        let good = file(0, [0; 4]);
        let mut other = good.clone();
        other[4 * 6] = 0;
        let mut empty = good.clone();
        for byte in &mut empty[64..] {
            *byte = 0xff;
        }
        for (bytes, said) in [
            (&good[..5], "holds 5 bytes; give a .dat"),
            (&other[..], "does not begin with the header"),
            (&good[..good.len() - 4], "3 × 2 × 4 × 6 bins need 1792"),
            (&empty[..], "holds no measurement"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = read_ngan(&path).unwrap_err().to_string();
            assert!(
                error.contains(said) && error.lines().count() == 1,
                "{error}"
            );
        }
    }
}
