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
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

const STEP_DEG: f64 = 6.0;
const POSES: usize = 60;

/// Which session: the seed of its material, its number, and how many poses it has.
#[derive(Clone, Copy)]
struct Of {
    seed: u64,
    number: u64,
    poses: usize,
}

/// A session from its frames to its cells: its errors are drawn for the inputs that have any, and its budget holds these.
fn run(
    material: &Arc<dyn Brdf>,
    Of {
        seed,
        number,
        poses,
    }: Of,
    has: &dyn Fn(Input) -> bool,
) -> (Filled, Budget, Errors) {
    let rig = nominal(1.0);
    let errors = Errors::draw((seed, number), has);
    let session = Session::new(&rig, material.clone(), errors, (seed + number, poses));
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

fn counted(material: &Arc<dyn Brdf>, of: Of, has: &dyn Fn(Input) -> bool) -> (Counts, Inputs) {
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

/// So many sessions of each material, then so many more.
const ROUND: usize = 8;
/// One session in so many is repeated with noise and interpolation alone.
const ALONE_ONE_IN: u64 = 4;

/// The sessions of a material.
struct OfMaterial {
    name: &'static str,
    material: Arc<dyn Brdf>,
    /// Materials that shared their sessions would be right or wrong together.
    seed: u64,
    with_errors: Sessions,
    alone: Sessions,
    inputs: Vec<Inputs>,
}

impl OfMaterial {
    fn new(name: &'static str) -> Self {
        let at = OWN.iter().chain(&UNSEEN).position(|of| *of == name);
        Self {
            name,
            material: named(name),
            seed: 1000 * (1 + at.unwrap_or(0) as u64),
            with_errors: Sessions::default(),
            alone: Sessions::default(),
            inputs: Vec::new(),
        }
    }

    /// Adds sessions of these numbers.
    fn go_on(&mut self, numbers: Range<u64>, poses: usize) {
        let both: Vec<(u64, bool)> = numbers
            .flat_map(|number| [(number, true), (number, false)])
            .filter(|(number, all)| *all || number.is_multiple_of(ALONE_ONE_IN))
            .collect();
        let counted: Vec<(bool, (Counts, Inputs))> = both
            .into_par_iter()
            .map(|(number, all)| {
                let of = Of {
                    seed: self.seed,
                    number,
                    poses,
                };
                (all, counted(&self.material, of, &|_| all))
            })
            .collect();
        for (all, (counts, inputs)) in counted {
            if all {
                self.with_errors.0.push(counts);
                self.inputs.push(inputs);
            } else {
                self.alone.0.push(counts);
            }
        }
    }
}

/// The tables of all.
fn printed(all: &[OfMaterial], with_inputs: bool) -> String {
    let columns = PARTS.map(count::name).join(" | ");
    let mut text = format!(
        "| within U (k = 2), % | sessions | {columns} | RMS of error/u | of misses above U, % |\n|---{}|---|---|---|\n",
        "|---".repeat(PARTS.len())
    );
    for of in all {
        text += &format!("| {} | {} |\n", of.name, of.with_errors);
        text += &format!("| {}, alone | {} |\n", of.name, of.alone);
    }
    for of in all.iter().filter(|_| with_inputs) {
        let inputs: Vec<&Inputs> = of.inputs.iter().collect();
        text += &inputs::table(of.name, &inputs);
    }
    text
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
    let names: Vec<&'static str> = OWN
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
    let with_inputs = rest.iter().any(|a| a == "--inputs");
    let mut all: Vec<OfMaterial> = names.into_iter().map(OfMaterial::new).collect();
    // In rounds, each of which adds some sessions to all materials: who stops early has as many of each.
    for first in (0..sessions).step_by(ROUND) {
        for of in &mut all {
            of.go_on(first..(first + ROUND as u64).min(sessions), poses_of);
        }
        if first + (ROUND as u64) < sessions {
            eprintln!("{}", printed(&all, with_inputs));
        }
    }
    println!("{}", printed(&all, with_inputs));
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
    for input in Input::ALL {
        let of = alone::with_error_of(input);
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
