//! Raw frames as a sensor gives them: counts, in a grey or RGB PNG of 8 or 16 bits a channel. Gamma
//! and colour profiles, which say how to *show* a PNG, are not applied.

use crate::FileError;
use gonia_rig::RawFrame;
use png::{BitDepth, ColorType};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Reads a raw frame that must be `width` × `height` pixels.
///
/// # Errors
/// One line naming the file: unreadable, not a PNG, cut short, with a palette or transparency, or
/// of another size.
pub fn read_raw(path: &Path, width: usize, height: usize) -> Result<RawFrame, FileError> {
    let broken = |error: png::DecodingError| match error {
        png::DecodingError::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            FileError::reading(path, &error)
        }
        error => FileError::new(
            path,
            format_args!("is not a PNG, or is cut short or damaged ({error})"),
            "raw exposures are PNGs of 8 or 16 bits; copy or make it again",
        ),
    };
    let file = File::open(path).map_err(|error| FileError::reading(path, &error))?;
    let mut reader = png::Decoder::new(BufReader::new(file))
        .read_info()
        .map_err(broken)?;
    let info = reader.info();
    let size = (info.width as usize, info.height as usize);
    if size != (width, height) {
        return Err(FileError::new(
            path,
            format_args!(
                "is {} × {} pixels, but the rig's camera has {width} × {height}",
                size.0, size.1
            ),
            "mend [camera] in rig.toml or use the frames of this rig",
        ));
    }
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
    Ok(RawFrame {
        width,
        height,
        channels,
        counts,
    })
}

/// Writes a raw frame whole, as a PNG of 16 bits.
///
/// # Errors
/// When the file cannot be written.
pub fn write_raw(path: &Path, raw: &RawFrame) -> Result<(), FileError> {
    let color = if raw.channels == 3 {
        ColorType::Rgb
    } else {
        ColorType::Grayscale
    };
    let bytes: Vec<u8> = raw.counts.iter().flat_map(|c| c.to_be_bytes()).collect();
    super::write_whole(path, |out| {
        let mut encoder = png::Encoder::new(out, raw.width as u32, raw.height as u32);
        encoder.set_color(color);
        encoder.set_depth(BitDepth::Sixteen);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header().map_err(std::io::Error::other)?;
        writer
            .write_image_data(&bytes)
            .map_err(std::io::Error::other)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_come_back_grey_and_rgb_and_other_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        for channels in [1, 3] {
            let raw = RawFrame {
                width: 5,
                height: 4,
                channels,
                counts: (0..20 * channels).map(|i| (i * 3100) as u16).collect(),
            };
            write_raw(&path, &raw).unwrap();
            assert_eq!(read_raw(&path, 5, 4).unwrap(), raw);
        }
        let said = |path: &Path, size: usize| read_raw(path, size, 4).unwrap_err().to_string();
        assert!(said(&path, 6).contains("is 5 × 4 pixels, but the rig's camera has 6 × 4"));
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(said(&path, 5).contains("cut short"), "{}", said(&path, 5));
        std::fs::write(&path, "no PNG").unwrap();
        assert!(said(&path, 5).contains("is not a PNG"));
        assert!(said(&dir.path().join("none.png"), 5).ends_with("check the path"));
    }
}
