//! Ways in which a picture is turned or mirrored before it comes here: by a camera that was held upright,
//! by a converter that obeys its tag, by a lens or mirror.

use gonia_rig::Frame;
use std::fmt;
use std::ops::Sub;

/// How a frame was turned or mirrored after it was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// By 180°.
    Half,
    /// By 90° clockwise.
    Right,
    /// By 90° anticlockwise.
    Left,
    /// Left and right are exchanged.
    Mirrored,
    /// Top and bottom are exchanged.
    Flipped,
    /// Columns are rows.
    Transposed,
    /// Columns are rows, and all of it is turned by 180°.
    Transverse,
}

impl Turn {
    /// All of them, the usual ones first.
    pub const ALL: [Self; 7] = [
        Self::Half,
        Self::Right,
        Self::Left,
        Self::Mirrored,
        Self::Flipped,
        Self::Transposed,
        Self::Transverse,
    ];

    /// The frame as it was taken; `None` where a frame of its size, turned, would have another.
    pub fn undo(self, frame: &Frame) -> Option<Frame> {
        let (width, height) = (frame.width, frame.height);
        let swaps = !matches!(self, Self::Half | Self::Mirrored | Self::Flipped);
        if width == 0 || height == 0 || (swaps && width != height) {
            return None;
        }
        let (right, bottom) = (width - 1, height - 1);
        let mut rgb = Vec::with_capacity(frame.rgb.len());
        for y in 0..height {
            rgb.extend((0..width).map(|x| {
                let [column, row] = self.seen_at([x, y], [right, bottom]);
                frame.rgb[row * width + column]
            }));
        }
        Some(Frame { width, height, rgb })
    }

    /// Where a turned frame shows what was at a pixel of it as it was taken; `last` is the largest column and row.
    pub fn seen_at<T: Copy + Sub<Output = T>>(self, [x, y]: [T; 2], last: [T; 2]) -> [T; 2] {
        let [right, bottom] = last;
        match self {
            Self::Half => [right - x, bottom - y],
            Self::Right => [right - y, x],
            Self::Left => [y, bottom - x],
            Self::Mirrored => [right - x, y],
            Self::Flipped => [x, bottom - y],
            Self::Transposed => [y, x],
            Self::Transverse => [right - y, bottom - x],
        }
    }
}

impl fmt::Display for Turn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Half => "turned by 180 degrees",
            Self::Right => "turned by 90 degrees clockwise",
            Self::Left => "turned by 90 degrees anticlockwise",
            Self::Mirrored => "mirrored, left for right (or its azimuths are counted clockwise)",
            Self::Flipped => "mirrored, top for bottom",
            Self::Transposed => "mirrored about its diagonal",
            Self::Transverse => "mirrored about its other diagonal",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(values: [u8; 4], width: usize) -> Frame {
        Frame {
            width,
            height: 4 / width,
            rgb: values.iter().map(|v| [f32::from(*v); 3]).collect(),
        }
    }

    #[test]
    fn a_frame_is_turned_back() {
        // 1 2 / 3 4, turned as named.
        for (turn, seen) in [
            (Turn::Half, [4, 3, 2, 1]),
            (Turn::Right, [3, 1, 4, 2]),
            (Turn::Left, [2, 4, 1, 3]),
            (Turn::Mirrored, [2, 1, 4, 3]),
            (Turn::Flipped, [3, 4, 1, 2]),
            (Turn::Transposed, [1, 3, 2, 4]),
            (Turn::Transverse, [4, 2, 3, 1]),
        ] {
            assert_eq!(
                turn.undo(&frame(seen, 2)),
                Some(frame([1, 2, 3, 4], 2)),
                "{turn:?}"
            );
        }
        let long = |turn: Turn| turn.undo(&frame([1, 2, 3, 4], 4));
        assert_eq!(long(Turn::Half), Some(frame([4, 3, 2, 1], 4)));
        assert_eq!(long(Turn::Right), None);
    }
}
