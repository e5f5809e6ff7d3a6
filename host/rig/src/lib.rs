//! What a rig, a pose, a frame, a scale and a figure of merit *are*: plain types without I/O, and the
//! geometry of the camera. Every other room of the host speaks in these.
//!
//! | module | what it describes |
//! |---|---|
//! | [`Rig`] and its parts | geometry, sensor, reference, sampling, as `rig.toml` has them |
//! | [`ArmPorts`], [`Source`], [`SessionSettings`], [`Genicam`] | the bench setup of a session |
//! | [`ArmGeometry`], [`TargetPlace`], [`Placement`] | arms and target as they were built, and where light and camera stand |
//! | [`Calibration`] | what a calibration of the geometry found, and how well |
//! | [`CameraModel`], [`Homography`] | from millimetres on the target to pixels |
//! | [`Frame`], [`RawFrame`], [`FrameRow`], [`Exposure`], [`Role`] | frames, and what is known of each |
//! | [`SampleSet`], [`Scale`], [`DenseFile`], [`CellMask`] | a dense BRDF with its scale and its measured cells |
//! | [`Channels`], [`SampleValues`], [`ChannelSamples`], [`DenseChannels`] | colours, one value, or the bands of a spectrum; samples and a dense BRDF of these |
//! | [`keep_sound`], [`Oddities`] | samples that cannot stand as they came |
//! | [`Remark`] | what is said of data that were used all the same |
//! | [`Stratum`], [`Figures`] | how far one BRDF is from another, by part of the domain |

mod arm_geometry;
mod bench_setup;
mod calibration;
mod camera_model;
mod cell_mask;
mod channel_samples;
mod channels;
mod check;
mod dense;
mod dense_channels;
mod figures;
mod frame;
mod frame_row;
mod genicam;
mod homography;
mod number;
mod pixel_format;
mod raw_frame;
mod remark;
mod rig;
mod rig_error;
mod sample_set;
mod sample_values;
mod scale;
mod sensor;
mod sound_samples;
pub mod stratum;

pub use arm_geometry::{ArmGeometry, Placement, TargetPlace};
pub use bench_setup::{ArmPorts, DEFAULT_BAUD, SessionSettings, Source, Thermometer};
pub use calibration::Calibration;
pub use camera_model::{CameraModel, CameraShift};
pub use cell_mask::CellMask;
pub use channel_samples::ChannelSamples;
pub use channels::{Channels, SameBand};
pub use check::{check_rig, rig_remarks};
pub use dense::DenseFile;
pub use dense_channels::DenseChannels;
pub use figures::{Figures, StratumFigures};
pub use frame::Frame;
pub use frame_row::{Exposure, FrameRow, Role};
pub use genicam::{ExposureTiming, Genicam};
pub use homography::Homography;
pub use pixel_format::PixelFormat;
pub use raw_frame::RawFrame;
pub use remark::Remark;
pub use rig::{
    CameraGeometry, CameraMount, LightGeometry, OrientationMark, Reference, ReflectanceTable, Rig,
    Sampling, Target,
};
pub use rig_error::RigError;
pub use sample_set::SampleSet;
pub use sample_values::SampleValues;
pub use scale::Scale;
pub use sensor::{Bayer, Sensor};
pub use sound_samples::{Oddities, Oddity, keep_sound};
pub use stratum::Stratum;
