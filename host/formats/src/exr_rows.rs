//! An uncompressed float EXR of any channels written and read row by row, in any order: for images that do not fit
//! memory, for a few values of a large one, and for all of them by several threads.
//!
//! Such a file is a header, a table of 8-byte offsets, and for each row its number and its length (two
//! 4-byte integers) before the values of its channels, which stand in the order of their names (B, G, R), all
//! little-endian.

use crate::exr_channels::{Named, named};
use crate::exr_header::sort_attributes;
use crate::exr_planes::{layer_attributes, text_attributes, to_io};
use crate::read_at::read_exact_at;
use crate::{FileError, write_whole};
use exr::compression::Compression;
use exr::io::PeekRead;
use exr::math::Vec2;
use exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData, Requirements, magic_number};
use gonia_rig::Channels;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Bytes before the values of a row.
const ROW_HEAD: u64 = 8;

/// A file being written.
pub(super) struct RowWriter<'a> {
    file: Mutex<&'a mut BufWriter<File>>,
    /// Where row 0 begins.
    start: u64,
    width: usize,
    /// Which channel comes when.
    order: Vec<usize>,
}

impl RowWriter<'_> {
    /// Writes some channels of a row, from any thread: their numbers, and the values of each. Each channel of each
    /// row is to be written once.
    pub fn write(&self, row: usize, channels: &[usize], values: &[&[f32]]) -> io::Result<()> {
        let size = 4 * self.order.len() * self.width;
        let start = self.start + row as u64 * (ROW_HEAD + size as u64);
        let mut bytes = Vec::with_capacity(ROW_HEAD as usize + 4 * channels.len() * self.width);
        bytes.extend((row as i32).to_le_bytes());
        bytes.extend((size as i32).to_le_bytes());
        // Channels that follow each other in the file are written at once, the first ones with the row's head.
        let mut pieces = vec![(start, bytes)];
        let mut next = 0;
        for (place, channel) in self.order.iter().enumerate() {
            let Some(k) = channels.iter().position(|c| c == channel) else {
                continue;
            };
            if place != next {
                let before = ROW_HEAD + 4 * (place * self.width) as u64;
                pieces.push((start + before, Vec::new()));
            }
            next = place + 1;
            if let Some((_, bytes)) = pieces.last_mut() {
                let from = bytes.len();
                bytes.resize(from + 4 * values[k].len(), 0);
                let places = bytes[from..].chunks_exact_mut(4);
                for (place, value) in places.zip(values[k]) {
                    place.copy_from_slice(&value.to_le_bytes());
                }
            }
        }
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        for (at, bytes) in pieces {
            file.seek(SeekFrom::Start(at))?;
            file.write_all(&bytes)?;
        }
        Ok(())
    }
}

/// Writes a square image of some channels whole; `fill` gives its rows.
pub(super) fn write_rows(
    path: &Path,
    side: usize,
    names: &[String],
    attributes: &BTreeMap<String, String>,
    fill: impl FnOnce(&RowWriter<'_>) -> io::Result<()>,
) -> Result<(), FileError> {
    let own = layer_attributes(path, attributes)?;
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by(|a, b| names[*a].as_bytes().cmp(names[*b].as_bytes()));
    let channels = order
        .iter()
        .map(|k| ChannelDescription::named(&*names[*k], SampleType::F32))
        .collect();
    let header = Header::new(Text::default(), (side, side), channels)
        .with_encoding(
            Compression::Uncompressed,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        )
        .with_attributes(own);
    write_whole(path, |file| {
        magic_number::write(file).map_err(to_io)?;
        let headers = [header];
        let requirements = MetaData::validate(&headers, true).map_err(to_io)?;
        requirements.write(file).map_err(to_io)?;
        Header::write_all(&headers, file, false).map_err(to_io)?;
        sort_attributes(file)?;
        let start = file.stream_position()? + 8 * side as u64;
        let row_bytes = ROW_HEAD + 4 * order.len() as u64 * side as u64;
        for row in 0..side as u64 {
            file.write_all(&(start + row * row_bytes).to_le_bytes())?;
        }
        fill(&RowWriter {
            file: Mutex::new(file),
            start,
            width: side,
            order,
        })
    })
}

/// A file that is read by rows.
pub(super) struct RowReader {
    file: File,
    /// Where each row begins.
    offsets: Vec<u64>,
    /// The number of the first row in the file.
    first: i32,
    /// What its channels are, and where each stands in a row.
    named: Named,
    /// How many channels a row has: those, and others beside them.
    channels: usize,
    attributes: BTreeMap<String, String>,
}

impl RowReader {
    /// Opens a square image. `None` when it is not of the plain kind that this module writes, or no
    /// EXR at all: who reads any EXR says what is wrong with it.
    pub fn open(path: &Path) -> Result<Option<Self>, FileError> {
        let file = File::open(path).map_err(|error| FileError::reading(path, &error))?;
        Ok(Self::of_plain(file))
    }

    /// `None` unless the file is plain and as long as it should be.
    fn of_plain(file: File) -> Option<Self> {
        let mut read = PeekRead::new(BufReader::new(&file));
        magic_number::validate_exr(&mut read).ok()?;
        let requirements = Requirements::read(&mut read).ok()?;
        requirements.validate().ok()?;
        let headers = Header::read_all(&mut read, &requirements, false).ok()?;
        let [header] = headers.as_slice() else {
            return None;
        };
        let channels = &header.channels.list;
        let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
        let named = named(&names).ok()?;
        let is_single = channels
            .iter()
            .all(|c| c.sample_type == SampleType::F32 && c.sampling == Vec2(1, 1));
        let pixel = 4 * channels.len() as u64;
        let side = header.layer_size.width();
        let plain = is_single
            && header.compression == Compression::Uncompressed
            && header.blocks == BlockDescription::ScanLines
            && !header.deep
            && header.layer_size.height() == side;
        if !plain {
            return None;
        }
        let first = header.own_attributes.layer_position.y();
        let attributes = text_attributes(header);
        let offsets = MetaData::read_offset_tables(&mut read, &headers)
            .ok()?
            .into_iter()
            .next()?;
        let length = file.metadata().ok()?.len();
        let whole = |offset: &u64| {
            let end = offset.checked_add(ROW_HEAD + pixel * side as u64);
            end.is_some_and(|end| end <= length)
        };
        // Rows that share their bytes would be a small file of a large image.
        let holds_all = (side as u64)
            .checked_mul(ROW_HEAD + pixel * side as u64)
            .is_some_and(|bytes| bytes <= length);
        let is_whole = holds_all && offsets.len() == side && offsets.iter().all(whole);
        is_whole.then_some(Self {
            file,
            offsets,
            first,
            named,
            channels: names.len(),
            attributes,
        })
    }

    /// Rows, and columns.
    pub fn side(&self) -> usize {
        self.offsets.len()
    }

    /// The text attributes of the file, by name.
    pub fn attributes(&self) -> &BTreeMap<String, String> {
        &self.attributes
    }

    /// What the channels are.
    pub fn channels(&self) -> &Channels {
        &self.named.channels
    }

    /// The value of a pixel in a channel.
    pub fn value(&self, row: usize, column: usize, channel: usize) -> io::Result<f32> {
        let before = (self.named.places[channel] * self.side() + column) as u64;
        let mut bytes = [0; 4];
        let at = self.offsets[row] + ROW_HEAD + 4 * before;
        read_exact_at(&self.file, &mut bytes, at)?;
        Ok(f32::from_le_bytes(bytes))
    }

    /// All of it, a plane a channel, by all threads; `None` when a row is not where the file says.
    pub fn read_all(&self) -> io::Result<Option<Vec<Vec<f32>>>> {
        let (side, n) = (self.side(), self.named.places.len());
        let size = 4 * self.channels * side;
        let mut planes: Vec<Vec<f32>> = (0..n).map(|_| vec![0.0; side * side]).collect();
        // Of each row the places of its values, in the order of the channels.
        let mut rows: Vec<Vec<&mut [f32]>> = (0..side).map(|_| Vec::with_capacity(n)).collect();
        for plane in &mut planes {
            for (row, values) in rows.iter_mut().zip(plane.chunks_mut(side)) {
                row.push(values);
            }
        }
        let in_place = rows.into_par_iter().enumerate().map_init(
            || vec![0; ROW_HEAD as usize + size],
            |bytes, (row, out)| {
                read_exact_at(&self.file, bytes, self.offsets[row])?;
                let (head, values) = bytes.split_at(ROW_HEAD as usize);
                let number = i64::from(self.first) + row as i64;
                let expected = [number as i32, size as i32].map(i32::to_le_bytes);
                for (out, place) in out.into_iter().zip(&self.named.places) {
                    let values = values[4 * side * place..][..4 * side].as_chunks().0.iter();
                    for (value, bytes) in out.iter_mut().zip(values) {
                        *value = f32::from_le_bytes(*bytes);
                    }
                }
                Ok::<_, io::Error>(head == expected.as_flattened())
            },
        );
        let in_place = in_place.try_reduce(|| true, |a, b| Ok(a && b))?;
        Ok(in_place.then_some(planes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exr_planes;

    #[test]
    fn rows_written_in_any_order_are_an_ordinary_exr_and_read_back_one_by_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rows.exr");
        let side = 24;
        let plane = |c: usize, row: usize| -> Vec<f32> {
            (0..side)
                .map(|k| (1000 * c + side * row + k) as f32)
                .collect()
        };
        let attributes = BTreeMap::from([("gonia.scale".to_owned(), "relative".to_owned())]);
        write_rows(&path, side, &Channels::Rgb.names(), &attributes, |writer| {
            for row in (0..side).rev() {
                let planes = [0, 1, 2].map(|c| plane(c, row));
                let [red, green, blue] = planes.each_ref().map(Vec::as_slice);
                writer.write(row, &[0, 1], &[red, green])?;
                writer.write(row, &[2], &[blue])?;
            }
            Ok(())
        })
        .unwrap();
        let image = exr_planes::read(&path, |w, h| {
            assert_eq!((w, h), (side, side));
            Ok(())
        })
        .unwrap();
        assert_eq!(image.attributes, attributes);
        let reader = RowReader::open(&path).unwrap().unwrap();
        assert_eq!(reader.side(), side);
        assert_eq!(reader.attributes(), &attributes);
        let whole = reader.read_all().unwrap().unwrap();
        for (c, read) in image.planes.into_iter().enumerate() {
            let read = read.into_f32();
            assert_eq!(read, whole[c]);
            for row in 0..side {
                assert_eq!(read[row * side..(row + 1) * side], plane(c, row));
                assert_eq!(reader.value(row, 7, c).unwrap(), plane(c, row)[7]);
            }
        }
    }

    #[test]
    fn rows_and_planes_give_the_same_bytes_every_time() {
        use crate::exr_planes::{ExrPlanes, Plane};
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rows.exr");
        let attributes: BTreeMap<String, String> = ["d", "a", "c", "b", "e", "f"]
            .map(|name| (format!("gonia.{name}"), name.to_owned()))
            .into();
        let row: Vec<f32> = (0..12).map(|k| k as f32).collect();
        let image = ExrPlanes {
            width: 12,
            height: 12,
            planes: [(); 3].map(|()| Plane::F32(row.repeat(12))),
            extra: None,
            attributes: attributes.clone(),
        };
        exr_planes::write(&path, image).unwrap();
        let planes = std::fs::read(&path).unwrap();
        for _ in 0..20 {
            write_rows(&path, 12, &Channels::Rgb.names(), &attributes, |writer| {
                (0..12)
                    .rev()
                    .try_for_each(|k| writer.write(k, &[0, 1, 2], &[&row[..]; 3]))
            })
            .unwrap();
            let header = planes.len() - 12 * (16 + 12 * 12);
            assert!(std::fs::read(&path).unwrap()[..header] == planes[..header]);
        }
    }

    #[test]
    fn a_failed_row_leaves_no_file_and_a_cut_file_is_not_opened() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rows.exr");
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        write_rows(&path, 12, &Channels::Rgb.names(), &BTreeMap::new(), |_| {
            Err(full())
        })
        .unwrap_err();
        assert!(!path.exists());
        let row = [0.5; 12];
        write_rows(
            &path,
            12,
            &Channels::Rgb.names(),
            &BTreeMap::new(),
            |writer| (0..12).try_for_each(|k| writer.write(k, &[0, 1, 2], &[&row[..]; 3])),
        )
        .unwrap();
        let length = std::fs::metadata(&path).unwrap().len();
        let file = File::options().write(true).open(&path).unwrap();
        file.set_len(length - 1).unwrap();
        assert!(RowReader::open(&path).unwrap().is_none());
    }

    #[test]
    fn rows_that_are_not_where_the_file_says_are_not_taken_for_others() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("rows.exr");
        let row = [0.5; 12];
        write_rows(
            &path,
            12,
            &Channels::Rgb.names(),
            &BTreeMap::new(),
            |writer| (0..12).try_for_each(|k| writer.write(k, &[0, 1, 2], &[&row[..]; 3])),
        )
        .unwrap();
        let reader = RowReader::open(&path).unwrap().unwrap();
        assert!(reader.read_all().unwrap().is_some());
        let mut file = File::options().write(true).open(&path).unwrap();
        file.seek(SeekFrom::Start(reader.offsets[3])).unwrap();
        file.write_all(&7i32.to_le_bytes()).unwrap();
        assert!(reader.read_all().unwrap().is_none());
    }
}
