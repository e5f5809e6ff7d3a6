//! The temperature, read by a program.

use crate::program::{self, ProgramError};
use gonia_rig::Thermometer;
use std::process::Command;
use std::time::Duration;

/// A program that takes longer than this does not answer.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Why a session waits for a temperature.
#[derive(Debug, thiserror::Error)]
pub enum TemperatureError {
    /// Too cold or too warm, degrees Celsius.
    #[error("the temperature is {degrees} degrees C, and {least} to {most} are allowed")]
    OutOfLimits {
        /// The reading.
        degrees: f64,
        /// The lower limit.
        least: f64,
        /// The upper limit.
        most: f64,
    },
    /// The program gave no reading.
    #[error("the thermometer {name} {source}; run it by hand")]
    Program {
        /// The program.
        name: String,
        /// What became of it.
        source: ProgramError,
    },
    /// The program's first word is no number.
    #[error("the thermometer {name} says \"{word}\", which is no number; run it by hand")]
    NoNumber {
        /// The program.
        name: String,
        /// Its first word.
        word: String,
    },
}

/// Whether the temperature is within its limits.
///
/// # Errors
/// It is not, or is not known.
pub fn check(thermometer: &Thermometer) -> Result<(), TemperatureError> {
    let [least, most] = thermometer.limits_c;
    let degrees = read(&thermometer.run)?;
    if (least..=most).contains(&degrees) {
        return Ok(());
    }
    Err(TemperatureError::OutOfLimits {
        degrees,
        least,
        most,
    })
}

/// The number that a program prints, degrees Celsius.
fn read(run: &[String]) -> Result<f64, TemperatureError> {
    let name = || run.first().cloned().unwrap_or_default();
    let mut command = Command::new(name());
    command.args(run.get(1..).unwrap_or_default());
    let said = program::run(&mut command, TIMEOUT).map_err(|source| TemperatureError::Program {
        name: name(),
        source,
    })?;
    let said = String::from_utf8_lossy(&said);
    let word = said.split_whitespace().next().unwrap_or_default();
    match word.parse::<f64>() {
        Ok(degrees) if degrees.is_finite() => Ok(degrees),
        _ => Err(TemperatureError::NoNumber {
            name: name(),
            word: word.to_owned(),
        }),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_program_says_how_warm_it_is_or_why_nobody_knows() {
        for (run, said) in [
            (&["echo", "22.5 C"][..], None),
            (&["echo", "18"], None),
            (&["echo", "31.5"], Some("is 31.5 degrees C, and 18 to 26")),
            (&["echo", "warm"], Some("says \"warm\"")),
            (&["echo", "nan"], Some("is no number")),
            (&["true"], Some("says \"\"")),
            (&["false"], Some("ended with")),
            (&["no-such-program"], Some("cannot be run")),
        ] {
            let thermometer = Thermometer {
                run: run.iter().map(|word| (*word).to_owned()).collect(),
                limits_c: [18.0, 26.0],
                every_s: 60.0,
            };
            match (check(&thermometer), said) {
                (Ok(()), None) => {}
                (Err(why), Some(said)) => {
                    assert!(why.to_string().contains(said), "{why}");
                }
                other => panic!("{run:?}: {other:?}"),
            }
        }
    }
}
