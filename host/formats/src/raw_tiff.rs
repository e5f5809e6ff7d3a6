//! Raw exposures as TIFF: grey or RGB of 8 or 16 bits, one image a file.

use crate::raw_file::{RawFile, wrong_size};
use crate::{FileError, encoding};
use gonia_rig::RawFrame;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

/// `PhotometricInterpretation` of a mosaic, and of raw files that are TIFFs in form alone.
const CFA: [u32; 2] = [32_803, 34_892];
/// `NewSubfileType` of a picture that is a smaller copy of another.
const REDUCED: u32 = 1;
/// Planes one after another.
const PLANAR: u32 = 2;
/// Bytes beside the counts of the frame that a file may ask for.
const ROOM: usize = 1 << 24;

// long: one check after another, each before what it lets through is made room for.
pub(super) fn read(path: &Path, width: usize, height: usize) -> Result<RawFile, FileError> {
    let broken = |error: TiffError| match error {
        TiffError::IoError(error) if error.kind() != std::io::ErrorKind::UnexpectedEof => {
            FileError::reading(path, &error)
        }
        TiffError::UnsupportedError(what) => FileError::new(
            path,
            format_args!("is a TIFF of a kind that is not read ({what})"),
            "save the raw counts as grey or RGB of 8 or 16 bits, uncompressed",
        ),
        error => FileError::new(
            path,
            format_args!("is not a TIFF, or is cut short or damaged ({error})"),
            "copy or make it again",
        ),
    };
    let file = File::open(path).map_err(|error| FileError::reading(path, &error))?;
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(broken)?;
    let mut limits = Limits::default();
    // Three channels of two bytes, which is all that is ever asked of it.
    limits.decoding_buffer_size = 6 * width * height + ROOM;
    limits.intermediate_buffer_size = 6 * width * height + ROOM;
    decoder = decoder.with_limits(limits);
    only_image(path, &mut decoder, broken)?;
    let unsigned =
        |decoder: &mut Decoder<_>, tag| decoder.find_tag_unsigned::<u32>(tag).map_err(broken);
    if let Some(code) = unsigned(&mut decoder, Tag::PhotometricInterpretation)?
        && CFA.contains(&code)
    {
        return Err(crate::raw_file::camera_raw(
            path,
            "camera raw file (NEF, ARW or alike)",
        ));
    }
    let (w, h) = decoder.dimensions().map_err(broken)?;
    let size = [w as usize, h as usize];
    if size != [width, height] {
        return Err(wrong_size(path, size, [width, height]));
    }
    let color = decoder.colortype().map_err(broken)?;
    let channels = match color {
        ColorType::Gray(8 | 16) => 1,
        ColorType::RGB(8 | 16) => 3,
        _ => {
            return Err(FileError::new(
                path,
                format_args!("holds {color:?}"),
                "save the raw counts as grey or RGB of 8 or 16 bits, without transparency",
            ));
        }
    };
    if channels > 1 && unsigned(&mut decoder, Tag::PlanarConfiguration)? == Some(PLANAR) {
        return Err(FileError::new(
            path,
            "holds its colours plane by plane",
            "save it with the colours of a pixel together",
        ));
    }
    let profile = decoder.find_tag(Tag::IccProfile).map_err(broken)?;
    let profile = profile.and_then(|value| value.into_u8_vec().ok());
    let (counts, bits): (Vec<u16>, u8) = match decoder.read_image().map_err(broken)? {
        DecodingResult::U8(counts) => (counts.into_iter().map(u16::from).collect(), 8),
        DecodingResult::U16(counts) => (counts, 16),
        _ => {
            return Err(FileError::new(
                path,
                "holds numbers that are no counts",
                "save raw counts as whole numbers of 8 or 16 bits, and linear radiance as OpenEXR",
            ));
        }
    };
    if counts.len() != width * height * channels {
        return Err(FileError::new(
            path,
            "is cut short",
            "copy or make it again",
        ));
    }
    Ok(RawFile {
        raw: RawFrame {
            width,
            height,
            channels,
            counts,
        },
        bits,
        encoded: profile.and_then(|profile| encoding::of_profile(&profile)),
        sensor: None,
    })
}

/// Goes to the only image that is no smaller copy of another.
fn only_image(
    path: &Path,
    decoder: &mut Decoder<BufReader<File>>,
    broken: impl Fn(TiffError) -> FileError,
) -> Result<(), FileError> {
    let mut full = Vec::new();
    for index in 0.. {
        let kind = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType);
        if kind.map_err(&broken)?.unwrap_or(0) & REDUCED == 0 {
            full.push(index);
        }
        if full.len() > 1 {
            return Err(FileError::new(
                path,
                "holds several images",
                "save every exposure as a file of its own",
            ));
        }
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().map_err(&broken)?;
    }
    match full.first() {
        Some(index) => decoder.seek_to_image(*index).map_err(broken),
        None => Ok(()),
    }
}
