//! `rig.toml`: reading, checking and writing a [`Rig`].

use crate::reflectance_csv::read_reflectance;
use crate::{FileError, toml_text, write_whole_bytes};
use gonia_rig::{Reflectance, Rig, check_rig};
use std::path::Path;

const REMEDY: &str = "docs/src/reference/files/rig.md has the keys and their units";

/// Reads a rig and checks that it could exist.
///
/// # Errors
/// One line naming the file and the line or key: unreadable, not TOML, an unknown, missing or
/// mistyped key, or a value that no rig has (a distance of zero, a sample larger than its fiducial lines, a
/// reflectance above 1.1).
pub fn read_rig(path: &Path) -> Result<Rig, FileError> {
    let mut rig: Rig = toml_text::read(path, REMEDY)?;
    let reflectance = rig.reference.as_mut().map(|of| &mut of.reflectance);
    if let Some(Reflectance::Table { file, table }) = reflectance {
        *table = read_reflectance(&path.with_file_name(&*file))?;
    }
    check_rig(&rig).map_err(|wrong| {
        FileError::new(path, wrong.problem, wrong.remedy).at(format_args!("key {}", wrong.key))
    })?;
    Ok(rig)
}

/// Writes a rig whole.
///
/// # Errors
/// When the file cannot be written.
pub fn write_rig(path: &Path, rig: &Rig) -> Result<(), FileError> {
    let text = toml::to_string(rig)
        .map_err(|error| FileError::new(path, error, "check the rig's values"))?;
    write_whole_bytes(path, text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_rig::{Bayer, Reference, ReflectanceTable, Sensor, Source};

    fn read_text(text: &str) -> Result<Rig, FileError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rig.toml");
        std::fs::write(&path, text).unwrap();
        read_rig(&path)
    }

    fn paper_text() -> String {
        toml::to_string(&Rig::paper(1024)).unwrap()
    }

    #[test]
    fn a_rig_comes_back_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rig.toml");
        let mut rig = Rig::paper(400);
        rig.camera.k1 = -0.02;
        rig.reference = Some(Reference::lambertian([0.99, 0.98, 1.0]));
        rig.sensor = Some(Sensor {
            black_counts: 64.0,
            saturation_counts: 4000.0,
            gain_e_per_count: 2.5,
            read_noise_e: 4.0,
            bayer: Some(Bayer::Grbg),
        });
        write_rig(&path, &rig).unwrap();
        assert_eq!(read_rig(&path).unwrap(), rig);
    }

    #[test]
    fn the_documented_rig_is_the_papers() {
        let page = include_str!("../../../docs/src/reference/files/rig.md");
        let (_, rest) = page.split_once("```toml\n").unwrap();
        let (text, _) = rest.split_once("```").unwrap();
        let mut paper = Rig::paper(1024);
        paper.reference = Some(Reference::lambertian([0.99; 3]));
        assert_eq!(read_text(text).unwrap(), paper);
    }

    #[test]
    fn a_genicam_camera_is_read_with_its_defaults_and_not_without_an_address() {
        let text = |address: &str| {
            format!(
                "{}\n[sensor]\nblack_counts = 64\nsaturation_counts = 4000\ngain_e_per_count = 2\nread_noise_e = 4\n[source]\nkind = \"genicam\"\naddress = \"{address}\"\npixel_format = \"Mono12\"\n",
                paper_text()
            )
        };
        let rig = read_text(&text("10.0.0.7")).unwrap();
        let Some(Source::Genicam(camera)) = &rig.source else {
            panic!("{:?}", rig.source);
        };
        assert_eq!(
            (camera.trigger_source.as_str(), camera.timeout_s),
            ("Line1", 10.0)
        );
        let error = read_text(&text("")).unwrap_err().to_string();
        assert!(
            error.contains("key source.address") && error.contains("give its IPv4 address"),
            "{error}"
        );
        assert!(!error.contains('\n'));
        let unknown = text("10.0.0.7") + "discover = true\n";
        assert!(read_text(&unknown).is_err());
    }

    #[test]
    fn a_reference_has_a_reflectance_or_a_table_beside_the_rig() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rig.toml");
        let read = |keys: &str| {
            std::fs::write(&path, format!("{}\n[reference]\n{keys}\n", paper_text())).unwrap();
            read_rig(&path)
        };
        let error = read("table = \"white.csv\"").unwrap_err().to_string();
        assert!(error.contains("white.csv: cannot be read"), "{error}");
        std::fs::write(dir.path().join("white.csv"), "theta_i,r,g,b\n8,1,0.9,1\n").unwrap();
        let rig = read("table = \"white.csv\"").unwrap();
        let expected = Reference::from(Reflectance::Table {
            file: "white.csv".into(),
            table: ReflectanceTable::ByIncidence(vec![(8.0, [1.0, 0.9, 1.0])]),
        });
        assert_eq!(rig.reference, Some(expected));
        write_rig(&path, &rig).unwrap();
        assert_eq!(read_rig(&path).unwrap(), rig);
        for keys in ["", "table = \"white.csv\"\nreflectance = [1.0, 1.0, 1.0]"] {
            let error = read(keys).unwrap_err().to_string();
            assert!(error.contains("either reflectance or table"), "{error}");
        }
    }

    #[test]
    fn unknown_missing_and_mistyped_keys_name_their_line() {
        let unknown = paper_text().replace("focal_px", "focal_mm");
        let error = read_text(&unknown).unwrap_err().to_string();
        assert!(
            error.contains("line 8") && error.contains("focal_mm"),
            "{error}"
        );

        let mistyped = paper_text().replace("width_px = 1024", "width_px = \"wide\"");
        let error = read_text(&mistyped).unwrap_err().to_string();
        assert!(
            error.contains("line 6") && error.contains("string"),
            "{error}"
        );

        let missing = paper_text().replace("distance_m = 1.1\n", "");
        let error = read_text(&missing).unwrap_err().to_string();
        assert!(
            error.contains("line 1") && error.contains("distance_m"),
            "{error}"
        );
        for text in [unknown, mistyped, missing] {
            assert_eq!(read_text(&text).unwrap_err().to_string().lines().count(), 1);
        }
    }

    #[test]
    fn values_that_no_rig_has_name_their_key() {
        for (from, to, key) in [
            ("distance_m = 1.1", "distance_m = 0.0", "light.distance_m"),
            ("distance_m = 1.8", "distance_m = -1.8", "camera.distance_m"),
            ("distance_m = 1.8", "distance_m = nan", "camera.distance_m"),
            ("width_px = 1024", "width_px = 0", "camera.width_px"),
            ("focal_px = 1600.0", "focal_px = inf", "camera.focal_px"),
            (
                "material_half_mm = 320.0",
                "material_half_mm = 334.0",
                "target.material_half_mm",
            ),
            (
                "disc_radius_mm = 277.0",
                "disc_radius_mm = 330.0",
                "sampling.disc_radius_mm",
            ),
            ("grid_mm = 14.0", "grid_mm = 0.0", "sampling.grid_mm"),
            (
                "distance_m = 1.1",
                "distance_m = 0.2",
                "sampling.disc_radius_mm",
            ),
            (
                "[sampling]",
                "[sensor]\nblack_counts = 4095\nsaturation_counts = 64\ngain_e_per_count = 2\nread_noise_e = 3\n[sampling]",
                "sensor.saturation_counts",
            ),
        ] {
            let text = paper_text();
            assert!(text.contains(from), "{from}");
            let error = read_text(&text.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(&format!("key {key}:")), "{to}: {error}");
        }
        for rho in ["0.0", "1.11", "-0.5", "nan"] {
            let text = format!(
                "{}\n[reference]\nreflectance = [0.9, {rho}, 0.9]\n",
                paper_text()
            );
            let error = read_text(&text).unwrap_err().to_string();
            assert!(error.contains("key reference.reflectance:"), "{error}");
        }
        // Words that name the key and what to give.
        let text = format!("{}\n[reference]\nreflectance = \"white\"\n", paper_text());
        let error = read_text(&text).unwrap_err().to_string();
        assert!(error.contains("reflectance: give one number"), "{error}");
    }

    #[test]
    fn one_reflectance_is_that_of_all_channels() {
        let with = |rho: &str| format!("{}\n[reference]\nreflectance = {rho}\n", paper_text());
        assert_eq!(
            read_text(&with("0.98")).unwrap().reference,
            read_text(&with("[0.98, 0.98, 0.98]")).unwrap().reference
        );
    }
}
