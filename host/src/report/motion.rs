//! The chart of the arms' speed against accuracy, as an SVG file of its own.

use super::svg;
use crate::evaluate::motion::{JerkRow, MotionRow};
use maud::{Markup, PreEscaped, html};

const W: f64 = 400.0;
const H: f64 = 270.0;
const LEFT: f64 = 48.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 44.0;

const STYLE: &str = "text{font:11px system-ui,sans-serif;fill:#1d2326}.small{font-size:10px;fill:#5c676b}\
.title{font-size:13px;font-weight:600}.tick{stroke:#9aa5a8}\
.curve{stroke:#2f7f74;fill:none;stroke-width:1.5}.span{stroke:#2f7f74;stroke-width:4;opacity:.18}\
.dot{fill:#2f7f74}.default{fill:#b98a1d}";

/// A panel for each setting (session time over true pointing error) and one for jerk.
pub fn motion_chart(rows: &[MotionRow], jerk: &[JerkRow], poses: usize, limit_deg: f64) -> String {
    let panels: Vec<Markup> = rows
        .chunk_by(|a, b| a.setting == b.setting)
        .map(|rows| setting_panel(rows, poses, limit_deg))
        .chain([jerk_panel(jerk)])
        .collect();
    let height = panels.len().div_ceil(2) as f64 * H;
    let drawn = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {} {}", svg::n(2.0 * W), svg::n(height)))
            width=(svg::n(2.0 * W)) height=(svg::n(height)) {
            style { (PreEscaped(STYLE)) }
            (svg_background(2.0 * W, height))
            @for (i, panel) in panels.iter().enumerate() {
                g transform=(format!("translate({} {})", svg::n((i % 2) as f64 * W), svg::n((i / 2) as f64 * H))) {
                    (panel)
                }
            }
        }
    };
    drawn.into_string()
}

fn svg_background(w: f64, h: f64) -> Markup {
    html! { rect x="0" y="0" width=(svg::n(w)) height=(svg::n(h)) fill="#ffffff" {} }
}

/// The plotting area of a panel: x begins at zero, y where the values do.
struct Plot {
    x_most: f64,
    y_least: f64,
    y_most: f64,
}

impl Plot {
    fn x(&self, value: f64) -> f64 {
        LEFT + (value / self.x_most).clamp(0.0, 1.0) * (W - LEFT - RIGHT)
    }

    fn y(&self, value: f64) -> f64 {
        let share = (value - self.y_least) / (self.y_most - self.y_least);
        H - BOTTOM - share.clamp(0.0, 1.0) * (H - TOP - BOTTOM)
    }

    fn frame(&self, title: &str, x_name: &str, y_name: &str) -> Markup {
        let ticks = |least: f64, most: f64| {
            let step = svg::round_up((most - least) / 5.0);
            let first = (least / step - 1e-9).ceil() as usize;
            (first..=(most / step + 1e-9) as usize).map(move |k| k as f64 * step)
        };
        html! {
            (svg::text(LEFT, 16.0, "start", "title", title))
            (svg::line(LEFT, H - BOTTOM, W - RIGHT, H - BOTTOM, "tick"))
            (svg::line(LEFT, TOP, LEFT, H - BOTTOM, "tick"))
            @for value in ticks(0.0, self.x_most) {
                (svg::line(self.x(value), H - BOTTOM, self.x(value), H - BOTTOM + 4.0, "tick"))
                (svg::text(self.x(value), H - BOTTOM + 16.0, "middle", "small", &short(value)))
            }
            @for value in ticks(self.y_least, self.y_most) {
                (svg::line(LEFT - 4.0, self.y(value), LEFT, self.y(value), "tick"))
                (svg::text(LEFT - 7.0, self.y(value) + 3.5, "end", "small", &short(value)))
            }
            (svg::text(0.5 * (LEFT + W - RIGHT), H - 8.0, "middle", "small", x_name))
            (svg::text(W - RIGHT, 16.0, "end", "small", y_name))
        }
    }

    fn curve(&self, points: &[(f64, f64)]) -> Markup {
        let path: Vec<String> = points
            .iter()
            .map(|(x, y)| format!("{},{}", svg::n(self.x(*x)), svg::n(self.y(*y))))
            .collect();
        html! { polyline points=(path.join(" ")) class="curve" {} }
    }

    fn dot(&self, x: f64, y: f64, is_default: bool) -> Markup {
        let (class, radius) = if is_default {
            ("default", "5.5")
        } else {
            ("dot", "3")
        };
        html! {
            circle cx=(svg::n(self.x(x))) cy=(svg::n(self.y(y))) r=(radius) class=(class) {}
        }
    }

    /// Labels at the right of places, the first ones first; one that would lie on another is left out.
    fn labels(&self, labels: &[(f64, f64, String)]) -> Markup {
        let mut taken: Vec<(f64, f64)> = Vec::new();
        let mut drawn = Vec::new();
        for (x, y, label) in labels {
            let at = (self.x(*x) + 8.0, self.y(*y) + 3.5);
            let is_free = |other: &(f64, f64)| {
                (other.0 - at.0).abs() > LABEL_W || (other.1 - at.1).abs() > LABEL_H
            };
            if taken.iter().all(is_free) {
                taken.push(at);
                drawn.push(svg::text(at.0, at.1, "start", "small", label));
            }
        }
        html! { @for label in &drawn { (label) } }
    }
}

/// Room that a label takes.
const LABEL_W: f64 = 34.0;
const LABEL_H: f64 = 10.0;

/// A range that shows the differences of values: from a little below the least to a little above.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (least, most) = values.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    if least > most {
        return (0.0, 1.0);
    }
    let room = 0.08 * (most - least).max(0.05 * most);
    ((least - room).max(0.0), most + room)
}

fn setting_panel(rows: &[MotionRow], poses: usize, limit_deg: f64) -> Markup {
    let hours = |row: &MotionRow| row.pose_s * poses as f64 / 3600.0;
    // A value with which poses are given up is no choice; the table has it.
    let whole: Vec<&MotionRow> = rows
        .iter()
        .filter(|row| row.stopped.is_none() && row.given_up == 0)
        .collect();
    let most = |of: &dyn Fn(&MotionRow) -> f64| whole.iter().map(|row| of(row)).fold(0.0, f64::max);
    let (y_least, y_most) = range(whole.iter().map(|row| hours(row)));
    let plot = Plot {
        x_most: most(&|row| row.max_deg).max(0.3 * limit_deg) * 1.2,
        y_least,
        y_most,
    };
    let x_name = format!(
        "true pointing error, deg: median to largest, 99 % at the dot (limit {})",
        short(limit_deg)
    );
    let unit = rows.first().map_or("", |row| row.unit);
    let title = format!("{} ({unit})", rows.first().map_or("", |row| row.setting));
    let points: Vec<(f64, f64)> = whole.iter().map(|row| (row.p99_deg, hours(row))).collect();
    // The default's label, and the ends', before those in between.
    let ends = whole.first().into_iter().chain(whole.last());
    let by_weight = whole
        .iter()
        .filter(|row| row.is_default)
        .chain(ends)
        .chain(&whole);
    let labels: Vec<(f64, f64, String)> = by_weight
        .map(|row| (row.max_deg, hours(row), short(row.value)))
        .collect();
    html! {
        (plot.frame(&title, &x_name, "hours"))
        @for row in &whole {
            (svg::line(plot.x(row.p50_deg), plot.y(hours(row)), plot.x(row.max_deg), plot.y(hours(row)), "span"))
        }
        (plot.curve(&points))
        @for row in &whole {
            (plot.dot(row.p99_deg, hours(row), row.is_default))
        }
        (plot.labels(&labels))
    }
}

fn jerk_panel(rows: &[JerkRow]) -> Markup {
    let rise_ms = |row: &JerkRow| f64::from(row.rise_ms);
    let (y_least, y_most) = range(rows.iter().map(|row| row.settled_s));
    let plot = Plot {
        x_most: rows.iter().map(rise_ms).fold(1.0, f64::max) * 1.2,
        y_least,
        y_most,
    };
    let of_the_curve = |rows: &[JerkRow]| {
        rows.last().map(|row| {
            (
                rise_ms(row),
                row.settled_s,
                format!("{} deg/s2", row.acceleration),
            )
        })
    };
    let curves = || rows.chunk_by(|a, b| a.acceleration == b.acceleration);
    let labels: Vec<(f64, f64, String)> = curves().filter_map(of_the_curve).collect();
    html! {
        (plot.frame("a move until it has settled, arms of 6 to 16 Hz", "jerk_time (ms); 0: trapezoid", "s"))
        @for rows in curves() {
            @let points: Vec<(f64, f64)> = rows.iter().map(|row| (rise_ms(row), row.settled_s)).collect();
            (plot.curve(&points))
            @for row in rows {
                (plot.dot(rise_ms(row), row.settled_s, row.is_default))
            }
        }
        (plot.labels(&labels))
    }
}

fn short(value: f64) -> String {
    format!("{}", (value * 1e4).round() / 1e4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_a_dot_and_the_default_stands_out() {
        let row = |value: f64| MotionRow {
            setting: "in_position_window",
            unit: "deg",
            value,
            is_default: value == 0.006,
            pose_s: 2.0,
            kept: 10,
            given_up: 0,
            recoveries: 0,
            p50_deg: 0.003,
            p99_deg: 0.006,
            max_deg: 0.007,
            stopped: None,
        };
        let stopped = MotionRow {
            stopped: Some("why".into()),
            ..row(0.001)
        };
        let drawn = motion_chart(&[stopped, row(0.003), row(0.006)], &[], 8505, 0.03);
        assert!(drawn.starts_with("<svg xmlns"));
        assert_eq!(drawn.matches("class=\"dot\"").count(), 1);
        assert_eq!(drawn.matches("class=\"default\"").count(), 1);
    }
}
