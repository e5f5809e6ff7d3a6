//! aravis' simulated device, and the one place where it is reached by C.

use crate::camera::genicam::CONTROL_PORT;
use crate::camera::simulated_gige::description::Register;
use crate::camera::simulated_gige::{description, lock};
use aravis::glib::translate::ToGlibPtr;
use aravis::{FakeCamera, GvFakeCamera};
use aravis_sys::{
    ArvBuffer, ArvPixelFormat, arv_buffer_get_data, arv_buffer_get_image_height,
    arv_buffer_get_image_width, arv_buffer_set_timestamp, arv_fake_camera_set_fill_pattern,
};
use gonia_rig::PixelFormat;
use std::ffi::c_void;
use std::io::Write;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How often the device looks at its line. It does nothing but look for the last millisecond.
const LOOKS_HZ: f64 = 100.0;
/// It takes a pulse within this time, or has stopped.
const TAKES_WITHIN: Duration = Duration::from_secs(1);

/// Why there is no simulated camera.
#[derive(Debug, thiserror::Error)]
pub enum GigeError {
    /// What its counts mean is not known.
    #[error(
        "the rig has no [sensor]: give black_counts, saturation_counts, gain_e_per_count and read_noise_e"
    )]
    NoSensor,
    /// The address is not to be had.
    #[error(
        "no camera can stand at {0}:{CONTROL_PORT} ({1}); give an address of this machine's loopback at which no other one stands"
    )]
    Address(Ipv4Addr, String),
    /// The device's description cannot be handed over.
    #[error("the camera's description cannot be written ({0}); check the temporary folder")]
    Description(std::io::Error),
}

/// What is between the trigger line and the device.
#[derive(Default)]
pub struct Line {
    /// The next frame: its bytes, and its time in ns.
    next: Mutex<Option<(Vec<u8>, u64)>>,
    sent: AtomicU32,
}

impl Line {
    pub fn sent(&self) -> u32 {
        self.sent.load(Ordering::Relaxed)
    }
}

/// How the host has set the device up.
#[derive(Clone, Copy)]
pub struct Settings {
    pub format: PixelFormat,
    /// `None`: as long as the pulse.
    pub exposure_us: Option<u64>,
}

/// A device that answers.
pub struct Device {
    // It is dropped first: its thread looks at the line.
    server: GvFakeCamera,
    camera: FakeCamera,
    line: Arc<Line>,
}

impl Device {
    pub fn start(address: Ipv4Addr, line: &Arc<Line>) -> Result<Self, GigeError> {
        let refused = |why: String| GigeError::Address(address, why);
        if !address.is_loopback() {
            return Err(refused("it is not loopback".into()));
        }
        // aravis does not tell of a port that is taken.
        UdpSocket::bind((address, CONTROL_PORT)).map_err(|error| refused(error.to_string()))?;
        let description = || {
            let mut file = tempfile::NamedTempFile::new()?;
            file.write_all(description::xml().as_bytes())?;
            Ok(file)
        };
        let file = description().map_err(GigeError::Description)?;
        let path = file.path().to_string_lossy();
        let server = GvFakeCamera::new_full(Some(&address.to_string()), Some("sim-1"), Some(&path));
        let camera = match server.fake_camera() {
            Some(camera) if server.is_running() => camera,
            _ => return Err(refused("no network interface has it".into())),
        };
        camera.set_trigger_frequency(LOOKS_HZ);
        let data = Arc::as_ptr(line).cast_mut().cast::<c_void>();
        // SAFETY: the camera is alive; `fill` has the signature, and `data` is the line, which outlives
        // the device's thread: that ends when `server` is dropped, before `line`.
        unsafe {
            arv_fake_camera_set_fill_pattern(camera.to_glib_none().0, Some(fill), data);
        }
        Ok(Self {
            server,
            camera,
            line: Arc::clone(line),
        })
    }

    /// How it is set up; `None` while it does not listen to its line.
    pub fn settings(&self) -> Option<Settings> {
        let read = |register: Register| self.camera.read_register(register as u32);
        let listens = read(Register::Acquisition)? == 1 && read(Register::TriggerMode)? == 1;
        let format = description::format_of(read(Register::PixelFormat)?)?;
        let by_pulse = read(Register::ExposureMode)? == description::TRIGGER_WIDTH;
        let set_us = u64::from(read(Register::ExposureTime)?);
        listens.then_some(Settings {
            format,
            exposure_us: (!by_pulse).then_some(set_us),
        })
    }

    /// Sends a frame, and waits until it is taken up.
    pub fn expose(&self, bytes: Vec<u8>, time_ns: u64, lost_share: f64) {
        self.server.set_gvsp_lost_ratio(lost_share);
        *lock(&self.line.next) = Some((bytes, time_ns));
        self.camera.write_register(Register::Line as u32, 1);
        let until = Instant::now() + TAKES_WITHIN;
        while lock(&self.line.next).is_some() && Instant::now() < until {
            std::thread::sleep(super::LOOK_EVERY);
        }
        if lock(&self.line.next).take().is_some() {
            self.camera.write_register(Register::Line as u32, 0);
        }
    }
}

/// Fills a frame of the device's, in its thread.
unsafe extern "C" fn fill(
    buffer: *mut ArvBuffer,
    data: *mut c_void,
    _exposure_us: u32,
    _gain: u32,
    format: ArvPixelFormat,
) {
    // SAFETY: see where this function is handed over.
    let line = unsafe { &*data.cast::<Line>() };
    let Some((bytes, time_ns)) = lock(&line.next).take() else {
        return;
    };
    // SAFETY: the buffer is the device's own, of an image, for the time of this call.
    let [width, height] = unsafe {
        [
            arv_buffer_get_image_width(buffer),
            arv_buffer_get_image_height(buffer),
        ]
    };
    let pixels = usize::try_from(width).unwrap_or(0) * usize::try_from(height).unwrap_or(0);
    let payload = pixels * (format >> 16 & 0xFF) as usize / 8;
    if bytes.len() == payload {
        let mut size = 0;
        // SAFETY: the device has made sure that the buffer holds `payload` bytes.
        unsafe {
            let to = arv_buffer_get_data(buffer, &mut size);
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, payload);
            arv_buffer_set_timestamp(buffer, time_ns);
        }
    }
    line.sent.fetch_add(1, Ordering::Relaxed);
}
