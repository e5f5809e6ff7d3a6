//! Which channels of an EXR are a frame: R, G and B, or Y alone, of one layer.
//!
//! Renderers and cameras name them `R`, `r`, `beauty.R`, or put them into a part of their own beside
//! depth and masks. One such set is taken; where several could be meant, none is.

use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;
use std::collections::BTreeMap;

/// More channel names than this make no message clearer.
const MAX_NAMES: usize = 24;

/// The channels of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Colours {
    /// Index of the part.
    pub part: usize,
    /// Indices of red, green and blue in it; all the same for a grey frame.
    pub channels: [usize; 3],
}

/// Finds the frame's channels.
///
/// # Errors
/// Problem and remedy: no colours, with what there is instead; colours of several layers; or ones that
/// are integers, subsampled or deep.
pub(super) fn find(headers: &[Header]) -> Result<Colours, (String, String)> {
    let mut sets: Vec<Set> = Vec::new();
    let flat = headers.iter().enumerate().filter(|(_, h)| !h.deep);
    for (part, header) in flat {
        sets.extend(sets_of(part, header));
    }
    let rgb: Vec<&Set> = sets.iter().filter(|set| !set.is_grey()).collect();
    let grey: Vec<&Set> = sets.iter().filter(|set| set.is_grey()).collect();
    let candidates = if rgb.is_empty() { grey } else { rgb };
    let set = match candidates.as_slice() {
        [] => return Err(nothing(headers)),
        [set] => *set,
        several => {
            // Channels without a prefix are a file's default layer.
            let plain: Vec<_> = several.iter().filter(|set| set.name.is_empty()).collect();
            match plain.as_slice() {
                [set] => **set,
                _ => return Err(ambiguous(several)),
            }
        }
    };
    let list = &headers[set.colours.part].channels.list;
    for index in set.colours.channels {
        check(&list[index])?;
    }
    Ok(set.colours)
}

/// Colours of one layer.
struct Set {
    /// The name of part and layer; empty for a file's only part and channels without a prefix.
    name: String,
    colours: Colours,
}

impl Set {
    fn is_grey(&self) -> bool {
        let [r, g, _] = self.colours.channels;
        r == g
    }
}

/// The layer of a channel's name, and the rest: `beauty.R` is `R` of `beauty`.
fn split(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

fn sets_of(part: usize, header: &Header) -> Vec<Set> {
    let names: Vec<String> = names(header).collect();
    let mut layers: BTreeMap<&str, Vec<(&str, usize)>> = BTreeMap::new();
    for (index, name) in names.iter().enumerate() {
        let (layer, colour) = split(name);
        layers.entry(layer).or_default().push((colour, index));
    }
    let part_name = header.own_attributes.layer_name.as_ref();
    let part_name = part_name.map(ToString::to_string).unwrap_or_default();
    let set = |(layer, channels): (&str, Vec<(&str, usize)>)| {
        // As they are written first: a file may have an `r` of something else beside its `R`.
        let of = |wanted: &str| {
            let exact = channels.iter().find(|(name, _)| *name == wanted);
            let found = exact.or_else(|| {
                let mut all = channels.iter();
                all.find(|(name, _)| name.eq_ignore_ascii_case(wanted))
            });
            found.map(|(_, index)| *index)
        };
        let channels = match (of("R"), of("G"), of("B")) {
            (Some(r), Some(g), Some(b)) => [r, g, b],
            // With RY and BY it is half of a colour, with X (and Z) one of three others.
            (None, None, None) if of("RY").or(of("BY")).or(of("X")).is_none() => [of("Y")?; 3],
            _ => return None,
        };
        let both = [part_name.as_str(), layer];
        let name = both.iter().filter(|name| !name.is_empty()).copied();
        Some(Set {
            name: name.collect::<Vec<_>>().join("."),
            colours: Colours { part, channels },
        })
    };
    layers.into_iter().filter_map(set).collect()
}

fn check(channel: &ChannelDescription) -> Result<(), (String, String)> {
    let name = channel.name.to_string();
    if channel.sample_type == SampleType::U32 {
        return Err((
            format!("channel {name} holds 32-bit integers"),
            "save it as half or float, linear radiance".into(),
        ));
    }
    if channel.sampling != exr::math::Vec2(1, 1) {
        return Err((
            format!("channel {name} is subsampled"),
            "save every pixel of it".into(),
        ));
    }
    Ok(())
}

fn nothing(headers: &[Header]) -> (String, String) {
    let mut all: Vec<String> = headers.iter().flat_map(names).collect();
    let missing: Vec<&str> = ["R", "G", "B"]
        .into_iter()
        .filter(|wanted| !all.iter().any(|n| split(n).1.eq_ignore_ascii_case(wanted)))
        .collect();
    let more = all.len().saturating_sub(MAX_NAMES);
    all.truncate(MAX_NAMES);
    let mut there = all.join(", ");
    if more > 0 {
        there += &format!(" and {more} more");
    }
    if headers.iter().all(|header| header.deep) {
        return ("holds deep data".into(), "save it as a flat image".into());
    }
    let missing = match missing.as_slice() {
        [] => "channels R, G and B of one layer".to_owned(),
        [one] => format!("channel {one}"),
        several => format!("channels {}", several.join(", ")),
    };
    (
        format!("has no {missing}, only {there}"),
        "save it as RGB, with channels R, G and B, or as grey, with Y alone".into(),
    )
}

fn ambiguous(sets: &[&Set]) -> (String, String) {
    let names: Vec<&str> = sets
        .iter()
        .map(|set| match set.name.as_str() {
            "" => "one without a name",
            name => name,
        })
        .take(MAX_NAMES)
        .collect();
    (
        format!("has colours in {} layers: {}", sets.len(), names.join(", ")),
        "save the one that is the frame's radiance by itself".into(),
    )
}

fn names(header: &Header) -> impl Iterator<Item = String> {
    header.channels.list.iter().map(|c| c.name.to_string())
}
