//! `gonia calibrate`: a rig's geometry from its own frames.

use crate::progress::Progress;
use crate::say::outln;
use crate::{remarks, table};
use anyhow::{Context, Result};
use gonia_acquire::session::{RIG, now};
use gonia_brdf::Elementary;
use gonia_formats::{CaptureFolder, check_output, rig_toml, write_whole_bytes};
use gonia_pipeline::calibrate::{LightState, Number, NumberState, Spread};
use gonia_pipeline::{Calibrated, calibrate};
use gonia_report::files::CALIBRATION_FIGURE;
use gonia_rig::{Role, rig_remarks};
use std::path::{Path, PathBuf};

/// Finds the rig's geometry from the frames of a capture folder: the camera and its arm from the fiducial
/// lines, the light and its arm from the shading on the reference.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia calibrate capture/                   # prints what it finds\n  gonia calibrate capture/ -o rig.toml       # and writes a rig.toml to use from now on\n\nFrames need poses of many directions; 60 of the reference are plenty. Lines are found although the\ncamera is rolled by 5 degrees, aims 40 mm aside, is 5 % nearer, or the arms' zeros are off by 2 degrees.\nWithout -o nothing is written; with it, calibration.svg beside it shows what lines and shading leave, and\ngonia report shows that picture. The rig that is written holds the numbers found and a table [calibration]\nwith their uncertainties; comments and the order of keys are not kept. A rig that was calibrated can be\ncalibrated again: its own numbers are the first guess then. The light needs frames of role 'reference'\nwhose reflectance [reference] gives, or of a reference that is smooth and reciprocal; without any, a matt\nmaterial shows it too, less well."
)]
pub struct Calibrate {
    /// The capture folder
    folder: PathBuf,
    /// Where to write the calibrated rig [default: nowhere]
    #[arg(short, long, value_name = "RIG")]
    output: Option<PathBuf>,
}

impl Calibrate {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if let Some(output) = &self.output {
            check_output(output, &[&self.folder.join("frames.csv")])?;
        }
        let progress = Progress::new();
        let folder = CaptureFolder::open(&self.folder)?;
        let mut calibrated = calibrate(folder.rig(), &folder, &progress.watch())
            .with_context(|| self.folder.display().to_string())?;
        if let Some(calibration) = &mut calibrated.rig.calibration {
            calibration.date = now();
        }
        remarks::print(&rig_remarks(self.folder.join(RIG).display(), folder.rig()));
        remarks::print(&calibrated.remarks);
        print_numbers(&calibrated.numbers);
        let mut rows = describe(&calibrated);
        if let Some(output) = &self.output {
            rig_toml::write_rig(output, &calibrated.rig)?;
            let figure = output.with_file_name(CALIBRATION_FIGURE);
            write_figure(&figure, &calibrated)?;
            rows.push((
                "written".into(),
                format!("{}, {}", output.display(), figure.display()),
            ));
        }
        table::print(&rows);
        Ok(())
    }
}

/// Draws what the calibration leaves.
pub fn write_figure(path: &Path, calibrated: &Calibrated) -> Result<()> {
    let drawn = gonia_report::calibration(&calibrated.residuals);
    Ok(write_whole_bytes(path, drawn.as_bytes())?)
}

/// The numbers, a line each.
fn print_numbers(numbers: &[Number]) {
    let head = ["number", "rig.toml", "found", "u", "prior", ""];
    let mut lines = vec![head.map(str::to_owned)];
    for number in numbers {
        // Two digits of the uncertainty, and as many decimals of the value.
        let decimals = (1.0 - number.u.decimal_log().floor()).clamp(0.0, 9.0) as usize;
        let show = |value: f64| format!("{value:.decimals$}");
        let state = match number.state {
            NumberState::Found => format!("{:.0} % determined", 100.0 * number.determined()),
            NumberState::Undetermined => "the frames do not tell".to_owned(),
            NumberState::NotNeeded => "kept: the frames do not need it".to_owned(),
        };
        lines.push([
            number.name.to_owned(),
            show(number.nominal),
            show(number.found),
            show(number.u),
            show(number.prior),
            state,
        ]);
    }
    let width = |k: usize| lines.iter().map(|l| l[k].len()).max().unwrap_or(0);
    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(width);
    for [name, nominal, found, u, prior, state] in &lines {
        outln!("{name:<a$}  {nominal:>b$}  {found:>c$}  {u:>d$}  {prior:>e$}  {state}");
    }
}

/// What the calibration stands on, and what it means for directions.
pub fn describe(found: &Calibrated) -> Vec<(String, String)> {
    let row = |name: &str, value: String| (name.to_owned(), value);
    let angles = |s: Spread| format!("{:.3} / {:.3} / {:.3} deg", s.p50, s.p95, s.max);
    let mut rows = vec![
        row(
            "frames",
            format!("{} looked at, {} used", found.frames[0], found.frames[1]),
        ),
        row(
            "lines",
            format!(
                "{:.2} px off before, {:.3} px after (RMS, median frame)",
                found.lines_px[0], found.lines_px[1]
            ),
        ),
        row(
            "camera's arm",
            format!(
                "repeats within {:.4} deg in theta, {:.4} deg in phi",
                found.camera_arm_deg[0], found.camera_arm_deg[1]
            ),
        ),
    ];
    rows.extend(describe_light(&found.light));
    if let Some(mirror) = &found.mirror {
        rows.push(row(
            "mirror",
            format!(
                "{} frames: the light's image {:.1} px off before, {:.2} px after (RMS); it lies {:+.1} mm above the target, tilted by {:+.2}, {:+.2} deg",
                mirror.frames,
                mirror.highlight_px[0],
                mirror.highlight_px[1],
                mirror.height_mm,
                mirror.tilt_deg[0],
                mirror.tilt_deg[1]
            ),
        ));
    }
    let [light, view] = found.changes;
    rows.push(row(
        "light moved by",
        format!("{} (median / p95 / max)", angles(light)),
    ));
    rows.push(row(
        "view moved by",
        format!("{} (median / p95 / max)", angles(view)),
    ));
    let [light, view] = found.direction_u;
    if let LightState::Found { .. } | LightState::FoundByMirror { .. } = found.light {
        rows.push(row("u of light", angles(light)));
    }
    rows.push(row("u of view", angles(view)));
    rows
}

fn describe_light(light: &LightState) -> Vec<(String, String)> {
    let row = |name: &str, value: String| (name.to_owned(), value);
    match *light {
        LightState::Found {
            surface,
            frames,
            shading,
            lamp,
            arm_deg,
        } => vec![
            row(
                "shading",
                format!(
                    "{:.2} % off before, {:.2} % after (RMS, median of {frames} frames of the {})",
                    100.0 * shading[0],
                    100.0 * shading[1],
                    match surface {
                        Role::Material => "material, of which nothing is known",
                        _ => "reference",
                    }
                ),
            ),
            row("lamp", format!("steady within {:.2} %", 100.0 * lamp)),
            row(
                "light's arm",
                format!(
                    "repeats within {:.4} deg in theta, {:.4} deg in phi",
                    arm_deg[0], arm_deg[1]
                ),
            ),
        ],
        LightState::FoundByMirror { frames } => vec![row(
            "light",
            format!(
                "found by its image in the mirror of {frames} frames; its beam is left as it is"
            ),
        )],
        LightState::NoReference { frames, needed } => vec![row(
            "light",
            format!(
                "left as it is: {frames} frames of the reference, or without one of the material, show anything, and {needed} are needed"
            ),
        )],
        LightState::Unlike {
            surface,
            level,
            within,
        } => {
            let by = format!(
                "levels differ by {:.1} %, values of a frame by {:.1} %",
                100.0 * level,
                100.0 * within
            );
            let why = match surface {
                Role::Material => format!(
                    "left as it is: the material is not smooth enough to show it ({by}); take frames of a white reference, or of a mirror"
                ),
                _ => format!(
                    "left as it is: the reference does not scatter as rig.toml says ({by}); give its reflectance, or a more diffuse one"
                ),
            };
            vec![row("light", why)]
        }
        LightState::NotTold { frames, u_deg } => {
            let told = match u_deg {
                Some(u_deg) => format!("tell its directions to {u_deg:.2} deg only"),
                None => "do not tell where it is".to_owned(),
            };
            vec![row(
                "light",
                format!(
                    "left as it is: {frames} frames of the material {told}; take frames of a white reference, or of a mirror"
                ),
            )]
        }
    }
}
