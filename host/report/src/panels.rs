//! Slices as a sheet of nine panels with axes, ticks and one scale.

use crate::slices::Slice;
use gonia_brdf::Elementary;
use gonia_render::{color_map, png, svg, tone};
use maud::{Markup, html};

const SIDE: f64 = 132.0;
const GAP: f64 = 12.0;
const LEFT: f64 = 58.0;
const TOP: f64 = 22.0;
const BELOW: f64 = 40.0;
const SCALE_HEIGHT: f64 = 10.0;

/// Slices in their own colours; `white` is the value that shows as white.
pub fn colours(slices: &[Slice<[f32; 3]>], white: f32, unit: &str) -> Markup {
    let paint = |rgb: &[f32; 3]| tone::rgb8(*rgb, 1.0 / white);
    let grey = |t: f32| tone::rgb8([t; 3], 1.0);
    let tick = |t: f64| format!("{:.3}", t * f64::from(white));
    sheet(
        slices,
        paint,
        &Scale {
            ramp: &grey,
            ticks: [0.0, 0.25, 0.5, 0.75, 1.0].map(|t| (t, tick(t))).to_vec(),
            unit,
        },
    )
}

/// Log ratios from −`limit` to `limit`.
pub fn differences(slices: &[Slice<f32>], limit: f32) -> Markup {
    let paint = |v: &f32| color_map::diverging(v / limit);
    let ramp = |t: f32| color_map::diverging(2.0 * t - 1.0);
    let tick = |t: f64| {
        let percent = 100.0 * (((2.0 * t - 1.0) * f64::from(limit)).exponential() - 1.0);
        (t, format!("{percent:+.1} %"))
    };
    let ticks = [0.0, 0.5, 1.0].map(tick).to_vec();
    sheet(
        slices,
        paint,
        &Scale {
            ramp: &ramp,
            ticks,
            unit: "",
        },
    )
}

/// Shares from none to the largest of all panels.
pub fn shares(slices: &[Slice<f32>]) -> Markup {
    let largest = super::slices::largest_difference(slices);
    let paint = |share: &f32| color_map::sequential(share / largest);
    let tick = |t: f64| (t, format!("{:.1} %", 100.0 * t * f64::from(largest)));
    let ticks = [0.0, 0.5, 1.0].map(tick).to_vec();
    sheet(
        slices,
        paint,
        &Scale {
            ramp: &color_map::sequential,
            ticks,
            unit: "",
        },
    )
}

/// Measured cells in a sheet of empty ones.
pub fn measured(slices: &[Slice<bool>]) -> Markup {
    let paint = |marked: &bool| color_map::sequential(if *marked { 0.85 } else { 0.08 });
    let ramp = |t: f32| color_map::sequential(if t > 0.5 { 0.85 } else { 0.08 });
    let ticks = vec![
        (0.25, "interpolated".to_owned()),
        (0.75, "measured".to_owned()),
    ];
    sheet(
        slices,
        paint,
        &Scale {
            ramp: &ramp,
            ticks,
            unit: "",
        },
    )
}

/// Kinds, each in a colour that is explained elsewhere.
pub fn kinds<T>(slices: &[Slice<T>], paint: impl Fn(&T) -> [u8; 3]) -> Markup {
    sheet(slices, paint, None)
}

struct Scale<'a> {
    /// Colour at 0 ..= 1 along the scale.
    ramp: &'a dyn Fn(f32) -> [u8; 3],
    /// Places along it and what stands there.
    ticks: Vec<(f64, String)>,
    /// What the numbers are, said once.
    unit: &'a str,
}

/// Nine panels, θi from top to bottom, θv from left to right.
fn sheet<'a, T>(
    slices: &[Slice<T>],
    paint: impl Fn(&T) -> [u8; 3],
    scale: impl Into<Option<&'a Scale<'a>>>,
) -> Markup {
    let width = LEFT + 3.0 * SIDE + 2.0 * GAP + 12.0;
    let rows_height = 3.0 * (SIDE + TOP);
    let scale = scale.into();
    let of_scale = if scale.is_some() {
        SCALE_HEIGHT + 26.0
    } else {
        0.0
    };
    let height = rows_height + BELOW + of_scale;
    let place = |k: usize| {
        let (row, column) = ((k / 3) as f64, (k % 3) as f64);
        (LEFT + column * (SIDE + GAP), TOP + row * (SIDE + TOP))
    };
    let inside = html! {
        @for (k, slice) in slices.iter().enumerate() {
            @let (x, y) = place(k);
            (panel(slice, x, y, &paint, k % 3 == 0, k / 3 == 2))
        }
        (svg::text(LEFT + 1.5 * SIDE + GAP, rows_height + 32.0, "middle", "axis", "azimuth of the view φv"))
        g transform=(format!("translate(13 {}) rotate(-90)", svg::n(0.5 * rows_height))) {
            (svg::text(0.0, 0.0, "middle", "axis", "azimuth of the light φi"))
        }
        @if let Some(scale) = scale { (colour_bar(scale, LEFT, rows_height + BELOW, 3.0 * SIDE + 2.0 * GAP)) }
    };
    svg::drawing(
        width,
        height,
        "slices over both azimuths at nine pairs of polar angles",
        inside,
    )
}

fn panel<T>(
    slice: &Slice<T>,
    x: f64,
    y: f64,
    paint: &impl Fn(&T) -> [u8; 3],
    first_column: bool,
    last_row: bool,
) -> Markup {
    let n = slice.values.len().isqrt();
    let pixels: Vec<[u8; 3]> = slice.values.iter().map(paint).collect();
    let uri = png::data_uri(&png::rgb(&pixels, n, n));
    let title = format!("θi {:.0}°  θv {:.0}°", slice.theta_i_deg, slice.theta_v_deg);
    html! {
        (svg::image(x, y, SIDE, SIDE, &uri))
        (svg::rect(x, y, SIDE, SIDE, "frame"))
        (svg::text(x + 0.5 * SIDE, y - 5.0, "middle", "title", &title))
        @for degrees in [0.0, 90.0, 180.0, 270.0, 360.0] {
            @let along = degrees / 360.0 * SIDE;
            (svg::line(x + along, y + SIDE, x + along, y + SIDE + 3.0, "tick"))
            (svg::line(x - 3.0, y + SIDE - along, x, y + SIDE - along, "tick"))
            @if last_row && degrees < 360.0 && degrees % 90.0 == 0.0 {
                (svg::text(x + along, y + SIDE + 13.0, "middle", "small", &format!("{degrees}°")))
            }
            @if first_column && degrees % 90.0 == 0.0 {
                (svg::text(x - 5.0, y + SIDE - along + 3.0, "end", "small", &format!("{degrees}°")))
            }
        }
    }
}

fn colour_bar(scale: &Scale<'_>, x: f64, y: f64, width: f64) -> Markup {
    const STEPS: usize = 256;
    let pixels: Vec<[u8; 3]> = (0..STEPS)
        .map(|k| (scale.ramp)(k as f32 / (STEPS - 1) as f32))
        .collect();
    let uri = png::data_uri(&png::rgb(&pixels, STEPS, 1));
    html! {
        (svg::image(x, y, width, SCALE_HEIGHT, &uri))
        (svg::rect(x, y, width, SCALE_HEIGHT, "frame"))
        @for (k, (t, label)) in scale.ticks.iter().enumerate() {
            @let label = if k + 1 == scale.ticks.len() { format!("{label} {}", scale.unit) } else { label.clone() };
            @let anchor = if *t == 0.0 { "start" } else if *t == 1.0 { "end" } else { "middle" };
            (svg::text(x + t * width, y + SCALE_HEIGHT + 13.0, anchor, "small", label.trim()))
        }
    }
}

/// A bar from one end of [`color_map::sequential`] to the other, as a drawing of its own.
pub fn sequential_bar(width: f64, ticks: Vec<(f64, String)>) -> Markup {
    let scale = Scale {
        ramp: &color_map::sequential,
        ticks,
        unit: "",
    };
    svg::drawing(
        width,
        30.0,
        "colour scale",
        colour_bar(&scale, 2.0, 2.0, width - 4.0),
    )
}
