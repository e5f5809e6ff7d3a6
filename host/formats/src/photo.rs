//! Photographs and other pictures from outside, as linear light.

use crate::FileError;
use crate::frame_exr::read_frame;
use gonia_brdf::Elementary;
use gonia_rig::Frame;
use png::{BitDepth, ColorType, Transformations};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Reads a picture: OpenEXR as it is, PNG of 8 or 16 bits by the sRGB curve.
///
/// # Errors
/// One line naming the file: unreadable, neither EXR nor PNG, or damaged.
pub fn read_photo(path: &Path) -> Result<Frame, FileError> {
    if path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("exr"))
    {
        return read_frame(path);
    }
    let broken = |error: png::DecodingError| {
        FileError::new(
            path,
            format_args!("is not a PNG, or is cut short or damaged ({error})"),
            "give a photograph as PNG (sRGB) or OpenEXR (linear)",
        )
    };
    let file = File::open(path).map_err(|error| FileError::reading(path, &error))?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(Transformations::EXPAND | Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(broken)?;
    let Some(size) = reader.output_buffer_size() else {
        return Err(FileError::new(path, "is too large", "make it smaller"));
    };
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(broken)?;
    let values: Vec<f32> = match info.bit_depth {
        BitDepth::Sixteen => {
            let (pairs, _) = bytes.as_chunks::<2>();
            let value = |pair: &[u8; 2]| f32::from(u16::from_be_bytes(*pair)) / 65535.0;
            pairs.iter().map(value).map(linear).collect()
        }
        _ => bytes
            .iter()
            .map(|b| linear(f32::from(*b) / 255.0))
            .collect(),
    };
    let rgb = match info.color_type {
        ColorType::GrayscaleAlpha => values.chunks_exact(2).map(|p| [p[0]; 3]).collect(),
        _ => values.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect(),
    };
    Ok(Frame {
        width: info.width as usize,
        height: info.height as usize,
        rgb,
    })
}

/// The inverse of the sRGB transfer curve.
fn linear(encoded: f32) -> f32 {
    if encoded <= 0.040_45 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).power(2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_is_read_as_the_light_it_shows() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("photo.png");
        let light = [0.0, 0.02, 0.2, 0.5, 0.9, 1.0];
        // IEC 61966-2-1: linear below 0.0031308.
        let encoded = |v: f32| match v {
            v if v <= 0.003_130_8 => 12.92 * v,
            v => 1.055 * v.power(1.0 / 2.4) - 0.055,
        };
        let bytes: Vec<u8> = light
            .iter()
            .flat_map(|v| [(255.0 * encoded(*v)).round() as u8; 3])
            .collect();
        let file = std::fs::File::create(&path).unwrap();
        let mut encoder = png::Encoder::new(file, 3, 2);
        encoder.set_color(png::ColorType::Rgb);
        encoder
            .write_header()
            .unwrap()
            .write_image_data(&bytes)
            .unwrap();
        let frame = read_photo(&path).unwrap();
        assert_eq!((frame.width, frame.height), (3, 2));
        for (pixel, light) in frame.rgb.iter().zip(light) {
            assert!((pixel[1] - light).abs() < 0.005, "{pixel:?} {light}");
        }
        std::fs::write(&path, "no picture").unwrap();
        let error = read_photo(&path).unwrap_err().to_string();
        assert!(error.contains("photo.png") && error.lines().count() == 1);
    }
}
