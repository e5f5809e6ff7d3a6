//! A frame as a small picture, with the fiducial lines as they were found.

use gonia_imaging::Registration;
use gonia_pipeline::process::Outcome;
use gonia_render::{png, tone};
use gonia_rig::{Frame, Target};

/// Neither side is longer, pixels.
const LONGEST_PX: usize = 480;
/// Pixels of a block that are looked at, along each side: a frame of 16 megapixels must not take
/// longer than one of 1.
const LOOKS_A_SIDE: usize = 2;
/// The brightest pixels that may be clipped, as a share.
const CLIPPED: f64 = 0.01;
/// Registered by the fiducial lines; by the arms' reading; not used at all.
const LOCKED: [u8; 3] = [70, 230, 140];
const FELL_BACK: [u8; 3] = [255, 180, 40];
const REFUSED: [u8; 3] = [255, 80, 70];

/// Pixels for the screen.
#[derive(Clone, Debug, PartialEq)]
pub struct Thumbnail {
    width: usize,
    height: usize,
    rgb: Vec<[u8; 3]>,
}

impl Thumbnail {
    /// Of a frame; its target's lines are drawn where the registration has them: green when it stands
    /// on them, amber where only the arms' reading says so, red when the frame was refused.
    pub fn of(
        frame: &Frame,
        registration: &Registration,
        outcome: Outcome,
        target: &Target,
    ) -> Self {
        let step = frame.width.max(frame.height).div_ceil(LONGEST_PX).max(1);
        let [width, height] = [frame.width, frame.height].map(|n| n / step);
        let linear = shrunk(frame, step, [width, height]);
        let exposure = exposure(&linear);
        let mut thumbnail = Self {
            width,
            height,
            rgb: linear.iter().map(|v| tone::rgb8(*v, exposure)).collect(),
        };
        let color = match outcome {
            Outcome::Locked => LOCKED,
            Outcome::FellBack(_) => FELL_BACK,
            Outcome::Refused(_) => REFUSED,
        };
        let a = target.line_offset_mm;
        let corners = [[-a, -a], [a, -a], [a, a], [-a, a]];
        for (k, from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % 4];
            thumbnail.line(*from, to, color, |at| {
                registration.project(at).map(|c| c / step as f64)
            });
        }
        thumbnail
    }

    /// As a PNG.
    pub fn png(&self) -> Vec<u8> {
        png::rgb(&self.rgb, self.width, self.height)
    }

    /// A straight line of the target: a curve under a lens that distorts.
    fn line(
        &mut self,
        from: [f64; 2],
        to: [f64; 2],
        color: [u8; 3],
        pixel: impl Fn([f64; 2]) -> [f64; 2],
    ) {
        // Half a pixel a step, however long it is in the picture.
        let steps = 4 * LONGEST_PX;
        for k in 0..=steps {
            let t = k as f64 / steps as f64;
            let at = pixel([0, 1].map(|i| from[i] + t * (to[i] - from[i])));
            let [x, y] = at.map(f64::floor);
            if x >= 0.0 && y >= 0.0 && (x as usize) < self.width && (y as usize) < self.height {
                self.rgb[y as usize * self.width + x as usize] = color;
            }
        }
    }
}

/// One pixel for each block of `step` × `step`.
fn shrunk(frame: &Frame, step: usize, [width, height]: [usize; 2]) -> Vec<[f32; 3]> {
    let looks = LOOKS_A_SIDE.min(step);
    let place = |block: usize, look: usize| block * step + (2 * look + 1) * step / (2 * looks);
    let mut out = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0; 3];
            for j in 0..looks {
                for i in 0..looks {
                    let pixel = frame.rgb[place(y, j) * frame.width + place(x, i)];
                    for c in 0..3 {
                        sum[c] += pixel[c];
                    }
                }
            }
            out.push(sum.map(|v| v / (looks * looks) as f32));
        }
    }
    out
}

/// What brings all but the brightest pixels onto the screen.
fn exposure(linear: &[[f32; 3]]) -> f32 {
    let mut brightest: Vec<f32> = linear
        .iter()
        .map(|v| v.iter().copied().fold(0.0, f32::max))
        .filter(|v| v.is_finite())
        .collect();
    if brightest.is_empty() {
        return 1.0;
    }
    let place = ((1.0 - CLIPPED) * (brightest.len() - 1) as f64) as usize;
    let white = *brightest.select_nth_unstable_by(place, f32::total_cmp).1;
    if white > 0.0 { 1.0 / white } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::{Direction, Pose};
    use gonia_imaging::Registrar;
    use gonia_rig::Rig;

    #[test]
    fn the_lines_are_drawn_where_the_registration_has_them_at_any_size() {
        for px in [100, 481, 1000] {
            let rig = Rig::paper(px);
            let frame = Frame {
                width: px,
                height: px,
                rgb: (0..px * px).map(|k| [(k % px) as f32; 3]).collect(),
            };
            let up = Direction::from_deg(0.0, 0.0);
            let pose = Pose {
                light: up,
                view: up,
            };
            let registration = Registrar::new(&rig).register(&frame, pose);
            let thumbnail = Thumbnail::of(&frame, &registration, Outcome::Locked, &rig.target);
            let step = px.div_ceil(LONGEST_PX);
            assert_eq!((thumbnail.width, thumbnail.height), (px / step, px / step));
            let a = rig.target.line_offset_mm;
            for point in [[a, 0.0], [0.0, a], [-a, a], [-a, -0.5 * a]] {
                let [x, y] = registration
                    .project(point)
                    .map(|c| (c / step as f64) as usize);
                assert_eq!(
                    thumbnail.rgb[y * thumbnail.width + x],
                    LOCKED,
                    "{px} {point:?}"
                );
            }
            // The ramp beneath is still there, from black to white.
            let middle = thumbnail.height / 2;
            let row = &thumbnail.rgb[middle * thumbnail.width..][..thumbnail.width];
            assert!(row[0][0] < 20 && row[thumbnail.width - 1][0] > 250);
        }
    }

    #[test]
    fn a_frame_without_a_finite_pixel_is_white_and_one_without_light_black() {
        let rig = Rig::paper(20);
        let up = Direction::from_deg(0.0, 0.0);
        let pose = Pose {
            light: up,
            view: up,
        };
        for (value, shown) in [(f32::INFINITY, 255), (0.0, 0)] {
            let frame = Frame {
                width: 20,
                height: 20,
                rgb: vec![[value; 3]; 400],
            };
            let registration = Registrar::new(&rig).register(&frame, pose);
            let thumbnail = Thumbnail::of(&frame, &registration, Outcome::Locked, &rig.target);
            assert_eq!(thumbnail.rgb[10 * 20 + 10], [shown; 3]);
        }
    }
}
