//! The picture of a calibration: what is left of lines and shading, before and after.

use gonia_pipeline::calibrate::Residuals;
use gonia_render::svg;
use maud::{Markup, html};

/// Width of a frame's panel, and of all.
const PANEL: f64 = 300.0;
const GAP: f64 = 30.0;
const LEFT: f64 = 44.0;
const TOP: f64 = 44.0;
/// Height of the panel of shading.
const SHADING: f64 = 170.0;
/// No more pieces of lines than this are drawn.
const MOST: usize = 2500;
/// How long the arrow of the 95th percentile is.
const LONG: f64 = 16.0;

/// Residuals of the lines as arrows over the frame, before and after, each with its own scale, and those of the
/// reference's shading by the light's polar angle; as one SVG file.
pub fn calibration(residuals: &Residuals) -> String {
    let [width, height] = residuals.size_px.map(|px| px as f64);
    let tall = PANEL * height / width.max(1.0);
    let total = LEFT + 2.0 * PANEL + GAP + 10.0;
    let has_shading = !residuals.shading.is_empty();
    let low = TOP + tall + 40.0;
    let bottom = if has_shading {
        low + SHADING + 62.0
    } else {
        low
    };
    let inside = html! {
        @for (i, name) in ["before", "after"].into_iter().enumerate() {
            (lines(residuals, i, name, (LEFT + i as f64 * (PANEL + GAP), tall)))
        }
        @if has_shading {
            (shading(residuals, low + 24.0, total - LEFT - 10.0))
        }
    };
    svg::alone(svg::drawing(
        total,
        bottom,
        "residuals of the calibration",
        inside,
    ))
}

/// One panel: arrows from where lines are seen, across them.
fn lines(residuals: &Residuals, which: usize, name: &str, (left, tall): (f64, f64)) -> Markup {
    let scale = PANEL / (residuals.size_px[0] as f64).max(1.0);
    let mut sizes: Vec<f64> = residuals.lines.iter().map(|l| l.px[which].abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = share * sizes.len().saturating_sub(1) as f64;
        sizes.get(place.round() as usize).copied().unwrap_or(0.0)
    };
    let longest = svg::round_up(at(0.95).max(1e-6));
    let rms = (sizes.iter().map(|s| s * s).sum::<f64>() / sizes.len().max(1) as f64).sqrt();
    let step = residuals.lines.len().div_ceil(MOST).max(1);
    let arrow = |line: &gonia_pipeline::calibrate::LineResidual| {
        let from = [0, 1].map(|i| scale * line.pixel[i] + [left, TOP][i]);
        let by = (line.px[which] / longest).clamp(-3.0, 3.0) * LONG;
        let to = [0, 1].map(|i| from[i] + by * line.outward[i]);
        html! {
            line x1=(svg::n(from[0])) y1=(svg::n(from[1])) x2=(svg::n(to[0])) y2=(svg::n(to[1]))
                stroke="var(--accent)" stroke-width="0.6" {}
        }
    };
    let (width, height) = (residuals.size_px[0], residuals.size_px[1]);
    html! {
        (svg::text(left, TOP - 24.0, "start", "label", &format!("fiducial lines, {name}")))
        (svg::text(left, TOP - 8.0, "start", "small", &format!(
            "RMS {} px, median {} px; frame of {width} × {height}", digits(rms), digits(at(0.5)))))
        rect x=(svg::n(left)) y=(svg::n(TOP)) width=(svg::n(PANEL)) height=(svg::n(tall))
            fill="none" stroke="var(--line)" {}
        @for line in residuals.lines.iter().step_by(step) { (arrow(line)) }
        line x1=(svg::n(left)) y1=(svg::n(TOP + tall + 14.0)) x2=(svg::n(left + LONG))
            y2=(svg::n(TOP + tall + 14.0)) stroke="var(--accent)" stroke-width="2" {}
        (svg::text(left + LONG + 6.0, TOP + tall + 18.0, "start", "small", &format!(
            "{} px from where the rig has the line", digits(longest))))
    }
}

/// The panel of shading: a frame before (hollow) and after (full).
fn shading(residuals: &Residuals, top: f64, wide: f64) -> Markup {
    let largest = residuals
        .shading
        .iter()
        .flat_map(|frame| frame.share)
        .fold(0.0, f64::max);
    let most = svg::round_up(100.0 * largest.max(1e-6));
    let x = |theta: f64| LEFT + wide * theta / 90.0;
    let y = |share: f64| top + SHADING * (1.0 - 100.0 * share / most);
    html! {
        (svg::text(LEFT, top - 10.0, "start", "label", "shading of the reference, a frame each: hollow before, full after"))
        (svg::line(LEFT, top + SHADING, LEFT + wide, top + SHADING, "tick"))
        (svg::line(LEFT, top, LEFT, top + SHADING, "tick"))
        @for k in 0..=6 {
            @let theta = 15.0 * f64::from(k);
            (svg::text(x(theta), top + SHADING + 16.0, "middle", "small", &format!("{theta}°")))
        }
        @for share in [0.0, 0.5, 1.0] {
            (svg::text(LEFT - 5.0, y(0.01 * share * most) + 4.0, "end", "small", &format!("{} %", digits(share * most))))
        }
        @for frame in &residuals.shading {
            circle cx=(svg::n(x(frame.theta_i_deg))) cy=(svg::n(y(frame.share[0]))) r="2.4"
                fill="none" stroke="var(--soft)" {}
        }
        @for frame in &residuals.shading {
            circle cx=(svg::n(x(frame.theta_i_deg))) cy=(svg::n(y(frame.share[1]))) r="2.2"
                fill="var(--accent)" {}
        }
        (svg::text(LEFT + 0.5 * wide, top + SHADING + 34.0, "middle", "axis", "polar angle of the light; RMS of a frame's values about what its light makes of them"))
    }
}

/// A number with two or three significant digits.
fn digits(value: f64) -> String {
    match value.abs() {
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        v if v >= 0.1 || v == 0.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_pipeline::calibrate::{LineResidual, ShadingResidual};

    #[test]
    fn arrows_have_a_scale_and_shading_is_drawn_where_it_was_used() {
        let mut residuals = Residuals {
            size_px: [400, 300],
            lines: vec![
                LineResidual {
                    pixel: [100.0, 50.0],
                    outward: [0.0, -1.0],
                    px: [4.0, 0.03],
                };
                40
            ],
            shading: Vec::new(),
        };
        let drawn = calibration(&residuals);
        assert!(
            drawn.contains("RMS 4.00 px") && drawn.contains("RMS 0.030 px"),
            "{drawn}"
        );
        assert!(
            drawn.contains("400 × 300") && !drawn.contains("shading"),
            "{drawn}"
        );
        residuals.shading = vec![ShadingResidual {
            theta_i_deg: 45.0,
            share: [0.04, 0.001],
        }];
        assert!(calibration(&residuals).contains("shading of the reference"));
        assert!(
            !calibration(&residuals).contains("var("),
            "a colour of the page"
        );
    }
}
