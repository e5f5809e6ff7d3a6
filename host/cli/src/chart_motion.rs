//! `gonia chart --motion`: the arms' speed against their accuracy.

use crate::say::{self, outln};
use anyhow::Result;
use gonia_acquire::capture::{POINTING_LIMIT_DEG, travelling};
use gonia_acquire::motion::{
    ArmRow, JerkRow, MotionRow, arm_rows, jerk_rows, motion_chart, motion_rows,
};
use gonia_brdf::Pose;
use gonia_formats::{check_writable, write_whole_bytes};
use gonia_plan::Rings;
use std::fmt::Write as _;
use std::path::Path;

/// Neighbouring poses of the plan that are run at every value, and how many such stretches.
const STRETCH: usize = 40;
const STRETCHES: usize = 10;

/// Runs the sessions, and writes `motion.svg`, `motion.csv`, `arms.csv` and `jerk.csv`.
pub fn draw(out: &Path, seed: u64) -> Result<()> {
    check_writable(out)?;
    let plan = travelling(&Rings::paper());
    let poses = plan.poses.len();
    let stretches = stretches(&plan.poses);
    let rows = motion_rows(&stretches, seed);
    let arms = arm_rows(&stretches, seed);
    let jerk = jerk_rows();
    let chart = motion_chart(&rows, &jerk, poses, POINTING_LIMIT_DEG);
    write_whole_bytes(&out.join("motion.svg"), chart.as_bytes())?;
    let table = csv_of(&rows, poses);
    write_whole_bytes(&out.join("motion.csv"), table.as_bytes())?;
    let arms = csv_of_arms(&arms, poses);
    write_whole_bytes(&out.join("arms.csv"), arms.as_bytes())?;
    write_whole_bytes(&out.join("jerk.csv"), csv_of_jerk(&jerk).as_bytes())?;
    say::out(format_args!("{table}{arms}"));
    outln!(
        "written: motion.svg, motion.csv, arms.csv and jerk.csv in {}",
        out.display()
    );
    Ok(())
}

/// Spread evenly over the plan.
fn stretches(poses: &[Pose]) -> Vec<Vec<Pose>> {
    let apart = poses.len() / STRETCHES;
    (0..STRETCHES)
        .map(|k| poses[k * apart..(k * apart + STRETCH).min(poses.len())].to_vec())
        .collect()
}

fn csv_of(rows: &[MotionRow], poses: usize) -> String {
    let mut csv = format!("setting,unit,{COLUMNS}\n");
    for row in rows {
        let _ = write!(csv, "{},{},", row.setting, row.unit);
        push_row(&mut csv, row, poses);
    }
    csv
}

fn csv_of_arms(rows: &[ArmRow], poses: usize) -> String {
    let mut csv = format!("arm,{}\n", COLUMNS.replacen("value", "deg_per_s", 1));
    for ArmRow { arm, row } in rows {
        let _ = write!(csv, "{arm},");
        push_row(&mut csv, row, poses);
    }
    csv
}

/// What both tables say of a session.
const COLUMNS: &str =
    "value,default,session_h,pose_s,p50_deg,p99_deg,max_deg,kept,given_up,recoveries,stopped";

fn push_row(csv: &mut String, row: &MotionRow, poses: usize) {
    let hours = row.pose_s * poses as f64 / 3600.0;
    let stopped = row
        .stopped
        .as_deref()
        .unwrap_or("")
        .replace([',', '"', '\n'], ";");
    // Writing to a string cannot fail.
    let _ = writeln!(
        csv,
        "{},{},{hours:.3},{:.4},{:.5},{:.5},{:.5},{},{},{},{stopped}",
        row.value,
        u8::from(row.is_default),
        row.pose_s,
        row.p50_deg,
        row.p99_deg,
        row.max_deg,
        row.kept,
        row.given_up,
        row.recoveries,
    );
}

fn csv_of_jerk(rows: &[JerkRow]) -> String {
    let mut csv = "acceleration_deg_s2,rise_ms,default,motion_s,settled_s,slowest_arm_s,own_arm_s,swing_deg\n".to_owned();
    for row in rows {
        let _ = writeln!(
            csv,
            "{},{},{},{:.4},{:.4},{:.4},{:.4},{:.5}",
            row.acceleration,
            row.rise_ms,
            u8::from(row.is_default),
            row.motion_s,
            row.settled_s,
            row.slowest_s,
            row.own_s,
            row.swing_deg
        );
    }
    csv
}
