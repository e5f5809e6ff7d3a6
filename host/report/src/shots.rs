//! The lit sphere and the draped cylinder, measured and true, for the page.

use gonia_brdf::{Brdf, DenseBrdf};
use gonia_render as render;
use gonia_render::color::delta_e;
use gonia_render::{Light, Picture, Tabulated, color_map, png, svg, tone};

/// Pixels a side.
pub const PX: usize = 448;

/// One object, as images for the page.
pub struct Shots {
    /// What it is.
    pub name: &'static str,
    /// The measured BRDF on it.
    pub measured: String,
    /// The true one, and their colour difference, where the truth is known.
    pub beside_truth: Option<BesideTruth>,
}

/// The pictures that need the truth.
pub struct BesideTruth {
    /// The true BRDF on the object.
    pub truth: String,
    /// Where the two differ.
    pub difference: String,
    /// The ΔE00 that is brightest in the difference.
    pub brightest_delta_e: f64,
}

/// The factor that shows a picture well: all but its brightest highlights below white.
pub fn exposure(picture: &Picture) -> f32 {
    picture.exposure(0.985, 0.82)
}

/// Draws sphere and cylinder.
pub fn draw(dense: &DenseBrdf, factor: f64, truth: Option<&dyn Brdf>) -> Vec<Shots> {
    let lights = render::studio();
    let measured = Tabulated::scaled(dense, factor);
    type Shape = fn(&dyn Brdf, &[Light], usize, usize) -> Picture;
    let shapes: [(&'static str, Shape); 2] = [
        ("Sphere", render::sphere),
        ("Draped cylinder", render::cylinder),
    ];
    shapes
        .into_iter()
        .map(|(name, shape)| {
            let shot = shape(&measured, &lights, PX, 1);
            let true_shot = truth.map(|truth| shape(truth, &lights, PX, 1));
            let exposure = exposure(true_shot.as_ref().unwrap_or(&shot));
            Shots {
                name,
                measured: uri(&tone::picture_rgba(&shot.with_smooth_outline(), exposure)),
                beside_truth: true_shot.map(|truth| {
                    let delta_e = differences(&shot, &truth, exposure);
                    let brightest = brightest_of(&delta_e);
                    BesideTruth {
                        truth: uri(&tone::picture_rgba(&truth.with_smooth_outline(), exposure)),
                        difference: uri(&difference_rgba(&delta_e, &shot.cover, brightest)),
                        brightest_delta_e: brightest,
                    }
                }),
            }
        })
        .collect()
}

fn uri(pixels: &[[u8; 4]]) -> String {
    png::data_uri(&png::rgba(pixels, PX, PX))
}

/// ΔE00 of what the screen shows, pixel by pixel.
fn differences(a: &Picture, b: &Picture, exposure: f32) -> Vec<f32> {
    let shown = |rgb: &[f32; 3]| rgb.map(|v| (v * exposure).clamp(0.0, 1.0));
    a.rgb
        .iter()
        .zip(&b.rgb)
        .map(|(a, b)| delta_e(shown(a), shown(b)))
        .collect()
}

/// A round number that nearly all differences stay below, at least 2: what differs less cannot
/// be seen and shall not look alarming.
fn brightest_of(delta_e: &[f32]) -> f64 {
    let mut sorted: Vec<f32> = delta_e.iter().copied().filter(|d| *d > 0.0).collect();
    sorted.sort_by(f32::total_cmp);
    let high = sorted
        .get(sorted.len() * 995 / 1000)
        .copied()
        .unwrap_or(0.0);
    svg::round_up(f64::from(high).max(2.0))
}

fn difference_rgba(delta_e: &[f32], cover: &[f32], brightest: f64) -> Vec<[u8; 4]> {
    let pixel = |(delta_e, cover): (&f32, &f32)| {
        let [r, g, b] = color_map::sequential(delta_e / brightest as f32);
        [r, g, b, (255.0 * cover) as u8]
    };
    delta_e.iter().zip(cover).map(pixel).collect()
}
