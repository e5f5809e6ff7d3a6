//! What the camera sees: a flat target with four bright lines and a material on a dark desk, lit by
//! a point source with a non-uniform beam, the light's head and arm sometimes in the way, and the
//! noise of a sensor. No more than the measurement can see: a BRDF at each pixel, no yarn.
//!
//! Radiance is linear. At the centre of the target and at normal incidence the irradiance is
//! exactly 1, so that radiance over cos θi is the BRDF there, and eq. (3) of the paper returns the
//! BRDF itself from a perfect chain.

mod as_built;
mod light;
mod mirror;
mod noise;
mod occluder;
mod of_rig;
mod optics;
mod sensor;
mod target;

pub use as_built::as_built;
pub use light::Beam;
pub use mirror::MirrorPlate;
pub use noise::Noise;
pub use occluder::Occluder;
pub use sensor::RawSensor;
pub use target::Texture;

use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::{Brdf, Direction, Pose};
use gonia_rig::{ArmGeometry, CameraMount, OrientationMark, Placement, TargetPlace};
use light::LightField;
use mirror::LampImage;
use noise::NoiseField;
use occluder::Silhouette;
use optics::Optics;
use std::sync::Arc;
use target::TargetMap;

/// Where light, camera and target are, as plain numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneGeometry {
    /// Distance of the light from the target's centre, metres.
    pub light_distance_m: f64,
    /// Distance of the camera from the target's centre, metres.
    pub camera_distance_m: f64,
    /// Width of a frame, pixels.
    pub width_px: usize,
    /// Height of a frame, pixels.
    pub height_px: usize,
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Principal point, pixels; the centre of the top left pixel is (0.5, 0.5).
    pub centre_px: [f64; 2],
    /// Radial distortion, coefficients of r² and r⁴ (r in units of the focal length, undistorted).
    pub distortion: [f64; 2],
    /// Standard deviation of the lens's blur, pixels; the pixel's own aperture comes on top.
    pub blur_px: f64,
    /// Lines at x = ±a and y = ±a: a, to the centre of the line, mm.
    pub line_offset_mm: f64,
    /// Width of a line, mm.
    pub line_width_mm: f64,
    /// Half the side of the material's square, mm.
    pub material_half_mm: f64,
    /// A bright disc on the desk that says which side is which.
    pub mark: Option<OrientationMark>,
    /// Half the side of the desk, to whose edge the lines go, mm.
    pub desk_half_mm: f64,
    /// The arm that holds the light, as it was built.
    pub light_arm: ArmGeometry,
    /// The arm that holds the camera, as it was built.
    pub camera_arm: ArmGeometry,
    /// How the camera sits on its arm.
    pub camera_mount: CameraMount,
    /// Where the target lies between the arms.
    pub target_place: TargetPlace,
}

impl SceneGeometry {
    /// The paper's rig with a camera of `px` × `px` pixels that sees the whole target at any
    /// polar angle up to 75°.
    pub fn paper(px: usize) -> Self {
        Self {
            light_distance_m: 1.1,
            camera_distance_m: 1.8,
            width_px: px,
            height_px: px,
            focal_px: 1600.0 / 1024.0 * px as f64,
            centre_px: [px as f64 / 2.0; 2],
            distortion: [0.0; 2],
            blur_px: 0.4,
            line_offset_mm: 335.0,
            line_width_mm: 4.0,
            material_half_mm: 320.0,
            mark: None,
            desk_half_mm: 400.0,
            light_arm: ArmGeometry::default(),
            camera_arm: ArmGeometry::default(),
            camera_mount: CameraMount::default(),
            target_place: TargetPlace::default(),
        }
    }

    /// Where the light stands at true shaft angles.
    fn light_at(&self, shaft: Direction) -> Placement {
        let distance_mm = 1000.0 * self.light_distance_m;
        self.light_arm
            .placement(shaft, distance_mm, &self.target_place)
    }

    /// Where the camera stands and how its image lies at true shaft angles.
    fn camera_at(&self, shaft: Direction) -> Placement {
        let distance_mm = 1000.0 * self.camera_distance_m;
        let held = self
            .camera_arm
            .placement(shaft, distance_mm, &self.target_place);
        let mount = &self.camera_mount;
        held.aimed(mount.aim_mm, distance_mm, mount.roll_deg.to_radians())
    }
}

/// Which cloth lies on the desk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// The material under test.
    Material,
    /// The reference.
    Reference,
    /// A plane mirror of black glass.
    Mirror,
}

/// A frame of linear radiance.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedFrame {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` pixels, row by row from the top left.
    pub rgb: Vec<[f32; 3]>,
}

/// A rig with its light, its target and its camera.
#[derive(Clone)]
pub struct Scene {
    /// Where everything is.
    pub geometry: SceneGeometry,
    /// The material under test.
    pub material: Arc<dyn Brdf>,
    /// The reference.
    pub reference: Arc<dyn Brdf>,
    /// The sensor's noise; `None` for an ideal sensor.
    pub noise: Option<Noise>,
    /// The light's beam; `None` for a source that is the same in all directions.
    pub beam: Option<Beam>,
    /// The light's head and arm, which hide the target from some views; `None` to leave them out.
    pub occluder: Option<Occluder>,
    /// Spatial inhomogeneity of the material; off by default.
    pub texture: Option<Texture>,
    /// How the mirror lies, for frames of [`Surface::Mirror`].
    pub mirror: MirrorPlate,
    /// Seed of the noise and of the texture.
    pub seed: u64,
}

impl Scene {
    /// A scene with the default noise, beam and occluder, and no texture.
    pub fn new(
        geometry: SceneGeometry,
        material: Arc<dyn Brdf>,
        reference: Arc<dyn Brdf>,
        seed: u64,
    ) -> Self {
        Self {
            geometry,
            material,
            reference,
            noise: Some(Noise::default()),
            beam: Some(Beam::default()),
            occluder: Some(Occluder::default()),
            texture: None,
            mirror: MirrorPlate::default(),
            seed,
        }
    }

    /// The frame taken at the true shaft angles `pose`. The noise depends on the scene's seed and
    /// on `shot` alone, so that frames may be rendered in any order on any number of threads.
    pub fn render(&self, which: Surface, pose: Pose, shot: u64) -> RenderedFrame {
        let painter = Painter::new(self, which, pose);
        let mut rgb = Vec::with_capacity(self.geometry.width_px * self.geometry.height_px);
        for row in 0..self.geometry.height_px {
            for column in 0..self.geometry.width_px {
                rgb.push(painter.radiance(column, row));
            }
        }
        if let Some(noise) = self.noise {
            let typical = painter.typical_radiance();
            NoiseField::new(noise, typical, self.seed, shot).add_to(&mut rgb);
        }
        RenderedFrame {
            width: self.geometry.width_px,
            height: self.geometry.height_px,
            rgb,
        }
    }
}

/// All that is the same for the pixels of a frame.
struct Painter<'a> {
    pose: Pose,
    brdf: &'a dyn Brdf,
    texture: Option<(Texture, u64)>,
    optics: Optics,
    target: TargetMap,
    light: LightField,
    /// What a mirror shows of the lamp, where there is one instead of a surface.
    lamp: Option<LampImage>,
    is_mirror: bool,
    camera_at_m: Vec3,
    silhouette: Option<Silhouette>,
}

impl<'a> Painter<'a> {
    fn new(scene: &'a Scene, which: Surface, pose: Pose) -> Self {
        let geometry = &scene.geometry;
        let camera = geometry.camera_at(pose.view);
        let light = geometry.light_at(pose.light);
        let optics = Optics::new(geometry, &camera);
        let brdf = match which {
            Surface::Material => scene.material.as_ref(),
            // Of a mirror the exposure is chosen for the lines.
            Surface::Reference | Surface::Mirror => scene.reference.as_ref(),
        };
        let texture = match which {
            Surface::Material => scene.texture.map(|t| (t, scene.seed)),
            Surface::Reference | Surface::Mirror => None,
        };
        let is_mirror = which == Surface::Mirror;
        Self {
            lamp: is_mirror
                .then(|| LampImage::new(&scene.mirror, &light, geometry, &optics))
                .flatten(),
            is_mirror,
            pose,
            brdf,
            texture,
            target: TargetMap::new(geometry, optics.largest_blur_mm(geometry.desk_half_mm)),
            light: LightField::new(geometry.light_distance_m, &light, scene.beam),
            camera_at_m: camera.at_mm.map(|c| c * 1e-3),
            silhouette: scene.occluder.and_then(|o| {
                let shaft = geometry.light_arm.shaft(pose.light);
                Silhouette::new(o, geometry.light_distance_m, shaft, &optics)
            }),
            optics,
        }
    }

    /// The radiance that the exposure is chosen for: the material's mean at the target's centre, or
    /// a white surface's where the material shines more than that. Of an HDR series the longest
    /// exposure serves the surface, and shorter ones its highlights.
    fn typical_radiance(&self) -> f64 {
        let (light, view) = (self.pose.light.to_vec3(), self.pose.view.to_vec3());
        let f = self.brdf.eval(light, view);
        let mean = (f[0] + f[1] + f[2]) / 3.0;
        mean.min(std::f64::consts::FRAC_1_PI) * light[2]
    }

    fn radiance(&self, column: usize, row: usize) -> [f32; 3] {
        let pixel = [column as f64 + 0.5, row as f64 + 0.5];
        let seen = match self.optics.target_point_mm(pixel) {
            Some(point) => self.target_radiance(pixel, point),
            None => [0.0; 3],
        };
        let Some(silhouette) = &self.silhouette else {
            return seen.map(|l| l as f32);
        };
        let hidden = silhouette.coverage(pixel);
        seen.map(|l| (l * (1.0 - hidden) + hidden * silhouette.radiance) as f32)
    }

    fn target_radiance(&self, pixel: [f64; 2], point_mm: [f64; 2]) -> [f64; 3] {
        let sigma_mm = self.optics.blur_across(pixel);
        let Some(paint) = self.target.paint(point_mm, sigma_mm) else {
            return [0.0; 3];
        };
        let irradiance_at = |at_mm: [f64; 2]| self.light.at(at_mm.map(|c| c * 1e-3)).1;
        let mut radiance = [0.0; 3];
        for (albedo, at_mm) in [(paint.lines, paint.lines_at), (paint.desk, point_mm)] {
            if albedo > 0.0 {
                let grey = albedo * irradiance_at(at_mm);
                radiance = radiance.map(|l| l + grey);
            }
        }
        if self.is_mirror {
            let lamp = self.lamp.as_ref().map_or(0.0, |lamp| lamp.radiance(pixel));
            return radiance.map(|l| l + paint.material * lamp);
        }
        if paint.material > 0.0 {
            let point_mm = paint.material_at;
            let point_m = point_mm.map(|c| c * 1e-3);
            let (to_light, irradiance) = self.light.at(point_m);
            let to_camera = normalize([
                self.camera_at_m[0] - point_m[0],
                self.camera_at_m[1] - point_m[1],
                self.camera_at_m[2],
            ]);
            let scale = match self.texture {
                Some((texture, seed)) => texture.factor(point_mm, seed),
                None => 1.0,
            } * paint.material
                * irradiance;
            let f = self.brdf.eval(to_light, to_camera);
            for c in 0..3 {
                radiance[c] += scale * f[c];
            }
        }
        radiance
    }
}

/// The BRDF that a perfect measurement finds at a point of the target (mm): the surface's value at
/// the point's local directions.
pub fn true_brdf(
    brdf: &dyn Brdf,
    geometry: &SceneGeometry,
    pose: Pose,
    point_mm: [f64; 2],
) -> [f64; 3] {
    brdf.eval(
        geometry.light_at(pose.light).direction_from(point_mm),
        geometry.camera_at(pose.view).direction_from(point_mm),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;
    use gonia_brdf::Elementary;
    use gonia_brdf::model::Kurt;

    fn scene(px: usize) -> Scene {
        Scene::new(
            SceneGeometry::paper(px),
            Arc::new(Kurt::two_thread_fabric()),
            Arc::new(Kurt::white_reference_fabric()),
            7,
        )
    }

    fn pose(ti: f64, pi: f64, tv: f64, pv: f64) -> Pose {
        Pose {
            light: Direction::from_deg(ti, pi),
            view: Direction::from_deg(tv, pv),
        }
    }

    #[test]
    fn central_radiance_over_cosine_is_the_brdf() {
        let mut scene = scene(401);
        scene.noise = None;
        let at = pose(60.0, 20.0, 30.0, 250.0);
        let frame = scene.render(Surface::Material, at, 0);
        let centre = frame.rgb[200 * 401 + 200];
        let f = true_brdf(scene.material.as_ref(), &scene.geometry, at, [0.0; 2]);
        for c in 0..3 {
            let measured = f64::from(centre[c]) / at.light.theta.cosine();
            assert!((measured / f[c] - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_frame_depends_on_seed_and_shot_alone() {
        let scene = scene(64);
        let at = pose(15.0, 0.0, 45.0, 90.0);
        let first = scene.render(Surface::Reference, at, 3);
        assert_eq!(first, scene.render(Surface::Reference, at, 3));
        assert_ne!(first, scene.render(Surface::Reference, at, 4));
        let other = Scene { seed: 8, ..scene };
        assert_ne!(first, other.render(Surface::Reference, at, 3));
    }

    #[test]
    fn noise_is_about_one_percent_at_a_typical_pixel_and_unbiased() {
        let noisy = scene(200);
        let mut clean = noisy.clone();
        clean.noise = None;
        let at = pose(30.0, 10.0, 15.0, 200.0);
        let (a, b) = (
            noisy.render(Surface::Reference, at, 1),
            clean.render(Surface::Reference, at, 1),
        );
        let mut errors = Vec::new();
        for row in 80..120 {
            for column in 80..120 {
                let i = row * 200 + column;
                errors.extend((0..3).map(|c| f64::from(a.rgb[i][c] / b.rgb[i][c]) - 1.0));
            }
        }
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let sd = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        assert!(mean.abs() < 4.0 * sd / n.sqrt(), "{mean}");
        assert!((0.008..0.013).contains(&sd), "{sd}");
    }

    #[test]
    fn the_lights_head_hides_the_centre_when_it_is_in_the_way() {
        let mut scene = scene(200);
        scene.noise = None;
        let at = pose(30.0, 60.0, 30.0, 60.0);
        let hidden = scene.render(Surface::Reference, at, 0).rgb[100 * 200 + 100];
        scene.occluder = None;
        let open = scene.render(Surface::Reference, at, 0).rgb[100 * 200 + 100];
        assert!(hidden[1] < 0.03 * open[1] && hidden[1] > 0.0);
    }

    #[test]
    fn the_lights_arm_stays_on_its_side_when_its_light_passes_the_pole() {
        let mut scene = scene(200);
        scene.noise = None;
        let hidden = |theta_i: f64| -> Vec<bool> {
            let mut at = pose(0.0, 0.0, 25.0, 0.0);
            at.light.theta = theta_i.to_radians();
            let shown = scene.render(Surface::Reference, at, 0).rgb;
            let mut open = scene.clone();
            open.occluder = None;
            let open = open.render(Surface::Reference, at, 0).rgb;
            let darker = |(a, b): (&[f32; 3], &[f32; 3])| a[1] < 0.5 * b[1];
            shown.iter().zip(&open).map(darker).collect()
        };
        let (before, after) = (hidden(-0.01), hidden(0.01));
        let count = after.iter().filter(|hidden| **hidden).count();
        let differ = before.iter().zip(&after).filter(|(a, b)| a != b).count();
        assert!(count > 100 && differ < count / 50, "{count} {differ}");
    }

    #[test]
    fn lines_thinner_than_a_pixel_keep_their_light() {
        // At θv = 75° and 200 px a line is 0.2 px thick: what it adds to the light of its
        // neighbourhood must not depend on where it falls between the pixels' centres.
        let mut scene = scene(200);
        scene.noise = None;
        scene.beam = None;
        scene.occluder = None;
        scene.geometry.material_half_mm = 100.0;
        let light_above_centre = |scene: &Scene| {
            let frame = scene.render(Surface::Material, pose(0.0, 0.0, 75.0, 0.0), 0);
            // The far line, x = −335 mm, is 12.8 rows above the centre.
            (80..94)
                .map(|row| f64::from(frame.rgb[row * 200 + 100][1]))
                .sum::<f64>()
        };
        let mut added = Vec::new();
        for shift in 0..5 {
            scene.geometry.centre_px[1] = 100.0 + 0.2 * f64::from(shift);
            scene.geometry.line_width_mm = 4.0;
            let with = light_above_centre(&scene);
            scene.geometry.line_width_mm = 0.0;
            added.push(with - light_above_centre(&scene));
        }
        let mean = added.iter().sum::<f64>() / added.len() as f64;
        for one in &added {
            assert!((one / mean - 1.0).abs() < 0.02, "{added:?}");
        }
    }
}
