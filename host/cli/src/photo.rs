//! `gonia photo`: a photograph of the material beside its render.

use crate::colours::read_colours;
use crate::output;
use crate::progress::Progress;
use crate::say::errln;
use crate::table;

use anyhow::{Result, bail};
use gonia_formats::photo::read_photo;
use gonia_formats::write_whole_bytes;
use gonia_render as render;
use gonia_render::color::{delta_e, luminance};
use gonia_render::{Picture, Tabulated, png, tone};
use gonia_rig::Frame;
use std::path::PathBuf;
use std::str::FromStr;

/// Sets a photograph of the material, bent around an upright cylinder, beside the render of its BRDF
/// in the same place under the same light, both at one exposure, and says how alike they are.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia photo dense.exr photo.png --box 410,120,890,1010 --light-up 35 -o beside.png\n\nThe box is the outline of the cylinder in the photograph: left, top, right, bottom, in pixels. The\ncamera looks at the axis squarely from afar; the light is a distant one. A PNG is taken as sRGB, an\nEXR as linear."
)]
pub struct Photo {
    /// The dense BRDF
    dense: PathBuf,
    /// The photograph, .png or .exr
    photo: PathBuf,
    /// The two side by side (PNG)
    #[arg(short, long, value_name = "BESIDE.png")]
    output: PathBuf,
    /// The cylinder's outline: left, top, right, bottom [default: the whole photograph]
    #[arg(long = "box", value_name = "L,T,R,B")]
    outline: Option<Outline>,
    /// Degrees of the light above the line of sight
    #[arg(
        long,
        default_value_t = 40.0,
        value_name = "DEG",
        allow_hyphen_values = true
    )]
    light_up: f64,
    /// Degrees of the light to the right of the line of sight
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "DEG",
        allow_hyphen_values = true
    )]
    light_right: f64,
    /// Degrees by which the material's x axis is turned anticlockwise from around the cylinder
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "DEG",
        allow_hyphen_values = true
    )]
    turn: f64,
}

/// A box of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Outline {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
}

impl FromStr for Outline {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides: Vec<usize> = text
            .split(',')
            .filter_map(|n| n.trim().parse().ok())
            .collect();
        match sides[..] {
            [left, top, right, bottom] if right >= left + 8 && bottom >= top + 8 => Ok(Self {
                left,
                top,
                right,
                bottom,
            }),
            _ => Err("four pixel numbers left,top,right,bottom, at least 8 apart".into()),
        }
    }
}

impl Photo {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if !(-89.0..=89.0).contains(&self.light_up) || !(-180.0..=180.0).contains(&self.light_right)
        {
            bail!("--light-up must lie in -89..=89 degrees, --light-right in -180..=180");
        }
        output::check_picture(&self.output, &["png"], &[&self.dense, &self.photo])?;
        let progress = Progress::new();
        let photo = read_photo(&self.photo)?;
        let outline = self.outline.unwrap_or(Outline {
            left: 0,
            top: 0,
            right: photo.width,
            bottom: photo.height,
        });
        if outline.right > photo.width || outline.bottom > photo.height {
            bail!(
                "{}: is {} × {} pixels, and --box ends at {}, {}; give the cylinder's outline in it",
                self.photo.display(),
                photo.width,
                photo.height,
                outline.right,
                outline.bottom
            );
        }
        let photo = cut(&photo, outline);
        let file = progress.stage("reading the dense BRDF", |_| read_colours(&self.dense))?;
        let lights = render::from_above(self.light_up, self.light_right);
        let size = (photo.width, photo.height);
        let picture = progress.stage("drawing", |_| {
            anyhow::Ok(render::bent(
                &Tabulated::new(&file.brdf),
                &lights,
                size,
                self.turn,
            ))
        })?;
        let likeness = Likeness::of(&photo, &picture);
        write_whole_bytes(&self.output, &beside(&photo, &picture, likeness.factor))?;
        table::print(&[
            (
                "exposure".into(),
                format!("render times {:.4}", likeness.factor),
            ),
            (
                "correlation".into(),
                format!("{:.4} of the luminances", likeness.correlation),
            ),
            ("ΔE00".into(), format!("mean {:.2}", likeness.delta_e)),
        ]);
        if !likeness.is_cylinder() {
            errln!(
                "warning: {}: does not darken from its middle as a cylinder under this light would (correlation of the columns {:.2}); check --box, --light-up and --light-right",
                self.photo.display(),
                likeness.across
            );
        }
        Ok(())
    }
}

fn cut(photo: &Frame, outline: Outline) -> Frame {
    let (width, height) = (outline.right - outline.left, outline.bottom - outline.top);
    let at = |k: usize| {
        let (x, y) = (outline.left + k % width, outline.top + k / width);
        photo.rgb[y * photo.width + x]
    };
    Frame {
        width,
        height,
        rgb: (0..width * height).map(at).collect(),
    }
}

/// Columns of a photograph of a cylinder follow its render's at least so well.
const LEAST_ACROSS: f64 = 0.5;

/// How alike two pictures of one size are.
struct Likeness {
    /// What the render is multiplied by to be as bright as the photograph, by least squares.
    factor: f32,
    /// Of the luminances, pixel by pixel.
    correlation: f64,
    /// Of the columns' luminances: what a cylinder's shape shows in, and threads do not.
    across: f64,
    /// Mean over the pixels, white at the photograph's 99th percentile.
    delta_e: f64,
}

impl Likeness {
    fn of(photo: &Frame, render: &Picture) -> Self {
        let light = |rgb: &[f32; 3]| f64::from(luminance(*rgb));
        let (a, b): (Vec<f64>, Vec<f64>) = photo
            .rgb
            .iter()
            .zip(&render.rgb)
            .map(|(a, b)| (light(a), light(b)))
            .unzip();
        let factor = product(&a, &b) / product(&b, &b).max(1e-30);
        let white = white_of(photo);
        let shown = |rgb: &[f32; 3], by: f32| rgb.map(|v| (v * by).clamp(0.0, 1.0));
        let pairs = photo.rgb.iter().zip(&render.rgb);
        let sum: f64 = pairs
            .map(|(a, b)| {
                let b = shown(b, factor as f32 / white);
                f64::from(delta_e(shown(a, 1.0 / white), b))
            })
            .sum();
        Self {
            factor: factor as f32,
            correlation: correlation(&a, &b),
            across: correlation(&columns(&a, photo.width), &columns(&b, photo.width)),
            delta_e: sum / a.len().max(1) as f64,
        }
    }

    /// Whether the photograph can be one of a cylinder in this light; a wide margin, since the BRDF
    /// may be another material's.
    fn is_cylinder(&self) -> bool {
        self.across >= LEAST_ACROSS
    }
}

fn product(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Pearson's correlation; 0 where one of both does not vary.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().max(1) as f64;
    let (mean_a, mean_b) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let about = |values: &[f64], mean: f64| values.iter().map(|v| v - mean).collect::<Vec<f64>>();
    let (a, b) = (about(a, mean_a), about(b, mean_b));
    product(&a, &b) / (product(&a, &a) * product(&b, &b)).max(1e-30).sqrt()
}

/// The sum of each column.
fn columns(values: &[f64], width: usize) -> Vec<f64> {
    let mut sums = vec![0.0; width];
    for row in values.chunks_exact(width) {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value;
        }
    }
    sums
}

/// The luminance that shows as white.
fn white_of(photo: &Frame) -> f32 {
    let mut values: Vec<f32> = photo.rgb.iter().map(|rgb| luminance(*rgb)).collect();
    let rank = (values.len() * 99 / 100).min(values.len().saturating_sub(1));
    match values.is_empty() {
        true => 1.0,
        false => values
            .select_nth_unstable_by(rank, f32::total_cmp)
            .1
            .max(1e-9),
    }
}

/// The photograph, a strip of nothing, and the render, as a PNG.
fn beside(photo: &Frame, render: &Picture, factor: f32) -> Vec<u8> {
    let white = white_of(photo);
    let gap = (photo.width / 16).max(4);
    let width = 2 * photo.width + gap;
    let mut pixels = vec![[0u8; 4]; width * photo.height];
    for y in 0..photo.height {
        for x in 0..photo.width {
            let from = y * photo.width + x;
            let opaque = |rgb: [u8; 3]| [rgb[0], rgb[1], rgb[2], 255];
            let to = y * width + x;
            pixels[to] = opaque(tone::rgb8(photo.rgb[from], 1.0 / white));
            pixels[to + photo.width + gap] = opaque(tone::rgb8(render.rgb[from], factor / white));
        }
    }
    png::rgba(&pixels, width, photo.height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::model::Kurt;

    #[test]
    fn a_photograph_of_the_material_itself_is_found_alike_and_a_turned_one_less_so() {
        let fabric = Kurt::two_thread_fabric();
        let lights = render::from_above(40.0, 0.0);
        let render = |turn| render::bent(&fabric, &lights, (64, 20), turn);
        let photo = Frame {
            width: 64,
            height: 20,
            rgb: render(0.0)
                .rgb
                .iter()
                .map(|rgb| rgb.map(|v| 0.5 * v))
                .collect(),
        };
        let same = Likeness::of(&photo, &render(0.0));
        assert!((same.factor - 0.5).abs() < 1e-5 && same.correlation > 0.9999);
        assert!(same.delta_e < 1e-3);
        let turned = Likeness::of(&photo, &render(45.0));
        assert!(turned.delta_e > 1.0 && turned.correlation < 0.999);
        assert!(same.is_cylinder() && turned.is_cylinder());
    }

    #[test]
    fn what_is_flat_or_bright_at_its_sides_is_no_cylinder() {
        let (width, height) = (64, 20);
        let photo = |light: &dyn Fn(f64, usize) -> f64| Frame {
            width,
            height,
            rgb: (0..width * height)
                .map(|k| {
                    let x = 2.0 * ((k % width) as f64 + 0.5) / width as f64 - 1.0;
                    [light(x, k) as f32; 3]
                })
                .collect(),
        };
        // Noise of a tenth, by the pixel's number.
        let noise = |k: usize| 1.0 + 0.2 * ((k * 7919 % 101) as f64 / 101.0 - 0.5);
        let lights = render::from_above(40.0, 0.0);
        let fabric = render::bent(&Kurt::two_thread_fabric(), &lights, (width, height), 0.0);
        let is_cylinder = |frame: &Frame| Likeness::of(frame, &fabric).is_cylinder();
        // A cylinder of another material, and one whose outline was drawn somewhat too wide.
        assert!(is_cylinder(&photo(&|x, k| (1.0 - x * x).sqrt() * noise(k))));
        assert!(is_cylinder(&photo(&|x, k| {
            (1.0 - (x / 0.9).powi(2)).max(0.0).sqrt() * noise(k)
        })));
        assert!(!is_cylinder(&photo(&|_, _| 0.5)));
        assert!(!is_cylinder(&photo(&|x, k| (0.2 + x * x) * noise(k))));
        assert!(!is_cylinder(&photo(&|x, k| (1.0 + 0.5 * x) * noise(k))));
    }

    #[test]
    fn an_outline_is_four_numbers_in_their_order() {
        let outline = Outline {
            left: 1,
            top: 2,
            right: 30,
            bottom: 40,
        };
        assert_eq!("1, 2,30,40".parse(), Ok(outline));
        for bad in ["1,2,3", "30,2,1,40", "a,b,c,d", "1,2,5,40"] {
            assert!(bad.parse::<Outline>().is_err(), "{bad}");
        }
    }
}
