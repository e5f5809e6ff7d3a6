//! A folder that another program fills: a file for every trigger pulse, in the order of their names.

use crate::camera::files::{frame_of, is_foreign};
use crate::camera::natural_order::in_order;
use crate::camera::source::{Camera, CameraError, Pulse};
use gonia_formats::FileError;
use gonia_rig::{Frame, FrameRow, Rig};
use std::collections::BTreeMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Pause between two looks into the folder, at least.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// And so many times as long as a look takes: thousands of files on a slow disk take a while.
const LOOKS: u32 = 5;
/// Folders are looked into so deep: camera programs sort frames by date, and by card.
const DEPTH: usize = 3;
/// Names of files in an error.
const NAMED: usize = 4;

/// What tells a file from another, or from the one that it was: a program may write the same name again
/// and again, and a counter may come round.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Version {
    bytes: u64,
    changed: Option<SystemTime>,
}

impl Version {
    fn of(file: &Metadata) -> Self {
        Self {
            bytes: file.len(),
            changed: file.modified().ok(),
        }
    }
}

type Files = BTreeMap<PathBuf, Version>;

/// Watches a folder.
pub struct FolderCamera {
    rig: Rig,
    folder: PathBuf,
    timeout: Duration,
    /// Files that are accounted for, as they were then.
    seen: Files,
}

impl FolderCamera {
    /// Watches a folder and the ones in it; what is there now is ignored. A frame may take `timeout_s`
    /// seconds after its trigger.
    ///
    /// # Errors
    /// When there is no such folder.
    pub fn open(rig: &Rig, folder: PathBuf, timeout_s: f64) -> Result<Self, CameraError> {
        let mut camera = Self {
            rig: rig.clone(),
            folder,
            timeout: Duration::from_secs_f64(timeout_s),
            seen: Files::new(),
        };
        camera.seen = camera.files()?;
        Ok(camera)
    }

    /// All files there are.
    fn files(&self) -> Result<Files, CameraError> {
        let mut files = Files::new();
        list(&self.folder, DEPTH, &mut files)
            .map_err(|error| CameraError::File(FileError::reading(&self.folder, &error)))?;
        Ok(files)
    }

    /// Files that are not accounted for.
    fn new_files(&self) -> Result<Files, CameraError> {
        let mut files = self.files()?;
        files.retain(|path, version| self.seen.get(path) != Some(version));
        Ok(files)
    }

    /// Waits until so many frames are there, at most until the timeout. Gives them in their order, and
    /// all that came.
    fn wait_for(&self, n: usize, until: Instant) -> Result<(Vec<PathBuf>, Files), CameraError> {
        loop {
            let began = Instant::now();
            let all = self.new_files()?;
            let frames = all.keys().filter(|path| !is_foreign(path)).cloned();
            let frames = in_order(frames.collect());
            if frames.len() >= n || Instant::now() >= until {
                return Ok((frames, all));
            }
            std::thread::sleep(LOOK_EVERY.max(began.elapsed() * LOOKS));
        }
    }

    /// What is in the folder now is accounted for.
    fn account_for(&mut self, files: Files) {
        self.seen.extend(files);
    }
}

impl Camera for FolderCamera {
    fn identity(&self) -> String {
        // The same from wherever the program is started.
        let folder = std::fs::canonicalize(&self.folder);
        let folder = folder.unwrap_or_else(|_| self.folder.clone());
        format!("folder {}", folder.display())
    }

    fn ready(&mut self, strays: usize) -> Result<usize, CameraError> {
        let (frames, all) = self.wait_for(strays, Instant::now() + self.timeout)?;
        self.account_for(all);
        Ok(frames.len().saturating_sub(strays))
    }

    fn fetch(&mut self, _: &FrameRow, pulses: &[Pulse]) -> Result<Frame, CameraError> {
        let until = Instant::now() + self.timeout;
        let expected = pulses.len();
        loop {
            let (frames, all) = self.wait_for(expected, until)?;
            let came = frames.len();
            if came > expected {
                self.account_for(all);
                let files = named(&frames);
                return Err(CameraError::TooManyFiles {
                    came,
                    expected,
                    files,
                });
            }
            if came < expected {
                let other = all.keys().find(|path| is_unread(path)).map(|p| name(p));
                self.account_for(all);
                let timeout_s = self.timeout.as_secs_f64();
                return Err(match other {
                    Some(other) => CameraError::Unread {
                        came,
                        expected,
                        timeout_s,
                        other,
                    },
                    None => CameraError::Late {
                        came,
                        expected,
                        timeout_s,
                    },
                });
            }
            let read = frame_of(&self.rig, &frames, pulses);
            // It may still be being written: then it changes, or cannot be read.
            let is_still = self.new_files()? == all;
            if (read.is_ok() && is_still) || Instant::now() >= until {
                self.account_for(all);
                return read;
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    fn reopen(&mut self) -> Result<(), CameraError> {
        self.new_files().map(drop)
    }
}

/// Adds the files of a folder, and of those in it. One that goes while it is looked at is left out.
fn list(folder: &Path, depth: usize, files: &mut Files) -> std::io::Result<()> {
    for item in std::fs::read_dir(folder)? {
        let path = item?.path();
        let Ok(found) = std::fs::metadata(&path) else {
            continue;
        };
        if found.is_file() {
            files.insert(path, Version::of(&found));
        } else if found.is_dir() && depth > 0 {
            // One that is gone again, or that nobody may read, holds no frame.
            let _ = list(&path, depth - 1, files);
        }
    }
    Ok(())
}

/// Whether a file is none that is still being written, and of an ending that is not read.
fn is_unread(file: &Path) -> bool {
    is_foreign(file) && !name(file).starts_with('.')
}

fn name(file: &Path) -> String {
    let name = file.file_name().unwrap_or(file.as_os_str());
    name.to_string_lossy().into_owned()
}

fn named(files: &[PathBuf]) -> String {
    let mut text: Vec<String> = files.iter().take(NAMED).map(|file| name(file)).collect();
    if files.len() > NAMED {
        text.push("…".into());
    }
    text.join(", ")
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
        assert!(matches!(many, CameraError::TooManyFiles { came: 2, .. }));
        assert!(many.to_string().contains("4.exr, 5.exr"), "{many}");
        // Half a file is waited for, and then refused.
        std::fs::write(folder.path().join("6.exr"), [0; 10]).unwrap();
        assert!(matches!(
            camera.fetch(&row(), &[Pulse::new(0.01, 0)]),
            Err(CameraError::File(_))
        ));
        std::fs::remove_dir_all(folder.path()).unwrap();
        assert!(camera.reopen().is_err());
    }

    /// A frame of one value, so that it is known again.
    fn flat(value: f32) -> Frame {
        Frame {
            width: 32,
            height: 32,
            rgb: vec![[value; 3]; 32 * 32],
        }
    }

    #[test]
    fn a_file_that_is_written_again_is_another_frame_also_in_a_folder_below() {
        let folder = tempfile::tempdir().unwrap();
        let below = folder.path().join("2026-11-27").join("card 1");
        std::fs::create_dir_all(&below).unwrap();
        let path = below.join("capture.exr");
        write_frame(&path, &flat(0.25)).unwrap();
        let rig = Rig::paper(32);
        let mut camera = FolderCamera::open(&rig, folder.path().to_owned(), 0.3).unwrap();
        for value in [0.5, 0.75, 1.0] {
            // The clocks of some file systems are coarse.
            std::thread::sleep(Duration::from_millis(20));
            write_frame(&path, &flat(value)).unwrap();
            let frame = camera.fetch(&row(), &[Pulse::new(0.01, 0)]).unwrap();
            assert_eq!(frame, flat(value));
            assert_eq!(camera.ready(0).unwrap(), 0);
        }
    }

    #[test]
    fn files_of_an_ending_that_is_not_read_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let rig = Rig::paper(32);
        let mut camera = FolderCamera::open(&rig, folder.path().to_owned(), 0.1).unwrap();
        std::fs::write(folder.path().join("IMG_0001.CR3"), "raw").unwrap();
        let late = camera.fetch(&row(), &[Pulse::new(0.01, 0)]).unwrap_err();
        assert!(late.to_string().contains("IMG_0001.CR3"), "{late}");
    }
}
