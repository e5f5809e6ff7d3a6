//! A program that is run for every frame, and exposes it.

use crate::camera::files::frame_of;
use crate::camera::natural_order::in_order;
use crate::camera::source::{Camera, CameraError, Pulse};
use crate::program;
use gonia_rig::{Frame, FrameRow, Rig};
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

/// Runs a command for each frame.
pub struct CommandCamera {
    rig: Rig,
    run: Vec<String>,
    timeout: Duration,
}

impl CommandCamera {
    /// `run` is the program and its arguments, with the placeholders of `rig.toml`; it is killed when it
    /// takes longer than `timeout_s` seconds.
    pub fn new(rig: &Rig, run: Vec<String>, timeout_s: f64) -> Self {
        Self {
            rig: rig.clone(),
            run,
            timeout: Duration::from_secs_f64(timeout_s),
        }
    }

    fn command(&self, shot: &FrameRow, file: &str) -> Option<Command> {
        let degrees = |value: f64| format!("{value:.4}");
        let (light, view) = (shot.pose.light, shot.pose.view);
        let fill = |word: &String| {
            word.replace("{file}", file)
                .replace("{role}", shot.role.name())
                .replace("{index}", &shot.frame.to_string())
                .replace("{theta_i}", &degrees(light.theta_deg()))
                .replace("{phi_i}", &degrees(light.phi_deg()))
                .replace("{theta_v}", &degrees(view.theta_deg()))
                .replace("{phi_v}", &degrees(view.phi_deg()))
        };
        let (program, arguments) = self.run.split_first()?;
        let mut command = Command::new(program);
        command.args(arguments.iter().map(fill));
        Some(command)
    }
}

impl Camera for CommandCamera {
    fn identity(&self) -> String {
        format!("command {}", self.run.join(" "))
    }

    fn ready(&mut self, _: usize) -> Result<usize, CameraError> {
        Ok(0)
    }

    fn fetch(&mut self, shot: &FrameRow, pulses: &[Pulse]) -> Result<Frame, CameraError> {
        let folder = tempfile::tempdir().map_err(CameraError::TemporaryFolder)?;
        let file = folder.path().join("frame");
        let mut command = self
            .command(shot, &file.to_string_lossy())
            .ok_or(CameraError::NoProgram)?;
        program::run(&mut command, self.timeout).map_err(|source| CameraError::Program {
            program: self.run.first().cloned().unwrap_or_default(),
            source,
        })?;
        let files: Vec<PathBuf> = std::fs::read_dir(folder.path())
            .map_err(CameraError::TemporaryFolder)?
            .filter_map(|item| Some(item.ok()?.path()))
            .collect();
        let files = in_order(files);
        let (came, expected) = (files.len(), pulses.len());
        if came != expected {
            return Err(CameraError::FilesOfProgram { came, expected });
        }
        frame_of(&self.rig, &files, pulses)
    }

    fn reopen(&mut self) -> Result<(), CameraError> {
        Ok(())
    }

    fn exposes_in_fetch(&self) -> bool {
        true
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use gonia_brdf::{Direction, Pose};
    use gonia_formats::frame_exr::write_frame;
    use gonia_rig::Role;

    fn fetch(run: &[&str], timeout_s: f64) -> Result<Frame, CameraError> {
        let run = run.iter().map(|word| (*word).to_owned()).collect();
        let up = Direction::from_deg(0.0, 0.0);
        let row = FrameRow {
            frame: 3,
            role: Role::Material,
            pose: Pose {
                light: up,
                view: up,
            },
            file: String::new(),
        };
        CommandCamera::new(&Rig::paper(32), run, timeout_s).fetch(&row, &[Pulse::new(0.01, 0)])
    }

    #[test]
    fn a_program_leaves_the_frame_of_its_pose_or_says_why_not() {
        let folder = tempfile::tempdir().unwrap();
        let frame = Frame {
            width: 32,
            height: 32,
            rgb: vec![[0.5; 3]; 32 * 32],
        };
        write_frame(&folder.path().join("material_3.exr"), &frame).unwrap();
        let from = folder.path().join("{role}_{index}.exr");
        let from = from.to_str().unwrap();
        assert_eq!(fetch(&["cp", from, "{file}.exr"], 10.0).unwrap(), frame);
        for (run, said) in [
            (&["false", "{file}"][..], "ended with"),
            (&["true", "{file}"], "left 0 files where 1 are due"),
            (&["no-such-program", "{file}"], "cannot be run"),
            (&["sleep", "30"], "did not end within 0.05 s"),
        ] {
            let error = fetch(run, if run[0] == "sleep" { 0.05 } else { 10.0 }).unwrap_err();
            assert!(error.to_string().contains(said), "{error}");
        }
    }
}
