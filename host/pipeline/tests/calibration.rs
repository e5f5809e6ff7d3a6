//! Rigs that are not what their rig.toml says, found from their own frames.
#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_brdf::model::{Kurt, KurtLobe};
use gonia_brdf::random::Random;
use gonia_brdf::{Brdf, Direction, Elementary, Pose};
use gonia_pipeline::calibrate::{LightState, NumberState};
use gonia_pipeline::{CalibrateError, Calibrated, calibrate, silent};
use gonia_rig::{FrameRow, Rig, Role};
use gonia_sim::scene::Beam;
use rendered::{Rendered, Scatter, crooked, errors, errors_at, nominal, random_rows};
use std::sync::Arc;

mod rendered;

fn run(source: &Rendered, px: usize) -> Result<Calibrated, CalibrateError> {
    calibrate(&nominal(px), source, &silent)
}

fn describe(found: &Calibrated, truth: &Rig) -> String {
    let mut text = format!(
        "frames {:?} lines {:?} light {:?} u {:?} arm {:?}\n",
        found.frames, found.lines_px, found.light, found.direction_u, found.camera_arm_deg
    );
    text += &format!("errors {:?}\n", errors(&found.rig, truth));
    for number in &found.numbers {
        text += &format!(
            "{} {} -> {} u {} {:?}\n",
            number.name, number.nominal, number.found, number.u, number.state
        );
    }
    text
}

#[test]
fn a_rig_that_is_off_in_everything_is_found_from_small_frames() {
    let truth = crooked(240, 1.0, 3);
    let source = Rendered::new(&truth, random_rows(Role::Reference, 60, 1), 0.01);
    let found = run(&source, 240).unwrap();
    let said = describe(&found, &truth);
    let [light, view] = errors(&found.rig, &truth);
    assert!(matches!(found.light, LightState::Found { .. }), "{said}");
    assert!(light[1] < 0.03 && view[1] < 0.03, "{said}");
    assert!(found.lines_px[0] > 5.0 && found.lines_px[1] < 0.1, "{said}");
    let record = found.rig.calibration.as_ref().unwrap();
    assert_eq!(record.names.len(), record.covariance.len());
    gonia_rig::check_rig(&found.rig).unwrap();
}

/// A small rig that is off by a little.
fn somewhat_off(seed: u64) -> Rig {
    crooked(160, 0.3, seed)
}

#[test]
fn a_calibrated_rig_is_calibrated_again_to_the_same() {
    // Of smaller frames the prior has its say in what is found, and it lies elsewhere the second time.
    let truth = crooked(240, 0.3, 5);
    let source = Rendered::new(&truth, random_rows(Role::Reference, 30, 2), 0.0);
    let once = run(&source, 240).unwrap();
    let twice = calibrate(&once.rig, &source, &silent).unwrap();
    for (spread, u) in twice.changes.iter().zip(&once.direction_u) {
        assert!(spread.p95 < 2.0 * u.p95, "{spread:?} {u:?}");
    }
    assert!(once.changes[0].p95 > 0.2, "{:?}", once.changes);
}

/// A renderer's frames have no noise, and its arms stand where they read.
#[test]
fn frames_without_noise_show_the_light() {
    for jitter_deg in [0.0, 0.01] {
        let truth = crooked(240, 0.5, 21);
        let scatter = Scatter {
            jitter_deg,
            noise: 0.0,
            beam: false,
            gloss: 0.0,
            seed: 7,
        };
        let rows = random_rows(Role::Reference, 30, 1);
        let found = run(&Rendered::scattered(&truth, rows, &scatter), 240).unwrap();
        let said = describe(&found, &truth);
        let [light, view] = errors(&found.rig, &truth);
        assert!(matches!(found.light, LightState::Found { .. }), "{said}");
        assert!(light[1] < 0.02 && view[1] < 0.01, "{said}");
    }
}

/// At 200 pixels a fiducial line is thinner than a pixel, and the edge of the material beside it as plain as both
/// of its own.
#[test]
fn a_rig_that_is_off_in_everything_by_all_that_is_allowed_is_found_from_frames_of_200_px() {
    let truth = crooked(200, 1.0, 1002);
    let scatter = Scatter {
        jitter_deg: 0.02,
        noise: 0.01,
        beam: false,
        gloss: 0.0,
        seed: 2,
    };
    let rows = random_rows(Role::Reference, 40, 2);
    let found = run(&Rendered::scattered(&truth, rows, &scatter), 200).unwrap();
    let said = describe(&found, &truth);
    let [light, view] = errors(&found.rig, &truth);
    assert_eq!(found.frames, [40, 40], "{said}");
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
    assert!(matches!(found.light, LightState::Found { .. }), "{said}");
    assert!(light[1] < 0.03 && view[1] < 0.015, "{said}");
}

#[test]
fn a_matt_material_of_which_nothing_is_known_shows_the_light() {
    let truth = crooked(160, 0.5, 30);
    let scatter = Scatter {
        jitter_deg: 0.01,
        noise: 0.005,
        beam: false,
        gloss: 0.0,
        seed: 30,
    };
    let rows = random_rows(Role::Material, 50, 30);
    let grey = Arc::new(Kurt::new([0.5; 3], &[]));
    let found = run(&Rendered::of_material(&truth, rows, &scatter, grey), 160).unwrap();
    let said = describe(&found, &truth);
    let off = |rig: &Rig| errors_at(found.poses.iter().copied(), [rig, &truth])[0];
    let (before, light) = (off(&nominal(160)), off(&found.rig));
    let surface = Role::Material;
    let is_found = matches!(found.light, LightState::Found { surface: s, .. } if s == surface);
    assert!(is_found, "{said}");
    assert!(before[0] > 0.5 && light[0] < 0.05, "{before:?} {light:?}");
    let u = found.direction_u[0];
    assert!(
        light[0] < 2.0 * u.p50 && light[1] < 2.0 * u.p95,
        "{light:?} {said}"
    );
}

#[test]
fn where_the_material_does_not_show_the_light_it_stays_and_is_said_to() {
    let truth = somewhat_off(6);
    let source = Rendered::new(&truth, random_rows(Role::Material, 24, 3), 0.0);
    let found = run(&source, 160).unwrap();
    assert!(
        matches!(
            found.light,
            LightState::Unlike { .. } | LightState::NotTold { .. } | LightState::NoReference { .. }
        ),
        "{:?}",
        found.light
    );
    assert_eq!(found.rig.light, nominal(160).light);
    assert!(found.numbers.iter().all(|n| !n.name.starts_with("light")));
    // What is not known is not said to be: the light's direction is as uncertain as its arm's zeros.
    let [light, _] = found.direction_u;
    assert!(light.p50 > 1.2 && light.p50 < 3.0, "{light:?}");
    assert!(
        errors(&found.rig, &truth)[1][1] < 0.1,
        "{}",
        describe(&found, &truth)
    );
}

#[test]
fn frames_that_cannot_tell_are_refused_in_one_line() {
    let truth = somewhat_off(7);
    let rows = random_rows(Role::Reference, 24, 4);
    let source = |rows: Vec<FrameRow>| Rendered::new(&truth, rows, 0.0);
    let refused = |source: &Rendered, words: &str| {
        let error = run(source, 160).unwrap_err().to_string();
        assert!(
            error.contains(words) && error.lines().count() == 1,
            "{error}"
        );
    };
    refused(&source(rows[..4].to_vec()), "there are 4");
    let mut alike = rows.clone();
    for (i, row) in alike.iter_mut().enumerate() {
        row.pose.view = Direction::from_deg(30.0 + i as f64 * 0.1, 60.0);
    }
    refused(&source(alike), "one direction of view");
    let mut blank = source(rows.clone());
    for frame in &mut blank.frames {
        frame.rgb.iter_mut().for_each(|pixel| *pixel = [0.5; 3]);
    }
    refused(
        &blank,
        "none of the 24 frames shows the four fiducial lines",
    );
    // Half of the frames are another rig's.
    let mut mixed = source(rows.clone());
    let mut other = truth.clone();
    other.camera.mount.roll_deg += 2.0;
    other.camera.mount.aim_mm[0] += 20.0;
    let others = Rendered::new(&other, rows, 0.0);
    for (i, frame) in others.frames.into_iter().enumerate().skip(14) {
        mixed.frames[i] = frame;
    }
    refused(&mixed, "do not fit one camera");
}

#[test]
fn a_target_that_was_put_in_turned_is_named_by_calibrate_and_by_process() {
    let mut drawn = nominal(160);
    (drawn.target.mark_mm, drawn.target.mark_radius_mm) = (Some([-365.0, 90.0]), Some(16.0));
    let mut truth = somewhat_off(8);
    truth.target.mark_radius_mm = Some(16.0);
    for (at, turn) in [
        ([-90.0, -365.0], "turned by 90 degrees anticlockwise"),
        ([365.0, -90.0], "turned by 180 degrees"),
        ([90.0, 365.0], "turned by 90 degrees clockwise"),
    ] {
        truth.target.mark_mm = Some(at);
        let source = Rendered::new(&truth, random_rows(Role::Reference, 20, 5), 0.0);
        let error = calibrate(&drawn, &source, &silent).unwrap_err().to_string();
        assert!(
            error.contains(turn) && error.lines().count() == 1,
            "{error}"
        );
    }
    // As drawn, it is calibrated as without a mark; process names a turned one with that rig.
    truth.target.mark_mm = drawn.target.mark_mm;
    let rows = random_rows(Role::Reference, 20, 5);
    let source = Rendered::new(&truth, rows.clone(), 0.0);
    let found = calibrate(&drawn, &source, &silent).unwrap();
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
    truth.target.mark_mm = Some([90.0, 365.0]);
    let mut rows = rows;
    rows.extend(random_rows(Role::Material, 20, 5));
    let source = Rendered::new(&truth, rows, 0.0);
    let masks = gonia_pipeline::process::Masks::default();
    let processed = gonia_pipeline::samples_of(&found.rig, &source, &masks, &silent);
    let error = processed.map(|_| ()).unwrap_err().to_string();
    assert!(
        error.contains("turned by 90 degrees clockwise in") && error.contains("of the reference"),
        "{error}"
    );
}

/// Poses at which the light is seen in a mirror, about in its middle.
fn mirror_rows(n: usize, seed: u64) -> Vec<FrameRow> {
    let mut random = Random::new(seed);
    (0..n)
        .map(|i| {
            let (theta, phi) = (random.between(12.0, 72.0), random.between(0.0, 360.0));
            FrameRow {
                frame: i as u32,
                role: Role::Mirror,
                pose: Pose::from_deg([theta, phi, theta, (phi + 180.0) % 360.0]),
                file: format!("frames/mirror_{i}.exr"),
            }
        })
        .collect()
}

#[test]
fn a_mirror_shows_where_the_light_is_without_a_reference() {
    let truth = crooked(240, 0.5, 11);
    let mut rows = random_rows(Role::Material, 24, 3);
    rows.extend(mirror_rows(16, 4));
    let source = Rendered::new(&truth, rows, 0.005);
    let found = run(&source, 240).unwrap();
    let said = describe(&found, &truth);
    eprintln!("{said}{:?} {:?}", found.mirror, found.remarks);
    assert_eq!(
        found.light,
        LightState::FoundByMirror { frames: 16 },
        "{said}"
    );
    let before = errors(&nominal(240), &truth)[0];
    let light = errors(&found.rig, &truth)[0];
    assert!(before[1] > 0.5 && light[1] < 0.04, "{before:?} {said}");
    // The stated uncertainty is true: within twice of it.
    assert!(light[0] < 2.0 * found.direction_u[0].p50, "{said}");
    let mirror = found.mirror.unwrap();
    assert!(
        mirror.highlight_px[0] > 1.0 && mirror.highlight_px[1] < 0.3,
        "{mirror:?}"
    );
    assert!((mirror.height_mm - 3.0).abs() < 1.0, "{mirror:?}");
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
}

#[test]
fn a_mirror_and_a_reference_together_are_as_good_as_the_better_of_them() {
    let truth = crooked(240, 0.5, 12);
    let reference = random_rows(Role::Reference, 24, 5);
    let light_of = |rows: Vec<FrameRow>| {
        let source = Rendered::new(&truth, rows, 0.005);
        let found = run(&source, 240).unwrap();
        assert!(found.remarks.is_empty(), "{:?}", found.remarks);
        assert!(
            matches!(found.light, LightState::Found { .. }),
            "{:?}",
            found.light
        );
        let of_place = found
            .numbers
            .iter()
            .filter(|n| n.name == "light.distance_m" || n.name.starts_with("light.arm"));
        let u: Vec<f64> = of_place.map(|n| n.u / n.prior).collect();
        assert_eq!(u.len(), 6);
        (errors(&found.rig, &truth)[0], found.direction_u[0], u)
    };
    let (alone, u_alone, numbers_alone) = light_of(reference.clone());
    let together = [reference, mirror_rows(12, 6)].concat();
    let (both, u_both, numbers_both) = light_of(together.clone());
    // A mirror that lies 4 mm lower than is said contradicts the reference.
    let mut drawn = nominal(240);
    drawn.target.mirror_height_mm = Some(6.9);
    let found = calibrate(&drawn, &Rendered::new(&truth, together, 0.005), &silent).unwrap();
    let said = found.remarks[0].to_string();
    assert!(said.contains("put it apart"), "{:?}", found.remarks);
    eprintln!("alone {alone:?} {u_alone:?}, both {both:?} {u_both:?}");
    // Directions are compared at other poses: the mirror's frames have their own. The numbers are the same.
    let ratios: Vec<f64> = numbers_both
        .iter()
        .zip(&numbers_alone)
        .map(|(b, a)| b / a)
        .collect();
    let mean = ratios.iter().sum::<f64>() / 6.0;
    assert!(mean < 1.0, "{ratios:?}");
    assert!(both[1] < alone[1].max(0.02), "{both:?} {alone:?}");
    assert!(both[0] < 2.0 * u_both.p50, "{both:?} {u_both:?}");
}

#[test]
fn a_mirror_frame_without_one_highlight_is_refused_and_named() {
    let truth = somewhat_off(13);
    let mut rows = random_rows(Role::Reference, 20, 5);
    rows.extend(mirror_rows(5, 8));
    // Beside the mirror's direction the mirror is dark.
    rows[22].pose.view = Direction::from_deg(40.0, 200.0);
    rows[22].pose.light = Direction::from_deg(20.0, 100.0);
    let source = Rendered::new(&truth, rows.clone(), 0.0);
    let error = run(&source, 160).unwrap_err().to_string();
    assert!(
        error
            .starts_with("mirror frame 2 (frames/mirror_2.exr): nothing in the mirror is brighter")
            && error.lines().count() == 1,
        "{error}"
    );
    let mut drawn = nominal(160);
    drawn.target.mirror_height_mm = None;
    let flush = Rendered::new(&truth, [&rows[..20], &rows[23..]].concat(), 0.0);
    let error = calibrate(&drawn, &flush, &silent).unwrap_err().to_string();
    assert!(
        error.starts_with("2 frames are of a mirror") && error.contains("target.mirror_height_mm"),
        "{error}"
    );
    // Two lamps.
    rows[22].pose = rows[23].pose;
    let mut source = Rendered::new(&truth, rows, 0.0);
    let width = source.frames[22].width;
    for (x, y) in [(70, 84), (71, 84), (70, 85), (71, 85)] {
        source.frames[22].rgb[y * width + x] = [80.0; 3];
    }
    let error = run(&source, 160).unwrap_err().to_string();
    assert!(
        error.contains("mirror frame 2") && error.contains("more than one"),
        "{error}"
    );
}

#[test]
fn process_leaves_frames_of_a_mirror_out_and_counts_them() {
    let truth = nominal(160);
    let mut rows = random_rows(Role::Material, 6, 9);
    let masks = gonia_pipeline::process::Masks::default();
    let samples = |rows: &[FrameRow]| {
        let source = Rendered::new(&truth, rows.to_vec(), 0.0);
        gonia_pipeline::samples_of(&truth, &source, &masks, &silent).unwrap()
    };
    let without = samples(&rows);
    rows.extend(mirror_rows(3, 10));
    let with = samples(&rows);
    assert_eq!((without.mirrors, with.mirrors), (0, 3));
    // Noise is by a frame's number: the material's frames are the same ones.
    assert_eq!(without.samples, with.samples);
}

/// `cargo test -p gonia-pipeline --test calibration light_by -- --ignored --nocapture`: directions of a light by
/// mirror frames alone.
#[test]
#[ignore = "twenty rigs, a minute of a core"]
fn light_by_number_of_mirror_frames() {
    let (mut within, mut medians) = (0, Vec::new());
    for n in [6, 12, 24, 48] {
        let (mut worst, mut all) = ([0.0f64; 2], Vec::new());
        for seed in 20..25 {
            let truth = crooked(240, 0.5, seed);
            let rows = [random_rows(Role::Material, 24, seed), mirror_rows(n, seed)].concat();
            let found = run(&Rendered::new(&truth, rows, 0.01), 240).unwrap();
            let light = errors(&found.rig, &truth)[0];
            all.push(light[1]);
            within += usize::from(light[1] <= 2.0 * found.direction_u[0].p95);
            worst = [
                worst[0].max(light[1]),
                worst[1].max(found.direction_u[0].p95),
            ];
        }
        all.sort_by(f64::total_cmp);
        medians.push(all[2]);
        eprintln!(
            "{n} mirror frames: light p95 median {:.3} worst {:.3} degrees, u p95 worst {:.3}",
            all[2], worst[0], worst[1]
        );
    }
    // Of twenty, one may lie outside of twice its uncertainty.
    assert!(within >= 19, "{within} of 20 within 2 u");
    assert!(medians[3] < medians[0], "{medians:?}");
}

/// Beams of the simulated lights in a rig's own numbers.
fn with_beam(rig: &mut Rig) {
    let beam = Beam::default();
    let [right, up] = beam.axis_deg.map(|deg| deg.to_radians().tangent());
    let inverse = beam.width_deg.to_radians().tangent().powi(-2);
    rig.light.beam = [
        inverse * right,
        inverse * up,
        -0.5 * inverse,
        0.0,
        -0.5 * inverse,
    ];
}

/// `cargo test -p gonia-pipeline --test calibration -- --ignored --nocapture`: fifty rigs that are off by a
/// fifth to all of what a calibration allows for, frames of several widths, noises and arms.
#[test]
#[ignore = "fifty rigs, ten minutes of a core"]
fn fifty_rigs_lie_within_their_uncertainties() {
    let rigs: Vec<u64> = std::env::var("GONIA_RIGS").map_or((0..50).collect(), |text| {
        text.split(',').map(|seed| seed.parse().unwrap()).collect()
    });
    let (mut numbers, mut angles) = (Tally::default(), Tally::default());
    let mut by_name: std::collections::BTreeMap<&str, Vec<f64>> = Default::default();
    for seed in rigs {
        let of = |choices: [f64; 3], every: u64| choices[(seed / every % 3) as usize];
        let px = of([240.0, 320.0, 200.0], 1) as usize;
        let scatter = Scatter {
            noise: of([0.01, 0.003, 0.02], 3),
            jitter_deg: of([0.01, 0.02, 0.005], 2),
            beam: seed % 2 == 1,
            gloss: 0.0,
            seed,
        };
        let mut truth = crooked(px, of([1.0, 0.5, 0.2], 5), 1000 + seed);
        if scatter.beam {
            with_beam(&mut truth);
        }
        let rows = random_rows(Role::Reference, 40, seed);
        let found = match run(&Rendered::scattered(&truth, rows, &scatter), px) {
            Ok(found) => found,
            Err(error) => {
                eprintln!("{seed}: {px} px: {error}");
                angles.of += 4;
                continue;
            }
        };
        // At the poses that uncertainties are stated for.
        let errors = errors_at(found.poses.iter().copied(), [&found.rig, &truth]);
        // A light that was left as it is has no uncertainty that its frames gave.
        let is_lit = matches!(found.light, LightState::Found { .. });
        for (error, u) in errors
            .iter()
            .zip(&found.direction_u)
            .skip(usize::from(!is_lit))
        {
            angles.count(error[0] / u.p50);
            angles.count(error[1] / u.p95);
        }
        let start = nominal(px);
        for n in &found.numbers {
            let is = *truth.clone().number_mut(n.name).unwrap();
            // What is nothing, and was found to be nothing, proves nothing.
            if n.state == NumberState::Found || is != *start.clone().number_mut(n.name).unwrap() {
                numbers.count((n.found - is) / n.u);
                by_name
                    .entry(n.name)
                    .or_default()
                    .push((n.found - is) / n.u);
            }
        }
        let [light, view] = found.direction_u;
        eprintln!(
            "{seed}: {px} px, noise {}, arms {}: light p95 {:.4} u {:.4}, view p95 {:.4} u {:.4} ({:?}, lines {:.3} px, arm {:.3?}, {:?})",
            scatter.noise,
            scatter.jitter_deg,
            errors[0][1],
            light.p95,
            errors[1][1],
            view.p95,
            found.frames,
            found.lines_px[1],
            found.camera_arm_deg,
            found.light
        );
    }
    for (name, z) in by_name {
        let inside = z.iter().filter(|z| z.abs() < 2.0).count();
        let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
        eprintln!("{name}: {inside} of {} within 2 u, rms {rms:.2}", z.len());
    }
    eprintln!("numbers: {numbers:?}; angles: {angles:?}");
    assert!(numbers.share() >= 0.95 && angles.share() >= 0.95);
}

/// Materials of which nothing is known.
fn materials() -> Vec<(&'static str, Arc<dyn Brdf>)> {
    let lobe = |specular: f64, m: [f64; 2]| KurtLobe {
        specular: [specular; 3],
        f0: 0.05,
        mx: m[0],
        my: m[1],
        alpha: 0.3,
        azimuth_deg: 25.0,
    };
    vec![
        ("Lambertian", Arc::new(Kurt::new([0.5; 3], &[]))),
        ("white fabric", Arc::new(Kurt::white_reference_fabric())),
        ("two-thread fabric", Arc::new(Kurt::two_thread_fabric())),
        (
            "satin",
            Arc::new(Kurt::new([0.4; 3], &[lobe(0.5, [0.35, 0.2])])),
        ),
        (
            "gloss paint",
            Arc::new(Kurt::new([0.3; 3], &[lobe(0.5, [0.1, 0.1])])),
        ),
    ]
}

/// `cargo test -p gonia-pipeline --test calibration light_of -- --ignored --nocapture`: directions of a light by
/// the shading on materials of which nothing is known.
#[test]
#[ignore = "fifteen rigs, some minutes of a core"]
fn light_of_unknown_materials() {
    let mut wrong = Vec::new();
    for (name, material) in materials() {
        for (frames, seed) in [(60, 30), (60, 31), (120, 32)] {
            let truth = crooked(240, 0.5, seed);
            let rows = random_rows(Role::Material, frames, seed);
            let scatter = Scatter {
                jitter_deg: 0.01,
                noise: 0.005,
                beam: false,
                gloss: 0.0,
                seed,
            };
            let source = Rendered::of_material(&truth, rows, &scatter, material.clone());
            let found = run(&source, 240).unwrap();
            let light = errors_at(found.poses.iter().copied(), [&found.rig, &truth])[0];
            let u = found.direction_u[0];
            let line = format!(
                "{name}, {frames} frames: light p50 {:.3} p95 {:.3} degrees, u {:.3} and {:.3}, {:?}",
                light[0], light[1], u.p50, u.p95, found.light
            );
            eprintln!("{line}");
            let is_found = matches!(found.light, LightState::Found { .. });
            if is_found && light[1] > 3.0 * u.p95 {
                wrong.push(line);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// What is unusual of frames that a rig is to be found from.
struct Case {
    name: &'static str,
    px: usize,
    rows: Vec<FrameRow>,
    scatter: Scatter,
    /// What rig.toml says.
    said: Rig,
}

fn cases() -> Vec<Case> {
    let usual = |name| Case {
        name,
        px: 240,
        rows: random_rows(Role::Reference, 40, 1),
        scatter: Scatter {
            jitter_deg: 0.01,
            noise: 0.01,
            beam: false,
            gloss: 0.0,
            seed: 7,
        },
        said: nominal(240),
    };
    let with = |name, change: &dyn Fn(&mut Case)| {
        let mut case = usual(name);
        change(&mut case);
        case
    };
    let few = |n: usize| move |case: &mut Case| case.rows.truncate(n);
    let each = |case: &mut Case, change: &dyn Fn(usize, &mut Pose)| {
        for (i, row) in case.rows.iter_mut().enumerate() {
            change(i, &mut row.pose);
        }
    };
    vec![
        usual("nothing unusual: 40 frames of 240 px, noise 1 %"),
        with("20 frames", &few(20)),
        with("10 frames", &few(10)),
        with("6 frames", &few(6)),
        with("5 frames", &few(5)),
        with("views at one azimuth", &|case| {
            each(case, &|_, pose| pose.view.phi = 0.0);
        }),
        with("views within 12 degrees", &|case| {
            each(case, &|i, pose| {
                pose.view = Direction::from_deg(30.0 + 0.3 * i as f64, 60.0);
            });
        }),
        with("lights at one azimuth", &|case| {
            each(case, &|_, pose| pose.light.phi = 0.0);
        }),
        with("lights at one polar angle, 45 degrees", &|case| {
            each(case, &|_, pose| pose.light.theta = 45f64.to_radians());
        }),
        with("no reference", &|case| {
            case.rows = random_rows(Role::Material, 40, 1);
        }),
        with("a Lambertian reference of unknown reflectance", &|case| {
            case.said.reference = None;
        }),
        with(
            "a glossy reference that is said to be Lambertian",
            &|case| {
                case.scatter.gloss = 0.5;
            },
        ),
        with("a glossy reference of unknown reflectance", &|case| {
            case.scatter.gloss = 0.5;
            case.said.reference = None;
        }),
        with("a beam that falls off by a tenth", &|case| {
            case.scatter.beam = true;
        }),
        with("noise of 10 %", &|case| case.scatter.noise = 0.1),
        with("arms that repeat within 0.05 degrees", &|case| {
            case.scatter.jitter_deg = 0.05;
        }),
        with("frames of 120 px", &|case| {
            (case.px, case.said) = (120, nominal(120));
        }),
        with("frames of 80 px", &|case| {
            (case.px, case.said) = (80, nominal(80));
        }),
    ]
}

/// `cargo test -p gonia-pipeline --test calibration where -- --ignored --nocapture` prints the rows of the guide's
/// table: errors and uncertainties from straight above to the lowest frame, at the case's own azimuths. Each case is refused, or what it finds lies within
/// its stated uncertainty, or a warning says that it may not.
#[test]
#[ignore = "18 calibrations, two minutes of a core"]
fn where_calibration_fails_it_says_so() {
    println!("| case | light: error p95 | u p95 | view: error p95 | u p95 | what it says |");
    println!("|---|---|---|---|---|---|");
    let mut wrong = Vec::new();
    for case in cases() {
        let truth = crooked(case.px, 0.5, 21);
        let source = Rendered::scattered(&truth, case.rows, &case.scatter);
        let found = match calibrate(&case.said, &source, &silent) {
            Ok(found) => found,
            Err(error) => {
                println!("| {} | – | – | – | – | refused: {error} |", case.name);
                continue;
            }
        };
        let errors = errors_at(found.poses.iter().copied(), [&found.rig, &truth]);
        let u = found.direction_u;
        let is_lit = matches!(found.light, LightState::Found { .. });
        let of = |which: usize| match which == 0 && !is_lit {
            true => format!("{:.3} | –", errors[0][1]),
            false => format!("{:.3} | {:.3}", errors[which][1], u[which].p95),
        };
        let (light, view) = (of(0), of(1));
        let mut says: Vec<String> = found.remarks.iter().map(ToString::to_string).collect();
        match found.light {
            LightState::NoReference { .. } => says.push("no reference: the light stays".into()),
            LightState::Unlike {
                surface,
                level,
                within,
            } => says.push(format!(
                "the {} is not as it is said to be, by {:.0} and {:.0} %: the light stays",
                format!("{surface:?}").to_lowercase(),
                100.0 * level,
                100.0 * within
            )),
            LightState::NotTold { u_deg, .. } => says.push(format!(
                "the material hardly tells where the light is (u {u_deg:.2?}): it stays"
            )),
            LightState::Found { .. } | LightState::FoundByMirror { .. } => {}
        }
        let undetermined = found.numbers.iter();
        let undetermined = undetermined.filter(|n| n.state == NumberState::Undetermined);
        match undetermined.count() {
            0 => {}
            n => says.push(format!("{n} numbers are not determined")),
        }
        println!("| {} | {light} | {view} | {} |", case.name, says.join("; "));
        for which in usize::from(!is_lit)..2 {
            let is_warned = says.iter().any(|said| said.contains("it may be wrong"));
            if errors[which][1] > 3.0 * u[which].p95 && !is_warned {
                wrong.push(format!("{}: {:?} {u:?}", case.name, errors));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// How many errors are within two standard uncertainties.
#[derive(Debug, Default)]
struct Tally {
    within: usize,
    of: usize,
}

impl Tally {
    fn count(&mut self, z: f64) {
        self.of += 1;
        self.within += usize::from(z.abs() < 2.0);
    }

    fn share(&self) -> f64 {
        self.within as f64 / self.of as f64
    }
}

/// From far off two of them show their lines: a camera of those is but a start.
#[test]
fn a_rig_is_found_from_ten_frames() {
    let truth = crooked(240, 0.5, 21);
    let rows = random_rows(Role::Reference, 10, 1);
    let poses: Vec<Pose> = rows.iter().map(|row| row.pose).collect();
    let found = run(&Rendered::new(&truth, rows, 0.01), 240).unwrap();
    let said = describe(&found, &truth);
    let [light, view] = errors_at(poses.into_iter(), [&found.rig, &truth]);
    assert_eq!(found.frames, [10, 10], "{said}");
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
    assert!(matches!(found.light, LightState::Found { .. }), "{said}");
    assert!(
        light[1] < 0.1 && view[1] < 0.03,
        "{light:?} {view:?} {said}"
    );
}
