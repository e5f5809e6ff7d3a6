//! Planes of an EXR file: what frames and dense BRDFs have in common.

use crate::exr_channels::{Named, named};
use crate::exr_header::sort_attributes;
use crate::{FileError, write_whole};
use exr::meta::attribute::{AttributeValue, SampleType};
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes,
    MetaData, ReadChannels, ReadLayers, Text, WritableImage, f16,
};
use gonia_rig::{Channels, Scale};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// The colour channels, in the order of every `[_; 3]` of this crate.
pub(super) const NAMES: [&str; 3] = ["R", "G", "B"];
/// What gonia's own attributes begin with in the file.
pub(super) const PREFIX: &str = "gonia.";
/// The attribute that holds the [`Scale`].
pub(super) const SCALE: &str = "gonia.scale";

/// Planes R, G and B of one file that is written, row by row from the top left.
pub(super) struct ExrPlanes {
    pub width: usize,
    pub height: usize,
    pub planes: [Plane; 3],
    /// A channel beside R, G and B, by name.
    pub extra: Option<(&'static str, Plane)>,
    /// The text attributes of the file, by name.
    pub attributes: BTreeMap<String, String>,
}

/// One channel in the precision of the file.
pub(super) enum Plane {
    F16(Vec<f16>),
    F32(Vec<f32>),
}

impl Plane {
    /// In single precision; moved, not copied, where it already is.
    pub fn into_f32(self) -> Vec<f32> {
        match self {
            Plane::F32(values) => values,
            Plane::F16(values) => values.into_iter().map(f16::to_f32).collect(),
        }
    }
}

impl From<Plane> for FlatSamples {
    fn from(plane: Plane) -> Self {
        match plane {
            Plane::F16(values) => FlatSamples::F16(values),
            Plane::F32(values) => FlatSamples::F32(values),
        }
    }
}

/// Planes of some channels of one file, row by row from the top left.
pub(super) struct NamedPlanes {
    pub width: usize,
    pub height: usize,
    pub channels: Channels,
    pub planes: Vec<Plane>,
    /// The text attributes of the file, by name.
    pub attributes: BTreeMap<String, String>,
}

/// Reads the planes of a file that are values: see [`named`]. `check` sees the size before anything large is
/// allocated, and may refuse it with (problem, remedy).
pub(super) fn read(
    path: &Path,
    check: impl FnOnce(usize, usize) -> Result<(), (String, String)>,
) -> Result<NamedPlanes, FileError> {
    let meta = MetaData::read_from_file(path, false).map_err(|error| unreadable(path, error))?;
    let [header] = meta.headers.as_slice() else {
        return Err(FileError::new(
            path,
            format_args!("holds {} images", meta.headers.len()),
            "keep one image a file",
        ));
    };
    if header.deep {
        return Err(FileError::new(
            path,
            "holds deep data",
            "save it as a flat image",
        ));
    }
    let list = &header.channels.list;
    let there: Vec<String> = list.iter().map(|c| c.name.to_string()).collect();
    let Named { channels, places } =
        named(&there).map_err(|(problem, remedy)| FileError::new(path, problem, remedy))?;
    let names: Vec<String> = places.iter().map(|k| there[*k].clone()).collect();
    for place in places {
        let (channel, name) = (&list[place], &there[place]);
        if channel.sample_type == SampleType::U32 {
            return Err(FileError::new(
                path,
                "holds 32-bit integers",
                "save it as half or float, linear radiance",
            )
            .at(format_args!("channel {name}")));
        }
        if channel.sampling != exr::math::Vec2(1, 1) {
            return Err(
                FileError::new(path, "is subsampled", "save every pixel of it")
                    .at(format_args!("channel {name}")),
            );
        }
    }
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    check(width, height).map_err(|(problem, remedy)| FileError::new(path, problem, remedy))?;
    check_promise(path, header)?;
    let attributes = text_attributes(header);

    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .map_err(|error| unreadable(path, error))?;
    let planes = take_planes(path, image.layer_data.channel_data, &names)?;
    Ok(NamedPlanes {
        width,
        height,
        channels,
        planes,
        attributes,
    })
}

/// Pixels of fewer bytes than this are never refused: memory for them is there.
const HARMLESS_BYTES: u64 = 1 << 28;
/// An EXR is packed no tighter than this: zlib's limit is 1032, and other kinds come near it.
const TIGHTEST: u64 = 2000;

/// Refuses a header that promises more than the file can hold, before memory is asked for it.
fn check_promise(path: &Path, header: &exr::meta::header::Header) -> Result<(), FileError> {
    let length = std::fs::metadata(path).map_err(|error| FileError::reading(path, &error))?;
    let length = length.len();
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    let channels = header.channels.list.iter();
    let bytes_a_pixel: usize = channels.map(|c| c.sample_type.bytes_per_sample()).sum();
    let promised = [height, bytes_a_pixel]
        .iter()
        .fold(width as u64, |all, n| all.saturating_mul(*n as u64));
    let tightest = match header.compression {
        Compression::Uncompressed => 1,
        _ => TIGHTEST,
    };
    if promised <= HARMLESS_BYTES || promised <= tightest * length {
        return Ok(());
    }
    Err(FileError::new(
        path,
        format_args!(
            "is cut short or damaged: its header promises {width} × {height} pixels, which its {length} bytes cannot hold"
        ),
        "copy or make it again",
    ))
}

/// The text attributes of a file, by name.
pub(super) fn text_attributes(header: &exr::meta::header::Header) -> BTreeMap<String, String> {
    let own = header.own_attributes.other.iter();
    own.chain(&header.shared_attributes.other)
        .filter_map(|(name, value)| match value {
            AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
            _ => None,
        })
        .collect()
}

/// What is wrong with a file that the `exr` crate does not read.
pub(super) fn unreadable(path: &Path, error: exr::error::Error) -> FileError {
    match error {
        exr::error::Error::Io(error) => FileError::reading(path, &error),
        exr::error::Error::NotSupported(what) => FileError::new(
            path,
            format_args!("is an EXR of a kind that is not read ({what})"),
            "save it as a flat RGB image",
        ),
        error => FileError::new(
            path,
            format_args!("is not an EXR, or is cut short or damaged ({error})"),
            "copy or make it again",
        )
        .caused_by(error),
    }
}

/// Writes three planes as one uncompressed image, whole, and gives them back. Attribute texts keep
/// letters outside of Latin-1, which an EXR cannot hold, as `\u{…}`.
pub(super) fn write(path: &Path, image: ExrPlanes) -> Result<[Plane; 3], FileError> {
    let ExrPlanes {
        width,
        height,
        planes,
        extra,
        attributes,
    } = image;
    let [r, g, b] = planes.map(FlatSamples::from);
    let extra = extra.map(|(name, plane)| (name, FlatSamples::from(plane)));
    let layer_attributes = layer_attributes(path, &attributes)?;
    let encoding = Encoding {
        compression: Compression::Uncompressed,
        ..Encoding::UNCOMPRESSED
    };
    let channels = AnyChannels::sort(
        [("R", r), ("G", g), ("B", b)]
            .into_iter()
            .chain(extra)
            .map(|(name, samples)| AnyChannel::new(name, samples))
            .collect(),
    );
    let image = Image::from_layer(Layer::new(
        (width, height),
        layer_attributes,
        encoding,
        channels,
    ));
    write_whole(path, |file| {
        image.write().to_buffered(&mut *file).map_err(to_io)?;
        sort_attributes(file)
    })?;
    let planes = take_planes(path, image.layer_data.channel_data, &NAMES)?;
    planes.try_into().map_err(|_| changed(path))
}

/// An error of the `exr` crate while a file is written.
pub(super) fn to_io(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// The text attributes of a file of gonia's.
pub(super) fn own_attributes(
    scale: Scale,
    provenance: &BTreeMap<String, String>,
) -> BTreeMap<String, String> {
    let own = provenance
        .iter()
        .map(|(name, text)| (format!("{PREFIX}{name}"), text.clone()));
    own.chain([(SCALE.to_owned(), scale.to_string())]).collect()
}

/// The attributes of a file, the program's name among them.
pub(super) fn layer_attributes(
    path: &Path,
    attributes: &BTreeMap<String, String>,
) -> Result<LayerAttributes, FileError> {
    let mut layer = LayerAttributes {
        software_name: Text::new_or_none(concat!("gonia ", env!("CARGO_PKG_VERSION"))),
        ..LayerAttributes::default()
    };
    for (name, value) in attributes {
        let texts = Text::new_or_none(name).zip(Text::new_or_none(latin(value)));
        let Some((name, value)) = texts else {
            return Err(FileError::new(
                path,
                format_args!("\"{name}\" cannot be the name of an attribute"),
                "name it with 1 to 255 Latin letters",
            ));
        };
        layer.other.insert(name, AttributeValue::Text(value));
    }
    Ok(layer)
}

/// The planes of some names out of an image, without copying them.
fn take_planes(
    path: &Path,
    channels: AnyChannels<FlatSamples>,
    names: &[impl AsRef<str>],
) -> Result<Vec<Plane>, FileError> {
    let mut list = channels.list;
    let take = |name: &_| {
        let name: &str = AsRef::as_ref(name);
        let place = list.iter().position(|channel| channel.name.eq(name));
        match place.map(|place| list.remove(place).sample_data) {
            Some(FlatSamples::F16(values)) => Ok(Plane::F16(values)),
            Some(FlatSamples::F32(values)) => Ok(Plane::F32(values)),
            Some(FlatSamples::U32(_)) | None => Err(changed(path)),
        }
    };
    names.iter().map(take).collect()
}

fn changed(path: &Path) -> FileError {
    FileError::new(path, "changed while it was read", "try again")
}

fn latin(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    for letter in text.chars() {
        if u32::from(letter) < 256 {
            kept.push(letter);
        } else {
            kept.extend(letter.escape_unicode());
        }
    }
    kept
}
