//! Registration against the simulator's truth.
#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_brdf::Elementary;
use gonia_brdf::direction::angle_between;
use gonia_brdf::{Direction, Pose};
use gonia_imaging::*;
use gonia_rig::{CameraModel, CameraShift, Frame, OrientationMark, Rig, Role};
use gonia_sim::scene::Scene;

const CORNERS: [[f64; 2]; 4] = [
    [-335.0, -335.0],
    [335.0, -335.0],
    [335.0, 335.0],
    [-335.0, 335.0],
];

/// Polar angles and azimuths of the plan's rings, some with lines parallel to the rows.
const VIEWS: [[f64; 2]; 10] = [
    [0.0, 0.0],
    [15.0, 60.0],
    [30.0, 0.0],
    [45.0, 200.0],
    [45.0, 45.0],
    [60.0, 90.0],
    [60.0, 18.0],
    [75.0, 0.0],
    [75.0, 45.0],
    [75.0, 285.0],
];

/// RMS distance of the corners from where a camera at `truth` sees them, pixels.
fn corner_error(found: &Registration, rig: &Rig, truth: Pose) -> f64 {
    let map = CameraModel::new(rig).predict(truth.view, CameraShift::default());
    let sum: f64 = CORNERS
        .iter()
        .map(|c| {
            let (a, b) = (found.pixel_from_target.apply(*c), map.apply(*c));
            (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
        })
        .sum();
    (sum / 4.0).sqrt()
}

fn register(scene: &Scene, which: Role, truth: Pose, reading: Pose) -> (Registration, f64) {
    let rig = scene.geometry.to_rig();
    let frame = scene.frame(which, truth, 1);
    let found = Registrar::new(&rig).register(&frame, reading);
    let error = corner_error(&found, &rig, truth);
    (found, error)
}

fn read_off(truth: Pose, by_deg: f64) -> Pose {
    Pose {
        light: truth.light,
        view: Direction::from_deg(
            truth.view.theta_deg() + by_deg,
            truth.view.phi_deg() - by_deg,
        ),
    }
}

#[test]
fn corners_are_found_to_a_fraction_of_a_pixel_up_to_75_degrees() {
    for (px, limit) in [(400, 0.05), (1024, 0.03)] {
        let scene = Scene::of_fabric(px);
        let mut squares = Vec::new();
        for [tv, pv] in VIEWS {
            for (which, light) in [
                (Role::Material, [30.0, 140.0]),
                (Role::Reference, [30.0, 140.0]),
                (Role::Reference, [85.0, 150.0]),
            ] {
                let truth = Pose::from_deg([light[0], light[1], tv, pv]);
                let (found, error) = register(&scene, which, truth, read_off(truth, 0.02));
                assert_eq!(found.state, RegistrationState::Locked, "{px} {tv} {pv}");
                assert!(found.residual_px < 0.05, "{}", found.residual_px);
                squares.push(error * error);
            }
        }
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(rms < limit, "{px}: {rms}");
    }
}

#[test]
fn the_arms_error_is_estimated_where_it_can_be_seen() {
    // At θv = 0 an error of 0.02° moves the corners by a hundredth of a pixel, and the estimate
    // stays near the reading; obliquely it must find most of it.
    for (px, limit_deg) in [(400, 0.01), (1024, 0.005)] {
        let scene = Scene::of_fabric(px);
        for [tv, pv] in VIEWS.into_iter().filter(|v| v[0] >= 45.0) {
            let truth = Pose::from_deg([30.0, 140.0, tv, pv]);
            let (found, _) = register(&scene, Role::Reference, truth, read_off(truth, 0.02));
            let left = [
                found.pose_offset.theta_deg + 0.02,
                found.pose_offset.phi_deg - 0.02,
            ];
            assert!(
                left.iter().all(|d| d.abs() < limit_deg),
                "{px} {tv} {pv}: {left:?}"
            );
        }
    }
}

#[test]
fn a_rig_known_badly_is_still_registered_or_refused_never_mistaken() {
    // The camera is not where its arm says: beyond what arms do, and far beyond.
    let scene = Scene::of_fabric(400);
    let mut locked = 0;
    for off in [0.3, 0.8, 2.0, 5.0, 15.0, 40.0] {
        for [tv, pv] in VIEWS {
            let truth = Pose::from_deg([30.0, 140.0, tv, pv]);
            for which in [Role::Material, Role::Reference] {
                let (found, error) = register(&scene, which, truth, read_off(truth, off));
                if found.state == RegistrationState::Locked {
                    locked += 1;
                    assert!(error < 0.2, "{off} {tv} {pv} {which:?}: {error}");
                }
            }
        }
    }
    assert!(locked >= 20, "{locked}");
}

#[test]
fn a_lens_that_bends_lines_is_allowed_for() {
    let mut scene = Scene::of_fabric(512);
    scene.geometry.distortion = [-0.15, 0.06];
    for [tv, pv] in VIEWS {
        let truth = Pose::from_deg([30.0, 140.0, tv, pv]);
        let (found, error) = register(&scene, Role::Material, truth, read_off(truth, 0.01));
        assert_eq!(found.state, RegistrationState::Locked);
        assert!(error < 0.06, "{tv} {pv}: {error}");
    }
}

#[test]
fn lines_hidden_in_part_still_carry_the_frame() {
    let scene = Scene::of_fabric(400);
    let rig = scene.geometry.to_rig();
    for [tv, pv] in VIEWS {
        let truth = Pose::from_deg([30.0, 140.0, tv, pv]);
        let mut frame = scene.frame(Role::Reference, truth, 1);
        // A dark body over the left 30 % of what the target covers.
        let columns = CORNERS.map(|c| {
            CameraModel::new(&rig)
                .predict(truth.view, CameraShift::default())
                .apply(c)[0]
        });
        let low = columns.iter().copied().fold(f64::INFINITY, f64::min);
        let high = columns.iter().copied().fold(0.0, f64::max);
        let edge = (low + 0.3 * (high - low)) as usize;
        for row in frame.rgb.chunks_mut(400) {
            row[..edge].fill([0.002; 3]);
        }
        let found = Registrar::new(&rig).register(&frame, read_off(truth, 0.02));
        let error = corner_error(&found, &rig, truth);
        // Even a fall-back is within what 0.02° of the arm moves.
        assert!(error < 0.2, "{tv} {pv}: {error} {:?}", found.state);
    }
}

#[test]
fn stripes_of_the_fabric_are_not_taken_for_marks() {
    let scene = Scene::of_fabric(400);
    let rig = scene.geometry.to_rig();
    for [tv, pv] in VIEWS {
        let truth = Pose::from_deg([30.0, 140.0, tv, pv]);
        let mut frame = scene.frame(Role::Reference, truth, 1);
        let map = CameraModel::new(&rig)
            .predict(truth.view, CameraShift::default())
            .inverse()
            .unwrap();
        for (i, pixel) in frame.rgb.iter_mut().enumerate() {
            let at = map.apply([(i % 400) as f64 + 0.5, (i / 400) as f64 + 0.5]);
            if at[0].abs().max(at[1].abs()) < 316.0 {
                // Bright lines parallel to the fiducial lines, as wide and every 40 mm.
                let on = at.iter().any(|c| (c.rem_euclid(40.0) - 20.0).abs() < 2.5);
                *pixel = pixel.map(|v| v * if on { 1.0 } else { 0.3 });
            }
        }
        let found = Registrar::new(&rig).register(&frame, read_off(truth, 0.02));
        let error = corner_error(&found, &rig, truth);
        assert!(error < 0.2, "{tv} {pv}: {error} {:?}", found.state);
    }
}

#[test]
fn a_frame_of_something_else_falls_back_and_says_why() {
    let scene = Scene::of_fabric(400);
    let rig = scene.geometry.to_rig();
    let registrar = Registrar::new(&rig);
    let frame = |value: &dyn Fn(usize, usize) -> f32| Frame {
        width: 400,
        height: 400,
        rgb: (0..160_000).map(|i| [value(i % 400, i / 400); 3]).collect(),
    };
    let noise = |i: usize| ((i * 2_654_435_761) % 1_000_003) as f32 / 1e6;
    let others = [
        frame(&|_, _| 0.0),
        frame(&|_, _| f32::NAN),
        frame(&|x, y| noise(y * 400 + x)),
        frame(&|x, y| 0.2 + 0.1 * noise(y * 400 + x) + 1e-3 * x as f32),
        frame(&|x, y| if (x + 2 * y) % 31 < 3 { 1.0 } else { 0.1 }),
        frame(&|x, y| if x % 23 < 2 || y % 29 < 2 { 1.0 } else { 0.1 }),
        frame(&|x, y| if x > 150 && y < 220 { 1.0 } else { 0.1 }),
    ];
    for (i, other) in others.iter().enumerate() {
        for [tv, pv] in VIEWS {
            let reading = Pose::from_deg([30.0, 140.0, tv, pv]);
            let found = registrar.register(other, reading);
            let RegistrationState::FellBack(reason) = found.state else {
                panic!("{i} {tv} {pv}: locked");
            };
            assert!(!reason.to_string().is_empty());
            let off = angle_between(found.view.to_vec3(), reading.view.to_vec3());
            assert!(off < 1e-12, "{off}");
            assert_eq!(corner_error(&found, &rig, reading), 0.0);
        }
    }
}

/// A frame with pixel (x, y) taken from `of(x, y)`; black where that is outside.
fn moved(frame: &Frame, of: impl Fn([i64; 2]) -> [i64; 2]) -> Frame {
    let (width, height) = (frame.width as i64, frame.height as i64);
    let pixels = (0..width * height).map(|i| of([i % width, i / width]));
    let rgb = pixels.map(|[x, y]| {
        let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
        if is_inside {
            frame.rgb[(y * width + x) as usize]
        } else {
            [0.0; 3]
        }
    });
    Frame {
        rgb: rgb.collect(),
        ..*frame
    }
}

#[test]
fn turned_and_mirrored_frames_are_told_from_straight_ones() {
    let scene = Scene::of_fabric(240);
    let registrar = Registrar::new(&scene.geometry.to_rig());
    let last = 239;
    type Of = fn([i64; 2], i64) -> [i64; 2];
    let turns: [(Turn, Of); 4] = [
        (Turn::Half, |[x, y], l| [l - x, l - y]),
        (Turn::Right, |[x, y], l| [y, l - x]),
        (Turn::Left, |[x, y], l| [l - y, x]),
        (Turn::Mirrored, |[x, y], l| [l - x, y]),
    ];
    for [tv, pv] in [[15.0, 65.0], [30.0, 20.0], [45.0, 200.0], [60.0, 285.0]] {
        let pose = Pose::from_deg([30.0, 140.0, tv, pv]);
        for role in [Role::Material, Role::Reference] {
            let frame = scene.frame(role, pose, 1);
            for (turn, of) in turns {
                let found = registrar.register(&moved(&frame, |p| of(p, last)), pose);
                let expected = RegistrationFailure::Turned(turn);
                assert_eq!(
                    found.state,
                    RegistrationState::FellBack(expected),
                    "{tv} {pv}"
                );
            }
        }
    }
    // From straight above a square shows nothing of it.
    let above = Pose::from_deg([30.0, 140.0, 0.0, 0.0]);
    let frame = scene.frame(Role::Material, above, 1);
    let found = registrar.register(&moved(&frame, |p| turns[0].1(p, last)), above);
    assert_eq!(found.state, RegistrationState::Locked);
}

#[test]
fn a_target_that_is_elsewhere_in_the_frame_is_not_kept_by_its_pose() {
    let (mut frames, mut named, mut kept) = (0, 0, Vec::new());
    for (px, by) in [
        (240, [2, 0]),
        (240, [0, -5]),
        (240, [20, 0]),
        (400, [9, 4]),
        (400, [0, 40]),
    ] {
        let scene = Scene::of_fabric(px);
        let registrar = Registrar::new(&scene.geometry.to_rig());
        for [tv, pv] in [[0.0, 0.0], [30.0, 20.0], [60.0, 90.0], [75.0, 285.0]] {
            let pose = Pose::from_deg([30.0, 140.0, tv, pv]);
            for role in [Role::Material, Role::Reference] {
                let frame = scene.frame(role, pose, 1);
                let frame = moved(&frame, |[x, y]| [x - by[0], y - by[1]]);
                let found = registrar.register(&frame, pose);
                frames += 1;
                match found.state {
                    RegistrationState::FellBack(RegistrationFailure::Displaced { shift_px }) => {
                        let off = [0, 1].map(|i| shift_px[i] - by[i] as f64);
                        let off = off[0].hypotenuse(off[1]);
                        assert!(off < 0.3, "{px} {by:?} {tv} {pv}: {shift_px:?}");
                        named += 1;
                    }
                    // Refused all the same, if with less of a reason.
                    RegistrationState::FellBack(
                        RegistrationFailure::WrongLayout { .. }
                        | RegistrationFailure::LinesMissing { found: 0 | 1 },
                    ) => {}
                    other => kept.push(format!("{px} {by:?} {tv} {pv} {role:?}: {other:?}")),
                }
            }
        }
    }
    println!("{named} of {frames} are told to be displaced");
    assert!(kept.is_empty(), "{kept:#?}");
    assert!(4 * named >= 3 * frames, "{named} of {frames}");
}

/// The frame turned clockwise about its middle, between pixels.
fn rolled(frame: &Frame, roll_deg: f64) -> Frame {
    let (sin, cos) = roll_deg.to_radians().sine_cosine();
    let middle = [0.5 * frame.width as f64, 0.5 * frame.height as f64];
    let pixel = |i: usize| {
        let from = [(i % frame.width) as f64, (i / frame.width) as f64];
        let [right, down] = [0, 1].map(|k| from[k] + 0.5 - middle[k]);
        let at = [cos * right + sin * down, cos * down - sin * right];
        let [x, y] = [0, 1].map(|k| at[k] + middle[k] - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let mut rgb = [0.0; 3];
        for (column, row, weight) in [
            (x0, y0, (x0 + 1.0 - x) * (y0 + 1.0 - y)),
            (x0 + 1.0, y0, (x - x0) * (y0 + 1.0 - y)),
            (x0, y0 + 1.0, (x0 + 1.0 - x) * (y - y0)),
            (x0 + 1.0, y0 + 1.0, (x - x0) * (y - y0)),
        ] {
            let column = column.clamp(0.0, (frame.width - 1) as f64) as usize;
            let row = row.clamp(0.0, (frame.height - 1) as f64) as usize;
            for (sum, value) in rgb.iter_mut().zip(frame.rgb[row * frame.width + column]) {
                *sum += weight as f32 * value;
            }
        }
        rgb
    };
    Frame {
        rgb: (0..frame.rgb.len()).map(pixel).collect(),
        ..*frame
    }
}

#[test]
fn a_camera_that_is_rolled_is_said_to_be_and_by_how_much() {
    // Not near the zenith, where a roll and an azimuth are alike.
    let scene = Scene::of_fabric(400);
    let registrar = Registrar::new(&scene.geometry.to_rig());
    for (roll_deg, [tv, pv]) in [
        (0.7, [30.0, 20.0]),
        (-0.7, [45.0, 200.0]),
        (1.5, [60.0, 90.0]),
    ] {
        let pose = Pose::from_deg([30.0, 140.0, tv, pv]);
        let frame = rolled(&scene.frame(Role::Material, pose, 1), roll_deg);
        let found = registrar.register(&frame, pose);
        let RegistrationState::FellBack(RegistrationFailure::Rolled { roll_deg: said }) =
            found.state
        else {
            panic!("{roll_deg}, {tv}: {:?}", found.state);
        };
        assert!((said - roll_deg).abs() < 0.02, "{said} for {roll_deg}");
    }
}

/// A rig whose target has an orientation mark, and what its camera sees of targets that lie otherwise.
fn marked(px: usize, at_mm: [f64; 2], radius_mm: f64) -> Scene {
    let mut scene = Scene::of_fabric(px);
    scene.geometry.mark = Some(OrientationMark { at_mm, radius_mm });
    scene
}

fn turned_target(scene: &Scene, of: fn([f64; 2]) -> [f64; 2]) -> Scene {
    let mut turned = scene.clone();
    turned.geometry.mark = scene.geometry.mark.map(|mark| OrientationMark {
        at_mm: of(mark.at_mm),
        ..mark
    });
    turned
}

#[test]
fn a_target_that_lies_turned_is_found_out_by_its_mark() {
    type Lie = (Option<Turn>, fn([f64; 2]) -> [f64; 2]);
    let lies: [Lie; 4] = [
        (None, |p| p),
        (Some(Turn::Left), |[x, y]| [-y, x]),
        (Some(Turn::Half), |[x, y]| [-x, -y]),
        (Some(Turn::Right), |[x, y]| [y, -x]),
    ];
    let (mut locked, mut told) = (0, 0);
    for (px, at, radius) in [
        (240, [365.0, 120.0], 14.0),
        (300, [-130.0, 362.0], 12.0),
        (200, [0.0, -360.0], 18.0),
        (240, [-365.0, -365.0], 14.0),
    ] {
        let straight = marked(px, at, radius);
        let registrar = Registrar::new(&straight.geometry.to_rig());
        for (turn, of) in lies {
            let scene = turned_target(&straight, of);
            let lit = [
                (Role::Material, [30.0, 140.0]),
                (Role::Reference, [75.0, 20.0]),
            ];
            for ([tv, pv], (role, light)) in VIEWS.into_iter().zip(lit.into_iter().cycle()) {
                let pose = Pose::from_deg([light[0], light[1], tv, pv]);
                let frame = scene.frame(role, pose, 1);
                let found = registrar.register(&frame, pose);
                let place = format!("{px} {at:?} {turn:?} {tv} {pv} {role:?}: {:?}", found.state);
                match (turn, found.state) {
                    (None, RegistrationState::Locked) => locked += 1,
                    (Some(turn), RegistrationState::FellBack(reason)) => {
                        assert_eq!(reason, RegistrationFailure::TargetTurned(turn), "{place}");
                        told += 1;
                    }
                    // Hidden, or cut off by the frame: nothing is said of it.
                    (Some(_), RegistrationState::Locked) => {}
                    (None, _) => panic!("{place}"),
                }
                let rows = registrar.rows(pose.view);
                let by_rows = registrar.register_rows(&frame, pose, &rows);
                let is_locked = found.state == RegistrationState::Locked;
                assert_eq!(by_rows.is_some(), is_locked, "{place}");
            }
        }
    }
    eprintln!("{locked} locked, {told} of {} turned ones told", 3 * locked);
    assert_eq!(locked, 40);
    assert!(told >= 108, "{told}");
}

#[test]
fn a_frame_turned_by_the_camera_is_found_out_from_straight_above_by_the_mark() {
    let scene = marked(300, [365.0, 120.0], 12.0);
    let registrar = Registrar::new(&scene.geometry.to_rig());
    for phi in [0.0, 90.0, 45.0] {
        let pose = Pose::from_deg([30.0, 140.0, 0.0, phi]);
        let frame = scene.frame(Role::Material, pose, 1);
        let last = 299;
        type Of = fn([i64; 2], i64) -> [i64; 2];
        let turns: [(Turn, Of); 4] = [
            (Turn::Half, |[x, y], l| [l - x, l - y]),
            (Turn::Right, |[x, y], l| [y, l - x]),
            (Turn::Left, |[x, y], l| [l - y, x]),
            (Turn::Mirrored, |[x, y], l| [l - x, y]),
        ];
        for (turn, of) in turns {
            let found = registrar.register(&moved(&frame, |p| of(p, last)), pose);
            let expected = RegistrationFailure::TargetTurned(turn);
            assert_eq!(found.state, RegistrationState::FellBack(expected), "{phi}");
        }
    }
}

/// RMS distance of pieces of lines from where the target has them, pixels, in frames without noise.
fn placed_px(px: usize) -> f64 {
    let mut scene = Scene::of_fabric(px);
    (scene.noise, scene.beam, scene.occluder) = (None, None, None);
    let rig = scene.geometry.to_rig();
    let (registrar, camera) = (Registrar::new(&rig), CameraModel::new(&rig));
    let (mut sum, mut count) = (0.0, 0);
    // Azimuths at which lines are oblique in the frame, lights from all sides.
    let views = [
        [0.0, 44.0],
        [0.0, 315.0],
        [15.0, 70.0],
        [30.0, 130.0],
        [45.0, 24.0],
    ];
    let lights = [[45.0, 10.0], [60.0, 337.0], [75.0, 160.0], [85.0, 65.0]];
    for [tv, pv] in views {
        for [ti, pi] in lights {
            let pose = Pose::from_deg([ti, pi, tv, pv]);
            let frame = scene.frame(Role::Reference, pose, 0);
            let map = camera.predict(pose.view, CameraShift::default());
            let back = map.inverse().unwrap();
            for point in registrar.line_points(&frame, pose, Search::Near) {
                let at = back.apply(camera.undistort(point.pixel));
                let off = point.sign * at[point.axis] - rig.target.line_offset_mm;
                sum += (off * point.px_per_mm).powi(2);
                count += 1;
            }
        }
    }
    assert!(count > 500, "{count}");
    (sum / f64::from(count)).sqrt()
}

#[test]
fn a_near_light_moves_no_line_however_oblique_it_is_in_the_frame() {
    // Material beside the lines, and lines that stand alone.
    for px in [240, 500] {
        let rms = placed_px(px);
        println!("{px}: {rms}");
        assert!(rms < 8e-4, "{px}: {rms}");
    }
}
