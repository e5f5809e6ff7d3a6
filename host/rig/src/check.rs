//! Whether a rig could exist.

use crate::bench_setup::check_bench;
use crate::{Reference, Rig, Sensor};
use std::ops::RangeInclusive;

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
