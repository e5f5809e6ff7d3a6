//! `rig.toml`: where light, camera and target are.

use crate::arm_geometry::Placement;
use crate::arm_geometry::{ArmGeometry, TargetPlace};
use crate::bench_setup::{ArmPorts, SessionSettings, Source};
use crate::calibration::Calibration;
use crate::reference::Reference;
use crate::sensor::Sensor;
use crate::uncertainty::{Input, KnownFrom, Uncertainties};
use gonia_brdf::Direction;
use serde::{Deserialize, Serialize};

/// The geometry of a rig and how its frames are sampled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    /// The light.
    pub light: LightGeometry,
    /// The camera.
    pub camera: CameraGeometry,
    /// The target's fiducial lines and the sample's size.
    pub target: Target,
    /// The reference's reflectance, where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<Reference>,
    /// The sensor, where frames come as raw exposures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<Sensor>,
    /// The grid of sampling points.
    pub sampling: Sampling,
    /// The arms' controllers, for a session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arms: Option<ArmPorts>,
    /// Where a session's frames come from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<Source>,
    /// How a session goes, where it differs from the default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<SessionSettings>,
    /// How well is known what frames do not tell, where that differs from the default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Uncertainties>,
    /// How well the geometry is known, where it was calibrated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Calibration>,
}

/// A point source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightGeometry {
    /// Distance from the sample's centre, metres.
    pub distance_m: f64,
    /// The arm that holds it, as it was built.
    #[serde(default, skip_serializing_if = "is_default")]
    pub arm: ArmGeometry,
    /// The beam: logarithm of its intensity relative to that towards the target's centre, by the tangents
    /// u (right) and v (up) of the angle off that line as the light sees it: coefficients of u, v, u², u·v
    /// and v². All zero: the same in all directions.
    #[serde(default, skip_serializing_if = "is_default")]
    pub beam: [f64; 5],
}

/// How the camera sits on its arm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraMount {
    /// Turn of the image about the line of sight, clockwise as the frame shows it, degrees.
    pub roll_deg: f64,
    /// The point of the target that it looks at from straight above, right and down of the centre as the
    /// frame shows it, mm.
    pub aim_mm: [f64; 2],
}

/// A pinhole camera with optional distortion, in OpenCV's terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraGeometry {
    /// Distance from the sample's centre, metres.
    pub distance_m: f64,
    /// The arm that holds it, as it was built.
    #[serde(default, skip_serializing_if = "is_default")]
    pub arm: ArmGeometry,
    /// How it sits on the arm.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mount: CameraMount,
    /// Width of a frame, pixels.
    pub width_px: usize,
    /// Height of a frame, pixels.
    pub height_px: usize,
    /// Focal length, pixels; where `focal_y_px` is given, along the rows: OpenCV's fx.
    pub focal_px: f64,
    /// Focal length along the columns, pixels, where pixels are not square: OpenCV's fy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focal_y_px: Option<f64>,
    /// Principal point (x, y), pixels; the centre of the top left pixel is (0.5, 0.5).
    pub centre_px: [f64; 2],
    /// Radial distortion, coefficient of r² (r in units of the focal length).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub k1: f64,
    /// Radial distortion, coefficient of r⁴.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub k2: f64,
    /// Radial distortion, coefficient of r⁶.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub k3: f64,
    /// Tangential distortion: x moves by 2·p1·x·y, y by p1·(r² + 2y²).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub p1: f64,
    /// Tangential distortion: x moves by p2·(r² + 2x²), y by 2·p2·x·y.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub p2: f64,
}

/// Four bright lines on a dark desk, and the square sample inside them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Lines at x = ±a and y = ±a: a, to the centre of the line, mm.
    pub line_offset_mm: f64,
    /// Width of a line, mm.
    pub line_width_mm: f64,
    /// Half the side of the sample, mm.
    pub material_half_mm: f64,
    /// Middle of the orientation mark, a bright disc beside the lines that says which side is which, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mark_mm: Option<[f64; 2]>,
    /// Radius of the orientation mark, mm; there if `mark_mm` is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mark_radius_mm: Option<f64>,
    /// How far the surface of a mirror in the sample's place lies above the sample's, mm, where frames of one
    /// are to show the light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mirror_height_mm: Option<f64>,
    /// Where it lies between the arms.
    #[serde(default, skip_serializing_if = "is_default")]
    pub place: TargetPlace,
}

/// The orientation mark of a target: without it, a target that is turned by a quarter looks the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationMark {
    /// Its middle, mm.
    pub at_mm: [f64; 2],
    /// Its radius, mm.
    pub radius_mm: f64,
}

impl Target {
    /// Its orientation mark, if it has one.
    pub fn mark(&self) -> Option<OrientationMark> {
        let (at_mm, radius_mm) = (self.mark_mm?, self.mark_radius_mm?);
        Some(OrientationMark { at_mm, radius_mm })
    }
}

/// The sampling points of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sampling {
    /// Points lie within this distance of the centre, mm.
    pub disc_radius_mm: f64,
    /// Distance between points, mm.
    pub grid_mm: f64,
    /// Side of the square whose median is a point's value, mm.
    pub patch_mm: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Rig {
    /// The paper's rig with a camera of `px` × `px` pixels that sees the whole target at any
    /// polar angle up to 75°.
    pub fn paper(px: usize) -> Self {
        Self {
            light: LightGeometry {
                distance_m: 1.1,
                arm: ArmGeometry::default(),
                beam: [0.0; 5],
            },
            camera: CameraGeometry {
                distance_m: 1.8,
                arm: ArmGeometry::default(),
                mount: CameraMount::default(),
                width_px: px,
                height_px: px,
                focal_px: 1600.0 / 1024.0 * px as f64,
                focal_y_px: None,
                centre_px: [px as f64 / 2.0; 2],
                k1: 0.0,
                k2: 0.0,
                k3: 0.0,
                p1: 0.0,
                p2: 0.0,
            },
            target: Target {
                line_offset_mm: 335.0,
                line_width_mm: 4.0,
                material_half_mm: 320.0,
                mark_mm: None,
                mark_radius_mm: None,
                mirror_height_mm: None,
                place: TargetPlace::default(),
            },
            reference: None,
            sensor: None,
            sampling: Sampling {
                disc_radius_mm: 277.0,
                grid_mm: 14.0,
                patch_mm: 14.0,
            },
            arms: None,
            source: None,
            session: None,
            uncertainty: None,
            calibration: None,
        }
    }

    /// Where the light stands when its arm reads `reading`.
    pub fn light_at(&self, reading: Direction) -> Placement {
        let light = &self.light;
        let distance_mm = 1000.0 * light.distance_m;
        light
            .arm
            .placement(reading, distance_mm, &self.target.place)
    }

    /// What is known of an input of the measurement equation, but for what the calibration says of directions.
    pub fn input(&self, input: Input) -> (f64, KnownFrom) {
        input.of(
            self.reference.as_ref(),
            &self.uncertainty.unwrap_or_default(),
        )
    }
}
