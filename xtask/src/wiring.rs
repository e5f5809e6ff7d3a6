//! The wiring pages: each board's tables and figure, made from its pins.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gonia_pins::boards::BOARDS;
use gonia_pins::{Board, Level, StepEdge, Use};

use crate::wiring_figure;

const BEGIN: &str = "<!-- wiring: made by cargo xtask wiring -->\n";
const END: &str = "<!-- end of wiring -->";

/// Writes every page's part that is made, and every figure.
pub fn write(root: &Path) -> Result<()> {
    for (path, text) in made(root)? {
        std::fs::write(&path, text).with_context(|| format!("{}", path.display()))?;
        println!("{}", path.display());
    }
    Ok(())
}

/// Whether pages and figures are what the pins say.
pub fn check(root: &Path) -> Result<()> {
    for (path, text) in made(root)? {
        let is = std::fs::read_to_string(&path);
        // A checkout on Windows has its own ends of lines.
        if is.unwrap_or_default().replace("\r\n", "\n") != text {
            let path = path.display();
            bail!("{path} is not what the pins say: run cargo xtask wiring");
        }
    }
    Ok(())
}

/// Files and what they are to hold.
fn made(root: &Path) -> Result<Vec<(PathBuf, String)>> {
    let mut files = Vec::new();
    for board in BOARDS {
        let folder = root.join("docs/src/guides");
        let page = folder.join(format!("wiring-{}.md", board.name));
        let text = std::fs::read_to_string(&page).with_context(|| {
            let page = page.display();
            format!("{page}: every board has a page; copy that of another board")
        })?;
        let text = rewritten(&text.replace("\r\n", "\n"), &tables(board)?)
            .with_context(|| format!("{}", page.display()))?;
        files.push((page, text));
        let figure = folder.join(format!("wiring-{}.svg", board.name));
        files.push((figure, wiring_figure::figure(board, &uses(board))));
    }
    Ok(files)
}

fn rewritten(page: &str, made: &str) -> Result<String> {
    let (before, rest) = page
        .split_once(BEGIN)
        .context("no line that begins the wiring")?;
    let (_, after) = rest
        .split_once(END)
        .context("no line that ends the wiring")?;
    Ok(format!("{before}{BEGIN}{made}{END}{after}"))
}

/// Every use of a pin, in the order of the page.
fn uses(board: &Board) -> Vec<Use> {
    let mut uses = Vec::new();
    board.for_each_use(|this| uses.push(this));
    let place = |this: &Use| ROLES.iter().position(|(role, _)| *role == this.role);
    uses.sort_by_key(|this| place(this).unwrap_or(usize::MAX));
    uses
}

/// What is connected where, in the order of the page.
const ROLES: &[(&str, &str)] = &[
    (
        "host: transmit",
        "the receiver of the host's UART, 921,600 baud, 3.3 V",
    ),
    ("host: receive", "the transmitter of the host's UART"),
    ("θ step", "step input of θ's driver"),
    ("θ direction", "direction input of θ's driver"),
    ("φ step", "step input of φ's driver"),
    ("φ direction", "direction input of φ's driver"),
    ("drivers' current", "enable input of the driver"),
    (
        "θ encoder clock",
        "RS-422 driver of the ring's clock, 328 kHz",
    ),
    ("θ encoder data", "RS-422 receiver of the ring's data"),
    ("φ encoder clock", "the same of φ's ring"),
    ("φ encoder data", "the same of φ's ring"),
    (
        "θ ring A",
        "line receiver of a quadrature ring's A, in place of clock and data (`encoder_kind` 2)",
    ),
    ("θ ring B", "the same of its B"),
    ("θ ring index", "the same of its index (Z, reference mark)"),
    ("φ ring A", "the same of φ's ring"),
    ("φ ring B", "the same of φ's ring"),
    ("φ ring index", "the same of φ's ring"),
    (
        "θ home switch",
        "to ground; normally closed, it opens at home (`home_normally_closed`)",
    ),
    ("φ home switch", "the same of φ"),
    (
        "θ driver's alarm",
        "to ground while all is well: alarm output of θ's driver",
    ),
    ("φ driver's alarm", "the same of φ's driver"),
    (
        "θ driver's UART or select",
        "PDN_UART of a TMC2209 through 1 kΩ, or CSN of a TMC5160, where `driver_kind` says so",
    ),
    ("φ driver's UART or select", "the same of φ's driver"),
    ("drivers' clock", "SCK of both TMC5160"),
    ("drivers' data in", "SDI of both TMC5160"),
    ("drivers' data out", "SDO of both TMC5160"),
    (
        "brakes",
        "high lets them go: the coils of both, through a transistor; without power they are engaged",
    ),
    (
        "interlock chain",
        "to ground while closed: emergency stops, door, both relays in series",
    ),
    (
        "interlock relay",
        "high closes a contact in the chain: a relay with a make contact, through a transistor",
    ),
    (
        "trigger out",
        "the camera (camera arm only), and trigger in of the light arm",
    ),
    ("trigger in", "trigger out of the camera arm"),
    (
        "camera arm",
        "a jumper to ground on the camera arm; open on the light arm",
    ),
];

fn tables(board: &Board) -> Result<String> {
    let mut text = format!(
        "\n![Wiring of the {}](wiring-{}.svg)\n\n",
        board.title, board.name
    );
    text += "| function | pin | on the board | to |\n|---|---|---|---|\n";
    for this in uses(board) {
        let (role, pin, place) = (this.role, this.wire.pin, this.wire.place);
        let to = ROLES.iter().find(|(name, _)| *name == role);
        let (_, to) = to.with_context(|| format!("{role}: say in wiring.rs what it goes to"))?;
        writeln!(text, "| {role} | {pin} | {place} | {to} |")?;
    }
    text += "\nIn reset, and until the program sets them, all pins float. A resistor of 10 kΩ at each of these holds it off:\n\n";
    text += "| pin | resistor to | so that in reset there is | when the processor stops |\n|---|---|---|---|\n";
    for this in uses(board) {
        let Some(level) = this.resistor else { continue };
        let to = match level {
            Level::Low => "ground",
            Level::High => "3.3 V",
        };
        let (none, stops) = when_off(board, this.role)?;
        writeln!(
            text,
            "| {} ({}) | {to} | {none} | {stops} |",
            this.wire.pin, this.role
        )?;
    }
    text.push('\n');
    Ok(text)
}

/// What an output does in reset, and when the processor stops.
fn when_off(board: &Board, role: &str) -> Result<(&'static str, &'static str)> {
    let is_step = role.ends_with("step");
    let axis = &board.axes[usize::from(role.starts_with('φ'))];
    Ok(match role {
        _ if is_step && axis.edge == StepEdge::Interrupt => {
            ("no step", "no step: the processor makes each")
        }
        _ if is_step => ("no step", "no step after 10 ms: TIM8 stops both timers"),
        _ if role.ends_with("direction") => ("a direction, and no step", "as it was"),
        "drivers' current" => (
            "no current",
            "as it was until the watchdog's reset (0.07 s to 0.19 s), then off",
        ),
        "brakes" => (
            "no brake let go",
            "they engage after 10 ms, while the drivers still hold the arm: TIM8 again",
        ),
        "interlock relay" => ("an open chain", "the chain opens after 10 ms: TIM8 again"),
        "trigger out" => (
            "no pulse",
            "a pulse under way ends by itself, or at the reset",
        ),
        other => bail!("{other}: say in wiring.rs what it does in reset"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pin_of_every_board_stands_in_its_tables_and_its_figure() {
        for board in BOARDS {
            let (text, figure) = (
                tables(board).unwrap(),
                wiring_figure::figure(board, &uses(board)),
            );
            for this in uses(board) {
                let row = format!("| {} | {} |", this.role, this.wire.pin);
                assert!(text.contains(&row), "{}: {row}", board.name);
                let label = format!("{} · {}", this.wire.pin, this.wire.place);
                assert!(figure.contains(&label), "{}: {label}", board.name);
            }
        }
    }

    #[test]
    fn only_what_stands_between_the_marks_is_rewritten() {
        let page = format!("before\n{BEGIN}old\n{END}\nafter\n");
        let new = rewritten(&page, "new\n").unwrap();
        assert_eq!(new, page.replace("old", "new"));
        assert!(rewritten("no marks", "new").is_err());
    }

    #[test]
    fn an_active_low_enable_is_pulled_up() {
        let text = tables(&gonia_pins::boards::BTT_OCTOPUS).unwrap();
        assert!(
            text.contains("| PF14 (drivers' current) | 3.3 V | no current |"),
            "{text}"
        );
        assert!(text.contains("| PF13 (θ step) | ground | no step | no step: the processor"));
    }
}
