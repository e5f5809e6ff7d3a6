//! What `rig.toml` says of the bench itself: ports, where frames come from, how a session goes. Only
//! `gonia capture` needs it.

use crate::genicam::{Genicam, default_timeout_s};
use crate::rig_error::RigError;
use crate::sensor::Sensor;
use serde::{Deserialize, Serialize};

/// The arms' controllers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmPorts {
    /// Port of the light arm's controller.
    pub light: String,
    /// Port of the camera arm's controller.
    pub camera: String,
    /// Bits a second.
    #[serde(default = "default_baud")]
    pub baud: u32,
    /// Light and view nearer to each other than this would make the arms touch, degrees.
    #[serde(default)]
    pub keep_out_deg: f64,
}

/// Where frames come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Source {
    /// The simulated rig, with its own arms.
    Simulated {
        /// Seed of all that is random in it.
        #[serde(default = "default_seed")]
        seed: u64,
        /// Frames and readings are those of the commanded pose, so that every take of it gives the
        /// same bytes: to test what becomes of a session, not what arms do.
        #[serde(default)]
        exact: bool,
    },
    /// A folder that another program fills: a file a trigger pulse, in the order of their names.
    Folder {
        /// The folder, relative to that of `rig.toml`.
        path: String,
        /// How long a frame may take after its trigger, seconds.
        #[serde(default = "default_timeout_s")]
        timeout_s: f64,
    },
    /// A program that is run for every frame, and exposes it.
    Command {
        /// The program and its arguments. `{file}` is where it must leave the frame; `{role}`,
        /// `{index}`, `{theta_i}`, `{phi_i}`, `{theta_v}` and `{phi_v}` say what it is of.
        run: Vec<String>,
        /// How long it may take, seconds.
        #[serde(default = "default_timeout_s")]
        timeout_s: f64,
    },
    /// A GigE Vision camera.
    Genicam(Genicam),
}

/// How a session goes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SessionSettings {
    /// Whether the reference is measured over the whole plan before the material.
    pub reference: bool,
    /// Exposure times of a shot's pulses, seconds: more than one are brackets of raw exposures.
    pub exposures_s: Vec<f64>,
    /// After so many poses the first one is taken again and compared: the control pose.
    pub control_every: usize,
    /// By how much its brightness may have changed, as a share.
    pub drift_limit: f64,
    /// A pause between two looks at what is wrong, seconds.
    pub pause_s: f64,
    /// How often something is tried again before the session stops.
    pub max_retries: u32,
    /// The session pauses while the disk has less room than this, MB.
    pub disk_reserve_mb: u64,
    /// The session pauses while it is colder or warmer than this says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thermometer: Option<Thermometer>,
}

/// A program that says how warm it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thermometer {
    /// The program and its arguments. The first word that it prints is a number of degrees Celsius.
    pub run: Vec<String>,
    /// The least and the most at which the session goes on, degrees Celsius.
    pub limits_c: [f64; 2],
    /// Time between two readings, seconds.
    #[serde(default = "default_every_s")]
    pub every_s: f64,
}

impl Default for SessionSettings {
    fn default() -> Self {
        Self {
            reference: true,
            exposures_s: vec![0.01],
            control_every: 100,
            drift_limit: 0.02,
            pause_s: 30.0,
            max_retries: 10,
            disk_reserve_mb: 500,
            thermometer: None,
        }
    }
}

/// What the project's own board speaks.
pub const DEFAULT_BAUD: u32 = 921_600;

fn default_baud() -> u32 {
    DEFAULT_BAUD
}

fn default_seed() -> u64 {
    1
}

fn default_every_s() -> f64 {
    60.0
}

/// Checks that a bench could be as `rig.toml` says.
///
/// # Errors
/// The first value that is not possible.
pub(crate) fn check_bench(
    arms: Option<&ArmPorts>,
    source: Option<&Source>,
    session: Option<&SessionSettings>,
    sensor: Option<&Sensor>,
) -> Result<(), RigError> {
    if let Some(arms) = arms
        && !(0.0..180.0).contains(&arms.keep_out_deg)
    {
        return refuse(
            "arms.keep_out_deg",
            format!("{} degrees are not possible", arms.keep_out_deg),
            "give degrees from 0 to below 180",
        );
    }
    if let Some(source) = source {
        check_source(source, session, sensor)?;
    }
    session.map_or(Ok(()), check_session)
}

fn check_source(
    source: &Source,
    session: Option<&SessionSettings>,
    sensor: Option<&Sensor>,
) -> Result<(), RigError> {
    match source {
        Source::Folder { timeout_s, .. }
        | Source::Command { timeout_s, .. }
        | Source::Genicam(Genicam { timeout_s, .. })
            if !(0.01..=86_400.0).contains(timeout_s) =>
        {
            refuse(
                "source.timeout_s",
                format!("{timeout_s} s is not possible"),
                "give seconds from 0.01 to 86400",
            )
        }
        Source::Command { run, .. }
            if run.is_empty() || !run.iter().any(|word| word.contains("{file}")) =>
        {
            refuse(
                "source.run",
                "names no {file}".into(),
                "give a program and its arguments, one of them {file}: where it leaves the frame",
            )
        }
        Source::Genicam(camera) => camera.check(sensor, session.map_or(1, |s| s.exposures_s.len())),
        _ => Ok(()),
    }
}

fn check_session(session: &SessionSettings) -> Result<(), RigError> {
    let times = &session.exposures_s;
    if times.is_empty() || times.len() > 8 || !times.iter().all(|t| (1e-5..=600.0).contains(t)) {
        return refuse(
            "session.exposures_s",
            format!("{times:?} is not possible"),
            "give one to eight times from 0.00001 to 600 s",
        );
    }
    if session.control_every == 0 {
        return refuse(
            "session.control_every",
            "0 is not possible".into(),
            "give a number of poses, 1 or more",
        );
    }
    if !(session.drift_limit > 0.0 && session.drift_limit <= 1.0) {
        return refuse(
            "session.drift_limit",
            format!("{} is not possible", session.drift_limit),
            "give a share above 0 and at most 1",
        );
    }
    if !(0.0..=86_400.0).contains(&session.pause_s) {
        return refuse(
            "session.pause_s",
            format!("{} s is not possible", session.pause_s),
            "give seconds from 0 to 86400",
        );
    }
    session
        .thermometer
        .as_ref()
        .map_or(Ok(()), check_thermometer)
}

fn check_thermometer(thermometer: &Thermometer) -> Result<(), RigError> {
    if thermometer.run.is_empty() {
        return refuse(
            "session.thermometer.run",
            "names no program".into(),
            "give a program that prints degrees Celsius, and its arguments",
        );
    }
    let [least, most] = thermometer.limits_c;
    if !(least.is_finite() && most.is_finite() && least < most) {
        return refuse(
            "session.thermometer.limits_c",
            format!("{least} to {most} is not possible"),
            "give the least and the most degrees Celsius",
        );
    }
    if !(0.0..=86_400.0).contains(&thermometer.every_s) {
        return refuse(
            "session.thermometer.every_s",
            format!("{} s is not possible", thermometer.every_s),
            "give seconds from 0 to 86400",
        );
    }
    Ok(())
}

fn refuse(key: &'static str, problem: String, remedy: &str) -> Result<(), RigError> {
    Err(RigError::new(key, problem, remedy))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thermometer_needs_a_program_and_limits_between_which_something_is() {
        let read = |text: &str| toml::from_str::<SessionSettings>(text).unwrap();
        let settings = read("[thermometer]\nrun = [\"cat\", \"t\"]\nlimits_c = [18, 26.5]\n");
        assert_eq!(settings.thermometer.as_ref().unwrap().every_s, 60.0);
        assert!(check_bench(None, None, Some(&settings), None).is_ok());
        for (key, text) in [
            ("run", "run = []\nlimits_c = [18, 26]"),
            ("limits_c", "run = [\"t\"]\nlimits_c = [26, 18]"),
            ("limits_c", "run = [\"t\"]\nlimits_c = [nan, 26]"),
            (
                "every_s",
                "run = [\"t\"]\nlimits_c = [18, 26]\nevery_s = -1",
            ),
        ] {
            let settings = read(&format!("[thermometer]\n{text}\n"));
            let refused = check_bench(None, None, Some(&settings), None).unwrap_err();
            assert_eq!(refused.key, format!("session.thermometer.{key}"));
        }
    }
}
