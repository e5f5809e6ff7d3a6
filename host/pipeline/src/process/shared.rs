//! Frames that several processes sample, each a share of them.
//!
//! Sampling is nearly all of the work. What a share says of its frames is taken where it is what would be found here;
//! anything else (a frame that could not be used, or one whose reference cannot) is sampled here, so that the result is
//! that of one process, bit for bit.

use super::account::{Outcome, Refusal};
use super::reference::distance_of_same;
use super::sampled_bytes::{split_first, to_bytes};
use super::{
    FrameRow, FrameSource, Heard, Hidden, Masks, ProcessError, Processed, Role, SampledFrame,
    Sampling, process_sampled,
};
use gonia_rig::{Remark, Rig};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// What each frame of a share begins with.
const MAGIC: &[u8; 4] = b"GSH1";

/// Samples some rows of a source's frames: bytes for [`process_shared`]. Frames that cannot be used are not in them.
///
/// # Errors
/// The system lacks what every frame needs.
pub fn sample_share(
    rig: &Rig,
    source: &dyn FrameSource,
    rows: Range<usize>,
) -> Result<Vec<u8>, ProcessError> {
    let all = source.rows();
    let here = all.get(rows).unwrap_or_default();
    let sampling = Sampling::new(rig, source);
    let frames: Vec<Vec<u8>> = here
        .par_iter()
        .map(|row| {
            let finds = finds_what_hides(all, row);
            let hidden = if finds {
                Hidden::Find
            } else {
                Hidden::Known(None)
            };
            match sampling.sample_usable(row, hidden) {
                Ok((frame, remarks)) => Ok(bytes_of(&frame, finds, &remarks)),
                Err(error) if error.is_of_the_system() => Err(error),
                Err(_) => Ok(Vec::new()),
            }
        })
        .collect::<Result<_, _>>()?;
    Ok(frames.concat())
}

/// As [`process`](super::process), of frames of which `shares` say what most of them showed.
///
/// # Errors
/// As [`process`](super::process).
pub fn process_shared(
    rig: &Rig,
    source: &dyn FrameSource,
    shares: &[Vec<u8>],
    progress: Heard<'_>,
) -> Result<Processed, ProcessError> {
    let places: HashMap<(Role, u32), Found> = shares
        .iter()
        .flat_map(|share| found_in(share))
        .map(|found| ((found.frame.report.role, found.frame.report.frame), found))
        .collect();
    let sampling = Sampling::new(rig, source);
    let sampled = |row: &FrameRow, hidden: Hidden| {
        let found = places.get(&(row.role, row.frame));
        match (found, hidden) {
            (Some(found), Hidden::Find) if found.finds => Ok(found.taken(&sampling, row)),
            (Some(found), Hidden::Known(None)) if !found.finds => Ok(found.taken(&sampling, row)),
            _ => sampling.sample(row, hidden),
        }
    };
    let processed = process_sampled(rig, source.rows(), &sampled, &Masks::default(), progress);
    sampling.heard.judge(source.rows(), processed)
}

/// Whether a frame itself must tell what hides its target: one of the material needs not where a frame of the
/// reference was taken at the same pose.
fn finds_what_hides(all: &[FrameRow], row: &FrameRow) -> bool {
    let is_its_reference =
        |of: &FrameRow| of.role == Role::Reference && distance_of_same(of.pose, row.pose).is_some();
    row.role != Role::Material || !all.iter().any(is_its_reference)
}

/// What a share says of a frame.
struct Found {
    frame: SampledFrame,
    /// Whether the frame was looked at for what hides its target.
    finds: bool,
    remarks: Vec<Remark>,
}

impl Found {
    fn taken(&self, sampling: &Sampling<'_>, row: &FrameRow) -> SampledFrame {
        sampling.heard.of_frame(row, self.remarks.clone());
        self.frame.clone()
    }
}

/// `GSH1`; 1 where the frame was looked at for what hides its target, else 0; how many remarks (u32), each with its
/// length (u32) in UTF-8; the frame.
fn bytes_of(frame: &SampledFrame, finds: bool, remarks: &[Remark]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.push(u8::from(finds));
    bytes.extend((remarks.len() as u32).to_le_bytes());
    for remark in remarks {
        let text = remark.to_string();
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.as_bytes());
    }
    bytes.extend(to_bytes(frame));
    bytes
}

/// The frames of a share, up to where it is none.
fn found_in(mut share: &[u8]) -> impl Iterator<Item = Found> {
    std::iter::from_fn(move || {
        let (found, rest) = first_of(share)?;
        share = rest;
        Some(found)
    })
}

fn first_of(share: &[u8]) -> Option<(Found, &[u8])> {
    let rest = share.strip_prefix(MAGIC)?;
    let (finds, rest) = rest.split_first()?;
    let (count, mut rest) = length_of(rest)?;
    let mut remarks = Vec::new();
    for _ in 0..count {
        let (length, after) = length_of(rest)?;
        let (text, after) = after.split_at_checked(length)?;
        remarks.push(Remark::of_line(std::str::from_utf8(text).ok()?));
        rest = after;
    }
    let (frame, rest) = split_first(rest)?;
    // A refused frame's reason is found here where the bytes do not hold it.
    let is_known = frame.report.outcome != Outcome::Refused(Refusal::NoReference);
    let found = Found {
        frame,
        finds: *finds != 0,
        remarks,
    };
    is_known.then_some((found, rest))
}

fn length_of(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    Some((u32::from_le_bytes(*length) as usize, rest))
}
