//! A GigE Vision camera that the controller's pulses trigger, by aravis.

use crate::camera::matching::{Matching, Stamp};
use crate::camera::source::{Camera, CameraError, Pulse};
use aravis::prelude::*;
use aravis::{AcquisitionMode, Auto, Buffer, BufferStatus, ExposureMode, GvDevice, GvStream};
use gio::prelude::*;
use gonia_pipeline::bracket::merge_checked;
use gonia_rig::{ExposureTiming, Frame, FrameRow, Genicam, PixelFormat, RawFrame, Rig, Sensor};
use std::error::Error;
use std::fmt::Display;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::path::Path;
use std::time::{Duration, Instant};

/// Where GigE Vision cameras are controlled.
pub const CONTROL_PORT: u16 = 3956;
/// Frames that may come unasked beside a shot's own before one is lost.
const SPARE_BUFFERS: usize = 8;
/// A camera that was opened anew may still send what it had; it is done when nothing came for so long.
const QUIET: Duration = Duration::from_millis(300);

/// How long another program's control is waited for: one that was killed has it for its heartbeat, 3 s
/// by default.
const HEARTBEAT: Duration = Duration::from_secs(5);

/// A camera opened by its address.
pub struct GenicamCamera {
    setup: Genicam,
    format: PixelFormat,
    size_px: [usize; 2],
    sensor: Sensor,
    exposures_s: Vec<f64>,
    identity: String,
    matching: Matching,
    open: Option<Open>,
    /// No pulse was given since the acquisition began.
    is_fresh: bool,
}

/// Under control of this program, and acquiring.
struct Open {
    camera: aravis::Camera,
    stream: aravis::Stream,
}

impl Drop for Open {
    fn drop(&mut self) {
        // A camera that is gone does not answer.
        let _ = self.camera.stop_acquisition();
    }
}

impl GenicamCamera {
    /// Opens a camera and sets it up: all that `source` says, the trigger, and the acquisition.
    ///
    /// # Errors
    /// No camera answers at the address, somebody else controls it (a program that was killed does so for a
    /// few seconds, which are waited for), or it refuses a setting.
    pub fn open(rig: &Rig, setup: &Genicam, exposures_s: &[f64]) -> Result<Self, CameraError> {
        let (Some(format), Some(sensor)) =
            (PixelFormat::named(&setup.pixel_format), rig.sensor.clone())
        else {
            return Err(CameraError::NoSensor);
        };
        let mut camera = Self {
            setup: setup.clone(),
            format,
            size_px: [rig.camera.width_px, rig.camera.height_px],
            sensor,
            exposures_s: exposures_s.to_vec(),
            identity: String::new(),
            matching: Matching::default(),
            open: None,
            is_fresh: true,
        };
        let open = camera.connect()?;
        camera.identity = camera.identity_of(&open.camera)?;
        camera.open = Some(open);
        Ok(camera)
    }

    fn failed(&self, problem: impl Display, remedy: &'static str) -> CameraError {
        CameraError::Device {
            address: self.setup.address.clone(),
            problem: problem.to_string(),
            remedy,
            source: None,
        }
    }

    /// As [`Self::failed`], because of an error of the library or the system.
    fn failed_by<E: Error + Send + Sync + 'static>(
        &self,
        what: &str,
        error: E,
        remedy: &'static str,
    ) -> CameraError {
        CameraError::Device {
            address: self.setup.address.clone(),
            problem: format!("{what} ({error})"),
            remedy,
            source: Some(Box::new(error)),
        }
    }

    fn absent<E: Error + Send + Sync + 'static>(&self, error: E) -> CameraError {
        self.failed_by(
            "cannot be opened",
            error,
            "check its power, cable and address",
        )
    }

    fn connect(&self) -> Result<Open, CameraError> {
        let Some(ip) = self.setup.ip() else {
            return Err(self.failed(
                "cannot be opened (no address)",
                "check its power, cable and address",
            ));
        };
        let own = own_address(ip).map_err(|error| self.absent(error))?;
        let [own, ip] = [own, ip].map(|ip| gio::InetAddress::from(std::net::IpAddr::V4(ip)));
        let until = Instant::now() + HEARTBEAT;
        let device = loop {
            // Opening by name would search the network for it.
            let device = GvDevice::new(&own, &ip).map_err(|error| self.absent(error))?;
            if device.is_controller() {
                break device;
            }
            if Instant::now() > until {
                return Err(self.failed("is used by another program", "end that one"));
            }
            std::thread::sleep(QUIET);
        };
        let camera = aravis::Camera::with_device(&device).map_err(|error| self.absent(error))?;
        self.set_up(&camera, &device).map_err(|error| {
            self.failed_by(
                "refuses a setting",
                error,
                "check [source] in rig.toml against the camera's manual",
            )
        })?;
        self.check_size(&camera)?;
        let acquire = || -> Result<Open, aravis::glib::Error> {
            let stream = camera.create_stream()?;
            if let Some(stream) = stream.downcast_ref::<GvStream>() {
                stream.set_socket_buffer(aravis::GvStreamSocketBuffer::Auto);
            }
            let payload = camera.payload()? as usize;
            for _ in 0..self.exposures_s.len() + SPARE_BUFFERS {
                stream.push_buffer(Buffer::new_allocate(payload));
            }
            camera.start_acquisition()?;
            Ok(Open {
                camera: camera.clone(),
                stream,
            })
        };
        acquire().map_err(|error| self.absent(error))
    }

    fn set_up(
        &self,
        camera: &aravis::Camera,
        device: &GvDevice,
    ) -> Result<(), aravis::glib::Error> {
        // A program that was killed may have left it acquiring, with its settings locked.
        camera.stop_acquisition()?;
        for feature in &self.setup.features {
            device.set_features_from_string(feature)?;
        }
        camera.set_pixel_format_from_string(&self.setup.pixel_format)?;
        camera.set_acquisition_mode(AcquisitionMode::Continuous)?;
        if camera.is_exposure_auto_available()? {
            camera.set_exposure_time_auto(Auto::Off)?;
        }
        // Some cameras offer TriggerWidth only while a trigger is on.
        camera.set_trigger(&self.setup.trigger_source)?;
        match self.setup.exposure {
            ExposureTiming::Pulse => camera.set_exposure_mode(ExposureMode::TriggerWidth)?,
            ExposureTiming::Camera => {
                if camera.is_feature_available("ExposureMode")? {
                    camera.set_exposure_mode(ExposureMode::Timed)?;
                }
                if let Some(exposure_s) = self.exposures_s.first() {
                    camera.set_exposure_time(exposure_s * 1e6)?;
                }
            }
        }
        Ok(())
    }

    fn check_size(&self, camera: &aravis::Camera) -> Result<(), CameraError> {
        let (_, _, width, height) = camera.region().map_err(|error| self.lost(error))?;
        let [expected_width, expected_height] = self.size_px;
        if usize::try_from(width) == Ok(expected_width)
            && usize::try_from(height) == Ok(expected_height)
        {
            return Ok(());
        }
        Err(self.failed(
            format_args!(
                "gives {width} x {height} pixels, and rig.toml says {expected_width} x {expected_height}"
            ),
            "mend [camera], or set Width, Height, OffsetX and OffsetY by source.features",
        ))
    }

    fn identity_of(&self, camera: &aravis::Camera) -> Result<String, CameraError> {
        let lost = |error| self.lost(error);
        let vendor = camera.vendor_name().map_err(lost)?;
        let model = camera.model_name().map_err(lost)?;
        let serial = camera.device_serial_number();
        let serial = serial.or_else(|_| camera.device_id()).map_err(lost)?;
        // Some have one, some the other.
        let firmware = ["DeviceFirmwareVersion", "DeviceVersion"]
            .into_iter()
            .find_map(|name| camera.string(name).ok())
            .map_or_else(|| "unknown".to_owned(), |version| version.to_string());
        Ok(format!(
            "{vendor} {model}, serial {serial}, firmware {firmware}, {} of {} x {} px at {}",
            self.setup.pixel_format, self.size_px[0], self.size_px[1], self.setup.address
        ))
    }

    fn lost<E: Error + Send + Sync + 'static>(&self, error: E) -> CameraError {
        self.failed_by("does not answer", error, "check its power and cable")
    }

    fn not_open(&self) -> CameraError {
        self.failed(
            "does not answer (it is not open)",
            "check its power and cable",
        )
    }

    fn raw_of(&self, buffer: &Buffer) -> Result<RawFrame, CameraError> {
        let [width, height] = self.size_px;
        let data = buffer.image_data();
        let pixels = width * height;
        let Some(counts) = self.format.counts(&data, pixels) else {
            let expected = self.format.bytes_of(pixels);
            return Err(self.failed(
                format_args!("a frame has {} bytes instead of {expected}", data.len()),
                "leave its size and pixel format to rig.toml",
            ));
        };
        Ok(RawFrame {
            width,
            height,
            channels: 1,
            counts,
        })
    }
}

impl Camera for GenicamCamera {
    fn identity(&self) -> String {
        self.identity.clone()
    }

    fn ready(&mut self, strays: usize) -> Result<usize, CameraError> {
        let Some(open) = &self.open else {
            return Err(self.not_open());
        };
        let until = Instant::now() + Duration::from_secs_f64(self.setup.timeout_s);
        // An acquisition that began after the pulses owes none of their frames.
        let may_trickle = self.is_fresh && strays > 0;
        let mut came = 0;
        loop {
            let buffer = if may_trickle {
                pop(&open.stream, Instant::now() + QUIET)
            } else if came < strays {
                pop(&open.stream, until)
            } else {
                open.stream.try_pop_buffer()
            };
            let Some(buffer) = buffer else { break };
            came += 1;
            self.matching.pass(stamp_of(&buffer));
            open.stream.push_buffer(buffer);
        }
        self.is_fresh = false;
        Ok(came.saturating_sub(strays))
    }

    fn fetch(&mut self, _: &FrameRow, pulses: &[Pulse]) -> Result<Frame, CameraError> {
        let Some(open) = &self.open else {
            return Err(self.not_open());
        };
        let until = Instant::now() + Duration::from_secs_f64(self.setup.timeout_s);
        let (mut stamps, mut exposures) = (Vec::new(), Vec::new());
        for pulse in pulses {
            let Some(buffer) = pop(&open.stream, until) else {
                return Err(CameraError::Late {
                    came: stamps.len(),
                    expected: pulses.len(),
                    timeout_s: self.setup.timeout_s,
                });
            };
            // Nothing else of the buffer means anything before this.
            if buffer.status() != BufferStatus::Success {
                return Err(CameraError::Incomplete {
                    frame: stamps.len() + 1,
                    expected: pulses.len(),
                    status: format!("{:?}", buffer.status()),
                });
            }
            stamps.push(stamp_of(&buffer));
            exposures.push((pulse.exposure_s, self.raw_of(&buffer)?));
            open.stream.push_buffer(buffer);
        }
        self.matching.check(&stamps, pulses)?;
        Ok(merge_checked(&exposures, &self.sensor, Path::new("the camera"))?.frame)
    }

    fn reopen(&mut self) -> Result<(), CameraError> {
        // First, so that it gives up control of the camera.
        self.open = None;
        let open = self.connect()?;
        let identity = self.identity_of(&open.camera)?;
        if identity != self.identity {
            return Err(self.failed(
                format_args!("is now {identity}, and was {}", self.identity),
                "connect the camera that the session began with",
            ));
        }
        self.open = Some(open);
        self.is_fresh = true;
        self.matching.count_anew();
        Ok(())
    }
}

fn pop(stream: &aravis::Stream, until: Instant) -> Option<Buffer> {
    let left = until.saturating_duration_since(Instant::now());
    stream.timeout_pop_buffer(left.as_micros() as u64)
}

fn stamp_of(buffer: &Buffer) -> Stamp {
    Stamp {
        id: buffer.frame_id(),
        time_ns: buffer.timestamp(),
    }
}

/// The address by which this machine reaches the camera. Nothing is sent for it.
fn own_address(camera: Ipv4Addr) -> std::io::Result<Ipv4Addr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    socket.connect(SocketAddrV4::new(camera, CONTROL_PORT))?;
    match socket.local_addr()? {
        std::net::SocketAddr::V4(own) => Ok(*own.ip()),
        std::net::SocketAddr::V6(_) => {
            Err(std::io::Error::other("no IPv4 address of this machine"))
        }
    }
}
