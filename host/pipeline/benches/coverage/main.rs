//! Whether U (k = 2) is true: sessions whose rigs, references, lamps and cameras have errors drawn from the stated
//! uncertainties, from frames to cells, against the truth.
//!
//! `cargo bench -p gonia-pipeline --bench coverage [-- SESSIONS] [--poses N] [--inputs] [MATERIAL …]` prints, for each
//! material and part of the domain, the share of cells (all but extrapolated ones) whose true value lies within U of the
//! found one, with its standard error by the sessions' scatter: of so many sessions with all errors, then of a quarter as
//! many that have noise and interpolation alone. With `--inputs` it says what each input's error changes, against what the
//! budget says. Without materials it goes on with sessions that have one error alone, against the same sessions without it.

#![allow(clippy::expect_used, clippy::unwrap_used)]

mod alone;
mod count;
mod inputs;
mod materials;
mod session;

use alone::Baseline;
use count::{Bar, Counts, PARTS, Sessions};
use gonia_brdf::model::Brdf;
use gonia_pipeline::budget::{CellUncertainty, budget_of};
use gonia_pipeline::process::{Masks, process};
use gonia_pipeline::{FillOptions, Filled, fill, silent};
use gonia_rig::{Budget, Input, Scale};
use inputs::Inputs;
use materials::{OWN, UNSEEN, named};
use rayon::prelude::*;
use session::{Errors, Session, nominal, with_directions_off};
use std::ops::ControlFlow;
use std::sync::Arc;

const STEP_DEG: f64 = 6.0;
const POSES: usize = 60;

/// A session from its frames to its cells: its errors are drawn for the inputs that have any, and its budget holds these.
fn run(
    material: &Arc<dyn Brdf>,
    (seed, poses): (u64, usize),
    has: &dyn Fn(Input) -> bool,
) -> (Filled, Budget, Errors) {
    let rig = nominal(1.0);
    let errors = Errors::draw(seed, 1.0, has);
    let session = Session::new(&rig, material.clone(), errors, (seed, poses));
    let go = &|_, _| ControlFlow::Continue(());
    let mut done = process(&rig, &session, &Masks::default(), go).expect("frames are sound");
    with_directions_off(&mut done.samples, &session.errors);
    let mut budget = budget_of(&rig, done.calibration, &done.samples);
    for input in Input::ALL {
        if !has(input) {
            budget = budget.with(input, 0.0);
        }
    }
    let options = FillOptions {
        with_errors: true,
        ..FillOptions::with_step_deg(STEP_DEG)
    };
    let filled =
        fill(done.samples, Scale::Absolute, &options, &silent).expect("samples are enough");
    (filled, budget, session.errors)
}

fn counted(
    material: &Arc<dyn Brdf>,
    of: (u64, usize),
    has: &dyn Fn(Input) -> bool,
) -> (Counts, Inputs) {
    let (filled, budget, drawn) = run(material, of, has);
    let errors = filled.errors.as_ref().expect("asked for");
    let (grid, plane) = (filled.dense.grid, &filled.dense.planes[1]);
    let cells = CellUncertainty::new(grid, plane, &errors.origin, &budget).expect("its own plane");
    let bar = Bar {
        noise: &errors.standard_error[1],
        origin: &errors.origin,
        plane,
    };
    let (mut counts, mut inputs) = (Counts::default(), Inputs::of(&drawn));
    count::visit(&cells, &bar, (grid, material.as_ref()), |cell| {
        counts.add(cell);
        inputs.add(cell);
    });
    (counts, inputs)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |text: &String| text.parse::<u64>().ok();
    let at = arguments.iter().position(|a| a == "--poses");
    let poses = at.and_then(|k| arguments.get(k + 1)).and_then(number);
    let poses_of = poses.map_or(POSES, |poses| poses as usize);
    let mut rest: Vec<String> = arguments;
    if let Some(k) = at {
        rest.drain(k..(k + 2).min(rest.len()));
    }
    let sessions = rest.iter().find_map(number).unwrap_or(200);
    let names: Vec<&str> = OWN
        .into_iter()
        .chain(UNSEEN)
        .filter(|name| rest.iter().any(|a| a == name))
        .collect();
    let is_whole = names.is_empty();
    let names = if is_whole {
        OWN.into_iter().take(4).collect()
    } else {
        names
    };
    let columns = PARTS.map(count::name).join(" | ");
    println!(
        "| within U (k = 2), % | sessions | {columns} | RMS of error/u | of misses above U, % |"
    );
    println!("|---|---{}|---|---|", "|---".repeat(PARTS.len()));
    let mut of_inputs = Vec::new();
    for name in &names {
        let material = named(name);
        // Sessions of their own: materials that shared theirs would be right or wrong together.
        let at = OWN.iter().chain(&UNSEEN).position(|of| of == name);
        let first = 1000 * (1 + at.unwrap_or(0) as u64);
        for (what, all) in [("", true), (", noise and interpolation alone", false)] {
            let count = if all { sessions } else { sessions.div_ceil(4) };
            let (counts, inputs): (Vec<Counts>, Vec<Inputs>) = (0..count)
                .into_par_iter()
                .map(|seed| counted(&material, (first + seed, poses_of), &|_| all))
                .unzip();
            println!("| {name}{what} | {} |", Sessions(counts));
            let sum = inputs.into_iter().reduce(|sum, of| sum.join(&of));
            of_inputs.extend(sum.filter(|_| all).map(|sum| (*name, sum)));
        }
    }
    if rest.iter().any(|a| a == "--inputs") {
        of_inputs.iter().for_each(|(name, of)| of.print(name));
    }
    if is_whole {
        each_alone();
    }
}

/// Prints what each input's error changes by itself.
fn each_alone() {
    println!(
        "\n| error alone | size found over true | explained, % | within U, % | left out, % | cells |"
    );
    println!("|---|---|---|---|---|---|");
    let baseline = Baseline::new();
    for input in Input::ALL {
        let of = baseline.with_error_of(input);
        println!(
            "| {} | {:.2} | {:.1} | {:.1} | {:.1} | {} |",
            input.key(),
            of.ratio,
            100.0 * of.explained,
            100.0 * of.within,
            100.0 * of.left_out,
            of.shown_by
        );
    }
}
