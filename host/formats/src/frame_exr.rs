//! Frames as EXR: linear radiance, channels R, G and B, half or float.

use crate::exr_planes::{ExrPlanes, Plane};
use crate::{FileError, exr_planes};
use exr::prelude::f16;
use gonia_rig::Frame;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::Path;

/// Radiance below this is no noise around zero any more, but a broken file.
const LEAST: f32 = -1e6;
/// Pixels converted at a time, so that they are still near when they are gathered.
const CHUNK: usize = 4096;

/// Reads a frame of any size up to 65,536 pixels a side.
///
/// # Errors
/// One line naming the file, and the channel and pixel where there is one: not an EXR, cut short,
/// not RGB, or with values that are no radiance (NaN, below −10⁶). +∞ is one: a saturated pixel.
pub fn read_frame(path: &Path) -> Result<Frame, FileError> {
    read_checked(path, |width, height| {
        if width > 65_536 || height > 65_536 {
            return Err((
                format!("is {width} × {height} pixels"),
                "check the file".into(),
            ));
        }
        Ok(())
    })
}

/// Reads a frame that must be `width` × `height` pixels.
///
/// # Errors
/// As [`read_frame`], and when its size is another.
pub fn read_frame_of_size(path: &Path, width: usize, height: usize) -> Result<Frame, FileError> {
    read_checked(path, |w, h| {
        if (w, h) != (width, height) {
            return Err((
                format!("is {w} × {h} pixels, but the rig's camera has {width} × {height}"),
                "mend [camera] in rig.toml or use the frames of this rig".into(),
            ));
        }
        Ok(())
    })
}

fn read_checked(
    path: &Path,
    check: impl FnOnce(usize, usize) -> Result<(), (String, String)>,
) -> Result<Frame, FileError> {
    let ExrPlanes {
        width,
        height,
        planes,
        ..
    } = exr_planes::read(path, check)?;
    let n = width * height;
    let mut rgb = Vec::with_capacity(n);
    let mut values = [[0.0f32; CHUNK]; 3];
    for start in (0..n).step_by(CHUNK) {
        let len = CHUNK.min(n - start);
        let mut sound = true;
        for (values, plane) in values.iter_mut().zip(&planes) {
            plane.copy_to(start, &mut values[..len]);
            // A NaN is not at least anything either.
            sound = values[..len].iter().fold(sound, |ok, v| ok & (*v >= LEAST));
        }
        let [r, g, b] = &values;
        rgb.extend((0..len).map(|i| [r[i], g[i], b[i]]));
        if !sound {
            let wrong = |pixel: &[f32; 3]| !pixel.iter().all(|v| *v >= LEAST);
            let place = start + rgb[start..].iter().position(wrong).unwrap_or(0);
            return Err(bad_pixel(path, rgb[place], place % width, place / width));
        }
    }
    Ok(Frame { width, height, rgb })
}

fn bad_pixel(path: &Path, pixel: [f32; 3], x: usize, y: usize) -> FileError {
    let bad = (0..3)
        .find(|c| {
            !matches!(
                pixel[*c].partial_cmp(&LEAST),
                Some(Ordering::Greater | Ordering::Equal)
            )
        })
        .unwrap_or(0);
    FileError::new(
        path,
        format_args!("{} is no radiance", pixel[bad]),
        "take the frame again, or mend the pixel (dead ones: the median of their neighbours)",
    )
    .at(format_args!(
        "channel {}, pixel ({x}, {y})",
        ["R", "G", "B"][bad]
    ))
}

/// Bits of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 16 bits: eleven significant ones, up to 65,504.
    Half,
    /// 32 bits.
    Single,
}

/// Writes a frame whole, in half precision, uncompressed (0.07 s for 16 Mpx; compressing takes
/// ten times as long). Finite values beyond the range of half (65,504) are clamped to it.
///
/// # Errors
/// When the file cannot be written.
pub fn write_frame(path: &Path, frame: &Frame) -> Result<(), FileError> {
    write_frame_as(path, frame, Precision::Half)
}

/// Writes a frame as [`write_frame`] does, in either precision.
///
/// # Errors
/// When the file cannot be written.
pub fn write_frame_as(path: &Path, frame: &Frame, precision: Precision) -> Result<(), FileError> {
    let limit = f16::MAX.to_f32();
    let half = |v: f32| {
        let kept = if v.is_finite() {
            v.clamp(-limit, limit)
        } else {
            v
        };
        f16::from_f32(kept)
    };
    let planes = [0, 1, 2].map(|c| {
        let values = frame.rgb.iter().map(|pixel| pixel[c]);
        match precision {
            Precision::Half => Plane::F16(values.map(half).collect()),
            Precision::Single => Plane::F32(values.collect()),
        }
    });
    exr_planes::write(
        path,
        ExrPlanes {
            width: frame.width,
            height: frame.height,
            planes,
            extra: None,
            attributes: BTreeMap::new(),
        },
    )
    .map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes,
        WritableImage,
    };

    fn frame() -> Frame {
        let rgb = (0..12 * 5)
            .map(|k| [k as f32, 0.5 * k as f32, -0.25])
            .collect();
        Frame {
            width: 12,
            height: 5,
            rgb,
        }
    }

    #[test]
    fn a_frame_comes_back_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        write_frame(&path, &frame()).unwrap();
        assert_eq!(read_frame(&path).unwrap(), frame());
        assert_eq!(read_frame_of_size(&path, 12, 5).unwrap(), frame());
        let error = read_frame_of_size(&path, 5, 12).unwrap_err().to_string();
        assert!(
            error.contains("is 12 × 5 pixels, but the rig's camera has 5 × 12"),
            "{error}"
        );
    }

    #[test]
    fn single_precision_and_saturated_pixels_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let mut bright = frame();
        bright.rgb[3] = [1e-9, 1e9, f32::INFINITY];
        write_frame_as(&path, &bright, Precision::Single).unwrap();
        assert_eq!(read_frame(&path).unwrap(), bright);
        write_frame(&path, &bright).unwrap();
        assert_eq!(
            read_frame(&path).unwrap().rgb[3][1..],
            [65_504.0, f32::INFINITY]
        );
    }

    #[test]
    fn a_nan_names_its_channel_and_pixel() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let mut broken = frame();
        broken.rgb[2 * 12 + 7][1] = f32::NAN;
        write_frame(&path, &broken).unwrap();
        let error = read_frame(&path).unwrap_err().to_string();
        assert!(
            error.contains("a.exr, channel G, pixel (7, 2): NaN is no radiance"),
            "{error}"
        );
    }

    #[test]
    fn a_file_cut_short_is_refused_in_one_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        write_frame(&path, &frame()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for keep in [0, 3, 50, 200, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..keep]).unwrap();
            let error = read_frame(&path).unwrap_err().to_string();
            assert!(error.contains("cut short"), "{keep}: {error}");
            assert_eq!(error.lines().count(), 1);
        }
        let error = read_frame(&dir.path().join("none.exr"))
            .unwrap_err()
            .to_string();
        assert!(error.ends_with("check the path"), "{error}");
    }

    #[test]
    fn channels_that_are_not_rgb_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let save = |channels: Vec<(&str, FlatSamples)>| {
            let list = channels
                .into_iter()
                .map(|(name, data)| AnyChannel::new(name, data));
            let layer = Layer::new(
                (2, 1),
                LayerAttributes::default(),
                Encoding::UNCOMPRESSED,
                AnyChannels::sort(list.collect()),
            );
            Image::from_layer(layer).write().to_file(&path).unwrap();
            read_frame(&path)
        };
        let float = || FlatSamples::F32(vec![1.0, 2.0]);
        let error = save(vec![("Y", float())]).unwrap_err().to_string();
        assert!(
            error.contains("has no channel R, only Y; save it as RGB"),
            "{error}"
        );
        let integer = FlatSamples::U32(vec![1, 2]);
        let error = save(vec![("R", float()), ("G", integer), ("B", float())]).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("channel G: holds 32-bit integers"),
            "{error}"
        );
        let half = FlatSamples::F16(vec![f16::ONE, f16::ONE]);
        let mixed = save(vec![
            ("A", float()),
            ("R", half),
            ("G", float()),
            ("B", float()),
        ]);
        assert_eq!(mixed.unwrap().rgb, [[1.0, 1.0, 1.0], [1.0, 2.0, 2.0]]);
    }
}
