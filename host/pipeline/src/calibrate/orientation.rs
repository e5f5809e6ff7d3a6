//! Whether the target lay as `rig.toml` has it, in all frames that show its orientation mark.

use crate::calibrate::MISFITS;
use crate::calibrate::error::CalibrateError;
use gonia_imaging::{Orientation, Turn};
use gonia_rig::Remark;

/// Judges frames by their numbers and marks: an error where the target lies turned, a remark where few frames
/// of many show it so. A frame that hides its mark says nothing.
pub fn judged(frames: &[(u32, Option<Orientation>)]) -> Result<Option<Remark>, CalibrateError> {
    let seen: Vec<(u32, Orientation)> = frames
        .iter()
        .filter_map(|(frame, orientation)| Some((*frame, (*orientation)?)))
        .collect();
    let turned: Vec<(u32, Turn)> = seen
        .iter()
        .filter_map(|(frame, orientation)| match orientation {
            Orientation::Turned(turn) => Some((*frame, *turn)),
            Orientation::AsDrawn => None,
        })
        .collect();
    let count = |turn: Turn| turned.iter().filter(|(_, t)| *t == turn).count();
    // Of equals the first.
    let most = turned.iter().copied();
    let Some((first, turn)) = most.reduce(|a, b| if count(b.1) > count(a.1) { b } else { a })
    else {
        return Ok(None);
    };
    if turned.len() as f64 > MISFITS * seen.len() as f64 {
        return Err(CalibrateError::TargetTurned {
            turn,
            frames: count(turn),
            of: seen.len(),
            first: (count(turn) < seen.len()).then_some(first),
        });
    }
    Ok(Some(Remark::new(
        format_args!("{} of {} frames", turned.len(), seen.len()),
        format_args!(
            "the target is {turn} in them, as its orientation mark shows (frame {first} the first), and they are left out"
        ),
        "the calibration stands on the others",
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_turned_frames_are_left_out_and_many_are_refused() {
        let frames = |turned: &[Turn], straight: usize, hidden: usize| {
            let turned = turned.iter().map(|turn| Some(Orientation::Turned(*turn)));
            let straight = std::iter::repeat_n(Some(Orientation::AsDrawn), straight);
            let all = straight
                .chain(turned)
                .chain(std::iter::repeat_n(None, hidden));
            let all: Vec<_> = (7..).zip(all).collect();
            judged(&all)
        };
        assert_eq!(frames(&[], 20, 5).unwrap(), None);
        assert_eq!(frames(&[], 0, 5).unwrap(), None);
        let remark = frames(&[Turn::Half], 20, 0).unwrap().unwrap().to_string();
        assert!(remark.starts_with("1 of 21 frames"), "{remark}");
        assert!(remark.contains("frame 27 the first"), "{remark}");
        let error = frames(&[Turn::Left; 6], 0, 30).unwrap_err().to_string();
        assert!(
            error.contains("anticlockwise in 6 of 6 frames") && error.contains("turn it back"),
            "{error}"
        );
        let error = frames(&[Turn::Half, Turn::Left, Turn::Left], 9, 0);
        let error = error.unwrap_err().to_string();
        assert!(
            error.contains("in 2 of 12 frames") && error.contains("(frame 17 the first)"),
            "{error}"
        );
    }
}
