//! The command `gonia`. Each command is one file; all end with exit code 0, with 1 after one line
//! that says what is wrong and what to do, or with 2 for wrong usage.

#![deny(clippy::print_stdout, clippy::print_stderr)]

mod account;
mod baselines;
mod calibrate;
mod capture;
mod chart;
mod chart_motion;
mod colours;
mod compare;
mod demo;
mod device;
mod export;
mod fill;
mod fit;
mod import;
mod output;
mod photo;
mod plan;
mod plan_adaptive;
mod process;
mod progress;
mod query;
mod rectify;
mod remarks;
mod render;
mod report;
mod rivals;
mod sample_facts;
mod say;
mod scale;
mod sim_device;
mod symmetry;
mod table;
mod verify;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Measures dense anisotropic BRDFs with a gonioreflectometer.
#[derive(Parser)]
#[command(name = "gonia", version, about, max_term_width = 100)]
struct Cli {
    /// Threads to compute with [default: all processors]
    #[arg(long, global = true, value_name = "N")]
    threads: Option<std::num::NonZeroUsize>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Measure a material on the simulated rig: arms, frames, bins, dense BRDF, report
    Demo(demo::Demo),
    /// Dry run: poses in travelling order, limits checked, time and disk estimated
    Plan(plan::Plan),
    /// Measure a material: every pose, its frame, its samples; resumable after any end
    Capture(capture::Capture),
    /// Check a session: every checksum, every pose once, every sample
    Verify(verify::Verify),
    /// The rig's geometry from a capture folder's frames
    Calibrate(calibrate::Calibrate),
    /// Frames of a capture folder → samples
    Process(process::Process),
    /// One frame as seen from straight above, or merged from its exposures
    Rectify(rectify::Rectify),
    /// Samples → bins → dense BRDF
    Fill(fill::Fill),
    /// An analytic model fitted to a dense BRDF
    Fit(fit::Fit),
    /// Other people's measurements → dense BRDF
    Import(import::Import),
    /// A dense BRDF → other people's formats
    Export(export::Export),
    /// Values of a dense BRDF at directions read from standard input
    Query(query::Query),
    /// How far one dense BRDF is from another, by stratum
    Compare(compare::Compare),
    /// What accuracy costs, as SVG and CSV
    Chart(chart::Chart),
    /// One HTML file with pictures and figures of a measurement
    Report(report::Report),
    /// A sphere or a draped cylinder of the material
    Render(render::Render),
    /// A photograph of the material beside its render
    Photo(photo::Photo),
    /// Baselines: other ways to the same BRDF, and how far each is from it
    Rivals(rivals::Rivals),
    /// Talk to the controller of an arm: identify, home, move, settings, calibration
    Device(device::Device),
    /// Simulated controllers on pseudo-terminals
    SimDevice(sim_device::SimDevice),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match start(cli).and_then(|()| say::finish()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            say::errln!("gonia: {}", chain_in_one_line(&error));
            ExitCode::FAILURE
        }
    }
}

fn start(cli: Cli) -> anyhow::Result<()> {
    if let Some(threads) = cli.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()?;
    }
    match cli.command {
        Command::Demo(command) => command.run(),
        Command::Plan(command) => command.run(),
        Command::Capture(command) => command.run(),
        Command::Verify(command) => command.run(),
        Command::Calibrate(command) => command.run(),
        Command::Process(command) => command.run(),
        Command::Rectify(command) => command.run(),
        Command::Fill(command) => command.run(),
        Command::Fit(command) => command.run(),
        Command::Import(command) => command.run(),
        Command::Export(command) => command.run(),
        Command::Query(command) => command.run(),
        Command::Compare(command) => command.run(),
        Command::Chart(command) => command.run(),
        Command::Report(command) => command.run(),
        Command::Render(command) => command.run(),
        Command::Photo(command) => command.run(),
        Command::Rivals(command) => command.run(),
        Command::Device(command) => command.run(),
        Command::SimDevice(command) => command.run(),
    }
}

/// The whole chain of causes on one line; a cause that is in the text already is not said again.
fn chain_in_one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain() {
        let text = gonia_formats::one_line(&cause.to_string());
        if !line.contains(&text) {
            if !line.is_empty() {
                line += ": ";
            }
            line += &text;
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn an_error_says_nothing_twice() {
        let inner = anyhow::anyhow!("a.exr: cannot be\nread");
        let error = inner.context("frame 3: a.exr: cannot be read").context("b");
        assert_eq!(
            chain_in_one_line(&error),
            "b: frame 3: a.exr: cannot be read"
        );
    }

    #[test]
    fn every_command_has_help_with_an_example() {
        let mut command = Cli::command();
        command.build();
        for sub in command.get_subcommands_mut() {
            if sub.get_name() == "help" {
                continue;
            }
            let help = sub.render_long_help().to_string();
            assert!(help.contains("Example"), "{}", sub.get_name());
        }
    }
}
