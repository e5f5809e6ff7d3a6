//! Whether a rig could exist.

use crate::bench_setup::{Source, check_bench};
use crate::rig_error::within;
use crate::uncertainty::check_uncertainties;
use crate::{
    ArmGeometry, Calibration, CameraGeometry, CameraModel, LightGeometry, Reflectance, Remark, Rig,
    RigError, Sampling, Sensor, Target,
};
use gonia_brdf::Elementary;

/// A lens whose inverse is off by more than this at a corner of the frame, pixels, has none.
const MAX_FOLD_PX: f64 = 0.5;

/// Checks that a rig could exist, whoever made it.
///
/// # Errors
/// The first value that is not possible, in the order of the file.
pub fn check_rig(rig: &Rig) -> Result<(), RigError> {
    within("light.distance_m", rig.light.distance_m, 0.01..=1000.0, "m")?;
    check_arm("light.arm", &rig.light.arm)?;
    for beam in rig.light.beam {
        within("light.beam", beam, -100.0..=100.0, "")?;
    }
    check_camera(&rig.camera)?;
    check_arm("camera.arm", &rig.camera.arm)?;
    check_lens(rig)?;
    // What a calibration finds of a simulated rig is no lens that is to be drawn.
    if rig.calibration.is_none() {
        check_simulated(&rig.camera, rig.source.as_ref())?;
    }
    check_target(&rig.target)?;
    if let Some(Reflectance::Lambertian(reflectance)) = reflectance_of(rig) {
        for rho in *reflectance {
            check_reflectance(rho)?;
        }
    }
    let stated = rig.uncertainty.unwrap_or_default();
    check_uncertainties(rig.reference.as_ref(), &stated)?;
    if let Some(sensor) = &rig.sensor {
        check_sensor(sensor)?;
    }
    check_sampling(&rig.sampling, &rig.target, &rig.light, &rig.camera)?;
    if let Some(fault) = rig.calibration.as_ref().and_then(Calibration::fault) {
        return Err(RigError::new(
            "calibration",
            fault,
            "calibrate the rig again, or remove the table",
        ));
    }
    check_bench(
        rig.arms.as_ref(),
        rig.source.as_ref(),
        rig.session.as_ref(),
        rig.sensor.as_ref(),
    )
}

fn reflectance_of(rig: &Rig) -> Option<&Reflectance> {
    rig.reference.as_ref().map(|of| &of.reflectance)
}

/// Most that a reference reflects of the light, a channel: real tiles, whose factor is against an ideal
/// diffuser, come out a little above 1 in one.
const REFLECTANCE_MAX: f64 = 1.1;

fn check_reflectance(rho: f64) -> Result<(), RigError> {
    let key = "reference.reflectance";
    // White standards reflect more than half: their percentages are not mistaken for anything else.
    if (50.0..=100.0 * REFLECTANCE_MAX).contains(&rho) {
        let problem = format!("{rho} is not possible: it may be a percentage");
        return Err(RigError::new(key, problem, "give a share: 99 % is 0.99"));
    }
    within(key, rho, f64::MIN_POSITIVE..=REFLECTANCE_MAX, "")
}

/// What is to be said of a rig that was read from `file` and may be used all the same.
pub fn rig_remarks(file: impl std::fmt::Display, rig: &Rig) -> Vec<Remark> {
    let Some(Reflectance::Lambertian(reflectance)) = reflectance_of(rig) else {
        return Vec::new();
    };
    let above = reflectance.iter().copied().filter(|rho| *rho > 1.0);
    above
        .reduce(f64::max)
        .map(|most| {
            Remark::new(
                format_args!("{file}, key reference.reflectance"),
                format_args!(
                    "{most} is more than an ideal diffuser reflects, and is used as it is"
                ),
                "check it against the reference's certificate",
            )
        })
        .into_iter()
        .collect()
}

/// What is to be said of a reference whose certificate has run out by a day, written as `2027-03-31`.
pub fn remark_on_certificate(
    file: impl std::fmt::Display,
    rig: &Rig,
    today: &str,
) -> Option<Remark> {
    let certificate = &rig.reference.as_ref()?.certificate;
    let until = certificate.valid_until.as_deref()?;
    // Days that are written so stand in the order of their letters.
    (until < today).then(|| {
        let named = certificate.certificate.as_deref();
        Remark::new(
            format_args!("{file}, key reference.valid_until"),
            format_args!(
                "the reference was to be relied on until {until}{}, and today is {today}",
                named.map_or(String::new(), |name| format!(" ({name})"))
            ),
            "have it calibrated again, or give it a larger u",
        )
    })
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
    if let Some(focal) = camera.focal_y_px {
        let x = camera.focal_px;
        // Pixels of half or twice the width; beyond that one of the two is a slip.
        within("camera.focal_y_px", focal, 0.5 * x..=2.0 * x, "px")?;
    }
    for (key, value) in [
        ("camera.k1", camera.k1),
        ("camera.k2", camera.k2),
        ("camera.k3", camera.k3),
    ] {
        within(key, value, -10.0..=10.0, "")?;
    }
    for (key, value) in [("camera.p1", camera.p1), ("camera.p2", camera.p2)] {
        within(key, value, -1.0..=1.0, "")?;
    }
    let aim_mm = 500.0 * camera.distance_m;
    within(
        "camera.mount.roll_deg",
        camera.mount.roll_deg,
        -360.0..=360.0,
        "degrees",
    )?;
    for aim in camera.mount.aim_mm {
        within("camera.mount.aim_mm", aim, -aim_mm..=aim_mm, "mm")?;
    }
    Ok(())
}

/// An arm that is further from an ideal one than this is another machine, or a slip of the pen.
fn check_arm(key: &'static str, arm: &ArmGeometry) -> Result<(), RigError> {
    within(key, arm.theta_zero_deg, -90.0..=90.0, "degrees")?;
    within(key, arm.phi_zero_deg, -360.0..=360.0, "degrees")?;
    within(key, arm.axis_square_deg, -20.0..=20.0, "degrees")?;
    within(key, arm.axis_miss_mm, -1e3..=1e3, "mm")?;
    within(key, arm.right_mm, -1e3..=1e3, "mm")
}

/// The simulated camera draws two radial terms and square pixels: with others its frames would be of
/// another lens than the rig's.
fn check_simulated(camera: &CameraGeometry, source: Option<&Source>) -> Result<(), RigError> {
    let others = [camera.k3, camera.p1, camera.p2];
    let is_plain = others == [0.0; 3] && camera.focal_y_px.is_none_or(|f| f == camera.focal_px);
    match source {
        Some(Source::Simulated { .. }) if !is_plain => Err(RigError::new(
            "source.kind",
            "the simulated camera has no focal_y_px, k3, p1 or p2".into(),
            "leave them out of [camera], or give frames of this camera",
        )),
        _ => Ok(()),
    }
}

/// Checks that the lens has an inverse over the frame: terms of another order, or of another program's
/// model, fold its corners inwards.
fn check_lens(rig: &Rig) -> Result<(), RigError> {
    let (camera, model) = (&rig.camera, CameraModel::new(rig));
    let (width, height) = (camera.width_px as f64, camera.height_px as f64);
    for corner in [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]] {
        let back = model.distort(model.undistort(corner));
        let off = (back[0] - corner[0]).hypotenuse(back[1] - corner[1]);
        if off.is_nan() || off > MAX_FOLD_PX {
            return Err(RigError::new(
                "camera.k1",
                format!(
                    "the lens terms have no inverse at the corner ({}, {}) of the frame",
                    corner[0], corner[1]
                ),
                "give k1, k2, p1, p2, k3 as OpenCV's calibration does, in units of the focal length",
            ));
        }
    }
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
    if let Some(height) = target.mirror_height_mm {
        within("target.mirror_height_mm", height, -100.0..=100.0, "mm")?;
    }
    let place = &target.place;
    within("target.place.height_mm", place.height_mm, -1e3..=1e3, "mm")?;
    for tilt in place.tilt_deg {
        within("target.place.tilt_deg", tilt, -45.0..=45.0, "degrees")?;
    }
    for by in place.offset_mm {
        within("target.place.offset_mm", by, -1e3..=1e3, "mm")?;
    }
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
    check_mark(target)
}

/// Checks that an orientation mark is a disc by itself, on the desk.
fn check_mark(target: &Target) -> Result<(), RigError> {
    let (at, radius) = match (target.mark_mm, target.mark_radius_mm) {
        (None, None) => return Ok(()),
        (Some(at), Some(radius)) => (at, radius),
        (Some(_), None) | (None, Some(_)) => {
            let (key, other) = match target.mark_mm {
                Some(_) => ("target.mark_radius_mm", "target.mark_mm"),
                None => ("target.mark_mm", "target.mark_radius_mm"),
            };
            let problem = format!("is missing, and {other} is there");
            return Err(RigError::new(key, problem, "give both, or neither"));
        }
    };
    let offset = target.line_offset_mm;
    within("target.mark_radius_mm", radius, 0.001..=0.25 * offset, "mm")?;
    for along in at {
        within("target.mark_mm", along, -3.0 * offset..=3.0 * offset, "mm")?;
    }
    let furthest = at[0].abs().max(at[1].abs());
    let wrong = if furthest - radius < target.material_half_mm {
        "lies on the sample"
    } else if (at.iter()).any(|c| (c.abs() - offset).abs() < radius + 0.5 * target.line_width_mm) {
        "touches a fiducial line"
    } else {
        return Ok(());
    };
    Err(RigError::new(
        "target.mark_mm",
        format!(
            "a mark of {radius} mm radius at [{}, {}] {wrong}",
            at[0], at[1]
        ),
        "put it on the desk beside a line, with desk all round it",
    ))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Reference;

    fn rig_of(reflectance: [f64; 3]) -> Rig {
        Rig {
            reference: Some(Reference::lambertian(reflectance)),
            ..Rig::paper(400)
        }
    }

    #[test]
    fn a_reflectance_a_little_above_one_is_used_and_said() {
        for (reflectance, remarks) in [([0.99; 3], 0), ([1.0; 3], 0), ([0.99, 1.02, 1.1], 1)] {
            let rig = rig_of(reflectance);
            assert_eq!(check_rig(&rig), Ok(()));
            assert_eq!(rig_remarks("rig.toml", &rig).len(), remarks);
        }
        let said = rig_remarks("rig.toml", &rig_of([0.99, 1.02, 1.0]))[0].to_string();
        assert!(
            said.starts_with("rig.toml, key reference.reflectance: 1.02 is more"),
            "{said}"
        );
    }

    #[test]
    fn a_certificate_that_has_run_out_is_said() {
        let mut rig = rig_of([0.99; 3]);
        let said = |rig: &Rig, today| remark_on_certificate("rig.toml", rig, today);
        assert_eq!(said(&rig, "2027-04-01"), None);
        if let Some(reference) = &mut rig.reference {
            reference.certificate.valid_until = Some("2027-03-31".into());
            reference.certificate.certificate = Some("PTB 12345".into());
        }
        assert_eq!(said(&rig, "2027-03-31"), None);
        let remark = said(&rig, "2027-04-01").map(|remark| remark.to_string());
        let remark = remark.unwrap_or_default();
        assert!(remark.contains("until 2027-03-31 (PTB 12345)"), "{remark}");
    }

    #[test]
    fn what_is_no_reflectance_is_refused_and_a_percentage_is_called_one() {
        for wrong in [0.0, -0.5, 1.11, 30.0, f64::NAN] {
            let error = check_rig(&rig_of([0.9, 0.9, wrong])).unwrap_err();
            assert!(error.remedy.contains("at most 1.1"), "{error}");
        }
        let error = check_rig(&rig_of([98.5, 99.0, 99.0])).unwrap_err();
        assert!(error.problem.contains("percentage"), "{error}");
    }

    fn wrong(change: impl FnOnce(&mut Rig)) -> Option<&'static str> {
        let mut rig = Rig::paper(400);
        change(&mut rig);
        check_rig(&rig).err().map(|error| error.key)
    }

    #[test]
    fn lenses_without_an_inverse_and_pixels_that_are_hardly_square_are_refused() {
        assert_eq!(wrong(|_| {}), None);
        // A wide lens as OpenCV gives it; a telephoto with large terms at small radii.
        assert_eq!(
            wrong(|rig| {
                let camera = &mut rig.camera;
                (camera.focal_px, camera.focal_y_px) = (300.0, Some(299.0));
                (camera.k1, camera.k2, camera.k3) = (-0.29, 0.105, -0.02);
                (camera.p1, camera.p2) = (0.001, -0.0005);
            }),
            None
        );
        assert_eq!(
            wrong(|rig| (rig.camera.k1, rig.camera.k2) = (-0.4, 9.0)),
            None
        );
        // In pixels instead of focal lengths; a term too many.
        assert_eq!(
            wrong(|rig| (rig.camera.focal_px, rig.camera.k1) = (200.0, -2.0)),
            Some("camera.k1")
        );
        assert_eq!(
            wrong(|rig| rig.camera.focal_y_px = Some(6.0)),
            Some("camera.focal_y_px")
        );
        assert_eq!(wrong(|rig| rig.camera.p1 = 3.0), Some("camera.p1"));
    }

    #[test]
    fn a_mirror_lies_within_some_centimetres_of_the_sample() {
        let height = |mm| wrong(|rig| rig.target.mirror_height_mm = Some(mm));
        assert_eq!(height(-3.0), None);
        for mm in [1000.0, f64::NAN] {
            assert_eq!(height(mm), Some("target.mirror_height_mm"));
        }
    }

    #[test]
    fn an_orientation_mark_is_a_disc_on_the_desk() {
        let mark = |at: Option<[f64; 2]>, radius: Option<f64>| {
            wrong(|rig| (rig.target.mark_mm, rig.target.mark_radius_mm) = (at, radius))
        };
        assert_eq!(mark(Some([365.0, 120.0]), Some(12.0)), None);
        // Between sample and line; in a corner, outside of both lines.
        assert_eq!(mark(Some([0.0, 326.5]), Some(3.0)), None);
        assert_eq!(mark(Some([-370.0, -370.0]), Some(12.0)), None);
        assert_eq!(
            mark(Some([365.0, 120.0]), None),
            Some("target.mark_radius_mm")
        );
        assert_eq!(mark(None, Some(12.0)), Some("target.mark_mm"));
        for at in [
            [0.0, 0.0],
            [310.0, 0.0],
            [335.0, 50.0],
            [345.0, 50.0],
            [370.0, 330.0],
            [2000.0, 0.0],
            [f64::NAN, 365.0],
        ] {
            assert_eq!(mark(Some(at), Some(12.0)), Some("target.mark_mm"), "{at:?}");
        }
        for radius in [0.0, -3.0, 200.0, f64::NAN] {
            assert_eq!(
                mark(Some([365.0, 120.0]), Some(radius)),
                Some("target.mark_radius_mm")
            );
        }
    }

    #[test]
    fn the_simulated_camera_has_two_radial_terms() {
        let simulated = Some(Source::Simulated {
            seed: 1,
            exact: false,
        });
        let with = |change: fn(&mut Rig)| {
            wrong(|rig| {
                rig.source.clone_from(&simulated);
                change(rig);
            })
        };
        assert_eq!(with(|rig| rig.camera.k1 = -0.1), None);
        assert_eq!(
            with(|rig| rig.camera.focal_y_px = Some(rig.camera.focal_px)),
            None
        );
        assert_eq!(with(|rig| rig.camera.p2 = 0.001), Some("source.kind"));
        assert_eq!(with(|rig| rig.camera.k3 = 0.1), Some("source.kind"));
    }
}
