//! Raw frames as a sensor gives them: counts, in a grey or RGB PNG or TIFF of 8 or 16 bits a channel, or in a
//! DNG.

pub use crate::raw_file::{FileSensor, RawFile};

use crate::raw_file::camera_raw;
use crate::{FileError, dng, raw_png, raw_tiff};
use gonia_rig::RawFrame;
use png::{BitDepth, ColorType};
use std::fs::File;
use std::io::Read;
use std::path::Path;

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
const EXR: &[u8] = &[0x76, 0x2f, 0x31, 0x01];
/// Classic and big, little-endian and big-endian.
const TIFF: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];
/// Files of cameras, by what they begin with, and at which byte.
const CAMERA_RAW: [(usize, &[u8], &str); 6] = [
    (8, b"CR\x02", "Canon CR2"),
    (4, b"ftypcrx", "Canon CR3"),
    (0, b"FUJIFILMCCD-RAW", "Fujifilm RAF"),
    (0, b"IIU\0", "Panasonic RW2"),
    (0, b"IIRO", "Olympus ORF"),
    (0, b"FOVb", "Sigma X3F"),
];
/// As many first bytes as these need.
const HEAD: u64 = 16;

/// Reads a raw frame that must be `width` × `height` pixels, by what its file begins with.
///
/// # Errors
/// One line naming the file: unreadable, neither PNG nor TIFF, cut short, with a palette or
/// transparency, of several images, or of another size.
pub fn read_raw(path: &Path, width: usize, height: usize) -> Result<RawFile, FileError> {
    let head = first_bytes(path)?;
    let camera = CAMERA_RAW
        .iter()
        .find(|(at, magic, _)| head.get(*at..).is_some_and(|rest| rest.starts_with(magic)));
    if let Some((_, _, name)) = camera {
        return Err(camera_raw(path, &format!("camera raw file ({name})")));
    }
    if head.starts_with(PNG) {
        return raw_png::read(path, width, height);
    }
    if TIFF.iter().any(|magic| head.starts_with(magic)) {
        if dng::is_one(path)? {
            return dng::read(path, width, height);
        }
        return raw_tiff::read(path, width, height);
    }
    if head.starts_with(EXR) {
        return Err(FileError::new(
            path,
            "is an OpenEXR of radiance, but has an exposure time",
            "leave exposure_s empty in its row of frames.csv",
        ));
    }
    Err(FileError::new(
        path,
        "is not a PNG or TIFF, or is cut short",
        "raw exposures are PNGs or TIFFs of 8 or 16 bits; copy or make it again",
    ))
}

/// Whether a file begins as raw exposures do, and not as an OpenEXR.
pub(super) fn looks_raw(path: &Path) -> bool {
    first_bytes(path).is_ok_and(|head| {
        let magics = TIFF.iter().chain([&PNG]);
        magics.into_iter().any(|magic| head.starts_with(magic))
    })
}

fn first_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    let reading = |error: &std::io::Error| FileError::reading(path, error);
    let mut head = Vec::new();
    let file = File::open(path).map_err(|error| reading(&error))?;
    file.take(HEAD)
        .read_to_end(&mut head)
        .map_err(|error| reading(&error))?;
    Ok(head)
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
    use crate::encoding::tests::profile;
    use std::borrow::Cow;
    use tiff::encoder::{TiffEncoder, colortype};

    fn raw(channels: usize, most: u16) -> RawFrame {
        RawFrame {
            width: 5,
            height: 4,
            channels,
            counts: (0..20 * channels)
                .map(|i| (i * 3100 % usize::from(most)) as u16)
                .collect(),
        }
    }

    #[test]
    fn counts_come_back_grey_and_rgb_and_other_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        for channels in [1, 3] {
            let raw = raw(channels, u16::MAX);
            write_raw(&path, &raw).unwrap();
            let read = read_raw(&path, 5, 4).unwrap();
            assert_eq!((read.raw, read.bits, read.encoded), (raw, 16, None));
        }
        let said = |path: &Path, size: usize| read_raw(path, size, 4).unwrap_err().to_string();
        assert!(said(&path, 6).contains("is 5 × 4 pixels, but the rig's camera has 6 × 4"));
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(said(&path, 5).contains("cut short"), "{}", said(&path, 5));
        for (text, words) in [
            ("no PNG", "is not a PNG or TIFF"),
            ("", "is not a PNG or TIFF"),
            (
                "II*\0\x10\0\0\0CR\x02\0",
                "is a camera raw file (Canon CR2), which is not read; convert it to DNG",
            ),
            ("\0\0\0\x18ftypcrx ", "Canon CR3"),
            ("v/1\x01\x02\0\0\0", "leave exposure_s empty"),
            ("II*\0\x08\0\0\0", "is not a TIFF, or is cut short"),
        ] {
            std::fs::write(&path, text).unwrap();
            assert!(said(&path, 5).contains(words), "{}", said(&path, 5));
        }
        assert!(said(&dir.path().join("none.png"), 5).ends_with("check the path"));
    }

    /// What a TIFF holds, by the writer of its image.
    fn tiff(path: &Path, write: impl FnOnce(&mut TiffEncoder<File>)) {
        write(&mut TiffEncoder::new(File::create(path).unwrap()).unwrap());
    }

    #[test]
    fn a_tiff_is_read_whatever_its_name_and_only_if_it_holds_one_exposure() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let (grey, rgb, bytes) = (raw(1, u16::MAX), raw(3, u16::MAX), raw(1, 256));
        let narrow: Vec<u8> = bytes.counts.iter().map(|c| *c as u8).collect();
        tiff(&path, |t| {
            t.write_image::<colortype::Gray16>(5, 4, &grey.counts)
                .unwrap()
        });
        assert_eq!(read_raw(&path, 5, 4).unwrap().raw, grey);
        let whole = std::fs::read(&path).unwrap();
        tiff(&path, |t| {
            t.write_image::<colortype::RGB16>(5, 4, &rgb.counts)
                .unwrap()
        });
        let read = read_raw(&path, 5, 4).unwrap();
        assert_eq!((read.raw, read.bits, read.encoded), (rgb, 16, None));
        tiff(&path, |t| {
            t.write_image::<colortype::Gray8>(5, 4, &narrow).unwrap()
        });
        let read = read_raw(&path, 5, 4).unwrap();
        assert_eq!((read.raw, read.bits), (bytes, 8));

        let said = || {
            let error = read_raw(&path, 5, 4).unwrap_err().to_string();
            assert_eq!(error.lines().count(), 1);
            error
        };
        tiff(&path, |t| {
            t.write_image::<colortype::Gray16>(4, 5, &grey.counts)
                .unwrap()
        });
        assert!(said().contains("is 4 × 5 pixels, but the rig's camera has 5 × 4"));
        tiff(&path, |t| {
            t.write_image::<colortype::Gray32Float>(5, 4, &[0.5; 20])
                .unwrap()
        });
        assert!(said().contains("Gray(32)"), "{}", said());
        tiff(&path, |t| {
            for _ in 0..2 {
                t.write_image::<colortype::Gray16>(5, 4, &grey.counts)
                    .unwrap();
            }
        });
        assert!(said().contains("holds several images"), "{}", said());
        // A small copy beside it is none of them.
        tiff(&path, |t| {
            t.write_image::<colortype::Gray16>(5, 4, &grey.counts)
                .unwrap();
            let mut small = t.new_image::<colortype::Gray8>(1, 1).unwrap();
            let kind = tiff::tags::Tag::NewSubfileType;
            small.encoder().write_tag(kind, 1u32).unwrap();
            small.write_data(&[9]).unwrap();
        });
        assert_eq!(read_raw(&path, 5, 4).unwrap().raw, grey);
        for keep in [8, 20, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..keep]).unwrap();
            assert!(said().contains("cut short"), "{keep}: {}", said());
        }
    }

    #[test]
    fn files_say_themselves_when_their_counts_are_encoded() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let curve = |gamma: u16| [b"curv\0\0\0\0\0\0\0\x01", &gamma.to_be_bytes()[..]].concat();
        let png = |set: &dyn Fn(&mut png::Info<'_>)| {
            let mut info = png::Info::with_size(5, 4);
            info.color_type = ColorType::Grayscale;
            info.bit_depth = BitDepth::Eight;
            set(&mut info);
            let out = File::create(&path).unwrap();
            let encoder = png::Encoder::with_info(out, info).unwrap();
            let mut writer = encoder.write_header().unwrap();
            writer.write_image_data(&[7; 20]).unwrap();
            writer.finish().unwrap();
            read_raw(&path, 5, 4).unwrap().encoded
        };
        let gamma = |value: f32| Some(png::ScaledFloat::new(value));
        assert_eq!(png(&|_| {}), None);
        assert_eq!(png(&|info| info.source_gamma = gamma(1.0)), None);
        let said = png(&|info| info.source_gamma = gamma(0.45455)).unwrap();
        assert!(said.contains("gAMA") && said.contains("2.20"), "{said}");
        let said = png(&|info| info.srgb = Some(png::SrgbRenderingIntent::Perceptual)).unwrap();
        assert!(said.contains("sRGB"), "{said}");
        let said = png(&|info| info.icc_profile = Some(Cow::Owned(profile(&curve(563))))).unwrap();
        assert!(said.contains("gamma of 2.20"), "{said}");
        assert_eq!(
            png(&|info| info.icc_profile = Some(Cow::Owned(profile(&curve(256))))),
            None
        );
        for (value, linear) in [(256, true), (461, false)] {
            tiff(&path, |t| {
                let mut image = t.new_image::<colortype::Gray8>(5, 4).unwrap();
                let profile = profile(&curve(value));
                let tag = tiff::tags::Tag::IccProfile;
                image.encoder().write_tag(tag, &profile[..]).unwrap();
                image.write_data(&[7; 20]).unwrap();
            });
            assert_eq!(read_raw(&path, 5, 4).unwrap().encoded.is_none(), linear);
        }
    }
}
