//! UTIA `.bin`: the table's values at the nodes of [`crate::utia`], 64-bit floats.

use super::{ExportFormat, ExportSettings, Holds, How, Meaning};
use crate::utia::{N_PHI, PHI_STEP_DEG, SIDE, THETA_STEP_DEG, read};
use crate::{FileError, write_whole};
use gonia_brdf::Direction;
use gonia_rig::{DenseFile, Remark};
use std::io::Write;
use std::path::Path;

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "utia",
    title: "UTIA .bin",
    ending: "bin",
    readers: "UTIA's tools, `gonia import`; they disagree on the scale of values",
    means: Meaning::Absolute,
    holds: Holds::Colours,
    angles: "every 15° up to 75°, every 7.5° in azimuth",
    provenance: None,
    is_folder: false,
    resolution: None,
    step_deg: |_| THETA_STEP_DEG,
    how: How::Brdf { write, read },
};

fn write(path: &Path, file: &DenseFile, _: &ExportSettings) -> Result<Vec<Remark>, FileError> {
    let node = |k: usize| {
        let (theta, phi) = (k / N_PHI, k % N_PHI);
        Direction::from_deg(theta as f64 * THETA_STEP_DEG, phi as f64 * PHI_STEP_DEG)
    };
    write_whole(path, |out| {
        for c in 0..3 {
            for cell in 0..SIDE * SIDE {
                let value = file.brdf.lookup(node(cell / SIDE), node(cell % SIDE))[c];
                out.write_all(&f64::from(value).to_le_bytes())?;
            }
        }
        Ok(())
    })?;
    Ok(Vec::new())
}

#[cfg(test)]
mod tests {
    use super::super::lopsided::{Lopsided, file, settings};
    use super::*;
    use gonia_brdf::Brdf;

    #[test]
    fn every_node_has_the_tables_value() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bin");
        write(&path, &file(&Lopsided, 7.5), &settings(0, false)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        // By the format's description: plane, row = light, column = view, 48 azimuths of a polar angle.
        let (words, _) = bytes.as_chunks::<8>();
        let at = |c: usize, i: [usize; 2], v: [usize; 2]| {
            f64::from_le_bytes(words[c * 288 * 288 + (48 * i[0] + i[1]) * 288 + 48 * v[0] + v[1]])
        };
        for (i, v) in [([2, 5], [4, 40]), ([5, 47], [1, 0]), ([3, 30], [5, 13])] {
            let d = |[t, p]: [usize; 2]| Direction::from_deg(15.0 * t as f64, 7.5 * p as f64);
            let wanted = Lopsided.eval(d(i).to_vec3(), d(v).to_vec3());
            for (c, wanted) in wanted.iter().enumerate() {
                assert!((at(c, i, v) / wanted - 1.0).abs() < 1e-6);
            }
            let found = read(&path).unwrap().eval(d(i).to_vec3(), d(v).to_vec3());
            assert!((found[1] / wanted[1] - 1.0).abs() < 1e-6);
        }
        assert_eq!(bytes.len(), 1_990_656);
    }
}
