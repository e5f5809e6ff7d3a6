//! The control pose: taken again and again, so that a lamp that drifts or a sample that was moved is
//! noticed. A take and its judgement are an entry of the journal.

use gonia_brdf::Elementary;
use gonia_imaging::LeftOut;
use gonia_pipeline::process::{SampledFrame, SampledPoint};
use gonia_rig::Role;
use std::fmt;

/// Points that scatter more than this about their common change are not those of the same sample.
const SCATTER_LIMIT: f64 = 0.1;
/// Marks that moved more than this are not where they were, degrees.
const MOVED_LIMIT_DEG: f64 = 0.2;

/// A take of the control pose beside its first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlComparison {
    /// Median brightness over that of the first take.
    pub ratio: f64,
    /// Robust standard deviation of the points' own ratios about it.
    pub scatter: f64,
    /// How far the marks have moved, as an angle of the camera, degrees.
    pub moved_deg: f64,
}

/// What a comparison means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// All is as it was.
    Same,
    /// The lamp is brighter or darker: it may pass.
    Drifted,
    /// Something seems moved, in one take: it is taken once more.
    Unconfirmed,
    /// Something was moved: it does not pass.
    Moved,
}

impl Judgement {
    const ALL: [Self; 4] = [
        Judgement::Same,
        Judgement::Drifted,
        Judgement::Unconfirmed,
        Judgement::Moved,
    ];

    fn name(self) -> &'static str {
        match self {
            Judgement::Same => "same",
            Judgement::Drifted => "drifted",
            Judgement::Unconfirmed => "unconfirmed",
            Judgement::Moved => "moved",
        }
    }
}

/// A take of the control pose, as the journal keeps it.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlDone {
    /// What lay on the target.
    pub role: Role,
    /// The pose's place in the plan.
    pub index: usize,
    /// What it meant; `None` in a journal of an older program, which did not say.
    pub judgement: Option<Judgement>,
    /// How it compared with the first take; `None` when its fiducial lines were not seen, or no point was
    /// in common.
    pub comparison: Option<ControlComparison>,
}

impl ControlDone {
    /// What it means, when brightness may change by the share `drift_limit`.
    pub fn judge(&self, drift_limit: f64) -> Judgement {
        // Numbers of an older journal are rounded to a hundredth of a percent.
        let by_numbers = |c: ControlComparison| c.judge(drift_limit + 5e-5);
        self.judgement
            .unwrap_or_else(|| self.comparison.map_or(Judgement::Moved, by_numbers))
    }

    /// What the journal's line says behind `control`.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (role, rest) = text.split_once(' ')?;
        let role = Role::ALL.into_iter().find(|r| r.name() == role)?;
        if let Some(rest) = rest.strip_prefix("pose ") {
            return Self::parse_words(role, rest);
        }
        let words: Vec<&str> = rest.split(' ').collect();
        let [index, judgement, numbers @ ..] = &words[..] else {
            return None;
        };
        let judgement = judgement.strip_prefix("judgement=")?;
        let comparison = match numbers {
            ["unseen"] => None,
            [ratio, scatter, moved] => Some(ControlComparison {
                ratio: ratio.strip_prefix("ratio=")?.parse().ok()?,
                scatter: scatter.strip_prefix("scatter=")?.parse().ok()?,
                moved_deg: moved.strip_prefix("moved=")?.parse().ok()?,
            }),
            _ => return None,
        };
        Some(Self {
            role,
            index: index.parse().ok()?,
            judgement: Some(Judgement::ALL.into_iter().find(|j| j.name() == judgement)?),
            comparison,
        })
    }

    /// As an older program wrote it: `0: brightness -10.00 %, points scatter 0.10 %, marks moved 0.001
    /// degrees`, or why there were no numbers.
    fn parse_words(role: Role, text: &str) -> Option<Self> {
        let (index, said) = text.split_once(": ")?;
        let mut numbers = said.split(' ').filter_map(|word| word.parse::<f64>().ok());
        let comparison = match [numbers.next(), numbers.next(), numbers.next()] {
            [Some(percent), Some(scatter), Some(moved_deg)] => Some(ControlComparison {
                ratio: 1.0 + percent / 100.0,
                scatter: scatter / 100.0,
                moved_deg,
            }),
            _ => None,
        };
        Some(Self {
            role,
            index: index.parse().ok()?,
            judgement: None,
            comparison,
        })
    }
}

impl fmt::Display for ControlDone {
    /// As the journal's line has it behind `control`; one of an older journal for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let role = self.role.name();
        match (self.judgement, self.comparison) {
            (Some(judgement), Some(c)) => write!(
                f,
                "{role} {} judgement={} ratio={:.6} scatter={:.6} moved={:.5}",
                self.index,
                judgement.name(),
                c.ratio,
                c.scatter,
                c.moved_deg
            ),
            (Some(judgement), None) => {
                write!(
                    f,
                    "{role} {} judgement={} unseen",
                    self.index,
                    judgement.name()
                )
            }
            (None, Some(c)) => write!(f, "{role} pose {}: {c}", self.index),
            (None, None) => write!(
                f,
                "{role} pose {}: its marks are not to be seen",
                self.index
            ),
        }
    }
}

impl ControlComparison {
    /// Compares two takes; `None` when they have no point in common.
    pub fn of(first: &SampledFrame, now: &SampledFrame) -> Option<Self> {
        let mut ratios: Vec<f64> = first
            .points
            .iter()
            .zip(&now.points)
            .filter_map(|(a, b)| Some(brightness(b)? / brightness(a)?))
            .filter(|ratio| ratio.is_finite())
            .collect();
        let ratio = median(&mut ratios)?;
        let mut apart: Vec<f64> = ratios.iter().map(|r| (r / ratio - 1.0).abs()).collect();
        let offset = |frame: &SampledFrame| {
            let offset = frame.report.pose_offset;
            let sin = frame.reading.view.theta.sine();
            [offset.theta_deg, offset.phi_deg * sin]
        };
        let (a, b) = (offset(first), offset(now));
        Some(Self {
            ratio,
            scatter: 1.4826 * median(&mut apart)?,
            moved_deg: (a[0] - b[0]).hypotenuse(a[1] - b[1]),
        })
    }

    /// What it means, when brightness may change by the share `drift_limit`.
    pub fn judge(&self, drift_limit: f64) -> Judgement {
        if self.scatter > SCATTER_LIMIT || self.moved_deg > MOVED_LIMIT_DEG {
            Judgement::Moved
        } else if (self.ratio - 1.0).abs() > drift_limit {
            Judgement::Drifted
        } else {
            Judgement::Same
        }
    }
}

impl fmt::Display for ControlComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "brightness {:+.2} %, points scatter {:.2} %, marks moved {:.3} degrees",
            100.0 * (self.ratio - 1.0),
            100.0 * self.scatter,
            self.moved_deg
        )
    }
}

fn brightness(point: &Result<SampledPoint, LeftOut>) -> Option<f64> {
    let sum: f32 = point.as_ref().ok()?.rgb.iter().sum();
    (sum > 0.0).then_some(f64::from(sum))
}

fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::some_frame::some_frame;
    use gonia_rig::Role;

    fn frame(value: impl Fn(usize) -> f32) -> SampledFrame {
        let mut frame = some_frame(0, Role::Material);
        frame.points = (0..101)
            .map(|i| {
                Ok(SampledPoint {
                    rgb: [value(i); 3],
                    offset_mm: [0.0; 2],
                })
            })
            .collect();
        frame
    }

    #[test]
    fn a_darker_lamp_drifts_and_another_sample_has_moved() {
        let first = frame(|i| 1.0 + i as f32);
        let same = ControlComparison::of(&first, &frame(|i| 1.001 * (1.0 + i as f32))).unwrap();
        assert_eq!(same.judge(0.02), Judgement::Same);
        let darker = ControlComparison::of(&first, &frame(|i| 0.9 * (1.0 + i as f32))).unwrap();
        assert!((darker.ratio - 0.9).abs() < 1e-6);
        assert_eq!(darker.judge(0.02), Judgement::Drifted);
        let turned = ControlComparison::of(&first, &frame(|i| 102.0 - i as f32)).unwrap();
        assert_eq!(turned.judge(0.02), Judgement::Moved);
        let mut shifted = first.clone();
        shifted.report.pose_offset.theta_deg += 0.3;
        let moved = ControlComparison::of(&first, &shifted).unwrap();
        assert_eq!(moved.judge(0.02), Judgement::Moved);
        let mut hidden = first.clone();
        hidden.points.fill(Err(LeftOut::Occlusion));
        assert_eq!(ControlComparison::of(&first, &hidden), None);
    }

    #[test]
    fn controls_of_an_older_journal_are_judged_by_their_numbers() {
        for (text, expected) in [
            (
                "brightness -10.00 %, points scatter 0.05 %, marks moved 0.000 degrees",
                Judgement::Drifted,
            ),
            (
                "brightness +2.00 %, points scatter 0.05 %, marks moved 0.000 degrees",
                Judgement::Same,
            ),
            (
                "brightness +0.01 %, points scatter 0.05 %, marks moved 0.300 degrees",
                Judgement::Moved,
            ),
            ("its marks are not to be seen", Judgement::Moved),
        ] {
            let line = format!("material pose 12: {text}");
            let control = ControlDone::parse(&line).unwrap();
            assert_eq!((control.role, control.index), (Role::Material, 12));
            assert_eq!(control.judge(0.02), expected, "{text}");
            assert_eq!(control.to_string(), line);
        }
    }
}
