//! `gonia rectify`: one frame as seen from straight above.

use crate::say::outln;
use crate::{output, remarks};
use anyhow::{Result, bail};
use gonia_formats::frame_exr::{Precision, write_frame_as};
use gonia_formats::{CaptureFolder, FileError, write_whole_bytes};
use gonia_imaging::hdr::Radiance;
use gonia_imaging::rectify::{View, rectify, rectify_variance};
use gonia_imaging::{Registrar, Registration, RegistrationState};
use gonia_pipeline::bracket::{Bracket, load_bracket};
use gonia_render::{png, tone};
use gonia_rig::{Frame, Role};
use std::path::{Path, PathBuf};

/// The brightest share of a PNG's pixels that may be white.
const WHITE_SHARE: f64 = 0.005;

/// Writes one frame of a capture folder as seen from straight above: x to the right, y up. Raw
/// exposures are merged first.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia rectify capture/ 12 -o seen.png\n  gonia rectify capture/ 12 --as-taken -o merged.exr --variance variance.exr"
)]
pub struct Rectify {
    /// The capture folder
    folder: PathBuf,
    /// Number of the frame in frames.csv
    frame: u32,
    /// The reference's frame of that number, not the material's
    #[arg(long)]
    reference: bool,
    /// The image: .exr for radiance, .png to look at
    #[arg(short, long, value_name = "IMAGE")]
    output: PathBuf,
    /// Pixels a millimetre of the target [default: 2500 for 700 mm, as in the paper]
    #[arg(long, value_name = "N", default_value_t = 2500.0 / 700.0, hide_default_value = true)]
    px_per_mm: f64,
    /// The frame as the camera took it, merged but not rectified
    #[arg(long)]
    as_taken: bool,
    /// Also write the variance of each value, of raw exposures (.exr)
    #[arg(long, value_name = "EXR")]
    variance: Option<PathBuf>,
    /// Single instead of half precision in an EXR
    #[arg(long)]
    single: bool,
}

impl Rectify {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let folder = CaptureFolder::open(&self.folder)?;
        let view = View::of_target(folder.rig(), self.px_per_mm);
        // At most a gigapixel.
        if !(1..=32_768).contains(&view.side_px) || self.px_per_mm.is_nan() {
            bail!(
                "--px-per-mm {} makes an image of {} pixels a side: give 1 to 32768 pixels",
                self.px_per_mm,
                view.side_px
            );
        }
        output::check_picture(&self.output, &["exr", "png"], &[])?;
        if let Some(variance) = &self.variance {
            output::check_picture(variance, &["exr"], &[])?;
        }
        let is_exr = output::ends_in(&self.output, "exr");
        let radiance = self.load(&folder)?;
        let Radiance {
            mut frame,
            variance,
            linearity,
        } = radiance;
        if let Some(worst) = linearity {
            outln!(
                "exposures     {} s and {} s differ the most, by {:+.2} %",
                worst.shorter_s,
                worst.longer_s,
                100.0 * worst.deviation
            );
        }
        if self.variance.is_some() && variance.is_empty() {
            bail!(
                "{}: frame {} has no exposure_s in frames.csv, and its variance is not known",
                self.folder.display(),
                self.frame
            );
        }
        let mut variance = Frame {
            rgb: variance,
            ..frame
        };
        if !self.as_taken {
            let registration = self.register(&folder, &frame)?;
            frame = rectify(&frame, &registration, &view);
            if self.variance.is_some() {
                variance = rectify_variance(&variance, &registration, &view);
            }
        }
        if is_exr {
            write_frame_as(&self.output, &frame, self.precision())?;
        } else {
            write_png(&self.output, &frame)?;
        }
        outln!("written       {}", self.output.display());
        if let Some(path) = &self.variance {
            // Half precision does not reach far enough down for squares.
            write_frame_as(path, &variance, Precision::Single)?;
            outln!("variance      {}", path.display());
        }
        Ok(())
    }

    fn precision(&self) -> Precision {
        if self.single {
            Precision::Single
        } else {
            Precision::Half
        }
    }

    fn role(&self) -> Role {
        if self.reference {
            Role::Reference
        } else {
            Role::Material
        }
    }

    fn load(&self, folder: &CaptureFolder) -> Result<Radiance> {
        let row = self.row(folder)?;
        if !folder.exposures(row).is_empty() {
            let Bracket { radiance, remarks } = load_bracket(folder, row)?;
            remarks::print(&remarks);
            return Ok(radiance);
        }
        Ok(Radiance {
            frame: folder.load(row)?,
            variance: Vec::new(),
            linearity: None,
        })
    }

    fn row<'a>(&self, folder: &'a CaptureFolder) -> Result<&'a gonia_rig::FrameRow> {
        let (role, number) = (self.role(), self.frame);
        let found = folder
            .rows()
            .iter()
            .find(|row| row.role == role && row.frame == number);
        found.ok_or_else(|| {
            let list = self.folder.join("frames.csv");
            let problem = format!("there is no {} frame {number}", role.name());
            FileError::new(&list, problem, "give a number of its column frame").into()
        })
    }

    fn register(&self, folder: &CaptureFolder, frame: &Frame) -> Result<Registration> {
        let registration = Registrar::new(folder.rig()).register(frame, self.row(folder)?.pose);
        match registration.state {
            RegistrationState::Locked => outln!(
                "registered    by {} lines to {:.3} px, blur {:.2} px, camera {:+.4}, {:+.4} degrees from its reading (theta, phi)",
                registration.lines_found,
                registration.residual_px,
                registration.blur_px,
                registration.pose_offset.theta_deg,
                registration.pose_offset.phi_deg
            ),
            RegistrationState::FellBack(reason) => outln!("registered    by its pose: {reason}"),
        }
        Ok(registration)
    }
}

/// Writes a picture for the screen, exposed so that few pixels are white.
fn write_png(path: &Path, frame: &Frame) -> Result<(), FileError> {
    let mut values: Vec<f32> = frame
        .rgb
        .iter()
        .map(|p| p[0].max(p[1]).max(p[2]))
        .filter(|v| v.is_finite() && *v > 0.0)
        .collect();
    let white = if values.is_empty() {
        1.0
    } else {
        let at = ((1.0 - WHITE_SHARE) * (values.len() - 1) as f64) as usize;
        *values.select_nth_unstable_by(at, f32::total_cmp).1
    };
    let pixels: Vec<[u8; 3]> = frame
        .rgb
        .iter()
        .map(|p| tone::rgb8(*p, 1.0 / white))
        .collect();
    write_whole_bytes(path, &png::rgb(&pixels, frame.width, frame.height))
}
