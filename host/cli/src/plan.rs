//! `gonia plan`: what a session will do, without doing it.

use crate::plan_adaptive::{expectation, propose};
use crate::symmetry::SymmetryArgument;
use crate::{output, remarks, table};
use anyhow::{Result, bail};
use gonia_acquire::capture::{
    SETTLE_TIME_S, keep_apart, travelling, travelling_order, travelling_some,
};
use gonia_brdf::{Pose, SymmetryKind};
use gonia_formats::plan_csv::write_plan_csv;
use gonia_formats::rig_toml::read_rig;
use gonia_imaging::SamplingGrid;
use gonia_plan as plan;
use gonia_plan::{RingList, Rings};
use gonia_protocol::settings::{Axis, Key};
use gonia_rig::{Rig, rig_remarks};
use std::path::{Path, PathBuf};

/// Bytes of a pixel in a frame's file: three half floats.
const BYTES_A_PIXEL: u64 = 6;
/// Bytes of a sample in a file: eight floats.
const BYTES_A_SAMPLE: u64 = 32;

/// Most poses that are proposed at once: ordering them takes the square of their number.
const ADD_MAX: usize = 5000;

/// Orders the poses, checks them against the arms' limits, and estimates time and disk.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia plan rig.toml -o plan.csv\n  gonia plan rig.toml --views 0:1,30:12,60:20 --lights 0:1,30:12,60:20,85:24\n  gonia plan rig.toml --adaptive samples.npy --add 500 -o more.csv\n  gonia plan rig.toml --symmetry half-turn-bilateral --plane 23 -o plan.csv\n\nA weave mostly has half-turn: half of the poses; with its threads upright on each other half-turn-bilateral: a\nquarter. Give gonia fill the same --symmetry and --plane: nothing else fills what was not measured. Without rings it is the paper's plan: 105 lights x 81 views."
)]
pub struct Plan {
    /// The rig
    rig: PathBuf,
    /// Where to write the poses (CSV); only a dry run without
    #[arg(short, long, value_name = "PLAN.csv")]
    output: Option<PathBuf>,
    /// Rings of view directions, THETA:COUNT in degrees
    #[arg(long, value_name = "RINGS")]
    views: Option<RingList>,
    /// Rings of light directions
    #[arg(long, value_name = "RINGS")]
    lights: Option<RingList>,
    /// The material's symmetry about its normal, where it is known: leave out the poses that it spares
    #[arg(long, value_enum, value_name = "SYMMETRY", conflicts_with = "adaptive")]
    symmetry: Option<SymmetryArgument>,
    /// Azimuth of the plane of a bilateral symmetry, degrees [default: 0]
    #[arg(
        long,
        value_name = "DEG",
        requires = "symmetry",
        allow_negative_numbers = true
    )]
    plane: Option<f64>,
    /// Samples measured so far (several files count together): propose the poses that lower the
    /// error of `gonia fill` most
    #[arg(long, value_name = "SAMPLES", num_args = 1.., conflicts_with_all = ["views", "lights"])]
    adaptive: Vec<PathBuf>,
    /// How many poses to propose
    #[arg(long, value_name = "N", default_value_t = 500, requires = "adaptive")]
    add: usize,
    /// Seconds a pose for exposures and read-out
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    dwell: f64,
    /// Arms that can touch: leave out poses whose light and view are nearer to each other than this,
    /// and see how the arms get past each other, in degrees [default: arms.keep_out_deg of the rig]
    #[arg(long, value_name = "DEG")]
    keep_out: Option<f64>,
}

impl Plan {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let rig = read_rig(&self.rig)?;
        remarks::print(&rig_remarks(self.rig.display(), &rig));
        if !(0.0..=86_400.0).contains(&self.dwell) {
            bail!("--dwell {}: must lie in 0..=86400 seconds", self.dwell);
        }
        let keep_out_deg = self.keep_out_deg(&rig)?;
        if !(1..=ADD_MAX).contains(&self.add) {
            bail!("--add {}: must lie in 1..={ADD_MAX} poses", self.add);
        }
        if let Some(path) = &self.output {
            let samples = self.adaptive.iter().map(PathBuf::as_path);
            let inputs: Vec<&Path> = samples.chain([&*self.rig]).collect();
            output::check_table(path, &inputs)?;
        }
        let (mut plan, proposed) = if self.adaptive.is_empty() {
            let mut rings = Rings::paper();
            if let Some(RingList(views)) = self.views {
                rings.views = views;
            }
            if let Some(RingList(lights)) = self.lights {
                rings.lights = lights;
            }
            check_limits(&rings)?;
            match self.symmetry {
                None => (travelling(&rings), Vec::new()),
                Some(asked) => spared(&rings, asked, self.plane)?,
            }
        } else {
            let proposal = propose(&rig, &self.adaptive, self.add, keep_out_deg)?;
            let plan = travelling_order(&proposal.poses);
            (plan, vec![expectation(proposal.error)])
        };
        let apart = (keep_out_deg > 0.0).then(|| keep_apart(&mut plan, keep_out_deg));
        if plan.poses.is_empty() {
            bail!("no pose is left: at each the arms would be nearer than {keep_out_deg} degrees");
        }
        let mut rows = estimate(&rig, &plan, self.dwell);
        rows.extend(proposed);
        if let Some(apart) = apart {
            rows.extend([
                (
                    "left out".into(),
                    format!(
                        "{} poses nearer than {keep_out_deg} deg, {} without a clear way",
                        table::count(apart.too_near as u64),
                        table::count(apart.out_of_reach as u64)
                    ),
                ),
                (
                    "ways round the other arm".into(),
                    table::count(apart.rounds as u64),
                ),
            ]);
        }
        if let Some(path) = &self.output {
            write_plan_csv(path, &plan.poses)?;
            rows.push(("written".into(), path.display().to_string()));
        }
        table::print(&rows);
        Ok(())
    }
}

impl Plan {
    /// The angle that light and view keep from each other. A session refuses poses below that of the rig.
    fn keep_out_deg(&self, rig: &Rig) -> Result<f64> {
        let of_rig_deg = rig.arms.as_ref().map_or(0.0, |arms| arms.keep_out_deg);
        let keep_out_deg = self.keep_out.unwrap_or(of_rig_deg);
        if !(0.0..180.0).contains(&keep_out_deg) {
            bail!("--keep-out {keep_out_deg}: must lie in 0..180 degrees");
        }
        if keep_out_deg < of_rig_deg {
            bail!(
                "--keep-out {keep_out_deg}: the arms of this rig touch below {of_rig_deg} degrees (arms.keep_out_deg in {}), and a session refuses such poses; leave --keep-out out",
                self.rig.display()
            );
        }
        Ok(keep_out_deg)
    }
}

/// The poses of rings that a symmetry leaves to measure, and what it spares, as a row.
fn spared(
    rings: &Rings,
    asked: SymmetryArgument,
    plane_deg: Option<f64>,
) -> Result<(plan::Plan, Vec<(String, String)>)> {
    let Some(symmetry) = Option::<SymmetryKind>::from(asked) else {
        bail!(
            "--symmetry auto: is found in samples, and a plan comes before them; name the symmetry, or leave it out"
        );
    };
    let has_plane = matches!(
        symmetry,
        SymmetryKind::Bilateral | SymmetryKind::HalfTurnBilateral
    );
    let plane_deg = match plane_deg {
        Some(plane) if !has_plane => {
            bail!(
                "--plane {plane}: the symmetry {} has no plane; leave it out",
                symmetry.name()
            )
        }
        Some(plane) if !(-360.0..=360.0).contains(&plane) => {
            bail!("--plane {plane}: must lie in -360..=360 degrees")
        }
        plane => plane.unwrap_or(0.0),
    };
    let needed = |pose: &Pose| plan::symmetry::is_needed(pose, symmetry, plane_deg);
    let plan = travelling_some(rings, &needed);
    let [of_plane, option] = if has_plane {
        [
            format!(" about azimuth {plane_deg}"),
            format!(" --plane {plane_deg}"),
        ]
    } else {
        [String::new(), String::new()]
    };
    let row = format!(
        "{}{of_plane}: {} of {} poses; fill with --symmetry {}{option}",
        symmetry.name(),
        table::count(plan.poses.len() as u64),
        table::count(rings.count() as u64),
        symmetry.name()
    );
    Ok((plan, vec![("symmetry".to_owned(), row)]))
}

/// Refuses polar angles beyond the controllers' default limits.
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
    ];
    if let Some(others) = plan.others {
        let row = |name: &str, time_s: f64| {
            let ratio = ratio(time_s, plan.travel_s);
            let text = format!("{} ({ratio:.2} x)", table::duration(time_s));
            (name.to_owned(), text)
        };
        rows.push(row("travelling as listed", others.listed_s));
        rows.push(row("no order is faster than", others.bound_s));
    }
    rows.extend([
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
        (
            "samples".into(),
            format!(
                "at most {}, {}",
                table::count(samples),
                table::bytes(samples * BYTES_A_SAMPLE)
            ),
        ),
    ]);
    rows
}

fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 1.0 }
}
