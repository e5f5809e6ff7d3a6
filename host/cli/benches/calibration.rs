//! How well `gonia calibrate` finds rigs: directions of light and view against the truth, by the number of
//! frames, their width, their noise, and how much of the rig is off; and what it costs.
//!
//! `cargo bench -p gonia --bench calibration [-- --out DIR]` prints a table, a row for each setting (the others
//! as in the first row; the median of several rigs, each off in every number at random), and writes
//! `calibration.svg`. A second table has CPU time, without that of making the frames: of a session of 8505 poses
//! too, whose frames are made when they are read.

#![allow(clippy::expect_used, clippy::unwrap_used)]

use cpu_time::{ProcessTime, ThreadTime};
use drawing::{Line, draw};
use gonia_brdf::Pose;
use gonia_formats::FileError;
use gonia_pipeline::calibrate::LightState;
use gonia_pipeline::process::FrameSource;
use gonia_pipeline::{Calibrated, Step, calibrate, silent};
use gonia_rig::{Frame, FrameRow, Role};
use rendered::{Rendered, Scatter, crooked, errors, nominal, random_rows, rings};
use std::ops::ControlFlow;
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

mod drawing;
#[path = "../../pipeline/tests/rendered/mod.rs"]
mod rendered;

/// Rigs of a row.
const RIGS: u64 = 3;

/// What frames there are, and of what rig.
#[derive(Clone, Copy)]
struct Setting {
    frames: usize,
    px: usize,
    noise: f64,
    /// Share of what a calibration allows for.
    off: f64,
}

const USUAL: Setting = Setting {
    frames: 40,
    px: 240,
    noise: 0.01,
    off: 0.5,
};

/// Median over the rigs.
struct Row {
    /// Of light and view: median, 95th percentile and largest error over the paper's poses, degrees.
    error_deg: [[f64; 3]; 2],
    /// The 95th percentile of the stated standard uncertainty.
    u_deg: [f64; 2],
    /// Rigs that were refused, or whose light was left as it was.
    lost: usize,
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let out = arguments
        .iter()
        .position(|a| a == "--out")
        .and_then(|at| arguments.get(at + 1));
    println!("| changed | light: p50 | p95 | max | u p95 | view: p50 | p95 | max | u p95 | lost |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let with = |change: &dyn Fn(&mut Setting)| {
        let mut setting = USUAL;
        change(&mut setting);
        setting
    };
    let usual = row(USUAL);
    print_row("nothing: 40 frames of 240 px, noise 1 %, half off", &usual);
    let panel = |name, values: &[f64], at, setting: &dyn Fn(f64) -> Setting| {
        panel(name, values, (at, &usual), setting)
    };
    let frames = panel("frames", &[12.0, 24.0, 80.0], USUAL.frames as f64, &|n| {
        with(&|s| s.frames = n as usize)
    });
    let widths = panel("px", &[160.0, 320.0], USUAL.px as f64, &|px| {
        with(&|s| s.px = px as usize)
    });
    let noise = panel("noise", &[0.003, 0.03], USUAL.noise, &|noise| {
        with(&|s| s.noise = noise)
    });
    let off = panel("off", &[0.25, 1.0], USUAL.off, &|off| {
        with(&|s| s.off = off)
    });
    if let Some(out) = out {
        let svg = draw(&[], &[frames, widths, noise, off]);
        std::fs::write(std::path::Path::new(out).join("calibration.svg"), svg)
            .expect("the drawing is written");
    }
    println!();
    println!("| session | frames looked at | core-s | of them once frames are sampled |");
    println!("|---|---|---|---|");
    cost("60 frames of 240 px", few_rows(60));
    cost("8505 poses of material and reference, 240 px", plan_rows());
}

/// Rows of a table and a panel of the drawing: one number of the setting changes; at the usual one the row is known.
fn panel<'a>(
    name: &'a str,
    values: &[f64],
    usual: (f64, &Row),
    setting: &dyn Fn(f64) -> Setting,
) -> Line<'a> {
    let mut series = [("light, p95", 0), ("view, p95", 1)]
        .map(|(name, which)| (name.to_owned(), which, Vec::new()));
    let mut add = |value: f64, row: &Row| {
        for (_, which, points) in &mut series {
            points.push((value, row.error_deg[*which][1]));
        }
    };
    add(usual.0, usual.1);
    for value in values {
        let row = row(setting(*value));
        print_row(&format!("{name} {value}"), &row);
        add(*value, &row);
    }
    for (_, _, points) in &mut series {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    Line {
        name: "error of directions, degrees",
        x: name,
        series: series.map(|(name, _, points)| (name, points)).to_vec(),
        log: true,
    }
}

fn row(setting: Setting) -> Row {
    let mut of: [[Vec<f64>; 4]; 2] = Default::default();
    let mut lost = 0;
    for seed in 0..RIGS {
        let truth = crooked(setting.px, setting.off, 500 + seed);
        let scatter = Scatter {
            jitter_deg: 0.01,
            noise: setting.noise,
            beam: seed % 2 == 1,
            gloss: 0.0,
            seed,
        };
        let rows = random_rows(Role::Reference, setting.frames, seed);
        let source = Rendered::scattered(&truth, rows, &scatter);
        let found = calibrate(&nominal(setting.px), &source, &silent);
        let Some(found) = found.ok().filter(has_light) else {
            lost += 1;
            continue;
        };
        let errors = errors(&found.rig, &truth);
        for which in [0, 1] {
            for (values, value) in of[which].iter_mut().zip(errors[which]) {
                values.push(value);
            }
            of[which][3].push(found.direction_u[which].p95);
        }
    }
    let middle = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let of = of.map(|values| values.map(middle));
    Row {
        error_deg: of.map(|[a, b, c, _]| [a, b, c]),
        u_deg: of.map(|[_, _, _, u]| u),
        lost,
    }
}

fn has_light(found: &Calibrated) -> bool {
    matches!(found.light, LightState::Found { .. })
}

fn print_row(name: &str, row: &Row) {
    let of = |which: usize| {
        let [p50, p95, max] = row.error_deg[which];
        format!("{p50:.4} | {p95:.4} | {max:.4} | {:.4}", row.u_deg[which])
    };
    println!(
        "| {name} | {} | {} | {} of {RIGS} |",
        of(0),
        of(1),
        row.lost
    );
}

/// Frames that are made when they are read, and the time that this takes.
struct Made {
    truth: gonia_rig::Rig,
    rows: Vec<FrameRow>,
    making: Mutex<Duration>,
}

impl FrameSource for Made {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let before = ThreadTime::now();
        let rendered = Rendered::new(&self.truth, vec![row.clone()], 0.01);
        let frame = rendered.load(row);
        let spent = before.elapsed();
        *self.making.lock().expect("no thread fails with it") += spent;
        frame
    }
}

fn cost(name: &str, rows: Vec<FrameRow>) {
    let px = USUAL.px;
    let source = Made {
        truth: crooked(px, USUAL.off, 500),
        rows,
        making: Mutex::new(Duration::ZERO),
    };
    let before = ProcessTime::now();
    let sampled = OnceLock::new();
    let watch = |step: Step, _: f64| {
        if step == Step::SolvingGeometry {
            sampled.get_or_init(|| before.elapsed().as_secs_f64());
        }
        ControlFlow::Continue(())
    };
    let found = calibrate(&nominal(px), &source, &watch);
    let all = before.elapsed().as_secs_f64();
    let solving = all - sampled.get().copied().unwrap_or(all);
    let making = source.making.lock().expect("as above").as_secs_f64();
    match found {
        Ok(found) => println!(
            "| {name} | {} | {:.1} | {solving:.1} |",
            found.frames[0],
            all - making
        ),
        Err(error) => println!("| {name} | {error} | {:.1} | – |", all - making),
    }
}

fn few_rows(n: usize) -> Vec<FrameRow> {
    random_rows(Role::Reference, n, 1)
}

/// The paper's plan, with the reference at every pose.
fn plan_rows() -> Vec<FrameRow> {
    let poses = rings(true)
        .into_iter()
        .flat_map(|light| rings(false).into_iter().map(move |view| (light, view)));
    let both = poses.enumerate().flat_map(|(i, ([ti, pi], [tv, pv]))| {
        [Role::Reference, Role::Material].map(|role| FrameRow {
            frame: i as u32,
            role,
            pose: Pose::from_deg([ti, pi, tv, pv]),
            file: format!("frames/{i:06}.exr"),
        })
    });
    both.collect()
}
