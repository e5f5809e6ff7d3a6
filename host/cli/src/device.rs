//! `gonia device`: the controller of one arm, for a person at the rig.

use crate::remarks;
use crate::say::{self, outln};
use crate::table;
use anyhow::{Context, Result, bail};
use clap::{Subcommand, ValueEnum};
use gonia_acquire::link::{
    LinkError, RemoteController, StreamTransport, Ticket, calibrate_axis, is_uncalibrated,
};
use gonia_protocol::NODE_ANY;
use gonia_protocol::message::{ControllerState, RequestOutcome, RequestRefusal};
use gonia_protocol::settings::{Axis, MEANINGS, Meaning};
use std::io::{BufRead, IsTerminal, Write};

/// Longest homing or move, µs.
const LIMIT_US: u64 = 240_000_000;
/// While an arm moves its place is printed this often, µs.
const PRINT_US: u64 = 500_000;

/// Talks to the controller of one arm.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia device /dev/ttyACM0 identify\n  gonia device /dev/ttyACM0 home\n  gonia device /dev/ttyACM0 move 15 90\n  gonia device /dev/ttyACM0 jog theta -0.5\n  gonia device /dev/ttyACM0 set theta home_angle -4980000\n  gonia device /dev/ttyACM0 calibrate phi --from -180 --to 165 --stands 24\n  gonia device unix:wire.sock monitor --seconds 10\n\nAngles are in degrees; settings are in their own units (see `settings`)."
)]
pub struct Device {
    /// A serial port, or unix:PATH for a socket
    port: String,
    /// Baud rate of the serial port
    #[arg(long, default_value_t = gonia_rig::DEFAULT_BAUD)]
    baud: u32,
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Its board, firmware and settings, and which of its encoders were never calibrated
    Identify,
    /// Its state, and where its axes are
    Status,
    /// Print where it is until the time is over
    Monitor {
        /// How long
        #[arg(long, value_name = "S", default_value_t = 60.0)]
        seconds: f64,
    },
    /// Home both axes
    Home,
    /// Move both axes to angles
    #[command(allow_negative_numbers = true)]
    Move {
        /// Polar angle, degrees
        theta: f64,
        /// Azimuth, degrees
        phi: f64,
    },
    /// Move one axis by an angle
    #[command(allow_negative_numbers = true)]
    Jog {
        /// Which axis
        axis: AxisName,
        /// By how much, degrees
        by: f64,
    },
    /// Slow down and stop
    Stop,
    /// Stop at once; the other arm stops too
    Estop,
    /// Clear a latched fault or an emergency stop, when its cause is gone
    Clear,
    /// The last faults and warnings, newest first
    Log,
    /// Every setting, with its unit
    Settings,
    /// Change a setting until the next restart
    #[command(allow_negative_numbers = true)]
    Set {
        /// Of which axis
        axis: AxisName,
        /// Its name, as `settings` prints it
        key: String,
        /// In the setting's unit
        value: i32,
    },
    /// Keep the settings in the board's memory
    Save,
    /// Measure the error of an encoder against a reference, whose readings are asked for (degrees, a
    /// line each on standard input)
    #[command(allow_negative_numbers = true)]
    Calibrate {
        /// Which axis
        axis: AxisName,
        /// First stand, degrees
        #[arg(long)]
        from: f64,
        /// Last stand, degrees
        #[arg(long)]
        to: f64,
        /// How many stands
        #[arg(long, default_value_t = 12)]
        stands: u16,
        /// The reference's zero is the axis's zero too
        #[arg(long)]
        absolute: bool,
    },
}

#[derive(Clone, Copy, ValueEnum)]
enum AxisName {
    Theta,
    Phi,
}

impl From<AxisName> for Axis {
    fn from(name: AxisName) -> Self {
        match name {
            AxisName::Theta => Axis::Theta,
            AxisName::Phi => Axis::Phi,
        }
    }
}

impl Device {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let mut arm = connect(&self.port, self.baud)?;
        let done = self.action.run(&mut arm);
        remarks::print(&arm.take_remarks());
        done
    }
}

impl Action {
    fn run(self, arm: &mut RemoteController) -> Result<()> {
        match self {
            Action::Identify => identify(arm),
            Action::Status => status(arm),
            Action::Monitor { seconds } => monitor(arm, seconds),
            Action::Home => {
                let ticket = arm.home()?;
                follow(arm, ticket, "homing")
            }
            Action::Move { theta, phi } => move_to(arm, [theta, phi]),
            Action::Jog { axis, by } => {
                let axes = arm.status()?.axes;
                let mut target = axes.map(|axis| f64::from(axis.encoder_udeg) * 1e-6);
                target[Axis::from(axis).index()] += by;
                move_to(arm, target)
            }
            Action::Stop => Ok(arm.stop()?),
            Action::Estop => Ok(arm.emergency_stop()?),
            Action::Clear => Ok(arm.clear_fault()?),
            Action::Log => log(arm),
            Action::Settings => settings(arm),
            Action::Set { axis, key, value } => set(arm, axis.into(), &key, value),
            Action::Save => Ok(arm.save_settings()?),
            Action::Calibrate {
                axis,
                from,
                to,
                stands,
                absolute,
            } => calibrate(arm, axis.into(), &spread(from, to, stands)?, absolute),
        }
    }
}

fn connect(port: &str, baud: u32) -> Result<RemoteController> {
    let transport = match port.strip_prefix("unix:") {
        #[cfg(unix)]
        Some(path) => StreamTransport::open_unix(path.as_ref()),
        #[cfg(not(unix))]
        Some(_) => bail!("{port}: this system has no Unix sockets"),
        None => StreamTransport::open_serial(port, baud),
    };
    // Firmware of another protocol still answers identity, log and stops.
    let transport =
        transport.with_context(|| format!("{port}: cannot be opened; check cable and name"))?;
    RemoteController::connect_for_service(Box::new(transport), NODE_ANY)
        .with_context(|| port.to_owned())
}

fn identify(arm: &mut RemoteController) -> Result<()> {
    let identity = arm.identity().clone();
    let [major, minor, patch] = identity.firmware;
    let mut rows = vec![
        ("controller".to_owned(), arm.name().to_owned()),
        ("board".into(), identity.board.to_string()),
        (
            "firmware".into(),
            format!("{major}.{minor}.{patch} ({})", identity.git),
        ),
        (
            "last start".into(),
            format!("{:?}, start number {}", identity.reset, identity.boot_id),
        ),
        (
            "settings".into(),
            format!("checksum {:08x}", identity.config_crc),
        ),
    ];
    if !identity.last_panic.is_empty() {
        rows.push(("last panic".into(), identity.last_panic.to_string()));
    }
    if let Err(error) = arm.check_version() {
        rows.push((
            "protocol".into(),
            format!("{error}; until then it is not moved"),
        ));
        table::print(&rows);
        return Ok(());
    }
    for axis in Axis::BOTH {
        let state = if is_uncalibrated(arm, axis)? {
            "not calibrated: how far it is off over the turn is not known"
        } else {
            "calibrated"
        };
        rows.push((format!("{axis:?} encoder").to_lowercase(), state.into()));
    }
    table::print(&rows);
    Ok(())
}

fn status(arm: &mut RemoteController) -> Result<()> {
    let status = arm.status()?;
    let mut rows = vec![
        ("state".to_owned(), state_in_words(status.state)),
        ("homed".into(), yes_no(status.homed)),
    ];
    for (axis, is) in Axis::BOTH.into_iter().zip(status.axes) {
        let deg = |udeg: i32| f64::from(udeg) * 1e-6;
        rows.push((
            format!("{axis:?}").to_lowercase(),
            format!(
                "encoder {:.4} deg, steps {:.4} deg, following error {:.4} deg, {} corrections",
                deg(is.encoder_udeg),
                deg(is.commanded_udeg),
                deg(is.following_udeg),
                is.corrections
            ),
        ));
    }
    rows.push((
        "wire".into(),
        format!(
            "{} packets good, {} damaged",
            status.packets_good, status.packets_bad
        ),
    ));
    table::print(&rows);
    Ok(())
}

fn monitor(arm: &mut RemoteController, seconds: f64) -> Result<()> {
    if !(0.0..=1e6).contains(&seconds) {
        bail!("--seconds {seconds}: must lie in 0..=1000000");
    }
    let until_us = arm.now_us() + (seconds * 1e6) as u64;
    while arm.now_us() < until_us && !say::is_closed() {
        print_place(arm)?;
        arm.rest(PRINT_US)?;
    }
    Ok(())
}

fn print_place(arm: &mut RemoteController) -> Result<()> {
    let status = arm.status()?;
    remarks::print(&arm.take_remarks());
    let [theta, phi] = status.axes.map(|axis| f64::from(axis.encoder_udeg) * 1e-6);
    outln!(
        "{:>9.1} s  theta {theta:>9.4} deg  phi {phi:>9.4} deg  {}",
        status.time_us as f64 * 1e-6,
        state_in_words(status.state)
    );
    Ok(())
}

fn move_to(arm: &mut RemoteController, target_deg: [f64; 2]) -> Result<()> {
    let possible = -720.0..=720.0;
    if !target_deg.iter().all(|deg| possible.contains(deg)) {
        bail!("{target_deg:?}: angles must lie in -720..=720 degrees");
    }
    let ticket = arm.move_to(target_deg.map(|deg| (deg * 1e6).round() as i32))?;
    follow(arm, ticket, "the move")
}

/// Prints where the arm is until it has arrived.
fn follow(arm: &mut RemoteController, ticket: Ticket, what: &str) -> Result<()> {
    let deadline_us = arm.now_us() + LIMIT_US;
    loop {
        let completed = match arm.poll(ticket, PRINT_US)? {
            Some(completed) => completed,
            None if arm.now_us() > deadline_us => arm.must_have_ended(ticket, LIMIT_US)?,
            None => {
                print_place(arm)?;
                continue;
            }
        };
        print_place(arm)?;
        return match completed.outcome {
            RequestOutcome::Done => Ok(()),
            RequestOutcome::Failed(code) => bail!("{what} ended in {code}"),
            outcome => bail!("{what} ended: {outcome:?}"),
        };
    }
}

fn log(arm: &mut RemoteController) -> Result<()> {
    for entry in arm.log()? {
        let axis = entry.axis.map(|axis| format!(" ({axis:?})"));
        if let Some(code) = entry.fault {
            outln!(
                "{:>9.1} s  {code}{}",
                entry.time_us as f64 * 1e-6,
                axis.unwrap_or_default()
            );
        }
    }
    Ok(())
}

fn settings(arm: &mut RemoteController) -> Result<()> {
    let mut rows = vec![("setting".to_owned(), "theta, phi".to_owned())];
    for meaning in &MEANINGS {
        let theta = arm.setting(Axis::Theta, meaning.key)?;
        let phi = arm.setting(Axis::Phi, meaning.key)?;
        let value = format!("{theta}, {phi} {}", meaning.unit);
        rows.push((meaning.name.to_owned(), value));
    }
    table::print(&rows);
    Ok(())
}

fn set(arm: &mut RemoteController, axis: Axis, name: &str, value: i32) -> Result<()> {
    let Some(Meaning { key, min, max, .. }) = MEANINGS.iter().find(|m| m.name == name) else {
        bail!("{name}: no such setting; `settings` prints them all");
    };
    if !(*min..=*max).contains(&value) {
        bail!("{name} {value}: must lie in {min}..={max}");
    }
    let result = arm.set_setting(axis, *key, value);
    match &result {
        Err(LinkError::Refused { refusal, .. }) => match refusal {
            RequestRefusal::Value => bail!(
                "{name} {value} refused: {refusal}; it must also agree with the other settings"
            ),
            _ => bail!("{name} {value} refused: {refusal}"),
        },
        _ => Ok(result?),
    }
}

fn spread(from_deg: f64, to_deg: f64, stands: u16) -> Result<Vec<i32>> {
    let within = |deg: f64| deg.abs() <= 720.0;
    if !within(from_deg) || !within(to_deg) || from_deg >= to_deg || stands < 6 {
        bail!("--from must be below --to, both in -720..=720 degrees, with 6 stands or more");
    }
    let step_deg = (to_deg - from_deg) / f64::from(stands - 1);
    let stand = |i: u16| ((from_deg + step_deg * f64::from(i)) * 1e6).round() as i32;
    Ok((0..stands).map(stand).collect())
}

fn calibrate(arm: &mut RemoteController, axis: Axis, stands: &[i32], absolute: bool) -> Result<()> {
    let is_person = std::io::stdin().is_terminal();
    let mut lines = std::io::stdin().lock().lines();
    let mut n = 0;
    let mut ask = |arm: &mut RemoteController, encoder_deg: f64| {
        n += 1;
        // Readings from a file need no prompt, and an error is then a line of its own.
        if is_person {
            say::err(format_args!(
                "stand {n} of {}: encoder {encoder_deg:.5} deg; reference (deg): ",
                stands.len()
            ));
            let _ = std::io::stderr().flush();
        }
        let line = lines.next().ok_or("the input has ended")?;
        let line = line.map_err(|error| error.to_string())?;
        arm.keep_alive().map_err(|error| error.to_string())?;
        let reading: f64 = line
            .trim()
            .parse()
            .map_err(|_| format!("{:?} is no number", line.trim()))?;
        if reading.is_finite() {
            Ok(reading)
        } else {
            Err(format!("{reading} is no angle"))
        }
    };
    let found = calibrate_axis(arm, axis, stands, absolute, &mut ask)?;
    let deg = |deg: f64| format!("{deg:.5} deg");
    let mut rows = vec![
        (
            "encoder, RMS before".to_owned(),
            deg(found.encoder.rms_before_deg),
        ),
        (
            "encoder, RMS after".into(),
            deg(found.encoder.rms_after_deg),
        ),
        (
            "encoder's map".into(),
            format!("{:?} µdeg", found.encoder.amplitudes_udeg),
        ),
    ];
    match found.gear {
        Some(gear) => rows.extend([
            ("gear, RMS before".to_owned(), deg(gear.rms_before_deg)),
            ("gear, RMS after".into(), deg(gear.rms_after_deg)),
            (
                "gear's map".into(),
                format!("{:?} µdeg", gear.amplitudes_udeg),
            ),
        ]),
        None => rows.push((
            "gear".into(),
            "not measured: the stands must lie at four or more phases of worm_turn".into(),
        )),
    }
    let limit = deg(f64::from(found.step_loss_limit_udeg) * 1e-6);
    rows.push(("step_loss_limit".into(), limit));
    rows.push(("next".into(), "`save` keeps it".into()));
    table::print(&rows);
    Ok(())
}

fn state_in_words(state: ControllerState) -> String {
    match state {
        ControllerState::Fault(code) => code.to_string(),
        ControllerState::EStop => "emergency stop".into(),
        other => format!("{other:?}").to_lowercase(),
    }
}

fn yes_no(is: bool) -> String {
    if is { "yes" } else { "no" }.into()
}
