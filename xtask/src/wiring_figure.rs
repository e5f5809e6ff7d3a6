//! A board's wiring as a picture: the board in the middle, what is wired to it on both sides.

use std::fmt::Write;

use gonia_pins::{Board, Level, Use};

/// What is drawn as one box, its side (left: false), and how its roles begin or end.
const BOXES: &[(&str, bool, &[&str])] = &[
    ("θ driver and motor", false, &["θ step", "θ direction"]),
    (
        "θ ring encoder (RS-422)",
        false,
        &["θ encoder clock", "θ encoder data"],
    ),
    (
        "or θ quadrature ring",
        false,
        &["θ ring A", "θ ring B", "θ ring index"],
    ),
    ("θ home switch", false, &["θ home switch"]),
    ("enable of the drivers", false, &["drivers' current"]),
    (
        "alarms of the drivers",
        false,
        &["θ driver's alarm", "φ driver's alarm"],
    ),
    (
        "chain and relay",
        false,
        &["interlock chain", "interlock relay"],
    ),
    ("φ driver and motor", true, &["φ step", "φ direction"]),
    (
        "φ ring encoder (RS-422)",
        true,
        &["φ encoder clock", "φ encoder data"],
    ),
    (
        "or φ quadrature ring",
        true,
        &["φ ring A", "φ ring B", "φ ring index"],
    ),
    ("φ home switch", true, &["φ home switch"]),
    ("brakes", true, &["brakes"]),
    ("camera, other arm", true, &["trigger out", "trigger in"]),
    ("jumper: camera arm", true, &["camera arm"]),
    ("host", true, &["host: transmit", "host: receive"]),
];

const WIDTH: u32 = 980;
const BOX_W: u32 = 190;
const ROW: u32 = 24;
const GAP: u32 = 16;
const TOP: u32 = 56;
/// Edges of the board.
const BOARD: (u32, u32) = (260, 720);

/// The figure of these uses of pins, as SVG. Text is dark and ground light, so that it reads on any page.
pub fn figure(board: &Board, all: &[Use]) -> String {
    let mut body = String::new();
    let mut ends = [TOP; 2];
    let mut drawn = Vec::new();
    for &(name, is_right, roles) in BOXES {
        let rows: Vec<&Use> = all
            .iter()
            .filter(|this| roles.contains(&this.role))
            .collect();
        drawn.extend(rows.iter().map(|this| this.wire.pin));
        let end = &mut ends[usize::from(is_right)];
        *end += device(&mut body, name, is_right, *end, &rows);
    }
    // What has no box of its own yet is drawn all the same.
    let others: Vec<&Use> = all
        .iter()
        .filter(|this| !drawn.contains(&this.wire.pin))
        .collect();
    if !others.is_empty() {
        ends[1] += device(&mut body, "others", true, ends[1], &others);
    }
    let height = ends[0].max(ends[1]) + 34;
    let (left, right) = BOARD;
    let (board_w, board_h, middle) = (right - left, height - 74, (left + right) / 2);
    let title = board.title;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n\
         <title>Wiring of the {title}</title>\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n\
         <rect x=\"{left}\" y=\"40\" width=\"{board_w}\" height=\"{board_h}\" rx=\"8\" fill=\"#eef3ee\" \
         stroke=\"#476\"/>\n\
         <text x=\"{middle}\" y=\"26\" text-anchor=\"middle\" font-size=\"17\" fill=\"#222\">{title}</text>\n\
         {body}<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\" font-size=\"11\" fill=\"#222\">\
         10 kΩ ↓: resistor to ground, 10 kΩ ↑: to 3.3 V; grounds are not drawn</text>\n</svg>\n",
        height - 12
    )
}

/// Draws a box with its wires from a height on. Returns how much of the height it took.
fn device(body: &mut String, name: &str, is_right: bool, top: u32, rows: &[&Use]) -> u32 {
    let height = ROW * (rows.len() as u32).max(1) + 14;
    let x = if is_right { WIDTH - BOX_W - 8 } else { 8 };
    // Writing to a string does not fail.
    let _ = writeln!(
        body,
        "<rect x=\"{x}\" y=\"{top}\" width=\"{BOX_W}\" height=\"{height}\" rx=\"4\" fill=\"#f4f4fa\" stroke=\"#558\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\" fill=\"#222\">{name}</text>",
        x + BOX_W / 2,
        top + height / 2 + 4
    );
    for (i, this) in rows.iter().enumerate() {
        wire(body, is_right, top + 7 + ROW * i as u32 + ROW / 2, this);
    }
    height + GAP
}

fn wire(body: &mut String, is_right: bool, y: u32, this: &Use) {
    let (left, right) = BOARD;
    let (from, to, at, anchor) = if is_right {
        (right, WIDTH - BOX_W - 8, right - 8, "end")
    } else {
        (8 + BOX_W, left, left + 8, "start")
    };
    let resistor = match this.resistor {
        Some(Level::Low) => "10 kΩ ↓",
        Some(Level::High) => "10 kΩ ↑",
        None => "",
    };
    let role = this.role;
    let short = role
        .split_once(' ')
        .map_or(role, |(first, rest)| match first {
            "θ" | "φ" => rest,
            _ => role,
        });
    let (pin, place) = (this.wire.pin, this.wire.place);
    let _ = writeln!(
        body,
        "<path d=\"M{from} {y}H{to}\" stroke=\"#333\"/>\
         <text x=\"{at}\" y=\"{}\" text-anchor=\"{anchor}\" font-size=\"11\" fill=\"#222\">\
         {pin} · {place}: {short}</text>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"10\" fill=\"#222\">{resistor}</text>",
        y + 4,
        (from + to) / 2,
        y - 3
    );
}
