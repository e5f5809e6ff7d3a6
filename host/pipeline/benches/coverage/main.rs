//! Whether U (k = 2) is true: sessions whose rigs, references, lamps and cameras have errors drawn from the stated
//! uncertainties, from frames to cells, against the truth.
//!
//! `cargo bench -p gonia-pipeline --bench coverage [-- SESSIONS] [--poses N] [MATERIAL …]` prints, for each material and
//! part of the domain, the share of cells (all but extrapolated ones) whose true value lies within U of the found one:
//! of sessions with all errors, then of ones that have noise and interpolation alone. Without materials it goes on with
//! sessions that have one error alone, against the same sessions without it: how large the change is that the error
//! makes, over what the budget says of it.

#![allow(clippy::expect_used, clippy::unwrap_used)]

mod alone;
mod count;
mod materials;
mod session;

use alone::Baseline;
use count::{Bar, Counts, PARTS};
use gonia_brdf::model::Brdf;
use gonia_pipeline::budget::{CellUncertainty, budget_of};
use gonia_pipeline::process::{Masks, process};
use gonia_pipeline::{FillOptions, Filled, fill, silent};
use gonia_rig::{Budget, Input, Scale};
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
) -> (Filled, Budget) {
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
    (filled, budget)
}

fn counted(material: &Arc<dyn Brdf>, of: (u64, usize), has: &dyn Fn(Input) -> bool) -> Counts {
    let (filled, budget) = run(material, of, has);
    let errors = filled.errors.as_ref().expect("asked for");
    let plane = &filled.dense.planes[1];
    let cells = CellUncertainty::new(filled.dense.grid, plane, &budget).expect("its own plane");
    let bar = Bar {
        noise: &errors.standard_error[1],
        origin: &errors.origin,
        plane,
    };
    count::count(&cells, &bar, filled.dense.grid, material.as_ref())
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
    println!("| within U (k = 2), % | {columns} | RMS of error/u |");
    println!("|---{}|---|", "|---".repeat(PARTS.len()));
    for name in &names {
        let material = named(name);
        for (what, all) in [("", true), (", noise and interpolation alone", false)] {
            let counts = (0..sessions / 4)
                .into_par_iter()
                .map(|seed| counted(&material, (1000 + seed, poses_of), &|_| all))
                .collect::<Vec<_>>();
            println!("| {name}{what} | {} |", count::sum(&counts));
        }
    }
    if is_whole {
        each_alone();
    }
}

/// Prints what each input's error changes by itself.
fn each_alone() {
    println!("\n| error alone | size found over true | explained, % | within U, % | left out, % |");
    println!("|---|---|---|---|---|");
    let baseline = Baseline::new();
    for input in Input::ALL {
        let of = baseline.with_error_of(input);
        println!(
            "| {} | {:.2} | {:.1} | {:.1} | {:.1} |",
            input.key(),
            of.ratio,
            100.0 * of.explained,
            100.0 * of.within,
            100.0 * of.left_out
        );
    }
}
