//! Runs the commands of a figure, and measures what they take.

use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A command of a figure. `{work}` stands for the folder of what is made, `{root}` for the project's;
/// words NAME=VALUE before the program are its environment; `gonia` is the release build.
pub struct Step {
    pub command: &'static str,
    pub before: Before,
}

/// What is done before a step.
pub enum Before {
    Nothing,
    /// The step prepares this file, and is left out where it is there already. What the step prints is
    /// no part of the figure.
    SkipIf(&'static str),
    /// This folder is removed.
    Remove(&'static str),
}

/// What a step printed and took.
pub struct Ran {
    pub command: &'static str,
    pub stdout: String,
    pub cost: Cost,
}

/// What a process took. CPU time and memory are known on Linux only.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    pub wall_s: f64,
    pub cpu_s: Option<f64>,
    pub peak_mb: Option<f64>,
}

impl Step {
    /// Runs the step. What it prints goes to the terminal as well. `None` where it only prepares.
    pub fn run(&self, root: &Path, work: &Path) -> Result<Option<Ran>> {
        match self.before {
            Before::SkipIf(file) if work.join(file).exists() => return Ok(None),
            Before::Remove(folder) if work.join(folder).exists() => {
                std::fs::remove_dir_all(work.join(folder))?;
            }
            _ => (),
        }
        println!("-- {}", self.command);
        let line = || self.command.to_owned();
        let mut command = command(self.command, root, work)?;
        let start = Instant::now();
        let mut child = command
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start: {}", line()))?;
        let (stdout, mut cost) = watch(&mut child)?;
        let status = child.wait()?;
        cost.wall_s = start.elapsed().as_secs_f64();
        if !status.success() {
            bail!("failed ({status}): {}", line());
        }
        let prepares = matches!(self.before, Before::SkipIf(_));
        Ok((!prepares).then_some(Ran {
            command: self.command,
            stdout,
            cost,
        }))
    }
}

fn command(line: &str, root: &Path, work: &Path) -> Result<Command> {
    let line = line.replace("{work}", &work.display().to_string());
    let line = line.replace("{root}", &root.display().to_string());
    let mut words = line.split(' ').peekable();
    let mut environment = Vec::new();
    while let Some(pair) = words.peek().and_then(|word| word.split_once('=')) {
        environment.push((pair.0.to_owned(), pair.1.to_owned()));
        words.next();
    }
    let program = words.next().context("a step without a program")?;
    let mut command = match program {
        "gonia" => Command::new(gonia(root)),
        program => Command::new(program),
    };
    command.args(words).envs(environment).current_dir(root);
    Ok(command)
}

/// The release build of the program.
fn gonia(root: &Path) -> std::path::PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), Into::into);
    let name = format!("gonia{}", std::env::consts::EXE_SUFFIX);
    target.join("release").join(name)
}

/// What a process prints until it ends, and what it took until then.
fn watch(child: &mut Child) -> Result<(String, Cost)> {
    let id = child.id();
    let stdout = child.stdout.take().context("no output to read")?;
    let has_ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let costs = scope.spawn(|| {
            let mut cost = Cost::default();
            while !has_ended.load(Ordering::Relaxed) {
                cost = taken(id, cost);
                std::thread::sleep(Duration::from_millis(5));
            }
            // The process is not waited for yet, so that its times are still there.
            taken(id, cost)
        });
        let mut text = String::new();
        for line in BufReader::new(stdout).lines() {
            let line = line?;
            println!("{line}");
            text += &line;
            text.push('\n');
        }
        has_ended.store(true, Ordering::Relaxed);
        let cost = costs.join().ok().context("the costs were not measured")?;
        Ok((text, cost))
    })
}

/// CPU time and peak memory of a process so far; what was known before where it tells nothing.
fn taken(id: u32, before: Cost) -> Cost {
    let read = |name: &str| std::fs::read_to_string(format!("/proc/{id}/{name}"));
    let cpu_s = read("stat").ok().and_then(|text| cpu_s(&text));
    let peak_mb = read("status").ok().and_then(|text| peak_mb(&text));
    Cost {
        cpu_s: cpu_s.or(before.cpu_s),
        peak_mb: peak_mb.or(before.peak_mb),
        ..before
    }
}

/// User and system time of all threads, from `/proc/ID/stat`, in hundredths of a second there.
fn cpu_s(stat: &str) -> Option<f64> {
    let (_, after_name) = stat.rsplit_once(')')?;
    let mut fields = after_name.split_whitespace().skip(11);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}

/// The most memory that was resident, from `/proc/ID/status`, MB.
fn peak_mb(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(1.024e-3 * kib)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_memory_are_read_as_linux_writes_them() {
        let stat = "7 (a (strange) name) S 1 7 7 0 -1 4194304 90 0 0 0 250 50 0 0 20 0 1 0";
        assert_eq!(cpu_s(stat), Some(3.0));
        assert_eq!(cpu_s("7 (gone"), None);
        assert_eq!(peak_mb("VmPeak:\t 9 kB\nVmHWM:\t  1000 kB\n"), Some(1.024));
        assert_eq!(peak_mb("State:\tZ (zombie)\n"), None);
    }

    #[test]
    fn a_step_is_run_left_out_or_an_error() {
        let folder = std::env::temp_dir();
        let of = |command, before| Step { command, before }.run(&folder, &folder);
        let ran = of("cargo --version", Before::Nothing).unwrap().unwrap();
        assert!(ran.stdout.starts_with("cargo "), "{}", ran.stdout);
        assert!(ran.cost.wall_s > 0.0);
        // The folder itself stands for a file that is there.
        assert!(of("nobody", Before::SkipIf(".")).unwrap().is_none());
        assert!(
            of("cargo --version", Before::SkipIf("no/file"))
                .unwrap()
                .is_none()
        );
        assert!(of("cargo --no-such-option", Before::Nothing).is_err());
        assert!(of("no-such-program", Before::Nothing).is_err());
    }

    #[test]
    fn a_step_names_its_environment_its_program_and_where_things_are() {
        let line = "ONE=1 TWO={root}/x program --out {work}/y";
        let command = command(line, Path::new("/r"), Path::new("/r/w")).unwrap();
        let of = |name: &str| {
            let mut all = command.get_envs();
            all.find(|(key, _)| *key == name)
                .unwrap()
                .1
                .unwrap()
                .to_owned()
        };
        assert_eq!((of("ONE"), of("TWO")), ("1".into(), "/r/x".into()));
        assert_eq!(command.get_program(), "program");
        let arguments: Vec<_> = command.get_args().collect();
        assert_eq!(arguments, ["--out", "/r/w/y"]);
        assert_eq!(command.get_current_dir(), Some(Path::new("/r")));
    }
}
