//! Frames as EXR: linear radiance, channels R, G and B (or Y alone), half or float.

use crate::exr_planes::{ExrPlanes, Plane, unreadable};
use crate::raw_frame::looks_raw;
use crate::{FileError, exr_blocks, exr_colours, exr_planes};
use exr::block::lines::LineRef;
use exr::math::Vec2;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::prelude::f16;
use gonia_rig::Frame;
use half::slice::HalfFloatSliceExt;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::ops::Range;
use std::path::Path;

/// Radiance below this is no noise around zero any more, but a broken file.
const LEAST: f32 = -1e6;
/// No frame is wider or higher.
const MAX_SIDE: usize = 65_536;
/// A file that claims to be larger than this many bytes in memory, and this many times its own length,
/// is not what it claims: no compression goes so far.
const CLAIM_BYTES: u64 = 1 << 26;
const CLAIM_RATIO: u64 = 4096;

/// Reads a frame of any size up to 65,536 pixels a side: what is in the data window, wherever that is.
///
/// # Errors
/// One line naming the file, and the channel and pixel where there is one: not an EXR, cut short,
/// without colours (see [`read_frame_of_size`]), or with values that are no radiance (NaN, below
/// −10⁶). +∞ is one: a saturated pixel.
pub fn read_frame(path: &Path) -> Result<Frame, FileError> {
    let mut spare = SpareFrame::default();
    read_placed(path, None, &mut spare, |header, file_bytes| {
        let (width, height) = (header.layer_size.width(), header.layer_size.height());
        let claimed = 12 * width as u64 * height as u64;
        if claimed > CLAIM_BYTES && claimed / CLAIM_RATIO > file_bytes {
            return Err((
                format!("claims {width} × {height} pixels in {file_bytes} bytes"),
                "copy or make it again".into(),
            ));
        }
        Ok(Placement {
            size: [width, height],
            from: [0, 0],
        })
    })
}

/// Reads a frame that must be `width` × `height` pixels: its display window. A data window that covers
/// only part of it, or reaches beyond it, is placed where the file says; NaN marks pixels that are not
/// in the file. Channels are R, G and B (in either case) of the only layer that has them, or of the one
/// without a name; or Y alone, a grey frame.
///
/// # Errors
/// As [`read_frame`]; and when its size is another, its data window lies outside of it, or colours are
/// missing or in several layers.
pub fn read_frame_of_size(path: &Path, width: usize, height: usize) -> Result<Frame, FileError> {
    read_frame_rows(path, [width, height], 0..height, &mut SpareFrame::default())
}

/// Memory of frames that were read and are no longer needed, for the next one. Memory that is new costs an
/// uncompressed frame more time than all the rest of its reading.
#[derive(Default)]
pub struct SpareFrame {
    rgb: Vec<[f32; 3]>,
    /// Pixels outside of these are NaN.
    written: Range<usize>,
}

impl SpareFrame {
    /// Keeps the memory of a frame of which [`read_frame_rows`] read `rows`, unchanged since.
    pub fn keep(&mut self, frame: Frame, rows: &Range<usize>) {
        self.written = rows.start * frame.width..rows.end * frame.width;
        self.rgb = frame.rgb;
    }

    /// Pixels for a new frame, of which `needed` will be read: NaN outside of them.
    fn take(&mut self, count: usize, needed: &Range<usize>) -> Vec<[f32; 3]> {
        let mut rgb = std::mem::take(&mut self.rgb);
        if rgb.len() != count {
            // Zeros are not touched before they are used.
            rgb = vec![[0.0; 3]; count];
            self.written = 0..count;
        }
        let written = self.written.clone();
        for old in [
            written.start..written.end.min(needed.start),
            written.start.max(needed.end)..written.end,
        ] {
            if let Some(old) = rgb.get_mut(old) {
                old.fill([f32::NAN; 3]);
            }
        }
        rgb
    }
}

/// As [`read_frame_of_size`], of a frame of width × height pixels of which only some rows are needed:
/// blocks of the file that show none of them are neither read nor decoded, and their pixels are NaN.
/// The frame's memory is that of `spare`, where it fits.
///
/// # Errors
/// As [`read_frame_of_size`]; but what is wrong with blocks that are not read is not seen.
pub fn read_frame_rows(
    path: &Path,
    size: [usize; 2],
    rows: Range<usize>,
    spare: &mut SpareFrame,
) -> Result<Frame, FileError> {
    let [width, height] = size;
    if looks_raw(path) {
        return Err(FileError::new(
            path,
            "is a picture of counts, not an OpenEXR of radiance",
            "give its exposure time in the column exposure_s of frames.csv",
        ));
    }
    read_placed(path, Some(rows), spare, |header, _| {
        let display = header.shared_attributes.display_window;
        let data = header.layer_size;
        let position = header.own_attributes.layer_position;
        let from = [
            i64::from(position.x()) - i64::from(display.position.x()),
            i64::from(position.y()) - i64::from(display.position.y()),
        ];
        let seen = [display.size.width(), display.size.height()];
        if seen != [width, height] {
            let data = [data.width(), data.height()];
            let window = if data == seen {
                String::new()
            } else {
                format!(" (and {} × {} in its data window)", data[0], data[1])
            };
            return Err((
                format!(
                    "is {} × {} pixels{window}, but the rig's camera has {width} × {height}",
                    seen[0], seen[1]
                ),
                "mend [camera] in rig.toml or use the frames of this rig".into(),
            ));
        }
        let outside =
            |i: usize, side: usize| from[i] >= seen[i] as i64 || from[i] + side as i64 <= 0;
        if outside(0, data.width()) || outside(1, data.height()) {
            return Err((
                format!(
                    "its data window of {} × {} pixels begins at ({}, {}), outside of the display window",
                    data.width(),
                    data.height(),
                    from[0],
                    from[1]
                ),
                "save it with the windows of the whole frame".into(),
            ));
        }
        Ok(Placement {
            size: [width, height],
            from,
        })
    })
}

/// Where in a frame the data window goes.
struct Placement {
    /// Width and height of the frame.
    size: [usize; 2],
    /// The frame's column and row of the first pixel of the data window.
    from: [i64; 2],
}

/// A value that is no radiance: its row, column, channel and itself.
type Wrong = (usize, usize, usize, f32);

/// A frame being read.
struct Reading {
    frame: Frame,
    /// Rows of it that are needed: others stay NaN, also where a block shows them too.
    rows: Range<usize>,
    from: [i64; 2],
    wrong: Option<Wrong>,
    halves: Vec<f16>,
    values: Vec<f32>,
}

fn read_placed(
    path: &Path,
    rows: Option<Range<usize>>,
    spare: &mut SpareFrame,
    place: impl FnOnce(&Header, u64) -> Result<Placement, (String, String)>,
) -> Result<Frame, FileError> {
    let refused = |(problem, remedy): (String, String)| FileError::new(path, problem, remedy);
    let reading = |error: &std::io::Error| FileError::reading(path, error);
    let file = File::open(path).map_err(|error| reading(&error))?;
    let bytes = file.metadata().map_err(|error| reading(&error))?.len();
    let reader =
        exr::block::read(BufReader::new(file), false).map_err(|error| unreadable(path, error))?;
    let colours = exr_colours::find(reader.headers()).map_err(refused)?;
    let header = &reader.headers()[colours.part];
    let data = header.layer_size;
    if data.width().max(data.height()) > MAX_SIDE {
        let problem = format!("is {} × {} pixels", data.width(), data.height());
        return Err(refused((problem, "check the file".into())));
    }
    let Placement { size, from } = place(header, bytes).map_err(refused)?;
    let rows = rows.unwrap_or(0..size[1]);
    let mut read = Reading {
        frame: blank(size, from, [data.width(), data.height()], &rows, spare),
        rows: rows.clone(),
        from,
        wrong: None,
        halves: Vec::new(),
        values: Vec::new(),
    };
    let within = |row: usize| (row as i64 - from[1]).clamp(0, data.height() as i64) as usize;
    let needed = within(rows.start)..within(rows.end);
    exr_blocks::each(reader, colours.part, needed, |meta, block| {
        let channels = &meta.headers[colours.part].channels;
        for line in block.lines(channels) {
            let index = line.location.channel;
            let kind = channels.list.get(index).map(|channel| channel.sample_type);
            let targets = (0..3).filter(|c| colours.channels[*c] == index);
            read.line(&line, kind, targets)?;
        }
        Ok(())
    })
    .map_err(|error| unreadable(path, error))?;
    match read.wrong {
        Some(wrong) => Err(no_radiance(path, wrong)),
        None => Ok(read.frame),
    }
}

/// A frame whose data window begins at `from`, before it is read: NaN where nothing will be.
fn blank(
    size: [usize; 2],
    from: [i64; 2],
    data: [usize; 2],
    rows: &Range<usize>,
    spare: &mut SpareFrame,
) -> Frame {
    let [width, height] = size;
    let covers = |i: usize| from[i] <= 0 && from[i] + data[i] as i64 >= size[i] as i64;
    let needed = if covers(0) && covers(1) {
        rows.start.min(height) * width..rows.end.min(height) * width
    } else {
        0..0
    };
    let rgb = spare.take(width * height, &needed);
    Frame { width, height, rgb }
}

impl Reading {
    /// Puts a line of one channel into the colours that are made of it.
    fn line(
        &mut self,
        line: &LineRef<'_>,
        kind: Option<SampleType>,
        targets: impl Iterator<Item = usize> + Clone,
    ) -> exr::error::UnitResult {
        let Some(first) = targets.clone().next() else {
            return Ok(());
        };
        let Vec2(x, y) = line.location.position;
        let row = y as i64 + self.from[1];
        let start = x as i64 + self.from[0];
        let width = self.frame.width as i64;
        let rows = self.rows.start as i64..self.rows.end.min(self.frame.height) as i64;
        // The line's own columns that lie in the frame.
        let skip = (-start).max(0);
        let end = (width - start).min(line.location.sample_count as i64);
        if !rows.contains(&row) || skip >= end {
            return Ok(());
        }
        let count = line.location.sample_count;
        self.values.resize(count, 0.0);
        if kind == Some(SampleType::F16) {
            self.halves.resize(count, f16::ZERO);
            line.read_samples_into_slice(&mut self.halves)?;
            self.halves.convert_to_f32_slice(&mut self.values);
        } else {
            line.read_samples_into_slice(&mut self.values)?;
        }
        let values = &self.values[skip as usize..end as usize];
        let at = (row * width + start + skip) as usize;
        let pixels = &mut self.frame.rgb[at..at + values.len()];
        for c in targets {
            for (pixel, value) in pixels.iter_mut().zip(values) {
                pixel[c] = *value;
            }
        }
        // A NaN is not at least anything either.
        if !values.iter().fold(true, |ok, v| ok & (*v >= LEAST)) {
            let bad = values
                .iter()
                .position(|v| v.is_nan() || *v < LEAST)
                .unwrap_or(0);
            let wrong = (
                row as usize,
                (start + skip) as usize + bad,
                first,
                values[bad],
            );
            // The first one of the frame, in whatever order lines come.
            let place = |(y, x, c, _): Wrong| (y, x, c);
            if self.wrong.is_none_or(|other| place(wrong) < place(other)) {
                self.wrong = Some(wrong);
            }
        }
        Ok(())
    }
}

fn no_radiance(path: &Path, (y, x, channel, value): Wrong) -> FileError {
    FileError::new(
        path,
        format_args!("{value} is no radiance"),
        "take the frame again, or mend the pixel (dead ones: the median of their neighbours)",
    )
    .at(format_args!(
        "channel {}, pixel ({x}, {y})",
        exr_planes::NAMES[channel]
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
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds,
        Layer, LayerAttributes, Text, WritableImage,
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

    /// Channels of a file with a data window at `position` in a display window of 4 × 3 pixels.
    fn save(
        path: &Path,
        parts: Vec<(&str, Vec<(&str, FlatSamples)>)>,
        size: [usize; 2],
        position: [i32; 2],
    ) {
        let layers = parts.into_iter().map(|(name, channels)| {
            let list = channels
                .into_iter()
                .map(|(name, data)| AnyChannel::new(name, data));
            let mut attributes =
                LayerAttributes::default().with_position(Vec2(position[0], position[1]));
            attributes.layer_name = Text::new_or_none(name);
            Layer::new(
                (size[0], size[1]),
                attributes,
                Encoding::SMALL_LOSSLESS,
                AnyChannels::sort(list.collect()),
            )
        });
        let display = IntegerBounds::new((7, -2), (4, 3));
        let attributes = ImageAttributes::new(display);
        Image::from_layers(attributes, layers.collect::<Vec<_>>())
            .write()
            .to_file(path)
            .unwrap();
    }

    fn floats(size: [usize; 2], scale: f32) -> FlatSamples {
        FlatSamples::F32((1..=size[0] * size[1]).map(|k| scale * k as f32).collect())
    }

    #[test]
    fn colours_are_found_by_whatever_name_and_in_whatever_part() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let size = [4, 3];
        let rgb = |names: [&'static str; 3]| {
            let scales = [1.0, 2.0, 4.0];
            let pairs = names.into_iter().zip(scales);
            pairs.map(|(n, s)| (n, floats(size, s))).collect::<Vec<_>>()
        };
        let with = |mut list: Vec<(&'static str, FlatSamples)>, name: &'static str| {
            list.push((name, floats(size, 9.0)));
            list
        };
        let colour = [
            vec![("", rgb(["R", "G", "B"]))],
            vec![("", with(rgb(["R", "G", "B"]), "A"))],
            vec![("", rgb(["r", "g", "b"]))],
            vec![("", rgb(["beauty.R", "beauty.G", "beauty.B"]))],
            vec![(
                "",
                with(
                    rgb([
                        "ViewLayer.Combined.R",
                        "ViewLayer.Combined.G",
                        "ViewLayer.Combined.B",
                    ]),
                    "ViewLayer.Depth.Z",
                ),
            )],
            vec![(
                "",
                [
                    rgb(["R", "G", "B"]),
                    rgb(["diffuse.B", "diffuse.R", "diffuse.G"]),
                ]
                .concat(),
            )],
            vec![
                ("depth", vec![("Z", floats(size, 3.0))]),
                ("rgb", rgb(["R", "G", "B"])),
            ],
        ];
        for (k, parts) in colour.into_iter().enumerate() {
            save(&path, parts, size, [7, -2]);
            let frame = read_frame_of_size(&path, 4, 3).unwrap();
            assert_eq!(frame.rgb[4], [5.0, 10.0, 20.0], "{k}");
            assert_eq!(frame.rgb[11], [12.0, 24.0, 48.0], "{k}");
        }
        for grey in ["Y", "y", "camera.Y"] {
            save(
                &path,
                vec![(
                    "",
                    vec![(grey, floats(size, 1.0)), ("A", floats(size, 5.0))],
                )],
                size,
                [7, -2],
            );
            assert_eq!(
                read_frame_of_size(&path, 4, 3).unwrap().rgb[4],
                [5.0; 3],
                "{grey}"
            );
        }
        let refused = [
            (
                vec![("", rgb(["R", "G", "A"]))],
                "has no channel B, only A, G, R;",
            ),
            (
                vec![("", rgb(["Y", "RY", "BY"]))],
                "has no channels R, G, B, only BY, RY, Y;",
            ),
            (vec![("", rgb(["X", "Y", "Z"]))], "only X, Y, Z;"),
            (
                vec![("", rgb(["a.R", "b.G", "b.B"]))],
                "has no channels R, G and B of one layer, only a.R, b.B, b.G;",
            ),
            (
                vec![(
                    "",
                    [rgb(["a.R", "a.G", "a.B"]), rgb(["b.R", "b.G", "b.B"])].concat(),
                )],
                "has colours in 2 layers: a, b;",
            ),
            (
                vec![
                    ("left", rgb(["R", "G", "B"])),
                    ("right", rgb(["R", "G", "B"])),
                ],
                "has colours in 2 layers: left, right;",
            ),
        ];
        for (parts, said) in refused {
            save(&path, parts, size, [7, -2]);
            let error = read_frame_of_size(&path, 4, 3).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
        let integer = FlatSamples::U32(vec![1; 12]);
        save(
            &path,
            vec![(
                "",
                vec![
                    ("R", floats(size, 1.0)),
                    ("G", integer),
                    ("B", floats(size, 1.0)),
                ],
            )],
            size,
            [7, -2],
        );
        let error = read_frame(&path).unwrap_err().to_string();
        assert!(error.contains("channel G holds 32-bit integers"), "{error}");
        let half = FlatSamples::F16(vec![f16::ONE; 12]);
        save(
            &path,
            vec![(
                "",
                vec![
                    ("R", half),
                    ("G", floats(size, 1.0)),
                    ("B", floats(size, 1.0)),
                ],
            )],
            size,
            [7, -2],
        );
        assert_eq!(read_frame(&path).unwrap().rgb[1], [1.0, 2.0, 2.0]);
    }

    #[test]
    fn a_data_window_is_placed_where_it_says() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let values = |size: [usize; 2], position: [i32; 2]| {
            let grey = vec![("", vec![("Y", floats(size, 1.0))])];
            save(&path, grey, size, position);
            read_frame_of_size(&path, 4, 3).map(|frame| {
                let values = frame.rgb.iter().map(|p| p[1]);
                values
                    .map(|v| if v.is_nan() { 0.0 } else { v })
                    .collect::<Vec<_>>()
            })
        };
        // Cropped: 2 × 2 pixels at (1, 1) of the frame.
        let cropped = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 3.0, 4.0, 0.0];
        assert_eq!(values([2, 2], [8, -1]).unwrap(), cropped);
        // Moved by one column and one row, either way.
        let moved = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 5.0, 6.0, 7.0];
        assert_eq!(values([4, 3], [8, -1]).unwrap(), moved);
        let back = [
            6.0, 7.0, 8.0, 0.0, 10.0, 11.0, 12.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        ];
        assert_eq!(values([4, 3], [6, -3]).unwrap(), back);
        // Wider than the frame on all sides.
        let wider = [
            8.0, 9.0, 10.0, 11.0, 14.0, 15.0, 16.0, 17.0, 20.0, 21.0, 22.0, 23.0,
        ];
        assert_eq!(values([6, 5], [6, -3]).unwrap(), wider);
        let error = values([4, 3], [11, -2]).unwrap_err().to_string();
        assert!(
            error.contains("4 × 3 pixels begins at (4, 0), outside"),
            "{error}"
        );
        let error = read_frame_of_size(&path, 5, 3).unwrap_err().to_string();
        assert!(
            error.contains("is 4 × 3 pixels, but the rig's camera has 5 × 3"),
            "{error}"
        );
    }

    #[test]
    fn rows_that_are_needed_are_those_of_the_whole_frame_in_every_encoding() {
        use exr::prelude::{Blocks, Compression, LineOrder};
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let size = [40, 300];
        let encodings = [
            (Compression::Uncompressed, Blocks::ScanLines),
            (Compression::RLE, Blocks::ScanLines),
            (Compression::ZIP1, Blocks::ScanLines),
            (Compression::ZIP16, Blocks::ScanLines),
            (Compression::PIZ, Blocks::ScanLines),
            (Compression::PXR24, Blocks::ScanLines),
            (Compression::ZIP16, Blocks::Tiles(Vec2(16, 8))),
        ];
        for (compression, blocks) in encodings {
            for line_order in [LineOrder::Increasing, LineOrder::Decreasing] {
                let encoding = Encoding {
                    compression,
                    blocks,
                    line_order,
                };
                let channels = [AnyChannel::new("Y", floats(size, 1.0))];
                let channels = AnyChannels::sort(channels.into_iter().collect());
                let attributes = LayerAttributes::default().with_position(Vec2(0, 5));
                let layer = Layer::new((40, 300), attributes, encoding, channels);
                let display = IntegerBounds::new((0, 0), (40, 310));
                Image::from_layers(ImageAttributes::new(display), vec![layer])
                    .write()
                    .to_file(&path)
                    .unwrap();
                let whole = read_frame_of_size(&path, 40, 310).unwrap();
                assert_eq!(whole.rgb[5 * 40][0], 1.0);
                let mut spare = SpareFrame::default();
                for rows in [0..310, 137..138, 150..180, 0..3, 306..310, 20..20] {
                    let some = read_frame_rows(&path, [40, 310], rows.clone(), &mut spare).unwrap();
                    for row in 0..310 {
                        let of = |frame: &Frame| -> Vec<u32> {
                            let pixels = &frame.rgb[row * 40..(row + 1) * 40];
                            pixels.iter().map(|pixel| pixel[0].to_bits()).collect()
                        };
                        if rows.contains(&row) {
                            assert_eq!(of(&some), of(&whole), "{row} of {rows:?}");
                        } else {
                            let pixels = &some.rgb[row * 40..(row + 1) * 40];
                            assert!(pixels.iter().flatten().all(|v| v.is_nan()), "{row}");
                        }
                    }
                    // The next one is read into the same memory.
                    spare.keep(some, &rows);
                }
                let bytes = std::fs::read(&path).unwrap();
                std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
                let error = read_frame_rows(&path, [40, 310], 150..151, &mut spare).unwrap_err();
                assert!(error.to_string().contains("cut short"), "{error}");
            }
        }
    }

    #[test]
    fn a_size_that_the_file_cannot_hold_is_refused_before_it_is_made_room_for() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        write_frame(&path, &frame()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let mut claim = |name: &[u8], skip: usize, values: &[i32]| {
            let at = bytes.windows(name.len()).position(|w| w == name).unwrap();
            let at = at + name.len() + skip;
            for (k, value) in values.iter().enumerate() {
                bytes[at + 4 * k..][..4].copy_from_slice(&value.to_le_bytes());
            }
        };
        claim(b"dataWindow\0box2i\0\x10\0\0\0", 8, &[59_999, 59_999]);
        claim(b"chunkCount\0int\0\x04\0\0\0", 0, &[60_000]);
        std::fs::write(&path, bytes).unwrap();
        let error = read_frame(&path).unwrap_err().to_string();
        assert!(error.contains("claims 60000 × 60000 pixels in"), "{error}");
        assert!(read_frame_of_size(&path, 12, 5).is_err());
    }
}
