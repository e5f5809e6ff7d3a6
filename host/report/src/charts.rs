//! Charts of a summary: pointing errors, seconds by stage, bins by polar angle.

use crate::panels;
use gonia_formats::{BinCounts, Pointing, Stage};
use gonia_render::{color_map, png, svg};
use maud::{Markup, html};

/// A histogram of the pointing errors, with the limit and the 99th percentile marked.
pub fn pointing(pointing: &Pointing) -> Markup {
    const W: f64 = 380.0;
    const H: f64 = 230.0;
    const LEFT: f64 = 46.0;
    const RIGHT: f64 = 14.0;
    const TOP: f64 = 26.0;
    const BOTTOM: f64 = 42.0;
    let (plot_w, plot_h) = (W - LEFT - RIGHT, H - TOP - BOTTOM);
    let classes = pointing.counts.len().max(1) as f64;
    let span_deg = classes * pointing.class_deg;
    let x = |deg: f64| LEFT + (deg / span_deg).clamp(0.0, 1.0) * plot_w;
    let most = pointing.counts.iter().copied().max().unwrap_or(0) as f64;
    let y = |count: f64| TOP + plot_h * (1.0 - count / most.max(1.0));
    let bar = plot_w / classes;
    let tick_deg = svg::round_up(span_deg / 5.0);
    let ticks = (0..=(span_deg / tick_deg + 1e-9) as usize).map(|k| k as f64 * tick_deg);
    let inside = html! {
        @for (k, count) in pointing.counts.iter().enumerate() {
            @let beyond = (k as f64 + 0.5) * pointing.class_deg > pointing.limit_deg;
            @let top = y(*count as f64);
            (svg::rect(LEFT + k as f64 * bar + 0.5, top, bar - 1.0, TOP + plot_h - top,
                if beyond { "bar bad" } else { "bar" }))
        }
        (svg::line(LEFT, TOP + plot_h, W - RIGHT, TOP + plot_h, "tick"))
        @for deg in ticks {
            (svg::line(x(deg), TOP + plot_h, x(deg), TOP + plot_h + 4.0, "tick"))
            (svg::text(x(deg), TOP + plot_h + 16.0, "middle", "small", &format!("{}°", trimmed(deg))))
        }
        (svg::text(LEFT - 6.0, TOP + 8.0, "end", "small", &thousands(most as u64)))
        (svg::text(LEFT - 6.0, TOP + plot_h, "end", "small", "0"))
        (svg::line(x(pointing.limit_deg), TOP - 4.0, x(pointing.limit_deg), TOP + plot_h, "limit"))
        (svg::text(x(pointing.limit_deg), TOP - 9.0, "middle", "small", &format!("limit {}°", trimmed(pointing.limit_deg))))
        (svg::line(x(pointing.p99_deg), TOP + 6.0, x(pointing.p99_deg), TOP + plot_h, "mark"))
        (svg::text(x(pointing.p99_deg) + 4.0, TOP + 14.0, "start", "small", &format!("p99 {:.4}°", pointing.p99_deg)))
        (svg::text(LEFT + 0.5 * plot_w, H - 6.0, "middle", "axis", "error of an axis at the trigger, by encoder"))
    };
    svg::drawing(W, H, "histogram of pointing errors", inside)
}

/// Seconds by stage as bars.
pub fn stages(stages: &[Stage]) -> Markup {
    const W: f64 = 380.0;
    const ROW: f64 = 24.0;
    const LEFT: f64 = 152.0;
    const RIGHT: f64 = 88.0;
    let longest = stages
        .iter()
        .map(|stage| stage.seconds)
        .fold(0.0, f64::max)
        .max(1e-9);
    let total: f64 = stages.iter().map(|stage| stage.seconds).sum();
    let inside = html! {
        @for (k, stage) in stages.iter().enumerate() {
            @let y = k as f64 * ROW;
            @let w = ((W - LEFT - RIGHT) * stage.seconds / longest).max(1.0);
            (svg::text(LEFT - 8.0, y + 16.0, "end", "label", &stage.name))
            (svg::rect(LEFT, y + 4.0, w, ROW - 8.0, "bar"))
            (svg::text(LEFT + w + 6.0, y + 16.0, "start", "small",
                &format!("{} · {:.0} %", seconds(stage.seconds), 100.0 * stage.seconds / total.max(1e-9))))
        }
    };
    svg::drawing(
        W,
        stages.len() as f64 * ROW + 2.0,
        "seconds by stage",
        inside,
    )
}

/// The share of bins filled, by the polar angles of light and view.
pub fn bins(bins: &BinCounts, step_deg: f64) -> Markup {
    const SIDE: f64 = 264.0;
    const LEFT: f64 = 56.0;
    const TOP: f64 = 8.0;
    let n = bins.share_by_polar_angle.len();
    // Light upwards, so the last row of the shares comes first.
    let pixels: Vec<[u8; 3]> = bins
        .share_by_polar_angle
        .iter()
        .rev()
        .flat_map(|row| (0..n).map(|v| row.get(v).copied().unwrap_or(0.0)))
        .map(|share| color_map::sequential(share.sqrt()))
        .collect();
    let uri = png::data_uri(&png::rgb(&pixels, n, n));
    let place = |deg: f64| (deg / step_deg + 0.5) / n.max(1) as f64 * SIDE;
    let inside = html! {
        (svg::image(LEFT, TOP, SIDE, SIDE, &uri))
        (svg::rect(LEFT, TOP, SIDE, SIDE, "frame"))
        @for deg in [0.0, 15.0, 30.0, 45.0, 60.0, 75.0] {
            @let along = place(deg);
            (svg::line(LEFT + along, TOP + SIDE, LEFT + along, TOP + SIDE + 4.0, "tick"))
            (svg::text(LEFT + along, TOP + SIDE + 16.0, "middle", "small", &format!("{deg}°")))
            (svg::line(LEFT - 4.0, TOP + SIDE - along, LEFT, TOP + SIDE - along, "tick"))
            (svg::text(LEFT - 7.0, TOP + SIDE - along + 4.0, "end", "small", &format!("{deg}°")))
        }
        (svg::text(LEFT + 0.5 * SIDE, TOP + SIDE + 34.0, "middle", "axis", "polar angle of the view θv"))
        g transform=(format!("translate(14 {}) rotate(-90)", svg::n(TOP + 0.5 * SIDE))) {
            (svg::text(0.0, 0.0, "middle", "axis", "polar angle of the light θi"))
        }
    };
    // The scale is that of the square root: most bins are sparsely filled.
    let ticks = [0.0, 0.05, 0.2, 0.5, 1.0]
        .map(|share: f64| (share.sqrt(), format!("{:.0} %", 100.0 * share)))
        .to_vec();
    html! {
        (svg::drawing(LEFT + SIDE + 16.0, TOP + SIDE + 40.0, "share of bins filled by polar angle", inside))
        (panels::sequential_bar(LEFT + SIDE + 16.0, ticks))
    }
}

/// A whole number with its thousands apart.
pub fn thousands(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            // A thin space that does not break.
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Seconds as people say them.
pub fn seconds(value: f64) -> String {
    if value < 10.0 {
        format!("{value:.2} s")
    } else if value < 120.0 {
        format!("{value:.1} s")
    } else if value < 7200.0 {
        format!("{}:{:02} min", (value / 60.0) as u64, (value % 60.0) as u64)
    } else {
        format!("{:.1} h", value / 3600.0)
    }
}

fn trimmed(value: f64) -> String {
    format!("{}", (value * 1e4).round() / 1e4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_people_write_them() {
        assert_eq!(thousands(62_726_400), "62\u{202f}726\u{202f}400");
        assert_eq!(thousands(999), "999");
        assert_eq!(seconds(4.567), "4.57 s");
        assert_eq!(seconds(187.9), "3:07 min");
        assert_eq!(seconds(972_000.0), "270.0 h");
        assert_eq!(trimmed(0.03), "0.03");
    }

    #[test]
    fn every_class_of_the_histogram_is_a_bar_and_those_beyond_the_limit_are_marked() {
        let errors: Vec<f64> = (0..360).map(|k| k as f64 * 1e-4).collect();
        let drawn = pointing(&Pointing::from_errors(&errors, 0.03).unwrap()).into_string();
        assert_eq!(drawn.matches("class=\"bar\"").count(), 30);
        assert_eq!(drawn.matches("class=\"bar bad\"").count(), 6);
        assert!(drawn.contains("limit 0.03°"));
    }
}
