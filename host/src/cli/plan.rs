//! `gonia plan`: what a session will do, without doing it.

use super::table;
use crate::capture::{SETTLE_TIME_S, move_time_s};
use crate::dataset::plan_csv::write_plan_csv;
use crate::dataset::rig_toml::read_rig;
use crate::dataset::{Rig, check_writable};
use crate::plan::{self, RingList, Rings};
use crate::vision::SamplingGrid;
use anyhow::{Result, bail};
use gonia_brdf::Direction;
use gonia_protocol::settings::{Axis, Key};
use std::path::PathBuf;

/// Bytes of a pixel in a frame's file: three half floats.
const BYTES_A_PIXEL: u64 = 6;
/// Bytes of a sample in a file: eight floats.
const BYTES_A_SAMPLE: u64 = 32;

/// Orders the poses, checks them against the arms' limits, and estimates time and disk.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia plan rig.toml -o plan.csv\n  gonia plan rig.toml --views 0:1,30:12,60:20 --lights 0:1,30:12,60:20,85:24\n\nWithout rings it is the paper's plan: 105 lights x 81 views."
)]
pub struct Plan {
    /// The rig
    rig: PathBuf,
    /// Where to write the poses (CSV); only a dry run without
    #[arg(short, long, value_name = "PLAN.csv")]
    output: Option<PathBuf>,
    /// Rings of view directions, ELEVATION:COUNT in degrees
    #[arg(long, value_name = "RINGS")]
    views: Option<RingList>,
    /// Rings of light directions
    #[arg(long, value_name = "RINGS")]
    lights: Option<RingList>,
    /// Seconds a pose for exposures and read-out
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    dwell: f64,
}

impl Plan {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let rig = read_rig(&self.rig)?;
        if !(0.0..=86_400.0).contains(&self.dwell) {
            bail!("--dwell {}: must lie in 0..=86400 seconds", self.dwell);
        }
        let mut rings = Rings::paper();
        if let Some(RingList(views)) = self.views {
            rings.views = views;
        }
        if let Some(RingList(lights)) = self.lights {
            rings.lights = lights;
        }
        check_limits(&rings)?;
        if let Some(path) = &self.output {
            check_writable(super::fill::folder_of(path))?;
        }
        let plan = travelling(&rings);
        let mut rows = estimate(&rig, &plan, self.dwell);
        if let Some(path) = &self.output {
            write_plan_csv(path, &plan.poses)?;
            rows.push(("written".into(), path.display().to_string()));
        }
        table::print(&rows);
        Ok(())
    }
}

/// The plan of some rings in the arms' own travelling times.
pub fn travelling(rings: &Rings) -> plan::Plan {
    plan::plan(rings, &arm_time_s, &arm_time_s)
}

/// How long an arm takes from one direction to another: its slower axis, φ the shorter way round.
fn arm_time_s(from: Direction, to: Direction) -> f64 {
    let turn = (to.phi_deg() - from.phi_deg() + 180.0).rem_euclid(360.0) - 180.0;
    let theta = move_time_s(Axis::Theta, from.theta_deg(), to.theta_deg());
    theta.max(move_time_s(Axis::Phi, 0.0, turn))
}

/// Refuses elevations beyond the controllers' default limits.
fn check_limits(rings: &Rings) -> Result<()> {
    let limit_deg = f64::from(Key::SoftMax.default_of(Axis::Theta)) * 1e-6;
    for (name, list) in [("light", &rings.lights), ("view", &rings.views)] {
        if let Some((theta, _)) = list.iter().find(|ring| ring.0 > limit_deg) {
            bail!(
                "the {name} ring at {theta} degrees is beyond the arm's limit of {limit_deg} degrees: leave it out"
            );
        }
    }
    Ok(())
}

fn estimate(rig: &Rig, plan: &plan::Plan, dwell_s: f64) -> Vec<(String, String)> {
    let poses = plan.poses.len() as u64;
    let session_s = plan.travel_s + poses as f64 * (SETTLE_TIME_S + dwell_s);
    let pixels = (rig.camera.width_px * rig.camera.height_px) as u64;
    let samples = poses * SamplingGrid::new(rig).points_mm().len() as u64;
    let mut rows = vec![
        ("poses".to_owned(), table::count(poses)),
        ("travelling".into(), table::duration(plan.travel_s)),
        (
            "travelling as listed".into(),
            format!(
                "{} ({:.2} x)",
                table::duration(plan.listed_travel_s),
                ratio(plan.listed_travel_s, plan.travel_s)
            ),
        ),
        (
            "no order is faster than".into(),
            format!(
                "{} ({:.2} x)",
                table::duration(plan.bound_s),
                ratio(plan.bound_s, plan.travel_s)
            ),
        ),
        (
            "session".into(),
            format!(
                "{} a material, with {SETTLE_TIME_S} s to settle and {dwell_s} s to expose a pose",
                table::duration(session_s)
            ),
        ),
        (
            "frames".into(),
            format!(
                "{} a material, if kept",
                table::bytes(poses * pixels * BYTES_A_PIXEL)
            ),
        ),
    ];
    rows.push((
        "samples".into(),
        format!(
            "at most {}, {}",
            table::count(samples),
            table::bytes(samples * BYTES_A_SAMPLE)
        ),
    ));
    rows
}

fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 1.0 }
}
