//! Photographs and other pictures from outside, as linear light.

use crate::FileError;
use crate::frame_exr::read_frame;
use gonia_brdf::Elementary;
use gonia_rig::Frame;
use png::{BitDepth, ColorType, Transformations};
use std::fs::File;
use std::io::{BufReader, ErrorKind};
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
    let broken = |error: png::DecodingError| match error {
        png::DecodingError::IoError(error) if error.kind() != ErrorKind::UnexpectedEof => {
            FileError::reading(path, &error)
        }
        error => FileError::new(
            path,
            format_args!("is not a PNG, or is cut short or damaged ({error})"),
            "give a photograph as PNG (sRGB) or OpenEXR (linear)",
        ),
    };
    let reading = |error| FileError::reading(path, &error);
    let file = File::open(path).map_err(reading)?;
    let length = file.metadata().map_err(reading)?.len();
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(Transformations::EXPAND | Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(broken)?;
    check_size(path, reader.info(), length)?;
    let Some(size) = reader.output_buffer_size() else {
        return Err(FileError::new(path, "is too large", "make it smaller"));
    };
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(broken)?;
    let values = match info.color_type {
        ColorType::GrayscaleAlpha => [0, 0, 0],
        _ => [0, 1, 2],
    };
    let bytes_a_value = if info.bit_depth == BitDepth::Sixteen {
        2
    } else {
        1
    };
    let bytes_a_pixel = info.color_type.samples() * bytes_a_value;
    let pixel = |pixel: &[u8]| {
        values.map(|value| match pixel[value * bytes_a_value..] {
            [high, low, ..] if bytes_a_value == 2 => {
                linear(f32::from(u16::from_be_bytes([high, low])) / 65535.0)
            }
            [byte, ..] => linear(f32::from(byte) / 255.0),
            [] => 0.0,
        })
    };
    Ok(Frame {
        width: info.width as usize,
        height: info.height as usize,
        rgb: bytes.chunks_exact(bytes_a_pixel).map(pixel).collect(),
    })
}

/// Most pixels of a picture: beyond those of any camera, and within the memory of most computers.
const MOST_PIXELS: u64 = 1 << 28;
/// Deflate packs 1032 bytes into one at best.
const TIGHTEST: u64 = 1032;

/// Refuses a size that nobody can have, before memory is asked for it.
fn check_size(path: &Path, info: &png::Info<'_>, length: u64) -> Result<(), FileError> {
    let (width, height) = (u64::from(info.width), u64::from(info.height));
    // Both are below 2³¹.
    let bytes = (width * info.bits_per_pixel() as u64).div_ceil(8);
    if bytes.saturating_mul(height) > TIGHTEST.saturating_mul(length) {
        return Err(FileError::new(
            path,
            format_args!(
                "is cut short or damaged: its header promises {width} × {height} pixels, which its {length} bytes cannot hold"
            ),
            "copy or make it again",
        ));
    }
    if width * height > MOST_PIXELS {
        return Err(FileError::new(
            path,
            format_args!("is {width} × {height} pixels"),
            format_args!("make it smaller, at most {MOST_PIXELS} pixels"),
        ));
    }
    Ok(())
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
        // A header that promises 28.8 GB, in 69 bytes or so.
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[16..24].copy_from_slice([60_000u32, 60_000].map(u32::to_be_bytes).as_flattened());
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let error = read_photo(&path).unwrap_err().to_string();
        assert!(error.contains("promises 60000 × 60000 pixels"), "{error}");
        std::fs::write(&path, "no picture").unwrap();
        let error = read_photo(&path).unwrap_err().to_string();
        assert!(error.contains("photo.png") && error.lines().count() == 1);
    }

    #[test]
    fn every_kind_of_png_shows_the_same_light() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("photo.png");
        for (color, depth, bytes) in [
            (ColorType::Rgb, BitDepth::Eight, vec![188; 3]),
            (ColorType::Rgba, BitDepth::Eight, vec![188, 188, 188, 9]),
            (ColorType::Grayscale, BitDepth::Sixteen, vec![188; 2]),
            (ColorType::GrayscaleAlpha, BitDepth::Eight, vec![188, 9]),
            (ColorType::Rgba, BitDepth::Sixteen, vec![188; 8]),
        ] {
            let file = std::fs::File::create(&path).unwrap();
            let mut encoder = png::Encoder::new(file, 1, 1);
            encoder.set_color(color);
            encoder.set_depth(depth);
            let mut writer = encoder.write_header().unwrap();
            writer.write_image_data(&bytes).unwrap();
            drop(writer);
            let frame = read_photo(&path).unwrap();
            assert_eq!(frame.rgb.len(), 1);
            for value in frame.rgb[0] {
                assert!(
                    (value - 0.5029).abs() < 1e-3,
                    "{color:?} {depth:?}: {value}"
                );
            }
        }
    }
}
