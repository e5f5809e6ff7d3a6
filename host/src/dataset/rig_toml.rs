//! `rig.toml`: reading, checking and writing a [`Rig`].

use super::bench_setup::check_bench;
use super::reflectance_csv::read_reflectance;
use super::rig::{Reference, Rig, Sensor};
use super::whole_file::write_whole_bytes;
use super::{FileError, toml_text};
use std::ops::RangeInclusive;
use std::path::Path;

const REMEDY: &str = "docs/frames.md has the keys and their units";

/// Reads a rig and checks that it could exist.
///
/// # Errors
/// One line naming the file and the line or key: unreadable, not TOML, an unknown, missing or
/// mistyped key, or a value that no rig has (a distance of zero, a sample larger than its marks, a
/// reflectance above one).
pub fn read_rig(path: &Path) -> Result<Rig, FileError> {
    let mut rig: Rig = toml_text::read(path, REMEDY)?;
    if let Some(Reference::Table { file, table }) = &mut rig.reference {
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

/// A value that no rig has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {problem}; {remedy}")]
pub struct RigError {
    /// The key in `rig.toml`, with its table.
    pub key: &'static str,
    /// What is wrong with its value.
    pub problem: String,
    /// What to do.
    pub remedy: String,
}

/// Checks that a rig could exist, whoever made it.
///
/// # Errors
/// The first value that is not possible, in the order of the file.
pub fn check_rig(rig: &Rig) -> Result<(), RigError> {
    let Rig {
        light,
        camera,
        target,
        reference,
        sensor,
        sampling,
        arms,
        source,
        session,
    } = rig;
    within("light.distance_m", light.distance_m, 0.01..=1000.0, "m")?;
    within("camera.distance_m", camera.distance_m, 0.01..=1000.0, "m")?;
    let sides = 16.0..=65_536.0;
    within(
        "camera.width_px",
        camera.width_px as f64,
        sides.clone(),
        "px",
    )?;
    within("camera.height_px", camera.height_px as f64, sides, "px")?;
    within("camera.focal_px", camera.focal_px, 1.0..=1e6, "px")?;
    for (centre, side) in camera
        .centre_px
        .into_iter()
        .zip([camera.width_px, camera.height_px])
    {
        // A shifted lens can put the principal point outside of the frame, but not far.
        let side = side as f64;
        within("camera.centre_px", centre, -side..=2.0 * side, "px")?;
    }
    within("camera.k1", camera.k1, -10.0..=10.0, "")?;
    within("camera.k2", camera.k2, -10.0..=10.0, "")?;

    within(
        "target.line_offset_mm",
        target.line_offset_mm,
        0.1..=1e5,
        "mm",
    )?;
    let offset = target.line_offset_mm;
    within(
        "target.line_width_mm",
        target.line_width_mm,
        0.001..=offset,
        "mm",
    )?;
    within(
        "target.material_half_mm",
        target.material_half_mm,
        0.1..=1e5,
        "mm",
    )?;
    let inner_edge = offset - 0.5 * target.line_width_mm;
    if target.material_half_mm > inner_edge {
        return Err(RigError {
            key: "target.material_half_mm",
            problem: format!(
                "the sample ({} mm) reaches beyond the inner edge of the lines ({inner_edge} mm)",
                target.material_half_mm
            ),
            remedy: "measure both from the centre of the target".into(),
        });
    }

    if let Some(Reference::Reflectance(reflectance)) = reference {
        for rho in *reflectance {
            within("reference.reflectance", rho, f64::MIN_POSITIVE..=1.0, "")?;
        }
    }

    if let Some(sensor) = sensor {
        check_sensor(sensor)?;
    }

    within(
        "sampling.disc_radius_mm",
        sampling.disc_radius_mm,
        0.1..=1e5,
        "mm",
    )?;
    let diameter = 2.0 * sampling.disc_radius_mm;
    // At most four million points a frame.
    within(
        "sampling.grid_mm",
        sampling.grid_mm,
        diameter / 2000.0..=diameter,
        "mm",
    )?;
    within(
        "sampling.patch_mm",
        sampling.patch_mm,
        0.001..=diameter,
        "mm",
    )?;
    if sampling.disc_radius_mm > target.material_half_mm {
        return Err(RigError {
            key: "sampling.disc_radius_mm",
            problem: format!(
                "the disc ({} mm) reaches beyond the sample ({} mm)",
                sampling.disc_radius_mm, target.material_half_mm
            ),
            remedy: "make it at most target.material_half_mm".into(),
        });
    }
    let arms_mm = 1000.0 * light.distance_m.min(camera.distance_m);
    if sampling.disc_radius_mm >= arms_mm {
        return Err(RigError {
            key: "sampling.disc_radius_mm",
            problem: format!(
                "the disc ({} mm) is wider than the shorter arm ({arms_mm} mm)",
                sampling.disc_radius_mm
            ),
            remedy: "check the units: distances of the arms are in metres".into(),
        });
    }
    check_bench(
        arms.as_ref(),
        source.as_ref(),
        session.as_ref(),
        sensor.as_ref(),
    )
}

fn check_sensor(sensor: &Sensor) -> Result<(), RigError> {
    let counts = f64::from(u16::MAX);
    within(
        "sensor.black_counts",
        sensor.black_counts,
        0.0..=counts,
        "counts",
    )?;
    within(
        "sensor.saturation_counts",
        sensor.saturation_counts,
        f64::MIN_POSITIVE..=counts,
        "counts",
    )?;
    within(
        "sensor.gain_e_per_count",
        sensor.gain_e_per_count,
        1e-6..=1e6,
        "electrons a count",
    )?;
    within(
        "sensor.read_noise_e",
        sensor.read_noise_e,
        0.0..=1e6,
        "electrons",
    )?;
    if sensor.black_counts < sensor.saturation_counts {
        return Ok(());
    }
    Err(RigError {
        key: "sensor.saturation_counts",
        problem: format!(
            "saturation ({} counts) does not lie above black ({} counts)",
            sensor.saturation_counts, sensor.black_counts
        ),
        remedy: "give the counts of a frame without light, and those the sensor ends at".into(),
    })
}

fn within(
    key: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    unit: &str,
) -> Result<(), RigError> {
    // Written so that a NaN is outside of every range.
    if range.contains(&value) {
        return Ok(());
    }
    let (least, most) = (range.start(), range.end());
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    let remedy = if *least == f64::MIN_POSITIVE {
        format!("give more than 0 and at most {most}{unit}")
    } else {
        format!("give a value from {least} to {most}{unit}")
    };
    Err(RigError {
        key,
        problem: format!("{value}{unit} is not possible"),
        remedy,
    })
}

#[cfg(test)]
mod tests {
    use super::super::bench_setup::Source;
    use super::super::rig::{Bayer, ReflectanceTable};
    use super::*;

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
        rig.reference = Some(Reference::Reflectance([0.99, 0.98, 1.0]));
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
        let page = include_str!("../../../docs/frames.md");
        let (_, rest) = page.split_once("```toml\n").unwrap();
        let (text, _) = rest.split_once("```").unwrap();
        let mut paper = Rig::paper(1024);
        paper.reference = Some(Reference::Reflectance([0.99; 3]));
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
        let expected = Reference::Table {
            file: "white.csv".into(),
            table: ReflectanceTable::ByIncidence(vec![(8.0, [1.0, 0.9, 1.0])]),
        };
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
        for rho in ["0.0", "1.01", "-0.5", "nan"] {
            let text = format!(
                "{}\n[reference]\nreflectance = [0.9, {rho}, 0.9]\n",
                paper_text()
            );
            let error = read_text(&text).unwrap_err().to_string();
            assert!(error.contains("key reference.reflectance:"), "{error}");
        }
    }
}
