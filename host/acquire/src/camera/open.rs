//! From what `rig.toml` says of its frames to a camera: the one place that knows all kinds.

use crate::camera::command::CommandCamera;
use crate::camera::folder::FolderCamera;
use crate::camera::rendering::RenderingCamera;
use crate::camera::source::{Camera, CameraError};
use gonia_rig::{Genicam, Rig, Source};
use gonia_sim::rig::SimRig;
use std::path::Path;

/// What a camera needs to know beside its source.
#[derive(Clone, Copy, Debug)]
pub struct CameraSetup<'a> {
    /// The rig: size, optics and sensor of the camera.
    pub rig: &'a Rig,
    /// The folder of `rig.toml`: paths in a source are relative to it.
    pub folder: &'a Path,
    /// Exposure times of a shot's pulses, seconds.
    pub exposures_s: &'a [f64],
    /// Poses of the plan.
    pub planned: usize,
    /// The simulated arms that trigger a simulated camera, if the session has them.
    pub simulated: Option<&'a SimRig>,
}

/// Opens the camera of a source.
///
/// # Errors
/// There is no such folder or camera, the camera refuses its settings, the program was built without
/// it, or a simulated camera has no simulated arms.
pub fn open_camera(source: &Source, setup: CameraSetup) -> Result<Box<dyn Camera>, CameraError> {
    let rig = setup.rig;
    Ok(match source {
        Source::Simulated { seed, exact } => {
            let arms = setup.simulated.ok_or(CameraError::NoTrigger)?.clone();
            let camera = RenderingCamera::new(rig, arms, *seed, setup.planned, *exact);
            Box::new(camera)
        }
        Source::Folder { path, timeout_s } => {
            let folder = setup.folder.join(path);
            Box::new(FolderCamera::open(rig, folder, *timeout_s)?)
        }
        Source::Command { run, timeout_s } => {
            Box::new(CommandCamera::new(rig, run.clone(), *timeout_s))
        }
        Source::Genicam(genicam) => open_genicam(genicam, setup)?,
    })
}

#[cfg(feature = "genicam")]
fn open_genicam(genicam: &Genicam, setup: CameraSetup) -> Result<Box<dyn Camera>, CameraError> {
    use crate::camera::genicam::GenicamCamera;
    let camera = GenicamCamera::open(setup.rig, genicam, setup.exposures_s)?;
    Ok(Box::new(camera))
}

#[cfg(not(feature = "genicam"))]
fn open_genicam(_: &Genicam, _: CameraSetup) -> Result<Box<dyn Camera>, CameraError> {
    Err(CameraError::NoGenicam)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_source_has_its_camera_or_its_reason() {
        let rig = Rig::paper(32);
        let folder = tempfile::tempdir().unwrap();
        let setup = CameraSetup {
            rig: &rig,
            folder: folder.path(),
            exposures_s: &[0.01],
            planned: 1,
            simulated: None,
        };
        let simulated = Source::Simulated {
            seed: 1,
            exact: true,
        };
        assert!(matches!(
            open_camera(&simulated, setup).map(drop),
            Err(CameraError::NoTrigger)
        ));
        let of_folder = |path: &str| Source::Folder {
            path: path.into(),
            timeout_s: 1.0,
        };
        let camera = open_camera(&of_folder("."), setup).unwrap();
        assert!(camera.identity().starts_with("folder "));
        assert!(open_camera(&of_folder("none"), setup).is_err());
        let command = Source::Command {
            run: vec!["expose".into(), "{file}".into()],
            timeout_s: 1.0,
        };
        let camera = open_camera(&command, setup).unwrap();
        assert_eq!(camera.identity(), "command expose {file}");
    }
}
