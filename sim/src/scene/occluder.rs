//! The light's head and the arm that holds it, as the camera sees them.

use super::optics::Optics;
use gonia_brdf::Direction;
use gonia_brdf::Elementary;

/// A ball at the light, and an arm that follows the light's meridian down to the desk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occluder {
    /// Radius of the head, mm.
    pub head_radius_mm: f64,
    /// Half the thickness of the arm, mm.
    pub arm_radius_mm: f64,
    /// Its radiance relative to a white surface at the target's centre: the back of the head gets
    /// only what the target scatters.
    pub brightness: f64,
}

impl Default for Occluder {
    fn default() -> Self {
        Self {
            head_radius_mm: 60.0,
            arm_radius_mm: 20.0,
            brightness: 0.015,
        }
    }
}

/// The dark shape in one frame.
pub struct Silhouette {
    /// Radiance of the shape.
    pub radiance: f64,
    parts: Vec<Capsule>,
    /// Columns and rows outside which nothing is hidden.
    bounds: [[f64; 2]; 2],
}

/// A segment between two discs, in pixels.
struct Capsule {
    from: [f64; 2],
    along: [f64; 2],
    inverse_length2: f64,
    radius: [f64; 2],
}

/// Half the width of the silhouette's soft edge (it is out of focus), pixels.
const SOFTNESS_PX: f64 = 1.0;

impl Silhouette {
    /// The shape seen by a camera, or `None` when nothing of it can be in the frame.
    pub fn new(
        occluder: Occluder,
        light_distance_m: f64,
        light: Direction,
        optics: &Optics,
    ) -> Option<Self> {
        // The arm runs behind the head, out of the beam.
        let arm_distance = light_distance_m + 1e-3 * occluder.head_radius_mm;
        let end = 95f64.to_radians();
        let steps = ((end - light.theta).max(0.0) / 4f64.to_radians()).ceil() as usize;
        let on_arm = |i: usize| {
            let theta = light.theta + (end - light.theta) * i as f64 / steps.max(1) as f64;
            let d = Direction {
                theta,
                phi: light.phi,
            };
            let (at, scale) = optics.project(d.to_vec3().map(|c| c * arm_distance))?;
            Some((at, scale * 1e-3 * occluder.arm_radius_mm))
        };
        let (head_at, scale) = optics.project(light.to_vec3().map(|c| c * light_distance_m))?;
        let head = (head_at, scale * 1e-3 * occluder.head_radius_mm);
        let mut parts = vec![Capsule::new(head, head)];
        for i in 0..steps {
            if let (Some(a), Some(b)) = (on_arm(i), on_arm(i + 1)) {
                parts.push(Capsule::new(a, b));
            }
        }
        let size = optics.size_px();
        parts.retain(|part| part.meets(size));
        let bounds = parts.iter().map(Capsule::bounds).reduce(|a, b| {
            [
                [a[0][0].min(b[0][0]), a[0][1].min(b[0][1])],
                [a[1][0].max(b[1][0]), a[1][1].max(b[1][1])],
            ]
        })?;
        Some(Self {
            radiance: occluder.brightness * light.theta.cosine().max(0.0) / std::f64::consts::PI,
            parts,
            bounds,
        })
    }

    /// How much of a pixel is hidden, 0 ..= 1.
    pub fn coverage(&self, pixel: [f64; 2]) -> f64 {
        let [low, high] = self.bounds;
        if (0..2).any(|i| pixel[i] < low[i] || pixel[i] > high[i]) {
            return 0.0;
        }
        let nearest = self
            .parts
            .iter()
            .map(|part| part.signed_distance(pixel))
            .fold(f64::INFINITY, f64::min);
        (0.5 - 0.5 * nearest / SOFTNESS_PX).clamp(0.0, 1.0)
    }
}

impl Capsule {
    fn new(a: ([f64; 2], f64), b: ([f64; 2], f64)) -> Self {
        let along = [b.0[0] - a.0[0], b.0[1] - a.0[1]];
        let length2 = along[0] * along[0] + along[1] * along[1];
        Self {
            from: a.0,
            along,
            inverse_length2: if length2 > 0.0 { 1.0 / length2 } else { 0.0 },
            radius: [a.1, b.1],
        }
    }

    fn signed_distance(&self, p: [f64; 2]) -> f64 {
        let d = [p[0] - self.from[0], p[1] - self.from[1]];
        let t =
            ((d[0] * self.along[0] + d[1] * self.along[1]) * self.inverse_length2).clamp(0.0, 1.0);
        let off = [d[0] - t * self.along[0], d[1] - t * self.along[1]];
        (off[0] * off[0] + off[1] * off[1]).sqrt()
            - (self.radius[0] + t * (self.radius[1] - self.radius[0]))
    }

    fn bounds(&self) -> [[f64; 2]; 2] {
        let margin = self.radius[0].max(self.radius[1]) + SOFTNESS_PX;
        let to = [self.from[0] + self.along[0], self.from[1] + self.along[1]];
        [
            [0, 1].map(|i: usize| self.from[i].min(to[i]) - margin),
            [0, 1].map(|i: usize| self.from[i].max(to[i]) + margin),
        ]
    }

    fn meets(&self, size: [f64; 2]) -> bool {
        let [low, high] = self.bounds();
        (0..2).all(|i| high[i] >= 0.0 && low[i] <= size[i])
    }
}
