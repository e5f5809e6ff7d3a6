//! The chart of `gonia chart`: error against cost, a panel an error figure, each with its Pareto
//! front; and error against the number of images.

use gonia_brdf::Elementary;
use gonia_brdf::interpolate::Preset;
use gonia_pipeline::chart::{ChartPoint, Family, Method, front};
use gonia_render::svg;
use gonia_rig::{Stratum, StratumFigures};
use maud::{Markup, PreEscaped, html};
use std::collections::BTreeMap;

/// An error figure of a point, where it has it.
type Figure = fn(&ChartPoint) -> Option<f64>;

/// Panels: heading and figure.
const PANELS: [(&str, Figure); 6] = [
    ("log RMS, all", |p| of(p, Stratum::All, |f| f.log_rms)),
    ("log RMS, interior", |p| {
        of(p, Stratum::Interior, |f| f.log_rms)
    }),
    ("log RMS, grazing", |p| {
        of(p, Stratum::Grazing, |f| f.log_rms)
    }),
    ("log RMS, highlight", |p| {
        of(p, Stratum::Highlight, |f| f.log_rms)
    }),
    ("cosine-weighted relative error, all", |p| {
        of(p, Stratum::All, |f| f.cos_error_mean)
    }),
    ("ΔE00, rendered sphere", |p| p.sphere_delta_e),
];

fn of(point: &ChartPoint, stratum: Stratum, figure: fn(&StratumFigures) -> f64) -> Option<f64> {
    let row = point.strata.iter().find(|row| row.stratum == stratum)?;
    Some(figure(row))
}

const W: f64 = 420.0;
const H: f64 = 300.0;
const LEFT: f64 = 52.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 28.0;
const BOTTOM: f64 = 40.0;
const COLUMNS: usize = 2;
const LEGEND: f64 = 72.0;

const STYLE: &str = "\
svg { background: #fbfaf7; }
text { font: 11px system-ui, sans-serif; fill: #1d2326; }
text.small { fill: #5c676b; font-size: 9.5px; }
text.name { fill: #1d2326; font-size: 9px; paint-order: stroke; stroke: #fbfaf7; stroke-width: 2.5px; }
text.title { font-weight: 600; }
.frame { fill: none; stroke: #dcd9d0; }
.tick { stroke: #e8e5dd; stroke-width: 0.8; }
.front { fill: none; stroke: #1d2326; stroke-width: 1; stroke-dasharray: 4 3; }
.series { fill: none; stroke-width: 1.2; }
.default { fill: none; stroke: #b3392f; stroke-width: 1.8; }
.blocks { fill: #1f6b63; stroke: #1f6b63; }
.linear { fill: #b98a1d; stroke: #b98a1d; }
.rbf { fill: #4b6cb7; stroke: #4b6cb7; }
.squares { fill: #8a4f9e; stroke: #8a4f9e; }
.distance { fill: #7d8588; stroke: #7d8588; }
";

fn class(family: Family) -> &'static str {
    match family {
        Family::Blocks => "blocks",
        Family::Linear => "linear",
        Family::Rbf => "rbf",
        Family::LeastSquares => "squares",
        Family::Distance => "distance",
    }
}

/// Error against core-seconds, as one SVG file; `basis` says what is compared with what.
pub fn methods(points: &[ChartPoint], title: &str, basis: &str) -> String {
    let cost = |p: &ChartPoint| Some(p.core_s);
    page(
        points,
        (title, basis),
        "core-seconds of the full fill",
        cost,
        &|chart| {
            let along = front(points, chart.error);
            let line: Vec<(f64, f64)> = along
                .iter()
                .filter_map(|k| chart.place(&points[*k]))
                .collect();
            // Blocks between the presets have theirs when pointed at: side by side there is no room.
            let worth_a_name = |k: usize, p: &ChartPoint| {
                let on_front = along.contains(&k) && p.family != Family::Blocks;
                on_front || p.is_default || p.name == "paper" || preset_of(&p.name).is_some()
            };
            let named: Vec<(&ChartPoint, String)> = points
                .iter()
                .enumerate()
                .filter(|(k, point)| worth_a_name(*k, point))
                .map(|(_, point)| (point, label(&point.name)))
                .collect();
            html! {
                polyline class="front" points=(polyline(&line)) {}
                @for point in points { (chart.dot(point)) }
                (chart.names(&named, points))
            }
        },
    )
}

/// Error against the number of images, as one SVG file. A series holds the points that differ only
/// in the samples; those of central samples only are squares.
pub fn images(points: &[ChartPoint], title: &str, basis: &str) -> String {
    let frames = |p: &ChartPoint| Some(p.frames as f64);
    page(points, (title, basis), "images", frames, &|chart| {
        let mut series: BTreeMap<&str, Vec<&ChartPoint>> = BTreeMap::new();
        for point in points.iter().filter(|p| !is_central(p)) {
            series.entry(method_of(point)).or_default().push(point);
        }
        let last = series.values().filter_map(|points| points.last());
        let central = points.iter().filter(|p| is_central(p));
        let named: Vec<(&ChartPoint, String)> = last
            .map(|point| (*point, label(method_of(point))))
            .chain(central.map(|point| (point, "central only".to_owned())))
            .collect();
        html! {
            @for points in series.values() {
                @let line: Vec<(f64, f64)> = points.iter().filter_map(|p| chart.place(p)).collect();
                polyline class=(format!("series {}", class(points[0].family)))
                    style="fill:none" points=(polyline(&line)) {}
            }
            @for point in points { (chart.dot(point)) }
            (chart.names(&named, points))
        }
    })
}

/// The preset that a method is.
fn preset_of(name: &str) -> Option<Preset> {
    let method = |preset: &Preset| Method::Blocks(preset.settings()).to_string();
    Preset::ALL
        .into_iter()
        .find(|preset| method(preset) == name)
}

/// A method's name in few letters: a preset's word, or the size of blocks, their nodes and tolerance.
fn label(name: &str) -> String {
    if let Some(preset) = preset_of(name) {
        return preset.name().to_owned();
    }
    let Some(blocks) = name.strip_prefix("blocks=") else {
        return name.to_owned();
    };
    blocks
        .replace(",nodes=", "°, ")
        .replace(",tolerance=", ", t=")
        .replace(",budget=", ", b=")
}

fn method_of(point: &ChartPoint) -> &str {
    point.name.split(" from ").next().unwrap_or_default()
}

fn is_central(point: &ChartPoint) -> bool {
    point.name.contains("central")
}

fn polyline(points: &[(f64, f64)]) -> String {
    let pairs = points
        .iter()
        .map(|(x, y)| format!("{},{}", svg::n(*x), svg::n(*y)));
    pairs.collect::<Vec<_>>().join(" ")
}

fn page(
    points: &[ChartPoint],
    (title, basis): (&str, &str),
    axis: &str,
    along: fn(&ChartPoint) -> Option<f64>,
    inside: &dyn Fn(&Panel) -> Markup,
) -> String {
    let panels: Vec<Panel> = PANELS
        .iter()
        .filter_map(|(name, error)| Panel::new(points, name, along, *error))
        .collect();
    let rows = panels.len().div_ceil(COLUMNS);
    let (w, h) = (COLUMNS as f64 * W, LEGEND + rows as f64 * H);
    let drawing = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(svg::n(w)) height=(svg::n(h))
            viewBox=(format!("0 0 {} {}", svg::n(w), svg::n(h))) role="img" aria-label=(title) {
            style { (PreEscaped(STYLE)) }
            rect width="100%" height="100%" fill="#fbfaf7" {}
            (svg::text(LEFT, 18.0, "start", "title", title))
            (svg::text(LEFT, 33.0, "start", "small", basis))
            @for (k, family) in Family::ALL.into_iter().enumerate() {
                @let x = LEFT + 110.0 * k as f64;
                circle cx=(svg::n(x + 4.0)) cy="51" r="3.5" class=(class(family)) {}
                (svg::text(x + 13.0, 55.0, "start", "small", family.name()))
            }
            circle cx=(svg::n(LEFT + 554.0)) cy="51" r="6.5" class="default" {}
            (svg::text(LEFT + 565.0, 55.0, "start", "small", "the default"))
            @for (k, panel) in panels.iter().enumerate() {
                @let (x, y) = ((k % COLUMNS) as f64 * W, LEGEND + (k / COLUMNS) as f64 * H);
                g transform=(format!("translate({} {})", svg::n(x), svg::n(y))) {
                    (panel.axes(axis))
                    (inside(panel))
                }
            }
        }
    };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n",
        drawing.into_string()
    )
}

/// A panel with logarithmic axes.
struct Panel {
    name: &'static str,
    along: fn(&ChartPoint) -> Option<f64>,
    error: Figure,
    /// Powers of ten at the ends of the axes.
    x: (f64, f64),
    y: (f64, f64),
}

impl Panel {
    /// `None` when no point has the figure.
    fn new(
        points: &[ChartPoint],
        name: &'static str,
        along: fn(&ChartPoint) -> Option<f64>,
        error: Figure,
    ) -> Option<Self> {
        let range = |figure: &dyn Fn(&ChartPoint) -> Option<f64>| {
            let logs = points.iter().filter_map(figure).map(f64::decimal_log);
            let (low, high) = logs
                .filter(|log| log.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), log| {
                    (low.min(log), high.max(log))
                });
            // A margin, and at least half a decade.
            let pad = (0.5 * (0.5 - (high - low))).max(0.08 * (high - low));
            (low <= high).then_some((low - pad, high + pad))
        };
        Some(Self {
            name,
            along,
            error,
            x: range(&along)?,
            y: range(&error)?,
        })
    }

    fn x_of(&self, log: f64) -> f64 {
        LEFT + (log - self.x.0) / (self.x.1 - self.x.0) * (W - LEFT - RIGHT)
    }

    fn y_of(&self, log: f64) -> f64 {
        TOP + (self.y.1 - log) / (self.y.1 - self.y.0) * (H - TOP - BOTTOM)
    }

    fn place(&self, point: &ChartPoint) -> Option<(f64, f64)> {
        let (x, y) = (
            (self.along)(point)?.decimal_log(),
            (self.error)(point)?.decimal_log(),
        );
        (x.is_finite() && y.is_finite()).then(|| (self.x_of(x), self.y_of(y)))
    }

    fn axes(&self, axis: &str) -> Markup {
        html! {
            @for tick in ticks(self.x) {
                @let x = self.x_of(tick.decimal_log());
                (svg::line(x, TOP, x, H - BOTTOM, "tick"))
                (svg::text(x, H - BOTTOM + 14.0, "middle", "small", &short(tick)))
            }
            @for tick in ticks(self.y) {
                @let y = self.y_of(tick.decimal_log());
                (svg::line(LEFT, y, W - RIGHT, y, "tick"))
                (svg::text(LEFT - 5.0, y + 3.0, "end", "small", &short(tick)))
            }
            (svg::rect(LEFT, TOP, W - LEFT - RIGHT, H - TOP - BOTTOM, "frame"))
            (svg::text(LEFT, TOP - 8.0, "start", "title", self.name))
            (svg::text(0.5 * (LEFT + W - RIGHT), H - 8.0, "middle", "small", axis))
        }
    }

    fn dot(&self, point: &ChartPoint) -> Markup {
        let Some((x, y)) = self.place(point) else {
            return html! {};
        };
        let class = class(point.family);
        let error = (self.error)(point).unwrap_or_default();
        html! {
            g {
                title { (point.name) ": " (short(error)) " at " (short(point.core_s)) " core-s" }
                @if is_central(point) {
                    rect x=(svg::n(x - 3.5)) y=(svg::n(y - 3.5)) width="7" height="7" class=(class) {}
                } @else {
                    circle cx=(svg::n(x)) cy=(svg::n(y)) r="3.5" class=(class) {}
                }
                @if point.is_default { circle cx=(svg::n(x)) cy=(svg::n(y)) r="6.5" class="default" {} }
            }
        }
    }

    /// Names beside their points, each as near to its own as other names and points leave room.
    fn names(&self, named: &[(&ChartPoint, String)], points: &[ChartPoint]) -> Markup {
        /// Height and mean width of a letter.
        const LETTER: (f64, f64) = (10.0, 4.9);
        // What is taken: left, right, top and bottom.
        let dots = points.iter().filter_map(|point| self.place(point));
        let mut taken: Vec<[f64; 4]> = dots
            .map(|(x, y)| [x - 4.0, x + 4.0, y - 4.0, y + 4.0])
            .collect();
        let mut texts = Vec::new();
        for (point, name) in named {
            let Some((x, y)) = self.place(point) else {
                continue;
            };
            let width = LETTER.1 * name.chars().count() as f64;
            let overlap = |b: &[f64; 4]| -> f64 {
                let shared = |a: &[f64; 4]| {
                    let across = a[1].min(b[1]) - a[0].max(b[0]);
                    let along = a[3].min(b[3]) - a[2].max(b[2]);
                    across.max(0.0) * along.max(0.0)
                };
                let outside = (b[1] - (W - RIGHT)).max(0.0) + (LEFT - b[0]).max(0.0);
                let beyond = (b[3] - (H - BOTTOM)).max(0.0) + (TOP - b[2]).max(0.0);
                taken.iter().map(shared).sum::<f64>() + 100.0 * (outside + beyond)
            };
            let sides = [(8.0, false), (-8.0, true)];
            let rises = [3.5, -7.0, 14.0, -18.0, 25.0, -29.0, 36.0, -40.0, 47.0];
            let places = rises.into_iter().flat_map(|dy| {
                sides.map(|(dx, is_left)| {
                    let left = if is_left { x + dx - width } else { x + dx };
                    let bottom = y + dy + 2.0;
                    [left, left + width, bottom - LETTER.0, bottom]
                })
            });
            // Of equal ones the first, which is the nearest.
            let best = places.min_by(|a, b| overlap(a).total_cmp(&overlap(b)));
            let Some(place) = best else { continue };
            taken.push(place);
            texts.push(svg::text(place[0], place[3] - 2.0, "start", "name", name));
        }
        html! { @for text in texts { (text) } }
    }
}

/// Ticks between two powers of ten: 1, 2, 5 where that gives few enough, else whole decades.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let factors: &[f64] = if high - low < 2.5 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let decades = low.floor() as i32..=high.ceil() as i32;
    decades
        .flat_map(|decade| factors.iter().map(move |f| f * 10f64.powi(decade)))
        .filter(|tick| (low..=high).contains(&tick.decimal_log()))
        .collect()
}

/// Three significant digits, without zeros at the end.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = 2 - value.abs().decimal_log().floor() as i32;
    let scale = 10f64.powi(digits);
    let rounded = (value * scale).round() / scale;
    if (1e-4..1e6).contains(&rounded.abs()) {
        rounded.to_string()
    } else {
        format!("{rounded:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(name: &str, core_s: f64, log_rms: f64) -> ChartPoint {
        ChartPoint {
            name: name.into(),
            family: Family::Rbf,
            is_default: name == "a",
            frames: 10,
            core_s,
            share: 1.0,
            failed: 0.0,
            sphere_delta_e: None,
            strata: vec![StratumFigures {
                stratum: Stratum::All,
                cells: 5,
                log_rms,
                log_mean: 0.0,
                cos_error_mean: 0.1,
                cos_error_p99: 0.2,
                delta_e: None,
                reciprocity_a: 0.0,
                reciprocity_b: None,
            }],
        }
    }

    #[test]
    fn every_point_is_drawn_in_every_panel_that_has_its_figure_and_the_default_is_marked() {
        let points = [
            point("a", 10.0, 0.02),
            point("<b>", 1000.0, 0.1),
            point("c", 1.0, 0.5),
        ];
        let drawn = methods(&points, "a title", "a basis");
        // Two panels have figures: log RMS and cosine-weighted error over all.
        assert_eq!(drawn.matches("<title>").count(), 6);
        assert_eq!(
            drawn.matches("class=\"default\"").count(),
            3,
            "with the legend's"
        );
        assert_eq!(drawn.matches("class=\"front\"").count(), 2);
        assert!(drawn.contains("&lt;b&gt;: 0.1 at 1000 core-s") && !drawn.contains("<b>"));
        assert!(!drawn.contains("NaN"));
    }

    #[test]
    fn images_are_joined_by_method_and_central_samples_stand_alone() {
        let points = [
            point("m from 8 images", 1.0, 0.1),
            point("m from 4 images", 1.0, 0.2),
            point("m from 8 images, central samples only", 1.0, 0.4),
        ];
        let drawn = images(&points, "t", "b");
        assert_eq!(drawn.matches("<polyline").count(), 2);
        assert_eq!(drawn.matches("central only").count(), 2);
    }

    #[test]
    fn names_are_short_and_lie_neither_on_each_other_nor_on_points() {
        assert_eq!(label("blocks=8,nodes=64,tolerance=1"), "8°, 64, t=1");
        let default = Method::Blocks(Preset::Default.settings()).to_string();
        assert_eq!(label(&default), "default");
        assert_eq!(label("paper"), "paper");
        // Four points of a front within a few pixels.
        let points: Vec<ChartPoint> = (0..4)
            .map(|k| {
                let k = f64::from(k);
                point(&format!("method {k}"), 10.0 + 0.1 * k, 0.1 - 0.001 * k)
            })
            .chain([point("far", 1e5, 1e-3)])
            .collect();
        let drawn = methods(&points, "t", "b");
        let first = drawn.split("<g transform").nth(1).unwrap();
        let attribute = |text: &str, name: &str| -> f64 {
            let value = text.split(&format!(" {name}=\"")).nth(1).unwrap();
            value.split('"').next().unwrap().parse().unwrap()
        };
        let ys: Vec<(f64, f64)> = first
            .split("<text")
            .filter(|text| text.contains("class=\"name\""))
            .map(|text| (attribute(text, "x"), attribute(text, "y")))
            .collect();
        assert_eq!(ys.len(), 5);
        for (k, a) in ys.iter().enumerate() {
            for b in &ys[k + 1..] {
                assert!(
                    (a.1 - b.1).abs() >= 10.0 || (a.0 - b.0).abs() >= 30.0,
                    "{ys:?}"
                );
            }
        }
    }

    #[test]
    fn numbers_on_axes_are_short() {
        for (value, text) in [(0.0123456, "0.0123"), (97_812.0, "97800"), (2e-7, "2e-7")] {
            assert_eq!(short(value), text);
        }
        assert_eq!(ticks((-1.1, 0.4)), [0.1, 0.2, 0.5, 1.0, 2.0]);
        assert_eq!(ticks((-1.0, 3.0)), [0.1, 1.0, 10.0, 100.0, 1000.0]);
    }
}
