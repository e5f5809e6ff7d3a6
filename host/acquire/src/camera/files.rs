//! A frame from files, as cameras and their programs leave them.

use crate::camera::source::{CameraError, Pulse};
use gonia_formats::frame_exr::read_frame_of_size;
use gonia_pipeline::bracket::merge_files;
use gonia_rig::{Frame, Rig};
use std::path::{Path, PathBuf};

/// What the names of frames end in.
const KINDS: [&str; 4] = ["exr", "png", "tif", "tiff"];

/// The frame of a shot's files, in the order of its pulses: PNGs or TIFFs of raw counts, or one
/// OpenEXR of linear radiance.
pub fn frame_of(rig: &Rig, files: &[PathBuf], pulses: &[Pulse]) -> Result<Frame, CameraError> {
    if let [file] = files
        && is_exr(file)
    {
        let camera = &rig.camera;
        return Ok(read_frame_of_size(file, camera.width_px, camera.height_px)?);
    }
    let bracket: Vec<(f64, PathBuf)> = pulses
        .iter()
        .map(|pulse| pulse.exposure_s)
        .zip(files.iter().cloned())
        .collect();
    Ok(merge_files(rig, &bracket)?.radiance.frame)
}

/// Whether a file is one that some program is still writing under another name, or none of a camera.
pub fn is_foreign(file: &Path) -> bool {
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned());
    let hidden = name.is_none_or(|n| n.starts_with('.'));
    let extension = file.extension().and_then(|e| e.to_str());
    hidden || !extension.is_some_and(|e| KINDS.contains(&&*e.to_ascii_lowercase()))
}

fn is_exr(file: &Path) -> bool {
    file.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("exr"))
}
