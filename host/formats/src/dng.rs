//! Raw exposures as DNG: what converters make of every camera's own files. Uncompressed or lossless JPEG;
//! black level, white level, colour filters, noise and exposure come from the file. Counts are as the sensor
//! gave them: nothing is turned, whatever the file says of its orientation.
//!
//! Adobe, Digital Negative (DNG) Specification 1.7.

use crate::FileError;
use crate::lossless_jpeg;
use crate::raw_file::{FileSensor, RawFile, wrong_size};
use crate::tiff_tags::{Directory, Tiff};
use gonia_rig::{Bayer, RawFrame};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

/// The tag that makes a TIFF a DNG.
const VERSION: u16 = 50_706;
/// `PhotometricInterpretation` of a mosaic, and of values that belong to a pixel each.
const MOSAIC: u64 = 32_803;
const LINEAR: u64 = 34_892;
/// The part of a raw image that shows something may be this much smaller than the whole.
const MOST_OVER_ACTIVE: usize = 4;

/// Photosites of a tile that an image however small may have.
const TILE: usize = 1 << 20;

/// Problem and remedy.
type Unusable = (String, &'static str);

const DAMAGED: &str = "copy or make it again";
const CONVERT: &str = "convert it to a DNG whose raw image is uncompressed or lossless JPEG, without other corrections";

/// Whether the first directory of a TIFF says that it is a DNG.
///
/// # Errors
/// When the file cannot be read; what is cut short is no DNG.
pub(super) fn is_one(path: &Path) -> Result<bool, FileError> {
    match first_tags(path) {
        Ok(tags) => Ok(tags.contains(&VERSION)),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(FileError::reading(path, &error)),
    }
}

/// The numbers of the tags in the first directory of a classic TIFF.
fn first_tags(path: &Path) -> std::io::Result<Vec<u16>> {
    let mut file = File::open(path)?;
    let mut head = [0; 8];
    file.read_exact(&mut head)?;
    let short = |b: [u8; 2]| match head[0] {
        b'M' => u16::from_be_bytes(b),
        _ => u16::from_le_bytes(b),
    };
    let at = [head[4], head[5], head[6], head[7]];
    let at = match head[0] {
        b'M' => u32::from_be_bytes(at),
        _ => u32::from_le_bytes(at),
    };
    file.seek(SeekFrom::Start(at.into()))?;
    let mut count = [0; 2];
    file.read_exact(&mut count)?;
    let mut entries = vec![0; 12 * usize::from(short(count))];
    file.read_exact(&mut entries)?;
    let entries = entries.chunks_exact(12);
    Ok(entries.map(|entry| short([entry[0], entry[1]])).collect())
}

/// Reads the raw image of a DNG, which must be of the camera's size.
pub(super) fn read(path: &Path, width: usize, height: usize) -> Result<RawFile, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    let refused = |(problem, remedy): Unusable| FileError::new(path, problem, remedy);
    let layout = Layout::of(&bytes).map_err(refused)?;
    let [top, left, bottom, right] = layout.active;
    if [right - left, bottom - top] != [width, height] {
        return Err(wrong_size(
            path,
            [right - left, bottom - top],
            [width, height],
        ));
    }
    if layout.width * layout.height > MOST_OVER_ACTIVE * width * height {
        let problem = format!("claims {} × {} photosites", layout.width, layout.height);
        return Err(refused((problem, DAMAGED)));
    }
    let sensor = layout.sensor(&bytes).map_err(refused)?;
    let all = layout.counts(&bytes).map_err(refused)?;
    let n = layout.channels;
    let mut counts = Vec::with_capacity(width * height * n);
    for row in top..bottom {
        let start = (row * layout.width + left) * n;
        counts.extend_from_slice(&all[start..start + width * n]);
    }
    layout.level(&mut counts, width, sensor.black_counts);
    Ok(RawFile {
        raw: RawFrame {
            width,
            height,
            channels: n,
            counts,
        },
        bits: 16,
        encoded: None,
        sensor: Some(sensor),
    })
}

/// How long a DNG was exposed, seconds; `None` where it does not say.
///
/// # Errors
/// When the file cannot be read.
pub(super) fn exposure_s(path: &Path) -> Result<Option<f64>, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    Ok(Tiff::of(&bytes).and_then(|tiff| exposure_of(&tiff)))
}

/// `ExposureTime`, which is in the directory for Exif.
fn exposure_of(tiff: &Tiff<'_>) -> Option<f64> {
    let images = tiff.images();
    let below = images
        .iter()
        .filter_map(|image| tiff.directory(image.number(34_665)?));
    let exif: Vec<Directory<'_>> = below.map(|(directory, _)| directory).collect();
    let times = exif.iter().chain(&images).filter_map(|d| d.reals(33_434));
    let mut times = times.filter_map(|values| values.first().copied());
    times.find(|time| time.is_finite() && *time > 0.0)
}

/// The raw image of a file: where it is, and what its numbers mean.
struct Layout<'a> {
    directory: Directory<'a>,
    is_big_endian: bool,
    width: usize,
    height: usize,
    /// Values a pixel.
    channels: usize,
    bits: usize,
    /// Rows and columns that show something: top, left, bottom, right.
    active: [usize; 4],
    /// Black levels by row and column, which repeat, relative to the active part.
    black: [[f64; 2]; 2],
    linear: Option<Vec<u64>>,
}

impl<'a> Layout<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, Unusable> {
        let damaged = |what: &str| {
            (
                format!("is no DNG, or is cut short or damaged ({what})"),
                DAMAGED,
            )
        };
        let tiff = Tiff::of(bytes).ok_or_else(|| damaged("no header"))?;
        let images = tiff.images();
        // A level or a table that is not there must not be taken for one that the file does not need.
        if images.iter().any(|image| image.is_cut) {
            return Err(damaged("a tag"));
        }
        let mut raw = images.into_iter().filter(|directory| {
            let kind = directory.number(262);
            (kind == Some(MOSAIC) || kind == Some(LINEAR))
                && directory.number(254).unwrap_or(0) == 0
        });
        let (Some(directory), None) = (raw.next(), raw.next()) else {
            return Err(("holds no raw image, or several".into(), CONVERT));
        };
        let number = |tag: u16| directory.number(tag).and_then(|n| usize::try_from(n).ok());
        let side = |tag: u16, name: &str| {
            let side = number(tag).filter(|side| (1..=65_536).contains(side));
            side.ok_or_else(|| damaged(name))
        };
        let (width, height) = (side(256, "ImageWidth")?, side(257, "ImageLength")?);
        let channels = number(277).unwrap_or(1);
        let bits = number(258).unwrap_or(1);
        if !(channels == 1 || channels == 3) || !(8..=16).contains(&bits) {
            let problem = format!("has {channels} values of {bits} bits a pixel");
            return Err((
                problem,
                "save whole numbers of 8 to 16 bits, one or three a pixel",
            ));
        }
        if number(284).is_some_and(|planar| planar != 1) {
            return Err(("holds its colours plane by plane".into(), CONVERT));
        }
        let active = match directory.numbers(50_829).as_deref() {
            None => [0, 0, height, width],
            Some(&[t, l, b, r]) if t < b && b <= height as u64 && l < r && r <= width as u64 => {
                [t, l, b, r].map(|side| side as usize)
            }
            Some(_) => return Err(damaged("ActiveArea")),
        };
        for tag in [50_715, 50_716] {
            let uneven = directory
                .reals(tag)
                .is_some_and(|d| d.iter().any(|d| d.abs() > 0.5));
            if uneven {
                return Err(("has a black level for each row or column".into(), CONVERT));
            }
        }
        Ok(Self {
            black: black_levels(&directory, channels).ok_or_else(|| damaged("BlackLevel"))?,
            linear: directory.numbers(50_712).filter(|table| !table.is_empty()),
            is_big_endian: tiff.is_big_endian,
            directory,
            width,
            height,
            channels,
            bits,
            active,
        })
    }

    fn sensor(&self, bytes: &[u8]) -> Result<FileSensor, Unusable> {
        let directory = &self.directory;
        let black_counts = self
            .black
            .as_flattened()
            .iter()
            .copied()
            .fold(0.0, f64::max);
        let white = directory.reals(50_717).unwrap_or_default();
        let most = match &self.linear {
            Some(table) => table.iter().copied().max().unwrap_or(0) as f64,
            None => ((1u64 << self.bits) - 1) as f64,
        };
        let saturation_counts = white.into_iter().fold(most, f64::min);
        if saturation_counts.is_nan() || saturation_counts <= black_counts {
            let problem = format!(
                "says that it is black at {black_counts} and white at {saturation_counts} counts"
            );
            return Err((problem, CONVERT));
        }
        let bayer = if directory.number(262) == Some(MOSAIC) {
            Some(self.bayer()?)
        } else {
            None
        };
        let tiff = Tiff::of(bytes);
        let images = tiff.map(|tiff| tiff.images()).unwrap_or_default();
        let noise = images
            .iter()
            .find_map(|image| noise_of(&image.reals(51_041)?));
        Ok(FileSensor {
            black_counts,
            saturation_counts,
            bayer,
            noise,
            exposure_s: tiff.and_then(|tiff| exposure_of(&tiff)),
        })
    }

    fn bayer(&self) -> Result<Bayer, Unusable> {
        let colours = self.directory.numbers(33_422);
        let is_2_by_2 = self.directory.numbers(33_421).as_deref() == Some(&[2, 2]);
        let is_rectangular = self
            .directory
            .number(50_711)
            .is_none_or(|layout| layout == 1);
        match colours.as_deref() {
            Some([0, 1, 1, 2]) if is_2_by_2 && is_rectangular => Ok(Bayer::Rggb),
            Some([2, 1, 1, 0]) if is_2_by_2 && is_rectangular => Ok(Bayer::Bggr),
            Some([1, 0, 2, 1]) if is_2_by_2 && is_rectangular => Ok(Bayer::Grbg),
            Some([1, 2, 0, 1]) if is_2_by_2 && is_rectangular => Ok(Bayer::Gbrg),
            _ => Err((
                "has colour filters that are no Bayer pattern".into(),
                "demosaic it to linear RGB of 16 bits (TIFF), or use a camera with such a pattern",
            )),
        }
    }

    /// All counts of the raw image, row by row.
    fn counts(&self, bytes: &[u8]) -> Result<Vec<u16>, Unusable> {
        let number = |tag: u16| {
            self.directory
                .number(tag)
                .and_then(|n| usize::try_from(n).ok())
        };
        let tiled = self.directory.has(324);
        let [offsets, lengths] = if tiled { [324, 325] } else { [273, 279] }
            .map(|tag| self.directory.numbers(tag).unwrap_or_default());
        let size = if tiled {
            [number(322), number(323)]
        } else {
            [
                Some(self.width),
                Some(number(278).unwrap_or(self.height).min(self.height)),
            ]
        };
        let cut = || (String::from("is cut short or damaged"), DAMAGED);
        let [Some(wide @ 1..=65_536), Some(high @ 1..=65_536)] = size else {
            return Err(cut());
        };
        // Tiles reach beyond the image, but not by this much: more than it is made room for.
        if wide * high > MOST_OVER_ACTIVE * self.width * self.height + TILE {
            return Err(cut());
        }
        let across = self.width.div_ceil(wide);
        let down = self.height.div_ceil(high);
        if offsets.len() < across * down || lengths.len() < across * down {
            return Err(cut());
        }
        let n = self.channels;
        let mut counts = vec![0; self.width * self.height * n];
        for k in 0..across * down {
            let (x, y) = (k % across * wide, k / across * high);
            let rows = if tiled {
                high
            } else {
                high.min(self.height - y)
            };
            let place = usize::try_from(offsets[k])
                .ok()
                .zip(usize::try_from(lengths[k]).ok());
            let segment = place.and_then(|(at, length)| bytes.get(at..at.checked_add(length)?));
            let segment = self.segment(segment.ok_or_else(cut)?, wide * n, rows)?;
            let seen = wide.min(self.width - x) * n;
            for (row, values) in segment.chunks(wide * n).enumerate().take(self.height - y) {
                let start = ((y + row) * self.width + x) * n;
                counts[start..start + seen].copy_from_slice(&values[..seen]);
            }
        }
        if let Some(table) = &self.linear {
            let last = table.len() - 1;
            for count in &mut counts {
                *count = table[usize::from(*count).min(last)].min(u64::from(u16::MAX)) as u16;
            }
        }
        Ok(counts)
    }

    /// The counts of a strip or tile.
    fn segment(&self, bytes: &[u8], width: usize, rows: usize) -> Result<Vec<u16>, Unusable> {
        let cut = || (String::from("is cut short or damaged"), DAMAGED);
        match self.directory.number(259).unwrap_or(1) {
            1 => {
                let stride = (width * self.bits).div_ceil(8);
                let bytes = bytes.get(..stride * rows).ok_or_else(cut)?;
                let rows = bytes.chunks(stride);
                Ok(rows.flat_map(|row| self.plain(row, width)).collect())
            }
            7 => {
                let samples = lossless_jpeg::decode(bytes, width * rows).ok_or_else(cut)?;
                // Rows of the JPEG may be several of the tile, or parts of one.
                if samples.rows * samples.values_a_row != width * rows {
                    return Err(cut());
                }
                Ok(samples.counts)
            }
            other => Err((
                format!("is compressed in a way that is not read ({other})"),
                CONVERT,
            )),
        }
    }

    /// A row of uncompressed counts.
    fn plain(&self, row: &[u8], width: usize) -> Vec<u16> {
        match self.bits {
            8 => row.iter().map(|byte| u16::from(*byte)).collect(),
            16 => {
                let of = if self.is_big_endian {
                    u16::from_be_bytes
                } else {
                    u16::from_le_bytes
                };
                row.as_chunks::<2>().0.iter().map(|two| of(*two)).collect()
            }
            bits => {
                // The most significant bit first, whatever the order of bytes.
                let mut values = Vec::with_capacity(width);
                let (mut held, mut count) = (0u32, 0);
                for byte in row {
                    held = held << 8 | u32::from(*byte);
                    count += 8;
                    if count >= bits {
                        count -= bits;
                        values.push((held >> count & ((1 << bits) - 1)) as u16);
                    }
                }
                values.truncate(width);
                values
            }
        }
    }

    /// Raises counts to one black level, where that of the sensor differs from photosite to photosite.
    fn level(&self, counts: &mut [u16], width: usize, black: f64) {
        let lift = self
            .black
            .map(|row| row.map(|level| (black - level).round() as u16));
        if lift.as_flattened().iter().all(|lift| *lift == 0) {
            return;
        }
        for (row, line) in counts.chunks_mut(width * self.channels).enumerate() {
            for (k, count) in line.iter_mut().enumerate() {
                let column = k / self.channels;
                *count = count.saturating_add(lift[row % 2][column % 2]);
            }
        }
    }
}

/// Black levels of 2 × 2 photosites; `None` where they repeat otherwise or differ between channels.
fn black_levels(directory: &Directory<'_>, channels: usize) -> Option<[[f64; 2]; 2]> {
    let Some(levels) = directory.reals(50_714) else {
        return Some([[0.0; 2]; 2]);
    };
    let (rows, columns) = match directory.numbers(50_713).as_deref() {
        None => (1, 1),
        Some(&[rows @ 1..=2, columns @ 1..=2]) => (rows as usize, columns as usize),
        Some(_) => return None,
    };
    let usable = levels.len() == rows * columns * channels
        && levels.iter().all(|level| (0.0..65_535.0).contains(level))
        && levels
            .chunks(channels)
            .all(|pixel| pixel.iter().all(|level| *level == pixel[0]));
    let at =
        |row: usize, column: usize| levels[((row % rows) * columns + column % columns) * channels];
    usable.then(|| [[at(0, 0), at(0, 1)], [at(1, 0), at(1, 1)]])
}

/// Variance of values from 0 to 1: a share of the value, and a constant; the green one's of three.
fn noise_of(profile: &[f64]) -> Option<[f64; 2]> {
    let of = |k: usize| Some([*profile.get(2 * k)?, *profile.get(2 * k + 1)?]);
    let noise = if profile.len() >= 6 { of(1) } else { of(0) }?;
    (noise[0] > 0.0 && noise[1] >= 0.0 && noise.iter().all(|v| v.is_finite())).then_some(noise)
}

#[cfg(test)]
mod tests {
    use super::read as read_raw;
    use super::*;

    /// A tag: number, type, number of values, and their bytes.
    type Tag = (u16, u16, u32, Vec<u8>);

    fn shorts(tag: u16, values: &[u16]) -> Tag {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        (tag, 3, values.len() as u32, bytes)
    }

    fn longs(tag: u16, values: &[u32]) -> Tag {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        (tag, 4, values.len() as u32, bytes)
    }

    /// Bytes of a directory that stands at `at`, with the values behind it.
    fn directory(at: usize, mut tags: Vec<Tag>) -> Vec<u8> {
        tags.sort_by_key(|tag| tag.0);
        let mut out = (tags.len() as u16).to_le_bytes().to_vec();
        let mut behind = Vec::new();
        let values_at = at + 2 + 12 * tags.len() + 4;
        for (tag, kind, count, bytes) in tags {
            out.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
            out.extend(count.to_le_bytes());
            if bytes.len() <= 4 {
                out.extend(bytes.iter().copied().chain([0; 4]).take(4));
            } else {
                out.extend(((values_at + behind.len()) as u32).to_le_bytes());
                behind.extend(bytes);
            }
        }
        out.extend([0; 4]);
        out.extend(behind);
        out
    }

    /// A DNG as converters write them: a small picture first, the raw image below it. `data` are the strips
    /// or tiles.
    fn dng(raw: Vec<Tag>, data: &[Vec<u8>], tiled: bool) -> Vec<u8> {
        let mut out = b"II*\0\0\0\0\0".to_vec();
        let mut places = Vec::new();
        for segment in data {
            places.push(out.len() as u32);
            out.extend(segment);
        }
        let exif_at = out.len();
        out.extend(directory(
            exif_at,
            vec![(
                33_434,
                5,
                1,
                [1u32.to_le_bytes(), 4u32.to_le_bytes()].concat(),
            )],
        ));
        let lengths: Vec<u32> = data.iter().map(|segment| segment.len() as u32).collect();
        let [at, of] = if tiled { [324, 325] } else { [273, 279] };
        let mut tags = raw;
        tags.extend([longs(at, &places), longs(of, &lengths)]);
        let raw_at = out.len();
        out.extend(directory(raw_at, tags));
        let first_at = out.len();
        let noise: Vec<u8> = [1e-4f64, 1e-6]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let first = vec![
            (VERSION, 1, 4, vec![1, 4, 0, 0]),
            longs(254, &[1]),
            longs(256, &[1]),
            longs(257, &[1]),
            shorts(262, &[1]),
            shorts(258, &[8]),
            longs(273, &[8]),
            longs(279, &[1]),
            longs(330, &[raw_at as u32]),
            longs(34_665, &[exif_at as u32]),
            (51_041, 12, 2, noise),
        ];
        out.extend(directory(first_at, first));
        out[4..8].copy_from_slice(&(first_at as u32).to_le_bytes());
        out
    }

    /// Tags of a mosaic of 8 × 6 photosites, of which 6 × 4 show something.
    fn mosaic(bits: u16, compression: u16) -> Vec<Tag> {
        vec![
            longs(256, &[8]),
            longs(257, &[6]),
            shorts(258, &[bits]),
            shorts(259, &[compression]),
            shorts(262, &[MOSAIC as u16]),
            shorts(277, &[1]),
            shorts(33_421, &[2, 2]),
            (33_422, 1, 4, vec![1, 0, 2, 1]),
            shorts(50_713, &[2, 2]),
            shorts(50_714, &[500, 512, 512, 510]),
            shorts(50_717, &[3900]),
            longs(50_829, &[1, 2, 5, 8]),
        ]
    }

    fn counts() -> Vec<u16> {
        (0..48).map(|k| 512 + 61 * k).collect()
    }

    /// The active part of [`counts`], raised to one black level.
    fn expected() -> Vec<u16> {
        let lift = [[12, 0], [0, 2]];
        let at = |k: usize| counts()[(k / 6 + 1) * 8 + k % 6 + 2] + lift[k / 6 % 2][k % 6 % 2];
        (0..24).map(at).collect()
    }

    fn little(counts: &[u16]) -> Vec<u8> {
        counts
            .iter()
            .flat_map(|count| count.to_le_bytes())
            .collect()
    }

    #[test]
    fn the_raw_image_comes_with_its_levels_pattern_noise_and_exposure() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.dng");
        let all = counts();
        let packed: Vec<u8> = all
            .as_chunks::<2>()
            .0
            .iter()
            .flat_map(|[a, b]| [(a >> 4) as u8, (a << 4) as u8 | (b >> 8) as u8, *b as u8])
            .collect();
        let strips = |mut tags: Vec<Tag>, rows: u32| {
            tags.push(longs(278, &[rows]));
            tags
        };
        let tiles = |mut tags: Vec<Tag>| {
            tags.extend([longs(322, &[16]), longs(323, &[16])]);
            tags
        };
        let mut padded = vec![9u16; 256];
        (0..48).for_each(|k| padded[k / 8 * 16 + k % 8] = all[k]);
        let jpeg = |counts: &[u16], rows: usize| lossless_jpeg::tests::encode(counts, rows, 2, 1);
        let files = [
            dng(strips(mosaic(16, 1), 6), &[little(&all)], false),
            dng(
                strips(mosaic(16, 1), 4),
                &[little(&all[..32]), little(&all[32..])],
                false,
            ),
            dng(strips(mosaic(12, 1), 6), &[packed], false),
            dng(tiles(mosaic(16, 1)), &[little(&padded)], true),
            dng(strips(mosaic(16, 7), 6), &[jpeg(&all, 6)], false),
            dng(tiles(mosaic(16, 7)), &[jpeg(&padded, 16)], true),
        ];
        for (k, bytes) in files.into_iter().enumerate() {
            std::fs::write(&path, &bytes).unwrap();
            assert!(is_one(&path).unwrap());
            let file = read_raw(&path, 6, 4).unwrap();
            assert_eq!(file.raw.counts, expected(), "{k}");
            let sensor = file.sensor.unwrap();
            assert_eq!(
                (sensor.black_counts, sensor.saturation_counts),
                (512.0, 3900.0)
            );
            assert_eq!(sensor.bayer, Some(Bayer::Grbg));
            assert_eq!(
                (sensor.noise, sensor.exposure_s),
                (Some([1e-4, 1e-6]), Some(0.25))
            );
            assert_eq!(exposure_s(&path).unwrap(), Some(0.25));
            for keep in (8..bytes.len()).step_by(7) {
                std::fs::write(&path, &bytes[..keep]).unwrap();
                let error = read_raw(&path, 6, 4).unwrap_err().to_string();
                assert_eq!(error.lines().count(), 1, "{k} {keep}: {error}");
            }
        }
    }

    #[test]
    fn the_raw_image_may_be_the_first_of_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.dng");
        let mut tags = mosaic(16, 1);
        let data = little(&counts());
        tags.extend([
            (VERSION, 1, 4, vec![1, 4, 0, 0]),
            longs(273, &[8]),
            longs(279, &[data.len() as u32]),
        ]);
        let at = 8 + data.len();
        let head = [&b"II*\0"[..], &(at as u32).to_le_bytes()].concat();
        std::fs::write(&path, [head, data, directory(at, tags)].concat()).unwrap();
        assert!(is_one(&path).unwrap());
        assert_eq!(read_raw(&path, 6, 4).unwrap().raw.counts, expected());
        assert_eq!(exposure_s(&path).unwrap(), None);
    }

    #[test]
    fn what_would_be_read_wrongly_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.dng");
        let said = |change: &dyn Fn(&mut Vec<Tag>), size: usize| {
            let mut tags = mosaic(16, 1);
            change(&mut tags);
            std::fs::write(&path, dng(tags, &[little(&counts())], false)).unwrap();
            let error = read_raw(&path, size, 4).unwrap_err().to_string();
            assert_eq!(error.lines().count(), 1, "{error}");
            error
        };
        let put = |tag: Tag| {
            move |tags: &mut Vec<Tag>| {
                tags.retain(|other| other.0 != tag.0);
                tags.push(tag.clone());
            }
        };
        let error = said(&|_| {}, 8);
        assert!(
            error.contains("is 6 × 4 pixels, but the rig's camera has 8 × 4"),
            "{error}"
        );
        for (change, words) in [
            (put((33_422, 1, 4, vec![0, 1, 3, 2])), "no Bayer pattern"),
            (put(shorts(33_421, &[6, 6])), "no Bayer pattern"),
            (
                put(shorts(259, &[34_892])),
                "compressed in a way that is not read (34892)",
            ),
            (
                put(shorts(50_717, &[400])),
                "black at 512 and white at 400 counts",
            ),
            (put(shorts(258, &[32])), "1 values of 32 bits a pixel"),
            (
                put((50_715, 8, 8, vec![9; 16])),
                "a black level for each row or column",
            ),
            (put(shorts(50_713, &[1, 3])), "damaged (BlackLevel)"),
            (put(longs(50_829, &[1, 2, 9, 8])), "damaged (ActiveArea)"),
            (put(longs(256, &[60_000])), "claims 60000 × 6 photosites"),
            (put(longs(254, &[1])), "holds no raw image"),
        ] {
            let error = said(&change, 6);
            assert!(
                error.contains(words) || words.contains("raw image"),
                "{words}: {error}"
            );
        }
    }
}
