//! A folder that another program fills: a file for every trigger pulse, in the order of their names.

use crate::camera::files::{frame_of, is_foreign};
use crate::camera::source::{Camera, CameraError, Pulse};
use gonia_formats::FileError;
use gonia_rig::{Frame, FrameRow, Rig};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Pause between two looks into the folder.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Watches a folder.
pub struct FolderCamera {
    rig: Rig,
    folder: PathBuf,
    timeout: Duration,
    /// Files that are accounted for.
    seen: BTreeSet<PathBuf>,
}

impl FolderCamera {
    /// Watches a folder; what is in it now is ignored. A frame may take `timeout_s` seconds after its
    /// trigger.
    ///
    /// # Errors
    /// When there is no such folder.
    pub fn open(rig: &Rig, folder: PathBuf, timeout_s: f64) -> Result<Self, CameraError> {
        let mut camera = Self {
            rig: rig.clone(),
            folder,
            timeout: Duration::from_secs_f64(timeout_s),
            seen: BTreeSet::new(),
        };
        camera.seen.extend(camera.new_files()?);
        Ok(camera)
    }

    /// Files that are not accounted for, by name.
    fn new_files(&self) -> Result<Vec<PathBuf>, CameraError> {
        let failed = |error| CameraError::File(FileError::reading(&self.folder, &error));
        let mut files = Vec::new();
        for item in std::fs::read_dir(&self.folder).map_err(failed)? {
            let path = item.map_err(failed)?.path();
            if !is_foreign(&path) && !self.seen.contains(&path) {
                files.push(path);
            }
        }
        files.sort();
        Ok(files)
    }

    /// Waits until so many files are there, at most until the timeout.
    fn wait_for(&self, n: usize, until: Instant) -> Result<Vec<PathBuf>, CameraError> {
        loop {
            let files = self.new_files()?;
            if files.len() >= n || Instant::now() >= until {
                return Ok(files);
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }
}

impl Camera for FolderCamera {
    fn identity(&self) -> String {
        format!("folder {}", self.folder.display())
    }

    fn ready(&mut self, strays: usize) -> Result<usize, CameraError> {
        let files = self.wait_for(strays, Instant::now() + self.timeout)?;
        let unasked = files.len().saturating_sub(strays);
        self.seen.extend(files);
        Ok(unasked)
    }

    fn fetch(&mut self, _: &FrameRow, pulses: &[Pulse]) -> Result<Frame, CameraError> {
        let until = Instant::now() + self.timeout;
        let expected = pulses.len();
        loop {
            let files = self.wait_for(expected, until)?;
            let came = files.len();
            if came > expected {
                self.seen.extend(files);
                return Err(CameraError::TooMany { came, expected });
            }
            if came < expected {
                let timeout_s = self.timeout.as_secs_f64();
                self.seen.extend(files);
                return Err(CameraError::Late {
                    came,
                    expected,
                    timeout_s,
                });
            }
            match frame_of(&self.rig, &files, pulses) {
                // It may still be being written.
                Err(_) if Instant::now() < until => std::thread::sleep(LOOK_EVERY),
                result => {
                    self.seen.extend(files);
                    return result;
                }
            }
        }
    }

    fn reopen(&mut self) -> Result<(), CameraError> {
        self.new_files().map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::source::Camera;
    use gonia_brdf::{Direction, Pose};
    use gonia_formats::frame_exr::write_frame;
    use gonia_rig::Role;

    fn row() -> FrameRow {
        let up = Direction::from_deg(0.0, 0.0);
        FrameRow {
            frame: 0,
            role: Role::Material,
            pose: Pose {
                light: up,
                view: up,
            },
            file: String::new(),
        }
    }

    #[test]
    fn a_pulse_has_one_frame_and_others_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let frame = Frame {
            width: 32,
            height: 32,
            rgb: vec![[0.5; 3]; 32 * 32],
        };
        let put = |name: &str| write_frame(&folder.path().join(name), &frame).unwrap();
        put("old.exr");
        let rig = Rig::paper(32);
        let mut camera = FolderCamera::open(&rig, folder.path().to_owned(), 0.2).unwrap();
        assert_eq!(camera.ready(0).unwrap(), 0);
        put("1.exr");
        std::fs::write(folder.path().join("notes.txt"), "x").unwrap();
        assert_eq!(camera.fetch(&row(), &[Pulse::new(0.01, 0)]).unwrap(), frame);
        // One that nobody asked for, and one whose shot was given up.
        put("2.exr");
        put("3.exr");
        assert_eq!(camera.ready(1).unwrap(), 1);
        let late = camera.fetch(&row(), &[Pulse::new(0.01, 0)]).unwrap_err();
        assert!(matches!(late, CameraError::Late { came: 0, .. }));
        put("4.exr");
        put("5.exr");
        let many = camera.fetch(&row(), &[Pulse::new(0.01, 0)]).unwrap_err();
        assert!(matches!(many, CameraError::TooMany { came: 2, .. }));
        // Half a file is waited for, and then refused.
        std::fs::write(folder.path().join("6.exr"), [0; 10]).unwrap();
        assert!(matches!(
            camera.fetch(&row(), &[Pulse::new(0.01, 0)]),
            Err(CameraError::File(_))
        ));
        std::fs::remove_dir_all(folder.path()).unwrap();
        assert!(camera.reopen().is_err());
    }
}
