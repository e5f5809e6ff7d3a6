//! Drawings of the benches.

use gonia_brdf::Elementary;
use std::fmt::Write as _;

/// A table of values as coloured cells with their numbers.
pub struct Heat<'a> {
    pub name: &'a str,
    /// θv of the columns, θi of the rows, degrees.
    pub columns: &'a [f64],
    pub rows: &'a [f64],
    /// Row by row.
    pub values: Vec<f64>,
    /// Whether zero is in the middle of the scale.
    pub signed: bool,
}

/// Points joined by lines.
pub struct Line<'a> {
    pub name: &'a str,
    /// Unit of the abscissa.
    pub x: &'a str,
    pub series: Vec<(String, Vec<(f64, f64)>)>,
    /// Whether both axes are logarithmic.
    pub log: bool,
}

const WIDTH: f64 = 330.0;
const HEIGHT: f64 = 250.0;
const COLORS: [&str; 4] = ["#1b6ca8", "#c1440e", "#3c8d40", "#7a4ea3"];

/// Panels two in a row.
pub fn draw(heats: &[Heat], lines: &[Line]) -> String {
    let n = heats.len() + lines.len();
    let columns = n.min(2);
    let (width, height) = (WIDTH * columns as f64, HEIGHT * n.div_ceil(2) as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"10\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for k in 0..n {
        let _ = writeln!(
            svg,
            "<g transform=\"translate({},{})\">",
            WIDTH * (k % 2) as f64,
            HEIGHT * (k / 2) as f64
        );
        match heats.get(k) {
            Some(heat) => cells(&mut svg, heat),
            None => curves(&mut svg, &lines[k - heats.len()]),
        }
        svg += "</g>\n";
    }
    svg + "</svg>\n"
}

fn text(svg: &mut String, x: f64, y: f64, anchor: &str, words: &str) {
    let _ = writeln!(
        svg,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>"
    );
}

fn cells(svg: &mut String, heat: &Heat) {
    text(svg, 40.0, 16.0, "start", heat.name);
    let (w, h) = (
        (WIDTH - 60.0) / heat.columns.len() as f64,
        (HEIGHT - 60.0) / heat.rows.len() as f64,
    );
    let largest = heat.values.iter().map(|v| v.abs()).fold(1e-12, f64::max);
    for (i, value) in heat.values.iter().enumerate() {
        let (row, column) = (i / heat.columns.len(), i % heat.columns.len());
        let (x, y) = (40.0 + w * column as f64, 24.0 + h * row as f64);
        let strength = 255.0 - 150.0 * value.abs() / largest;
        let color = if heat.signed && *value < 0.0 {
            format!("rgb({strength:.0},{strength:.0},255)")
        } else {
            format!("rgb(255,{strength:.0},{strength:.0})")
        };
        let _ = writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"{color}\"/>"
        );
        let digits = if largest < 0.1 { 4 } else { 2 };
        text(
            svg,
            x + 0.5 * w,
            y + 0.5 * h + 3.5,
            "middle",
            &format!("{value:.digits$}"),
        );
    }
    for (i, theta) in heat.rows.iter().enumerate() {
        text(
            svg,
            36.0,
            24.0 + h * (i as f64 + 0.5) + 3.5,
            "end",
            &format!("{theta}°"),
        );
    }
    for (i, theta) in heat.columns.iter().enumerate() {
        text(
            svg,
            40.0 + w * (i as f64 + 0.5),
            HEIGHT - 24.0,
            "middle",
            &format!("{theta}°"),
        );
    }
    text(svg, 4.0, 20.0, "start", "θi");
    text(svg, WIDTH - 16.0, HEIGHT - 24.0, "start", "θv");
}

fn curves(svg: &mut String, line: &Line) {
    text(svg, 10.0, 16.0, "start", line.name);
    let scale = |v: f64| if line.log { v.decimal_log() } else { v };
    let of = |f: fn(&(f64, f64)) -> f64| {
        let all = line.series.iter().flat_map(|s| &s.1).map(|p| scale(f(p)));
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        (low.min(if line.log { low } else { 0.0 }), high)
    };
    let (x, y) = (of(|p| p.0), of(|p| p.1));
    let place = |p: &(f64, f64)| {
        (
            40.0 + (WIDTH - 60.0) * (scale(p.0) - x.0) / (x.1 - x.0),
            HEIGHT - 40.0 - (HEIGHT - 70.0) * (scale(p.1) - y.0) / (y.1 - y.0),
        )
    };
    let _ = writeln!(
        svg,
        "<path d=\"M40 30V{}H{}\" stroke=\"#888\" fill=\"none\"/>",
        HEIGHT - 40.0,
        WIDTH - 20.0
    );
    for share in [0.0, 0.5, 1.0] {
        let value = |(low, high): (f64, f64)| {
            let v = low + share * (high - low);
            if line.log { 10f64.power(v) } else { v }
        };
        let at = 40.0 + (WIDTH - 60.0) * share;
        text(
            svg,
            at,
            HEIGHT - 26.0,
            if share == 1.0 { "end" } else { "middle" },
            &format!("{:.*} {}", usize::from(value(x) < 100.0), value(x), line.x),
        );
        let at = HEIGHT - 40.0 - (HEIGHT - 70.0) * share;
        text(svg, 37.0, at + 3.0, "end", &format!("{:.3}", value(y)));
    }
    for (k, (name, points)) in line.series.iter().enumerate() {
        let color = COLORS[k % COLORS.len()];
        let mut path = String::new();
        for (i, point) in points.iter().enumerate() {
            let (x, y) = place(point);
            let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
            let _ = writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{color}\"/>"
            );
        }
        let _ = writeln!(svg, "<path d=\"{path}\" stroke=\"{color}\" fill=\"none\"/>");
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"{color}\">{name}</text>",
            WIDTH - 20.0,
            32.0 + 13.0 * k as f64
        );
    }
}
