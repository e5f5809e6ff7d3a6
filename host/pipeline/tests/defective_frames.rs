//! The table of what registration and sampling make of frames that are not as they should be. Each
//! case is put before the real chain at eight views, and the rows are docs/src/explanation/frames.md.
//!
//! `GONIA_UPDATE_DOCS=1 cargo test -p gonia-pipeline --test defective_frames` writes the rows; without it the
//! test fails when the page says something else.
#![allow(clippy::unwrap_used)]

use gonia_brdf::Elementary;
use gonia_brdf::direction::{angle_between, local_direction};
use gonia_brdf::model::Kurt;
use gonia_brdf::{Direction, Pose};
use gonia_imaging::{LeftOut, Registrar, RegistrationFailure, SamplingGrid, find_occlusion};
use gonia_pipeline::process::{Outcome, Refusal};
use gonia_rig::{CameraModel, CameraShift, Frame, Homography, Rig};
use gonia_sim::scene::{Scene, SceneGeometry, Surface};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

const PX: usize = 512;
const LIGHT: [f64; 2] = [30.0, 140.0];
/// The arm's reading is off by this much in θ and in φ.
const READING_OFF_DEG: f64 = 0.02;
/// A lock that has a corner further off than this has taken something else for a mark, pixels.
const WRONG_PX: f64 = 0.3;
/// The samples of a frame that is as it should be are not further off than this, degrees.
const TRUE_DEG: f64 = 0.02;

const VIEWS: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [15.0, 60.0],
    [30.0, 200.0],
    [45.0, 45.0],
    [60.0, 90.0],
    [60.0, 18.0],
    [75.0, 0.0],
    [75.0, 285.0],
];
const GRAZING: [[f64; 2]; 8] = [
    [80.0, 0.0],
    [80.0, 45.0],
    [80.0, 200.0],
    [83.0, 90.0],
    [83.0, 30.0],
    [86.0, 0.0],
    [86.0, 45.0],
    [86.0, 285.0],
];

/// A change to the frame, pixel by pixel: (value, pixel, point of the target in mm, number of the
/// pixel).
type Change = fn([f32; 3], [f64; 2], [f64; 2], usize) -> [f32; 3];

struct Case {
    name: &'static str,
    /// Changes what there is to see; the samples shall show it.
    scene: Change,
    /// Spoils it; the samples shall not show it.
    defect: Change,
    /// Standard deviation of the noise, as a share of the value and of a typical one.
    noise: [f32; 2],
    views: [[f64; 2]; 8],
    /// Principal point, away from the middle, pixels.
    shift_px: [f64; 2],
    /// Turn of the target on the desk, degrees.
    turned_deg: f64,
    surface: Surface,
    must: Must,
}

/// What no change of the code may lose.
#[derive(Clone, Copy, PartialEq)]
enum Must {
    /// Every frame is used.
    Use,
    /// Nothing is asked but that no lock is wrong.
    NotMistake,
    /// Every frame is refused.
    Refuse,
    /// A square target looks the same after a quarter turn.
    BeBlind,
}

fn same(value: [f32; 3], _: [f64; 2], _: [f64; 2], _: usize) -> [f32; 3] {
    value
}

fn case(name: &'static str, scene: Change, defect: Change, must: Must) -> Case {
    Case {
        name,
        scene,
        defect,
        noise: [0.01, 0.002],
        views: VIEWS,
        shift_px: [0.0; 2],
        turned_deg: 0.0,
        surface: Surface::Material,
        must,
    }
}

fn is_beyond_material(at: [f64; 2]) -> bool {
    at[0].abs().max(at[1].abs()) > 322.0
}

/// Evenly distributed in 0 .. 1.
fn random(seed: usize) -> f64 {
    let mut z = (seed as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

fn stripes(at: f64, period: f64) -> f32 {
    if (at.rem_euclid(period) - 0.5 * period).abs() < 2.5 {
        1.0
    } else {
        0.3
    }
}

// long: a table, one entry a case.
fn cases() -> Vec<Case> {
    use Must::{BeBlind, NotMistake, Refuse, Use};
    let vignette: Change = |v, p, _, _| {
        let r = (p[0] - 256.0).hypotenuse(p[1] - 256.0) / 256.0;
        v.map(|c| c * (1.0 / (1.0 + 1.2 * r * r)) as f32)
    };
    let parallel: Change = |v, _, at, _| {
        let on = stripes(at[0], 40.0).max(stripes(at[1], 40.0));
        if is_beyond_material(at) {
            v
        } else {
            v.map(|c| c * on)
        }
    };
    let slanting: Change = |v, _, at, _| {
        let on = stripes(at[0] + 0.5 * at[1], 30.0);
        if is_beyond_material(at) {
            v
        } else {
            v.map(|c| c * on)
        }
    };
    let low_contrast: Change = |v, _, at, _| {
        // Lines of a third more than the desk, on a desk nearly as bright as they are.
        if is_beyond_material(at) {
            v.map(|c| 0.09 + 0.1 * c)
        } else {
            v
        }
    };
    let flare: Change = |v, _, at, _| {
        let r2 = ((at[0] - 335.0).powi(2) + (at[1] - 60.0).powi(2)) / (2.0 * 12.0f64.powi(2));
        let flared = v.map(|c| c + 20.0 * (-r2).exponential() as f32);
        flared.map(|c| if c > 2.0 { f32::INFINITY } else { c })
    };
    let long_flare: Change = |v, _, at, _| {
        let r2 = ((at[0] - 332.0) / 8.0).powi(2) / 2.0;
        v.map(|c| c + 3.0 * (-r2).exponential() as f32)
    };
    let covered: Change = |v, _, at, _| {
        if at[0] < -335.0 + 0.3 * 670.0 {
            [0.001; 3]
        } else {
            v
        }
    };
    let arm_across: Change = |v, _, at, _| {
        if (at[0] - 0.3 * at[1]).abs() < 100.0 {
            [0.001; 3]
        } else {
            v
        }
    };
    let dead: Change = |v, _, _, i| match random(i) {
        r if r < 0.001 => [0.0; 3],
        r if r > 0.999 => [40.0; 3],
        _ => v,
    };
    let over: Change = |v, _, _, _| v.map(|c| if c > 0.08 { f32::INFINITY } else { c });
    let noise: Change = |_, _, _, i| [random(i) as f32; 3];
    let room: Change = |_, p, _, _| {
        let wall = 0.3 + 0.001 * p[0];
        let door = (180.0..330.0).contains(&p[0]) && p[1] > 150.0;
        [if door { 0.05 } else { wall as f32 }; 3]
    };
    let blinds: Change = |_, p, _, _| {
        [if (p[0] + 2.0 * p[1]).rem_euclid(37.0) < 4.0 {
            1.0
        } else {
            0.1
        }; 3]
    };
    let reference = |case: Case| Case {
        surface: Surface::Reference,
        ..case
    };
    vec![
        case("as it should be", same, same, Use),
        Case {
            views: GRAZING,
            ..case("grazing views, θv 80° to 86°", same, same, NotMistake)
        },
        Case {
            shift_px: [115.0, 0.0],
            ..case("one line leaves the frame", same, same, NotMistake)
        },
        Case {
            shift_px: [115.0, 115.0],
            ..case("two lines leave the frame", same, same, NotMistake)
        },
        case(
            "low contrast: lines 1.3 times as bright as the desk",
            low_contrast,
            same,
            NotMistake,
        ),
        case("vignetting to 30 % in the corners", vignette, same, Use),
        case(
            "fabric striped along the lines, every 40 mm",
            parallel,
            same,
            NotMistake,
        ),
        case(
            "fabric striped across, every 30 mm",
            slanting,
            same,
            NotMistake,
        ),
        case("a saturated flare on a line, 50 mm wide", same, flare, Use),
        case(
            "a flare along a whole line, three times as bright, beside its middle",
            same,
            long_flare,
            NotMistake,
        ),
        reference(case(
            "a body over 30 % of the target, with one line",
            same,
            covered,
            NotMistake,
        )),
        reference(case(
            "a body across the middle, 30 % of the target",
            same,
            arm_across,
            NotMistake,
        )),
        Case {
            noise: [0.1, 0.06],
            ..case("a hundredth of the light: noise of 12 %", same, same, Use)
        },
        case(
            "four times too much light, saturated pixels marked",
            same,
            over,
            NotMistake,
        ),
        case("one pixel in 500 dead or stuck", same, dead, Use),
        Case {
            turned_deg: 7.0,
            ..case("the target turned by 7° on the desk", same, same, Refuse)
        },
        Case {
            turned_deg: 90.0,
            ..case("the target turned by 90°", same, same, BeBlind)
        },
        case("a frame of noise", noise, same, Refuse),
        case("a frame of a room", room, same, Refuse),
        case("a frame of stripes", blinds, same, Refuse),
    ]
}

/// What became of a case's frames.
#[derive(Default)]
struct Row {
    locked: usize,
    by_pose: usize,
    refused: usize,
    why: Vec<&'static str>,
    /// Largest error of a sample's direction, degrees.
    locked_deg: f64,
    /// Largest error of a corner of the target, pixels.
    locked_px: f64,
    by_pose_deg: f64,
    /// |ln(value / true value)| of all samples.
    errors: Vec<f64>,
    points: usize,
    left_out: [usize; 2],
}

fn run(case: &Case) -> Row {
    let mut scene = Scene::new(
        SceneGeometry::paper(PX),
        Arc::new(Kurt::two_thread_fabric()),
        Arc::new(Kurt::white_reference_fabric()),
        11,
    );
    (scene.noise, scene.beam, scene.occluder) = (None, None, None);
    let mut rig = Rig::paper(PX);
    for i in 0..2 {
        scene.geometry.centre_px[i] += case.shift_px[i];
        rig.camera.centre_px[i] += case.shift_px[i];
    }
    let mut row = Row::default();
    for view in case.views {
        let turn = |d: [f64; 2]| Direction::from_deg(d[0], d[1] - case.turned_deg);
        // The target is turned: in its own frame light and camera turn the other way.
        let true_pose = Pose {
            light: turn(LIGHT),
            view: turn(view),
        };
        let told = Pose {
            light: Direction::from_deg(LIGHT[0], LIGHT[1]),
            view: Direction::from_deg(view[0] + READING_OFF_DEG, view[1] - READING_OFF_DEG),
        };
        let true_map = CameraModel::new(&rig).predict(true_pose.view, CameraShift::default());
        let seen = frame_of(case, &scene, true_pose, &true_map);
        look(case, &rig, &seen, true_pose, told, &true_map, &mut row);
    }
    row
}

/// What there is to see, and the frame of it.
struct Seen {
    clean: Frame,
    frame: Frame,
}

fn frame_of(case: &Case, scene: &Scene, pose: Pose, map: &Homography) -> Seen {
    let rendered = scene.render(case.surface, pose, 0);
    let inverse = map.inverse().unwrap();
    let (mut clean, mut spoilt) = (rendered.rgb.clone(), rendered.rgb);
    let typical = clean[PX / 2 * PX + PX / 2][1].max(0.05);
    for i in 0..clean.len() {
        let pixel = [(i % PX) as f64 + 0.5, (i / PX) as f64 + 0.5];
        let at = inverse.apply(pixel);
        clean[i] = (case.scene)(clean[i], pixel, at, i);
        let shown = (case.defect)(clean[i], pixel, at, i);
        for c in 0..3 {
            let sd = (case.noise[0].powi(2) * shown[c].max(0.0) * typical
                + (case.noise[1] * typical).powi(2))
            .sqrt();
            // Nearly normal: the sum of twelve.
            let n: f64 = (0..12).map(|k| random((i * 3 + c) * 12 + k)).sum();
            spoilt[i][c] = if shown[c].is_finite() {
                shown[c] + sd * (n - 6.0) as f32
            } else {
                shown[c]
            };
        }
    }
    let frame = |rgb| Frame {
        width: PX,
        height: PX,
        rgb,
    };
    Seen {
        clean: frame(clean),
        frame: frame(spoilt),
    }
}

// long: one frame through the whole chain, each step compared with its truth.
fn look(
    case: &Case,
    rig: &Rig,
    seen: &Seen,
    truth: Pose,
    told: Pose,
    map: &Homography,
    row: &mut Row,
) {
    let registrar = Registrar::new(rig);
    let grid = SamplingGrid::new(rig);
    let found = registrar.register(&seen.frame, told);
    let outcome = Outcome::of(&found);
    if let Outcome::Refused(refusal) = outcome {
        row.refused += 1;
        let why = match refusal {
            Refusal::NotTheTarget(RegistrationFailure::LinesMissing { .. }) => "too few lines",
            Refusal::NotTheTarget(RegistrationFailure::WrongLayout { .. }) => {
                "lines not laid out as the target's"
            }
            Refusal::NotTheTarget(RegistrationFailure::FarFromPose { .. }) => {
                "lines far from the pose"
            }
            Refusal::NotTheTarget(RegistrationFailure::Displaced { .. }) => {
                "target elsewhere in the frame"
            }
            Refusal::NotTheTarget(RegistrationFailure::Rolled { .. }) => "camera rolled",
            Refusal::NotTheTarget(RegistrationFailure::Resized { .. }) => "another size",
            Refusal::NotTheTarget(RegistrationFailure::Turned(_)) => "turned or mirrored",
            Refusal::NotTheTarget(RegistrationFailure::TargetTurned(_)) => "target turned",
            Refusal::NoReference | Refusal::Unusable => "no reference",
        };
        if !row.why.contains(&why) {
            row.why.push(why);
        }
        return;
    }
    let mask = match case.surface {
        Surface::Reference => find_occlusion(&seen.frame, &found, told.light, rig),
        Surface::Material | Surface::Mirror => None,
    };
    let values = grid.sample(&seen.frame, &found, mask.as_ref());
    // The same places of what there is to see, without noise and defect.
    let clean = grid.sample(&seen.clean, &found, None);
    let back = map.inverse().unwrap();
    let metres = |p: [f64; 2]| p.map(|c| c * 1e-3);
    let mut worst: f64 = 0.0;
    for ((at, value), clean) in grid.points_mm().iter().zip(&values).zip(&clean) {
        row.points += 1;
        match (value, clean) {
            (Ok(value), Ok(clean)) => row.errors.push(
                f64::from(value.rgb[1].max(1e-6) / clean.rgb[1].max(1e-6))
                    .natural_log()
                    .abs(),
            ),
            (Err(LeftOut::Occlusion), _) => row.left_out[0] += 1,
            (Err(_), _) => row.left_out[1] += 1,
            (Ok(_), Err(_)) => {}
        }
        if value.is_ok() {
            let there = back.apply(found.project(*at));
            let light = angle_between(
                local_direction(told.light, rig.light.distance_m, metres(*at)),
                local_direction(truth.light, rig.light.distance_m, metres(there)),
            );
            let view = angle_between(
                local_direction(found.view, rig.camera.distance_m, metres(*at)),
                local_direction(truth.view, rig.camera.distance_m, metres(there)),
            );
            worst = worst.max(light.max(view).to_degrees());
        }
    }
    if outcome == Outcome::Locked {
        row.locked += 1;
        row.locked_deg = row.locked_deg.max(worst);
        for corner in [
            [-335.0, -335.0],
            [335.0, -335.0],
            [335.0, 335.0],
            [-335.0, 335.0],
        ] {
            let (a, b) = (found.project(corner), map.apply(corner));
            row.locked_px = row.locked_px.max((a[0] - b[0]).hypotenuse(a[1] - b[1]));
        }
    } else {
        row.by_pose += 1;
        row.by_pose_deg = row.by_pose_deg.max(worst);
    }
}

/// What is wrong with a row, if anything is.
fn judge(case: &Case, row: &Row) -> Option<String> {
    let name = case.name;
    let said = format!(
        "{name}: {} locked ({}), {} by pose ({}), {} refused",
        row.locked, row.locked_deg, row.by_pose, row.by_pose_deg, row.refused
    );
    let used = match case.must {
        Must::BeBlind => row.locked == VIEWS.len() && (row.locked_deg - 90.0).abs() < 40.0,
        Must::Use => row.refused == 0,
        Must::Refuse => row.refused == VIEWS.len(),
        Must::NotMistake => true,
    };
    // By the pose the samples have the error of its reading: 0.02° in each of θ and φ.
    let true_enough = case.must == Must::BeBlind
        || row.locked_px <= WRONG_PX
            && row.by_pose_deg <= 1.5 * READING_OFF_DEG
            && (case.must != Must::Use || row.locked_deg <= TRUE_DEG);
    (!(used && true_enough)).then_some(said)
}

/// The table, and what is wrong in it.
fn document() -> (String, Vec<String>) {
    let (mut text, mut wrong) = (String::from(HEAD), Vec::new());
    for case in cases() {
        let mut row = run(&case);
        wrong.extend(judge(&case, &row));
        let degrees = |n: usize, deg: f64| match n {
            0 => "–".to_owned(),
            _ => format!("{n} ({deg:.3}°)"),
        };
        let locked = match row.locked {
            0 => "–".to_owned(),
            n => format!("{n} ({:.3}°, {:.2} px)", row.locked_deg, row.locked_px),
        };
        row.errors.sort_by(f64::total_cmp);
        let share = |p: f64| row.errors.get((p * row.errors.len() as f64) as usize);
        let value = match (share(0.5), share(0.95)) {
            (Some(middle), Some(high)) => format!("{:.2} %, {:.2} %", 100.0 * middle, 100.0 * high),
            _ => "–".to_owned(),
        };
        let percent = |n: usize| format!("{:.0} %", 100.0 * n as f64 / row.points.max(1) as f64);
        let left_out = match row.left_out {
            [0, 0] => "–".to_owned(),
            [hidden, 0] => format!("{} hidden", percent(hidden)),
            [0, other] => format!("{} saturated or outside", percent(other)),
            [hidden, other] => {
                format!(
                    "{} hidden, {} saturated or outside",
                    percent(hidden),
                    percent(other)
                )
            }
        };
        let mut refused = row.refused.to_string();
        if row.refused > 0 {
            let _ = write!(refused, ": {}", row.why.join("; "));
        }
        let _ = writeln!(
            text,
            "| {} | {locked} | {} | {refused} | {value} | {left_out} |",
            case.name,
            degrees(row.by_pose, row.by_pose_deg),
        );
    }
    (text, wrong)
}

const HEAD: &str = "\
| case | locked | by its pose | refused | value | points left out |
|---|---|---|---|---|---|
";

/// The page with these rows between its two marks.
fn with_rows(page: &str, rows: &str) -> String {
    let (open, close) = ("<!-- rows -->\n", "<!-- /rows -->");
    let (before, rest) = page.split_once(open).unwrap();
    let (_, after) = rest.split_once(close).unwrap();
    format!("{before}{open}{rows}{close}{after}")
}

#[test]
fn no_frame_is_locked_wrongly_and_the_table_says_what_becomes_of_it() {
    let (rows, wrong) = document();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/explanation/frames.md");
    assert!(wrong.is_empty(), "{wrong:#?}\n{rows}");
    let written = std::fs::read_to_string(&path).unwrap();
    let page = with_rows(&written, &rows);
    if std::env::var_os("GONIA_UPDATE_DOCS").is_some() {
        std::fs::write(&path, &page).unwrap();
        return;
    }
    assert!(
        written == page,
        "docs/src/explanation/frames.md is out of date: run this test with GONIA_UPDATE_DOCS=1"
    );
}
