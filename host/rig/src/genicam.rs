//! What `rig.toml` says of a GenICam camera.

use crate::pixel_format::PixelFormat;
use crate::rig_error::RigError;
use crate::sensor::Sensor;
use serde::{Deserialize, Serialize};
use std::net::Ipv4Addr;

/// A GigE Vision camera, triggered by the camera arm's controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Genicam {
    /// Its IPv4 address. Cameras are never searched for.
    pub address: String,
    /// As GenICam names it: Mono or Bayer with its pattern, and the bits, packed (`p`, `Packed`) or not.
    pub pixel_format: String,
    /// The camera's input that the trigger cable is on.
    #[serde(default = "default_trigger_source")]
    pub trigger_source: String,
    /// What an exposure's length is.
    #[serde(default)]
    pub exposure: ExposureTiming,
    /// Other features, each `Name=value`, set in this order before the rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<String>,
    /// How long a frame may take after its trigger, seconds.
    #[serde(default = "default_timeout_s")]
    pub timeout_s: f64,
}

/// What an exposure's length is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ExposureTiming {
    /// That of the trigger pulse (GenICam: ExposureMode TriggerWidth), so that brackets are possible.
    #[default]
    Pulse,
    /// What the camera is set to; the pulse only begins it.
    Camera,
}

impl Genicam {
    /// The camera's address, if it can be one.
    pub fn ip(&self) -> Option<Ipv4Addr> {
        let ip: Ipv4Addr = self.address.parse().ok()?;
        let is_one = !ip.is_unspecified() && !ip.is_broadcast() && !ip.is_multicast();
        is_one.then_some(ip)
    }

    /// Checks that a camera could be so, with the rig's sensor and so many exposures a shot.
    ///
    /// # Errors
    /// The first value that is not possible.
    pub(crate) fn check(&self, sensor: Option<&Sensor>, exposures: usize) -> Result<(), RigError> {
        let refuse = |key, problem: String, remedy: &str| Err(RigError::new(key, problem, remedy));
        if self.ip().is_none() {
            return refuse(
                "source.address",
                format!("{:?} is not an address of a camera", self.address),
                "give its IPv4 address, as in 192.168.1.20: cameras are never searched for",
            );
        }
        let name = &self.pixel_format;
        let Some(format) = PixelFormat::named(name) else {
            return refuse(
                "source.pixel_format",
                format!("{name:?} is not one that is read"),
                "give Mono, BayerRG, BayerBG, BayerGR or BayerGB with 8, 10, 12, 14, 16, 10p, 12p, 14p, 10Packed or 12Packed, as in BayerRG12",
            );
        };
        if let Some(feature) = self.features.iter().find(|text| !is_setting(text)) {
            return refuse(
                "source.features",
                format!("{feature:?} sets nothing"),
                "give each as Name=value",
            );
        }
        if self.exposure == ExposureTiming::Camera && exposures > 1 {
            return refuse(
                "source.exposure",
                format!(
                    "a camera that times its exposures itself has one length for all {exposures}"
                ),
                "use exposure = \"pulse\", or one time in session.exposures_s",
            );
        }
        let Some(sensor) = sensor else {
            return refuse(
                "source",
                "gives raw counts, and there is no [sensor]".into(),
                "give black_counts, saturation_counts, gain_e_per_count and read_noise_e there",
            );
        };
        if sensor.bayer != format.bayer {
            return refuse(
                "sensor.bayer",
                format!("is not the pattern of {name}"),
                "make both say the same",
            );
        }
        let white = format.white_counts();
        if sensor.saturation_counts > f64::from(white) {
            return refuse(
                "sensor.saturation_counts",
                format!(
                    "{} counts are more than {name} has ({white})",
                    sensor.saturation_counts
                ),
                "give the counts from which the sensor is no longer linear",
            );
        }
        Ok(())
    }
}

fn is_setting(text: &str) -> bool {
    text.split_once('=')
        .is_some_and(|(name, value)| !name.is_empty() && !value.is_empty())
        && !text.contains(char::is_whitespace)
}

/// Of every source of frames, seconds.
pub(crate) fn default_timeout_s() -> f64 {
    10.0
}

fn default_trigger_source() -> String {
    "Line1".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::Bayer;

    fn camera() -> Genicam {
        Genicam {
            address: "192.168.1.20".into(),
            pixel_format: "BayerRG12".into(),
            trigger_source: default_trigger_source(),
            exposure: ExposureTiming::Pulse,
            features: vec!["GainAuto=Off".into()],
            timeout_s: 10.0,
        }
    }

    fn sensor() -> Sensor {
        Sensor {
            black_counts: 64.0,
            saturation_counts: 4000.0,
            gain_e_per_count: 2.5,
            read_noise_e: 4.0,
            bayer: Some(Bayer::Rggb),
        }
    }

    #[test]
    fn what_no_camera_is_like_is_refused_with_its_key() {
        let with = |change: fn(&mut Genicam, &mut Sensor)| {
            let (mut camera, mut sensor) = (camera(), sensor());
            change(&mut camera, &mut sensor);
            camera.check(Some(&sensor), 3).map_err(|error| error.key)
        };
        assert_eq!(with(|_, _| {}), Ok(()));
        for address in [
            "",
            "0.0.0.0",
            "255.255.255.255",
            "224.0.0.1",
            "camera",
            "::1",
        ] {
            let camera = Genicam {
                address: address.into(),
                ..camera()
            };
            let error = camera.check(Some(&sensor()), 3).unwrap_err();
            assert_eq!(error.key, "source.address", "{address}");
        }
        type Change = fn(&mut Genicam, &mut Sensor);
        for (change, key) in [
            (
                (|c, _| c.pixel_format = "RGB8".into()) as Change,
                "source.pixel_format",
            ),
            (|c, _| c.features.push("Gain".into()), "source.features"),
            (
                |c, _| c.features.push("Gain=0 TriggerMode=Off".into()),
                "source.features",
            ),
            (
                |c, _| c.exposure = ExposureTiming::Camera,
                "source.exposure",
            ),
            (|_, s| s.bayer = None, "sensor.bayer"),
            (
                |_, s| s.saturation_counts = 4096.0,
                "sensor.saturation_counts",
            ),
        ] {
            assert_eq!(with(change), Err(key));
        }
        assert_eq!(camera().check(None, 1).unwrap_err().key, "source");
    }
}
