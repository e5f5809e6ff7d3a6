//! The simulated rig's camera as a GigE Vision device on loopback: the arms' trigger pulses are its
//! line, and its frames are raw counts of the rig's sensor. The device itself is aravis'
//! `ArvGvFakeCamera`; what it shows, and its description, are from here.

mod description;
mod device;

pub use device::GigeError;

use device::{Device, Line, Settings};
use gonia_brdf::model::Brdf;
use gonia_rig::{PixelFormat, Rig, Role};
use gonia_sim::record::TriggerRecord;
use gonia_sim::rig::SimRig;
use gonia_sim::scene::{RawSensor, Scene, SceneGeometry};
use std::net::Ipv4Addr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Pause between two looks at the line.
const LOOK_EVERY: Duration = Duration::from_millis(1);
/// A white diffuser, lit from above, gets the longest exposure to this share of the range.
const WHITE_SHARE: f64 = 0.8;

/// What goes wrong with a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GigeTrouble {
    /// So large a share of its packets is lost.
    PacketsLost(f64),
    /// It is sent so much later.
    Late(Duration),
    /// Another one follows it that no pulse asked for.
    Extra,
    /// The camera goes off at the pulse, and comes back after this time.
    Dies(Duration),
}

/// What goes wrong with the pulse of this number, counted from 0.
pub type GigeTroubles = fn(u32) -> Option<GigeTrouble>;

/// The camera, until it is dropped.
pub struct SimulatedGige {
    line: Arc<Line>,
    role: Arc<Mutex<Role>>,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl SimulatedGige {
    /// Puts a camera on the simulated rig: it looks at a material or a reference, with the noise of
    /// the rig's sensor.
    ///
    /// # Errors
    /// No sensor in the rig, or the address is none of this machine, or taken.
    pub fn start(
        rig: &Rig,
        arms: SimRig,
        (material, reference): (Arc<dyn Brdf>, Arc<dyn Brdf>),
        seed: u64,
        address: Ipv4Addr,
        troubles: GigeTroubles,
    ) -> Result<Self, GigeError> {
        let sensor = rig.sensor.as_ref().ok_or(GigeError::NoSensor)?;
        let exposures_s = rig.session.clone().unwrap_or_default().exposures_s;
        let longest_s = exposures_s.into_iter().fold(1e-5, f64::max);
        let range = sensor.saturation_counts - sensor.black_counts;
        let mut scene = Scene::new(SceneGeometry::of_rig(rig), material, reference, seed);
        scene.noise = None;
        let line = Arc::new(Line::default());
        let (role, ends) = (
            Arc::new(Mutex::new(Role::Material)),
            Arc::new(AtomicBool::new(false)),
        );
        let sight = Sight {
            scene,
            sensor: sensor.clone(),
            counts_per_s: WHITE_SHARE * range * std::f64::consts::PI / longest_s,
            seed,
        };
        let mut camera = OnTheLine {
            device: Some(Device::start(address, &line)?),
            address,
            line: Arc::clone(&line),
            sight,
            role: Arc::clone(&role),
            troubles,
            switched_on_us: arms.now_us(),
            seen: 0,
        };
        let ended = Arc::clone(&ends);
        let thread = std::thread::spawn(move || {
            let mut given = arms.trigger_count();
            while !ended.load(Ordering::Relaxed) {
                std::thread::sleep(LOOK_EVERY);
                if arms.trigger_count() == given {
                    continue;
                }
                for pulse in arms.triggers().split_off(given) {
                    let Some(width_us) = pulse.width_us else {
                        break;
                    };
                    camera.pulse(&pulse, width_us);
                    given += 1;
                }
            }
        });
        Ok(Self {
            line,
            role,
            ends,
            thread: Some(thread),
        })
    }

    /// Changes what lies on the target.
    pub fn put(&self, role: Role) {
        *lock(&self.role) = role;
    }

    /// Frames sent so far.
    pub fn sent(&self) -> u32 {
        self.line.sent()
    }
}

impl Drop for SimulatedGige {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has said so.
            let _ = thread.join();
        }
    }
}

/// What the camera sees, as counts.
struct Sight {
    scene: Scene,
    sensor: gonia_rig::Sensor,
    counts_per_s: f64,
    seed: u64,
}

impl Sight {
    fn counts(
        &self,
        role: Role,
        pulse: &TriggerRecord,
        format: PixelFormat,
        exposure_s: f64,
    ) -> Vec<u16> {
        let frame = self.scene.frame(role, pulse.pose(), 0);
        let site = |(i, rgb): (usize, &[f32; 3])| {
            let value = match format.bayer {
                Some(pattern) => rgb[pattern.colors()[i / frame.width % 2][i % frame.width % 2]],
                None => rgb.iter().sum::<f32>() / 3.0,
            };
            value * self.counts_per_s as f32
        };
        let rates: Vec<f32> = frame.rgb.iter().enumerate().map(site).collect();
        let sensor = RawSensor {
            black_counts: self.sensor.black_counts as f32,
            white_counts: f32::from(format.white_counts()),
            gain_e_per_count: self.sensor.gain_e_per_count as f32,
            read_noise_e: self.sensor.read_noise_e as f32,
        };
        let seed = self.seed ^ (u64::from(pulse.sequence) << 20);
        sensor.expose(&rates, exposure_s, seed)
    }
}

/// The camera at the end of the trigger line.
struct OnTheLine {
    device: Option<Device>,
    address: Ipv4Addr,
    line: Arc<Line>,
    sight: Sight,
    role: Arc<Mutex<Role>>,
    troubles: GigeTroubles,
    /// Its clock began then, µs.
    switched_on_us: u64,
    /// Pulses so far.
    seen: u32,
}

impl OnTheLine {
    fn pulse(&mut self, pulse: &TriggerRecord, width_us: u64) {
        let trouble = (self.troubles)(self.seen);
        self.seen += 1;
        let mut lost_share = 0.0;
        match trouble {
            Some(GigeTrouble::Dies(off)) => {
                self.device = None;
                std::thread::sleep(off);
                self.switched_on_us = pulse.time_us;
                // Somebody else may have taken the port; then it stays away.
                self.device = Device::start(self.address, &self.line).ok();
                return;
            }
            Some(GigeTrouble::Late(by)) => std::thread::sleep(by),
            Some(GigeTrouble::PacketsLost(share)) => lost_share = share,
            Some(GigeTrouble::Extra) | None => {}
        }
        let Some(device) = &self.device else { return };
        let Some(settings) = device.settings() else {
            return;
        };
        let exposure_us = settings.exposure_us.unwrap_or(width_us);
        self.expose(device, settings, pulse, exposure_us, 0, lost_share);
        if trouble == Some(GigeTrouble::Extra) {
            self.expose(device, settings, pulse, exposure_us, 3_000, 0.0);
        }
    }

    /// A frame, so much after the pulse.
    fn expose(
        &self,
        device: &Device,
        settings: Settings,
        pulse: &TriggerRecord,
        exposure_us: u64,
        after_us: u64,
        lost_share: f64,
    ) {
        let role = *lock(&self.role);
        let exposure_s = exposure_us as f64 * 1e-6;
        let counts = self.sight.counts(role, pulse, settings.format, exposure_s);
        let bytes = settings.format.bytes(&counts);
        let time_us = pulse.time_us + after_us - self.switched_on_us + 1_000_000;
        device.expose(bytes, 1000 * time_us, lost_share);
    }
}

fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
