//! Whether a rig could exist.

use crate::bench_setup::check_bench;
use crate::rig_error::within;
use crate::{CameraGeometry, LightGeometry, Reference, Rig, RigError, Sampling, Sensor, Target};

/// Checks that a rig could exist, whoever made it.
///
/// # Errors
/// The first value that is not possible, in the order of the file.
pub fn check_rig(rig: &Rig) -> Result<(), RigError> {
    within("light.distance_m", rig.light.distance_m, 0.01..=1000.0, "m")?;
    check_camera(&rig.camera)?;
    check_target(&rig.target)?;
    if let Some(Reference::Reflectance(reflectance)) = &rig.reference {
        for rho in *reflectance {
            within("reference.reflectance", rho, f64::MIN_POSITIVE..=1.0, "")?;
        }
    }
    if let Some(sensor) = &rig.sensor {
        check_sensor(sensor)?;
    }
    check_sampling(&rig.sampling, &rig.target, &rig.light, &rig.camera)?;
    check_bench(
        rig.arms.as_ref(),
        rig.source.as_ref(),
        rig.session.as_ref(),
        rig.sensor.as_ref(),
    )
}

fn check_camera(camera: &CameraGeometry) -> Result<(), RigError> {
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
    Ok(())
}

fn check_target(target: &Target) -> Result<(), RigError> {
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
    Ok(())
}

fn check_sampling(
    sampling: &Sampling,
    target: &Target,
    light: &LightGeometry,
    camera: &CameraGeometry,
) -> Result<(), RigError> {
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
    Ok(())
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
