//! How warm it is, by a program that knows.

use gonia_rig::Thermometer;
use std::io::Read;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A program that takes longer than this does not answer.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Pause between two looks at it.
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// Whether it is as warm as it may be; what is wrong, in words, where it is not, or where nobody can
/// say.
pub fn check(thermometer: &Thermometer) -> Result<(), String> {
    let [least, most] = thermometer.limits_c;
    let degrees = read(&thermometer.run)?;
    if (least..=most).contains(&degrees) {
        return Ok(());
    }
    Err(format!(
        "the temperature is {degrees} degrees C, and {least} to {most} are allowed"
    ))
}

/// What a program says.
fn read(run: &[String]) -> Result<f64, String> {
    let name = run.first().map_or("", String::as_str);
    let failed = |what: String| format!("the thermometer {name} {what}; run it by hand");
    let mut child = Command::new(name)
        .args(run.get(1..).unwrap_or_default())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|error| failed(format!("cannot be run ({error})")))?;
    let until = Instant::now() + TIMEOUT;
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if Instant::now() < until => std::thread::sleep(LOOK_EVERY),
            Ok(None) => {
                // It may have ended in this moment; then there is nothing to kill.
                let _ = child.kill();
                let _ = child.wait();
                return Err(failed(format!("did not end within {TIMEOUT:?}")));
            }
            Err(error) => return Err(failed(format!("cannot be waited for ({error})"))),
        }
    };
    if !status.success() {
        return Err(failed(format!("ended with {status}")));
    }
    let mut said = [0; 64];
    let n = child
        .stdout
        .as_mut()
        .map_or(Ok(0), |out| out.read(&mut said));
    let said = String::from_utf8_lossy(&said[..n.unwrap_or(0)]);
    let word = said.split_whitespace().next().unwrap_or_default();
    match word.parse::<f64>() {
        Ok(degrees) if degrees.is_finite() => Ok(degrees),
        _ => Err(failed(format!("says \"{word}\", which is no number"))),
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
                (Err(why), Some(said)) => assert!(why.contains(said), "{why}"),
                other => panic!("{run:?}: {other:?}"),
            }
        }
    }
}
