//! Raw exposures as PNG: grey or RGB of 8 or 16 bits.

use crate::raw_file::{RawFile, wrong_size};
use crate::{FileError, encoding};
use gonia_rig::RawFrame;
use png::{BitDepth, ColorType, Info};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// What cICP calls linear: H.273, table 3.
const LINEAR_TRANSFER: u8 = 8;

pub(super) fn read(path: &Path, width: usize, height: usize) -> Result<RawFile, FileError> {
    let broken = |error: png::DecodingError| match error {
        png::DecodingError::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            FileError::reading(path, &error)
        }
        error => FileError::new(
            path,
            format_args!("is not a PNG, or is cut short or damaged ({error})"),
            "copy or make it again",
        ),
    };
    let file = File::open(path).map_err(|error| FileError::reading(path, &error))?;
    let mut reader = png::Decoder::new(BufReader::new(file))
        .read_info()
        .map_err(broken)?;
    let info = reader.info();
    let size = [info.width as usize, info.height as usize];
    if size != [width, height] {
        return Err(wrong_size(path, size, [width, height]));
    }
    let encoded = encoding_of(info);
    let (color, depth) = reader.output_color_type();
    let channels = match (color, depth) {
        (ColorType::Grayscale, BitDepth::Eight | BitDepth::Sixteen) => 1,
        (ColorType::Rgb, BitDepth::Eight | BitDepth::Sixteen) => 3,
        _ => {
            return Err(FileError::new(
                path,
                format_args!("holds {color:?} of {} bits", depth as u8),
                "save the raw counts as grey or RGB of 8 or 16 bits, without transparency",
            ));
        }
    };
    let bytes = width * height * channels * (depth as usize / 8);
    let mut buffer = vec![0; bytes];
    reader.next_frame(&mut buffer).map_err(broken)?;
    let counts = if depth == BitDepth::Sixteen {
        let (pairs, _) = buffer.as_chunks::<2>();
        pairs.iter().map(|pair| u16::from_be_bytes(*pair)).collect()
    } else {
        buffer.into_iter().map(u16::from).collect()
    };
    Ok(RawFile {
        raw: RawFrame {
            width,
            height,
            channels,
            counts,
        },
        bits: depth as u8,
        encoded,
        sensor: None,
    })
}

/// Why its counts are not proportional to light, by the chunk that rules (PNG, third edition, 4.3).
fn encoding_of(info: &Info<'_>) -> Option<String> {
    if let Some(points) = &info.coding_independent_code_points {
        let code = points.transfer_function;
        return (code != LINEAR_TRANSFER).then(|| {
            format!("its cICP chunk says that counts are encoded (transfer function {code})")
        });
    }
    if let Some(profile) = &info.icc_profile {
        return encoding::of_profile(profile);
    }
    if info.srgb.is_some() {
        return Some("its sRGB chunk says that counts are encoded for a screen".into());
    }
    encoding::of_gamma(f64::from(info.gama_chunk?.into_value()))
}
