//! A sampled frame as bytes, as a session's `frames.bin` has it and as one process gives it to another; all
//! little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 4 | `GFR1` |
//! | 4, 1 | number of the frame; role: place in `Role::ALL` |
//! | 1 | 0 by its marks; 1 by its pose; 2 refused |
//! | 1, 8, 8 | why it was not by its marks: 0 –, 1 lines missing (found), 2 wrong layout (pixels, deviations), 3 far from the pose (degrees), 4 displaced (pixels right, down), 5 turned (place in `Turn::ALL`), 6 rolled (degrees), 7 resized (share), 8 the target turned (likewise) |
//! | 3 × 8 | residual, pixels; offset of the camera's θ and φ, degrees |
//! | 6 × 8 | reading: θi, φi, θv, φv; the camera by its marks: θ, φ; radians |
//! | 4 | number of points |
//! | each 1 | 0 a value; 1 occlusion, 2 mark, 3 not finite, 4 saturated, 5 border |
//! | and 20 | where a value: r, g, b; offset of its pixels x, y, mm; float32 |
//! | 4, n | bytes of the mask, and the mask (as in masks.csv); none when nothing was hidden |

use super::account::{FrameReport, Outcome, Refusal};
use super::sampled::{SampledFrame, SampledPoint};
use gonia_brdf::{Direction, Pose};
use gonia_imaging::{LeftOut, Mask, PoseOffset, RegistrationFailure, Turn};
use gonia_rig::Role;

const MAGIC: &[u8; 4] = b"GFR1";
const LEFT_OUT: [LeftOut; 5] = [
    LeftOut::Occlusion,
    LeftOut::Mark,
    LeftOut::NotFinite,
    LeftOut::Saturated,
    LeftOut::Border,
];

/// A frame as bytes.
pub fn to_bytes(frame: &SampledFrame) -> Vec<u8> {
    let mut out = Vec::with_capacity(120 + 21 * frame.points.len());
    out.extend(MAGIC);
    out.extend(frame.report.frame.to_le_bytes());
    let place = Role::ALL.iter().position(|role| *role == frame.report.role);
    out.push(place.unwrap_or(0) as u8);
    let (outcome, reason) = match frame.report.outcome {
        Outcome::Locked => (0, None),
        Outcome::FellBack(reason) => (1, Some(reason)),
        Outcome::Refused(Refusal::NotTheTarget(reason)) => (2, Some(reason)),
        // Found out only when all frames are there, and of frames from files.
        Outcome::Refused(Refusal::NoReference | Refusal::Unusable) => (2, None),
    };
    let (why, a, b) = match reason {
        None => (0, 0.0, 0.0),
        Some(RegistrationFailure::LinesMissing { found }) => (1, found as f64, 0.0),
        Some(RegistrationFailure::WrongLayout {
            misfit_px,
            deviation,
        }) => (2, misfit_px, deviation),
        Some(RegistrationFailure::FarFromPose { offset_deg }) => (3, offset_deg, 0.0),
        Some(RegistrationFailure::Displaced { shift_px: [x, y] }) => (4, x, y),
        Some(RegistrationFailure::Turned(turn)) => (5, place_of(turn), 0.0),
        Some(RegistrationFailure::TargetTurned(turn)) => (8, place_of(turn), 0.0),
        Some(RegistrationFailure::Rolled { roll_deg }) => (6, roll_deg, 0.0),
        Some(RegistrationFailure::Resized { share }) => (7, share, 0.0),
    };
    out.extend([outcome, why]);
    let Pose { light, view } = frame.reading;
    let offset = frame.report.pose_offset;
    for value in [
        a,
        b,
        frame.report.residual_px,
        offset.theta_deg,
        offset.phi_deg,
        light.theta,
        light.phi,
        view.theta,
        view.phi,
        frame.view.theta,
        frame.view.phi,
    ] {
        out.extend(value.to_le_bytes());
    }
    out.extend((frame.points.len() as u32).to_le_bytes());
    for point in &frame.points {
        match point {
            Ok(SampledPoint { rgb, offset_mm }) => {
                out.push(0);
                for value in rgb.iter().chain(offset_mm) {
                    out.extend(value.to_le_bytes());
                }
            }
            Err(reason) => {
                let place = LEFT_OUT.iter().position(|r| r == reason).unwrap_or(0);
                out.push(1 + place as u8);
            }
        }
    }
    let mask = frame.mask.as_ref().map(Mask::to_bytes).unwrap_or_default();
    out.extend((mask.len() as u32).to_le_bytes());
    out.extend(mask);
    out
}

fn place_of(turn: Turn) -> f64 {
    let place = Turn::ALL.iter().position(|t| *t == turn);
    place.unwrap_or(0) as f64
}

/// The frame of some bytes; `None` when they are no frame.
pub fn from_bytes(bytes: &[u8]) -> Option<SampledFrame> {
    let (frame, rest) = split_first(bytes)?;
    rest.is_empty().then_some(frame)
}

/// The frame with which some bytes begin, and the bytes behind it; `None` when they begin with none.
pub fn split_first(bytes: &[u8]) -> Option<(SampledFrame, &[u8])> {
    let mut bytes = Bytes(bytes);
    if &bytes.take::<4>()? != MAGIC {
        return None;
    }
    let frame = u32::from_le_bytes(bytes.take()?);
    let [role, outcome, why] = bytes.take()?;
    let role = *Role::ALL.get(usize::from(role))?;
    let [a, b, residual_px, theta_deg, phi_deg] = bytes.numbers()?;
    let reason = match why {
        0 => None,
        1 => Some(RegistrationFailure::LinesMissing { found: a as usize }),
        2 => Some(RegistrationFailure::WrongLayout {
            misfit_px: a,
            deviation: b,
        }),
        3 => Some(RegistrationFailure::FarFromPose { offset_deg: a }),
        4 => Some(RegistrationFailure::Displaced { shift_px: [a, b] }),
        5 => Some(RegistrationFailure::Turned(*Turn::ALL.get(a as usize)?)),
        6 => Some(RegistrationFailure::Rolled { roll_deg: a }),
        7 => Some(RegistrationFailure::Resized { share: a }),
        8 => Some(RegistrationFailure::TargetTurned(
            *Turn::ALL.get(a as usize)?,
        )),
        _ => return None,
    };
    let outcome = match (outcome, reason) {
        (0, None) => Outcome::Locked,
        (1, Some(reason)) => Outcome::FellBack(reason),
        (2, Some(reason)) => Outcome::Refused(Refusal::NotTheTarget(reason)),
        (2, None) => Outcome::Refused(Refusal::NoReference),
        _ => return None,
    };
    let [light, view, seen] = [(); 3].map(|()| {
        let [theta, phi] = bytes.numbers()?;
        Some(Direction { theta, phi })
    });
    let n = u32::from_le_bytes(bytes.take()?);
    let mut points = Vec::new();
    for _ in 0..n {
        points.push(match bytes.take()? {
            [0] => {
                let [r, g, b, x, y] = bytes.floats()?;
                Ok(SampledPoint {
                    rgb: [r, g, b],
                    offset_mm: [x, y],
                })
            }
            [reason] => Err(*LEFT_OUT.get(usize::from(reason) - 1)?),
        });
    }
    let length = u32::from_le_bytes(bytes.take()?) as usize;
    let (mask, rest) = bytes.0.split_at_checked(length)?;
    let mask = match length {
        0 => None,
        _ => Some(Mask::from_bytes(mask)?),
    };
    let frame = SampledFrame {
        report: FrameReport {
            frame,
            role,
            outcome,
            residual_px,
            pose_offset: PoseOffset { theta_deg, phi_deg },
        },
        reading: Pose {
            light: light?,
            view: view?,
        },
        view: seen?,
        points,
        mask,
    };
    Some((frame, rest))
}

/// What is left to read.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*head)
    }

    fn numbers<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.take()?);
        }
        Some(numbers)
    }

    fn floats<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut floats = [0.0; N];
        for float in &mut floats {
            *float = f32::from_le_bytes(self.take()?);
        }
        Some(floats)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_rig::FrameRow;

    /// A frame of three points.
    fn some_frame() -> SampledFrame {
        let pose = Pose {
            light: Direction::from_deg(15.0, 60.0),
            view: Direction::from_deg(30.000_001, 359.9),
        };
        let row = FrameRow {
            frame: 7,
            role: Role::Reference,
            pose,
            file: String::new(),
        };
        SampledFrame {
            points: vec![
                Ok(SampledPoint {
                    rgb: [0.1, f32::INFINITY, -0.0],
                    offset_mm: [0.25, -1e-9],
                }),
                Err(LeftOut::Border),
                Err(LeftOut::Occlusion),
            ],
            ..SampledFrame::refused(&row, Refusal::NoReference)
        }
    }

    #[test]
    fn a_frame_comes_back_bit_for_bit() {
        let reason = RegistrationFailure::WrongLayout {
            misfit_px: 1.5,
            deviation: 9.0,
        };
        for outcome in [
            Outcome::Locked,
            Outcome::FellBack(RegistrationFailure::LinesMissing { found: 2 }),
            Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::Displaced {
                shift_px: [-2.5, 0.25],
            })),
            Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::Turned(
                Turn::Transverse,
            ))),
            Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::TargetTurned(
                Turn::Left,
            ))),
            Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::Rolled {
                roll_deg: -0.7,
            })),
            Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::Resized {
                share: 0.004,
            })),
            Outcome::Refused(Refusal::NotTheTarget(reason)),
            Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::FarFromPose {
                offset_deg: 3.0,
            })),
        ] {
            let mut frame = some_frame();
            frame.report.outcome = outcome;
            frame.mask = Mask::from_bytes(&{
                let mut bytes = Vec::new();
                for n in [2u32, 3, 4, 5, 6, 77, 0] {
                    bytes.extend(n.to_le_bytes());
                }
                bytes
            });
            assert!(frame.mask.is_some());
            let bytes = to_bytes(&frame);
            assert_eq!(from_bytes(&bytes), Some(frame));
        }
    }

    #[test]
    fn bytes_that_are_cut_or_too_many_are_no_frame() {
        let bytes = to_bytes(&some_frame());
        for n in 0..bytes.len() {
            assert_eq!(from_bytes(&bytes[..n]), None, "{n}");
        }
        let mut more = bytes.clone();
        more.push(0);
        assert_eq!(from_bytes(&more), None);
    }
}
