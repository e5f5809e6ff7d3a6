//! Whether a grey frame is a mosaic of colour filters, and where its green ones are: the four
//! photosites of a 2 × 2 cell tell.
//!
//! A mono sensor's four are alike; a mosaic's differ as its filters do, but for the two green ones, on a
//! diagonal. Columns read out by different amplifiers differ too, but have no diagonal that is alike.

use gonia_rig::{RawFrame, Sensor};

/// Photosites of a cell (row by row) on each diagonal: of GRBG and GBRG, and of RGGB and BGGR, green.
const DIAGONALS: [[usize; 2]; 2] = [[0, 3], [1, 2]];
/// Differences below this share are a sensor's own.
const LEAST_SPREAD: f64 = 0.05;
/// Two photosites are alike when they differ by at most this share of the whole spread.
const ALIKE: f64 = 0.3;
/// Cells below so many counts above black, or times the read noise, tell nothing.
const LEAST_COUNTS: f64 = 40.0;
const LEAST_SIGNAL: f64 = 10.0;
/// Fewer cells tell nothing,
const LEAST_CELLS: usize = 400;
/// and more than this many tell no more.
const MOST_CELLS: usize = 40_000;

/// A contradiction between a frame's photosites and the filters that `rig.toml` gives its sensor.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MosaicDoubt {
    /// A mono sensor's photosites differ as filters do.
    #[error(
        "its photosites differ by {:.0} % within cells of 2 × 2, as those of a colour mosaic do, but rig.toml gives the sensor no bayer pattern",
        100.0 * .spread
    )]
    Unnamed {
        /// The largest difference, as a share of the mean.
        spread: f64,
        /// Which patterns have green where two are alike.
        green: Diagonal,
    },
    /// The green photosites differ, and the others are alike.
    #[error(
        "the photosites that the bayer pattern of rig.toml calls green differ by {:.0} %, and the red and blue ones are alike",
        100.0 * .spread
    )]
    OtherDiagonal {
        /// The difference of those called green, as a share of the mean.
        spread: f64,
        /// Which patterns have green where two are alike.
        green: Diagonal,
    },
}

/// Where in a cell of 2 × 2 green is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Diagonal {
    /// At its top left and bottom right.
    Falling,
    /// At its top right and bottom left.
    Rising,
}

impl Diagonal {
    /// The patterns that have it there, for messages.
    pub fn patterns(self) -> &'static str {
        match self {
            Self::Falling => "GRBG or GBRG",
            Self::Rising => "RGGB or BGGR",
        }
    }
}

impl MosaicDoubt {
    /// Where green is by what the frame shows.
    pub fn green(&self) -> Diagonal {
        match self {
            Self::Unnamed { green, .. } | Self::OtherDiagonal { green, .. } => *green,
        }
    }
}

/// What speaks against a sensor's filters in a frame; `None` when nothing does, and for frames in colour
/// or too dark to tell. Red and blue cannot be told apart so.
pub fn mosaic_doubt(raw: &RawFrame, sensor: &Sensor) -> Option<MosaicDoubt> {
    if raw.channels != 1 {
        return None;
    }
    let phases = phases(raw, sensor)?;
    let difference = |[a, b]: [usize; 2]| (phases[a] - phases[b]).abs();
    let spread = {
        let (least, most) = phases
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, m), v| (l.min(*v), m.max(*v)));
        most - least
    };
    let [falling, rising] = DIAGONALS.map(difference);
    let (alike, apart, green) = if falling < rising {
        (falling, rising, Diagonal::Falling)
    } else {
        (rising, falling, Diagonal::Rising)
    };
    match sensor.bayer {
        None if spread > LEAST_SPREAD && alike <= ALIKE * spread => {
            Some(MosaicDoubt::Unnamed { spread, green })
        }
        Some(pattern) => {
            let said = if pattern.colors()[0][0] == 1 {
                Diagonal::Falling
            } else {
                Diagonal::Rising
            };
            let contradicts = said != green && apart > LEAST_SPREAD && alike <= ALIKE * apart;
            contradicts.then_some(MosaicDoubt::OtherDiagonal {
                spread: apart,
                green,
            })
        }
        None => None,
    }
}

/// The photosites of a cell over the cell's mean, the median over all cells that tell.
fn phases(raw: &RawFrame, sensor: &Sensor) -> Option<[f64; 4]> {
    let (columns, rows) = (raw.width / 2, raw.height / 2);
    let step = (columns * rows).div_ceil(MOST_CELLS).max(1);
    let read = sensor.read_noise_e / sensor.gain_e_per_count;
    let least = LEAST_COUNTS.max(LEAST_SIGNAL * read);
    let mut ratios = [const { Vec::new() }; 4];
    for cell in (0..columns * rows).step_by(step) {
        let at = 2 * (cell / columns * raw.width + cell % columns);
        let sites = [at, at + 1, at + raw.width, at + raw.width + 1];
        let counts = sites.map(|i| f64::from(raw.counts[i]));
        if counts.iter().any(|c| *c >= sensor.saturation_counts) {
            continue;
        }
        let signals = counts.map(|c| c - sensor.black_counts);
        let mean = 0.25 * signals.iter().sum::<f64>();
        if mean < least {
            continue;
        }
        for (ratios, signal) in ratios.iter_mut().zip(signals) {
            ratios.push(signal / mean);
        }
    }
    if ratios[0].len() < LEAST_CELLS {
        return None;
    }
    // Medians, so that a line that runs along a column of photosites has no say.
    Some(ratios.map(|mut ratios| {
        let middle = ratios.len() / 2;
        *ratios.select_nth_unstable_by(middle, f64::total_cmp).1
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_rig::Bayer;

    const SIDE: usize = 80;

    fn sensor(bayer: Option<Bayer>) -> Sensor {
        Sensor {
            black_counts: 64.0,
            saturation_counts: 4000.0,
            gain_e_per_count: 2.5,
            read_noise_e: 4.0,
            bayer,
        }
    }

    /// A frame of cells with these photosites on a ramp, with some noise and a bright column.
    fn frame(sites: [f64; 4], level: f64) -> RawFrame {
        let noise = |i: usize| 1.0 + 0.05 * ((i * 7919 % 101) as f64 / 50.0 - 1.0);
        let counts = (0..SIDE * SIDE).map(|i| {
            let (x, y) = (i % SIDE, i / SIDE);
            let bright = if x == 21 {
                5.0
            } else {
                1.0 + x as f64 / SIDE as f64
            };
            (64.0 + level * bright * sites[2 * (y % 2) + x % 2] * noise(i)) as u16
        });
        RawFrame {
            width: SIDE,
            height: SIDE,
            channels: 1,
            counts: counts.collect(),
        }
    }

    /// Photosites of a pattern under white light.
    fn sites(pattern: Bayer) -> [f64; 4] {
        let colors = pattern.colors();
        [0, 1, 2, 3].map(|i| [0.5, 1.0, 0.7][colors[i / 2][i % 2]])
    }

    #[test]
    fn a_mosaic_without_its_pattern_or_with_green_elsewhere_is_doubted() {
        let patterns = [Bayer::Rggb, Bayer::Bggr, Bayer::Grbg, Bayer::Gbrg];
        for true_pattern in patterns {
            let frame = frame(sites(true_pattern), 500.0);
            let doubt = mosaic_doubt(&frame, &sensor(None)).unwrap();
            assert!(
                matches!(doubt, MosaicDoubt::Unnamed { spread, .. } if spread > 0.5),
                "{doubt:?}"
            );
            let is_falling = true_pattern.colors()[0][0] == 1;
            assert_eq!(doubt.green() == Diagonal::Falling, is_falling);
            for said in patterns {
                let doubt = mosaic_doubt(&frame, &sensor(Some(said)));
                let same_green = (said.colors()[0][0] == 1) == is_falling;
                assert_eq!(
                    doubt.is_none(),
                    same_green,
                    "{true_pattern:?} {said:?} {doubt:?}"
                );
            }
        }
    }

    #[test]
    fn mono_sensors_dark_frames_and_unequal_columns_are_not_doubted() {
        for frame in [
            frame([1.0; 4], 500.0),
            // As dark as a black fabric, beside a bright line.
            frame([1.0; 4], 45.0),
            frame([1.0, 1.12, 1.0, 1.12], 500.0),
            frame([1.0, 1.0, 1.1, 1.1], 500.0),
            // Too dark to tell, and saturated.
            frame(sites(Bayer::Rggb), 15.0),
            frame(sites(Bayer::Rggb), 9000.0),
        ] {
            assert_eq!(mosaic_doubt(&frame, &sensor(None)), None);
        }
        let colour = RawFrame {
            channels: 3,
            ..frame([1.0; 4], 500.0)
        };
        assert_eq!(mosaic_doubt(&colour, &sensor(None)), None);
    }
}
