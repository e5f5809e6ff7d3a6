//! `gonia render`: what a material looks like.

use crate::colours::read_colours;
use crate::output;
use crate::progress::Progress;
use anyhow::{Context, Result, bail};
use gonia_brdf::Brdf;
use gonia_brdf::Elementary;
use gonia_formats::frame_exr::{Precision, write_frame_as};
use gonia_formats::photo::read_photo;
use gonia_formats::write_whole_bytes;
use gonia_render as render;
use gonia_render::{Environment, Light, Picture, Tabulated, png, tone};
use gonia_rig::Frame;
use std::path::{Path, PathBuf};

/// Draws a sphere or a draped cylinder of the material, in linear light, under directional lights
/// that stand for an environment, or under one.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia render dense.exr -o sphere.png --light sky\n\nAn environment is a latitude-longitude OpenEXR: its first row looks up, its middle column where the\ncamera looks. The whole picture can be kept in linear light with --linear."
)]
pub struct Render {
    /// The dense BRDF
    dense: PathBuf,
    /// The picture (PNG)
    #[arg(short, long, value_name = "PICTURE.png")]
    output: PathBuf,
    /// The same in linear light (OpenEXR)
    #[arg(long, value_name = "PICTURE.exr")]
    linear: Option<PathBuf>,
    /// What is covered with the material
    #[arg(long, value_enum, default_value = "sphere")]
    shape: Shape,
    /// sky, above (one light, 40 degrees above the line of sight), studio, or an environment (.exr)
    #[arg(long, default_value = "sky", value_name = "LIGHT")]
    light: String,
    /// Most lights an environment is stood for by
    #[arg(long, default_value_t = 512, value_name = "N")]
    lights: usize,
    /// Side of the picture in pixels
    #[arg(long, default_value_t = 512, value_name = "PX")]
    px: usize,
    /// Stops brighter than what is chosen by itself
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "STOPS",
        allow_hyphen_values = true
    )]
    exposure: f32,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum Shape {
    Sphere,
    Cylinder,
}

impl Render {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        for (name, value, most) in [("--px", self.px, 8192), ("--lights", self.lights, 100_000)] {
            if !(1..=most).contains(&value) {
                bail!("{name} {value}: must lie in 1..={most}");
            }
        }
        if !(-20.0..=20.0).contains(&self.exposure) {
            bail!("--exposure {}: must lie in -20..=20 stops", self.exposure);
        }
        let environment = Path::new(&self.light);
        let inputs = [&*self.dense, environment];
        output::check_picture(&self.output, &["png"], &inputs)?;
        if let Some(linear) = &self.linear {
            output::check_picture(linear, &["exr"], &inputs)?;
        }
        let lights = lights_of(&self.light, self.lights)?;
        let progress = Progress::new();
        let file = progress.stage("reading the dense BRDF", |_| read_colours(&self.dense))?;
        let brdf = Tabulated::new(&file.brdf);
        let draw: fn(&dyn Brdf, &[Light], usize, usize) -> Picture = match self.shape {
            Shape::Sphere => render::sphere,
            Shape::Cylinder => render::cylinder,
        };
        let picture = progress.stage(&format!("drawing with {} lights", lights.len()), |_| {
            anyhow::Ok(draw(&brdf, &lights, self.px, 1).with_smooth_outline())
        })?;
        let exposure = picture.exposure(0.985, 0.82) * 2f32.power(self.exposure);
        let pixels = tone::picture_rgba(&picture, exposure);
        write_whole_bytes(
            &self.output,
            &png::rgba(&pixels, picture.width, picture.height),
        )?;
        if let Some(path) = &self.linear {
            write_linear(path, &picture)?;
        }
        Ok(())
    }
}

/// The lights of a name, or of an environment.
pub fn lights_of(name: &str, most: usize) -> Result<Vec<Light>> {
    Ok(match name {
        "sky" => Environment::sky().lights(most),
        "above" => render::single(),
        "studio" => render::studio(),
        path if path.ends_with(".exr") => {
            let Frame { width, height, rgb } = read_photo(Path::new(path))?;
            if width != 2 * height {
                bail!(
                    "--light {path}: has {width} × {height} pixels; give a latitude-longitude map, twice as wide as high"
                );
            }
            Environment::new(width, height, rgb)
                .with_context(|| format!("{path}: nothing in it shines"))?
                .lights(most)
        }
        other => bail!("--light {other}: choose sky, above, studio, or an environment (.exr)"),
    })
}

/// A picture in linear light, black where there is no surface.
fn write_linear(path: &Path, picture: &Picture) -> Result<()> {
    let covered = picture.rgb.iter().zip(&picture.cover);
    let frame = Frame {
        width: picture.width,
        height: picture.height,
        rgb: covered.map(|(rgb, cover)| rgb.map(|v| v * cover)).collect(),
    };
    write_frame_as(path, &frame, Precision::Single)?;
    Ok(())
}
