//! Two axes behind the firmware's hardware trait: everything that one controller is wired to.

use gonia_firmware::driver::{DriverBus, tmc5160};
use gonia_firmware::hardware::{
    DriverAnswer, DriverBytes, EncoderKind, EncoderLost, EncoderSetup, EncoderWord, Hardware,
    NotSaved,
};
use gonia_firmware::profile::TICKS_PER_US;
use gonia_firmware::steps::{End, Period, REST_TICKS, StepChannel, StepProgress, StepTimer};
use gonia_firmware::store::{RECORD_MAX, Sectors, Store, Stored};
use gonia_protocol::settings::{Axis, Key};

use crate::driver_chip::DriverChip;
use crate::plant::{AxisPlant, PlantConfig};
use crate::quadrature::QuadratureRing;

/// Pins, encoders and memory of one simulated arm.
#[derive(Debug)]
pub struct SimulatedArm {
    axes: [AxisPlant; 2],
    steps: [StepChannel<VirtualTimer>; 2],
    now_us: u64,
    trigger: bool,
    /// When the pulse under way ends by itself.
    pulse_ends_us: u64,
    rising_edges: u32,
    /// A pulse has ended.
    has_fallen: bool,
    holds_interlock_open: bool,
    interlock_closed: bool,
    drivers_on: bool,
    brakes_released: bool,
    was_let_fall: bool,
    /// Readers of quadrature rings, where the settings say that they are such.
    rings: [QuadratureRing; 2],
    has_quadrature_pins: bool,
    /// Until when each driver reports an alarm, µs.
    alarm_until_us: [u64; 2],
    /// Drivers that are set by wire; `None` where they are set by hand.
    drivers: [Option<DriverChip>; 2],
    /// What the drivers answer, and from when on, µs.
    answers: [Option<(u64, DriverAnswer)>; 2],
    store: Store,
    flash: RamFlash,
}

/// How long an exchange on the one wire takes at 9600 baud, µs.
const ONE_WIRE_US: u64 = 16_000;

/// A timer with preloaded registers, in virtual time.
#[derive(Debug)]
struct VirtualTimer {
    /// When the running period ends, 1/256 µs.
    ends_ticks: u64,
    reload: u32,
    now_ticks: u64,
    up: bool,
}

impl VirtualTimer {
    fn at_rest(now_us: u64) -> StepChannel<Self> {
        let now_ticks = now_us * TICKS_PER_US;
        StepChannel::new(Self {
            ends_ticks: now_ticks + u64::from(REST_TICKS),
            reload: REST_TICKS,
            now_ticks,
            up: true,
        })
    }
}

impl StepTimer for VirtualTimer {
    // The channel itself returns what a period has ended with.
    fn end_with_pulse(&mut self, _: bool) {}

    fn reload(&mut self, ticks: u32) {
        self.reload = ticks;
    }

    fn restart(&mut self, ticks: u32) {
        self.ends_ticks = self.now_ticks + u64::from(ticks);
        self.reload = ticks;
    }

    fn set_direction(&mut self, up: bool) {
        self.up = up;
    }
}

/// Lets the timer run up to now.
fn play(steps: &mut StepChannel<VirtualTimer>, plant: &mut AxisPlant, now_us: u64) {
    let now_ticks = now_us * TICKS_PER_US;
    let is_playing = steps.progress().is_playing;
    let timer = steps.timer();
    let rest = u64::from(REST_TICKS);
    if !is_playing && timer.ends_ticks + rest < now_ticks {
        // Nothing happens in all these rests.
        timer.ends_ticks += (now_ticks - timer.ends_ticks) / rest * rest;
    }
    while steps.timer().ends_ticks <= now_ticks {
        let timer = steps.timer();
        let ended_ticks = timer.ends_ticks;
        timer.ends_ticks += u64::from(timer.reload);
        if steps.period_ended() == End::Step {
            plant.step(steps.timer().up, ended_ticks / TICKS_PER_US);
        }
    }
}

/// Two sectors that keep their bytes through a restart, until the power goes while one is written.
#[derive(Debug)]
struct RamFlash {
    sectors: [[u8; RECORD_MAX]; 2],
    /// The power goes after so many bytes of the next write.
    dies_after: Option<usize>,
    has_died: bool,
}

impl SimulatedArm {
    /// An arm of two axes, θ and φ.
    pub fn new(configs: [PlantConfig; 2], seed: u64) -> Self {
        let [theta, phi] = configs;
        Self {
            axes: [
                AxisPlant::new(theta, seed.wrapping_mul(2)),
                AxisPlant::new(phi, seed.wrapping_mul(2).wrapping_add(1)),
            ],
            steps: [0; 2].map(|_| VirtualTimer::at_rest(0)),
            now_us: 0,
            trigger: false,
            pulse_ends_us: 0,
            rising_edges: 0,
            has_fallen: false,
            holds_interlock_open: false,
            interlock_closed: true,
            drivers_on: false,
            brakes_released: false,
            was_let_fall: false,
            rings: Default::default(),
            has_quadrature_pins: true,
            alarm_until_us: [0; 2],
            drivers: [None, None],
            answers: [None, None],
            store: Store::default(),
            flash: RamFlash {
                sectors: [[0xFF; RECORD_MAX]; 2],
                dies_after: None,
                has_died: false,
            },
        }
    }

    /// An arm that the default settings fit, standing somewhere in its travel.
    pub fn default_arm(seed: u64) -> Self {
        let axis = |axis: Axis, start_udeg| {
            PlantConfig::worm_axis(f64::from(Key::HomeAngle.default_of(axis)), start_udeg)
        };
        Self::new([axis(Axis::Theta, 21.3e6), axis(Axis::Phi, -12.8e6)], seed)
    }

    /// The arm of the board in QEMU: it stands near its home switches, so that homing takes seconds,
    /// and leaves nothing to chance, so that the simulator's stands where QEMU's does.
    pub fn quiet_arm_near_home() -> Self {
        let axes = [(-5e6, 3e6), (-190e6, -170e6)];
        let axis = |(home, start)| PlantConfig::worm_axis(home, start).quiet();
        Self::new(axes.map(axis), 1)
    }

    /// Lets the time pass up to now: the steps that were due by then are given.
    pub fn set_now(&mut self, now_us: u64) {
        self.now_us = now_us;
        self.power_motors();
        if self.trigger && now_us >= self.pulse_ends_us {
            self.end_pulse();
        }
        for (steps, plant) in self.steps.iter_mut().zip(&mut self.axes) {
            play(steps, plant, now_us);
        }
    }

    /// One of the axes.
    pub fn axis(&mut self, axis: Axis) -> &mut AxisPlant {
        &mut self.axes[axis.index()]
    }

    /// The true angles of θ and φ, degrees.
    pub fn true_deg(&self, now_us: u64) -> [f64; 2] {
        [0, 1].map(|i| self.axes[i].true_udeg(now_us) * 1e-6)
    }

    /// Rising edges of the trigger output since the last call.
    pub fn take_rising_edges(&mut self) -> u32 {
        core::mem::take(&mut self.rising_edges)
    }

    /// Whether a pulse of the trigger output has ended since the last call.
    pub fn take_fall(&mut self) -> bool {
        core::mem::take(&mut self.has_fallen)
    }

    /// Whether this controller holds the shared interlock open.
    pub fn holds_interlock_open(&self) -> bool {
        self.holds_interlock_open
    }

    /// The interlock's chain closes or opens.
    pub fn set_interlock_closed(&mut self, closed: bool) {
        self.interlock_closed = closed;
    }

    /// What a controller that starts finds in the board's memory.
    pub fn open_store(&mut self) -> Option<Stored> {
        let (store, stored) = Store::open(&mut self.flash);
        self.store = store;
        stored
    }

    /// The power will go after so many bytes of the next write to the board's memory.
    pub fn die_while_saving(&mut self, after_bytes: usize) {
        self.flash.dies_after = Some(after_bytes);
    }

    /// Whether the power has gone since the last call.
    pub fn take_death(&mut self) -> bool {
        core::mem::take(&mut self.flash.has_died)
    }

    /// The driver of an axis takes its motor's current away and reports an alarm until then.
    pub fn raise_alarm_until(&mut self, axis: Axis, until_us: u64) {
        self.alarm_until_us[axis.index()] = until_us;
    }

    /// Fits drivers that are set by wire, all with address 0: each has a wire of its own.
    pub fn fit_drivers(&mut self, bus: DriverBus) {
        self.drivers = [0; 2].map(|_| Some(DriverChip::new(bus, 0)));
    }

    /// The driver of an axis, if it is set by wire.
    pub fn driver(&mut self, axis: Axis) -> Option<&mut DriverChip> {
        self.drivers[axis.index()].as_mut()
    }

    /// The quadrature ring of an axis, for what goes wrong with it.
    pub fn ring(&mut self, axis: Axis) -> &mut QuadratureRing {
        &mut self.rings[axis.index()]
    }

    /// The board has no pins for quadrature rings.
    pub fn take_quadrature_pins(&mut self) {
        self.has_quadrature_pins = false;
    }

    /// Whether the drivers were ever switched off, or not yet on, while the brakes were let go: nothing held
    /// the arm.
    pub fn was_let_fall(&self) -> bool {
        self.was_let_fall
    }

    /// Whether the brakes are let go, and whether the drivers have their current.
    pub fn brakes_and_drivers(&self) -> (bool, bool) {
        (self.brakes_released, self.drivers_on)
    }

    fn power_motors(&mut self) {
        self.was_let_fall |= self.brakes_released && !self.drivers_on;
        let axes = self.axes.iter_mut().zip(&self.drivers);
        for ((plant, driver), alarm_until_us) in axes.zip(self.alarm_until_us) {
            let has_alarm = self.now_us < alarm_until_us;
            let drives = driver.as_ref().is_none_or(DriverChip::drives);
            plant.let_turn(self.drivers_on && self.brakes_released && !has_alarm && drives);
        }
    }

    /// Outputs fall back to what they are without a controller.
    pub fn reset_outputs(&mut self) {
        self.has_fallen |= self.trigger;
        self.trigger = false;
        self.holds_interlock_open = false;
        self.drivers_on = false;
        self.brakes_released = false;
        self.answers = [None, None];
        self.rings.iter_mut().for_each(QuadratureRing::restart);
        self.steps = [0; 2].map(|_| VirtualTimer::at_rest(self.now_us));
    }
}

impl Hardware for SimulatedArm {
    fn queue_step(&mut self, axis: Axis, period: Period) {
        // The firmware queues only where there is room.
        let _ = self.steps[axis.index()].push(period);
    }

    fn progress(&mut self, axis: Axis) -> StepProgress {
        self.steps[axis.index()].progress()
    }

    fn halt(&mut self, axis: Axis) {
        self.steps[axis.index()].timer().now_ticks = self.now_us * TICKS_PER_US;
        self.steps[axis.index()].halt();
    }

    fn has_encoder(&self, _: Axis, kind: EncoderKind) -> bool {
        self.has_quadrature_pins || kind != EncoderKind::Quadrature
    }

    fn encoder_word(
        &mut self,
        axis: Axis,
        setup: EncoderSetup,
    ) -> Result<EncoderWord, EncoderLost> {
        let (now_us, i) = (self.now_us, axis.index());
        let plant = &mut self.axes[i];
        match setup.kind {
            EncoderKind::Ssi | EncoderKind::BissC => plant.encoder_word(now_us),
            EncoderKind::Quadrature => self.rings[i].word(setup.turn, plant, now_us),
        }
    }

    fn home_switch_closed(&mut self, axis: Axis) -> bool {
        let now_us = self.now_us;
        self.axes[axis.index()].switch_closed(now_us)
    }

    fn alarm_closed(&mut self, axis: Axis) -> bool {
        // Closed while all is well.
        self.now_us >= self.alarm_until_us[axis.index()]
    }

    fn has_driver_bus(&self, _: DriverBus) -> bool {
        true
    }

    fn ask_driver(
        &mut self,
        axis: Axis,
        bus: DriverBus,
        request: DriverBytes,
        answer_len: usize,
    ) -> bool {
        if self.answers.iter().any(Option::is_some) {
            return false;
        }
        let driver = self.drivers[axis.index()].as_mut();
        let (bytes, took_us) = match bus {
            DriverBus::OneWire => {
                let answer = driver.and_then(|driver| driver.one_wire(&request));
                (answer.unwrap_or_default(), ONE_WIRE_US)
            }
            DriverBus::Spi => (by_spi(driver, &request), 0),
        };
        let answer = if bytes.len() == answer_len {
            DriverAnswer::Bytes(bytes)
        } else {
            DriverAnswer::Silent
        };
        self.answers[axis.index()] = Some((self.now_us + took_us, answer));
        true
    }

    fn driver_answer(&mut self, axis: Axis, _: DriverBus) -> DriverAnswer {
        let now_us = self.now_us;
        let answer = self.answers[axis.index()].take_if(|(from_us, _)| *from_us <= now_us);
        answer.map_or(DriverAnswer::Waiting, |(_, answer)| answer)
    }

    fn switch_drivers(&mut self, on: bool) {
        self.drivers_on = on;
        self.power_motors();
    }

    fn release_brakes(&mut self, released: bool) {
        self.brakes_released = released;
        self.power_motors();
    }

    fn interlock_closed(&mut self) -> bool {
        self.interlock_closed && !self.holds_interlock_open
    }

    fn hold_interlock_open(&mut self, open: bool) {
        self.holds_interlock_open = open;
    }

    fn begin_pulse(&mut self, now_us: u64, length_us: u32) -> u64 {
        if !self.trigger {
            self.rising_edges += 1;
        }
        self.trigger = true;
        self.pulse_ends_us = now_us + u64::from(length_us);
        now_us
    }

    fn end_pulse(&mut self) {
        self.has_fallen |= self.trigger;
        self.trigger = false;
    }

    fn save_settings(&mut self, bytes: &[u8]) -> Result<(), NotSaved> {
        self.store.save(&mut self.flash, bytes)
    }
}

/// Datagrams one after the other, and what comes back: ones, where there is no chip.
fn by_spi(mut driver: Option<&mut DriverChip>, request: &[u8]) -> DriverBytes {
    let (datagrams, _) = request.as_chunks::<{ tmc5160::DATAGRAM_LEN }>();
    let answers = datagrams.iter().map(|&datagram| match &mut driver {
        Some(driver) => driver.spi(datagram),
        None => [0xFF; tmc5160::DATAGRAM_LEN],
    });
    answers.flatten().collect()
}

impl Sectors for RamFlash {
    fn slots(&self) -> usize {
        1
    }

    fn read(&mut self, sector: usize, _: usize, out: &mut [u8]) -> Result<(), NotSaved> {
        let from = self.sectors.get(sector).ok_or(NotSaved)?;
        out.copy_from_slice(from.get(..out.len()).ok_or(NotSaved)?);
        Ok(())
    }

    fn erase(&mut self, sector: usize) -> Result<(), NotSaved> {
        self.sectors.get_mut(sector).ok_or(NotSaved)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, sector: usize, _: usize, bytes: &[u8]) -> Result<(), NotSaved> {
        let dies_after = self.dies_after.take();
        let written = dies_after.map_or(bytes, |n| &bytes[..n.min(bytes.len())]);
        let to = self.sectors.get_mut(sector).ok_or(NotSaved)?;
        let to = to.get_mut(..written.len()).ok_or(NotSaved)?;
        to.copy_from_slice(written);
        self.has_died |= dies_after.is_some();
        if dies_after.is_some() {
            Err(NotSaved)
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use gonia_firmware::axis::AxisDrive;
    use gonia_firmware::profile::{Profile, Ramp};
    use gonia_firmware::settings::ControllerSettings;

    use super::*;

    /// What docs/src/guides/arms.md calls the highest step rate.
    const STEPS_S: u64 = 50_000;
    /// A control tick of 2 ms, and a main loop that is half a millisecond late every time.
    const LATE_TICK_US: u64 = 2_500;

    #[test]
    fn both_axes_keep_their_profile_at_the_highest_step_rate() {
        let ramp = Ramp::new(STEPS_S * 2_500, 300_000_000, 50_000, 144_000);
        let steps = 60_000;
        let mut profile = Profile::new(steps, ramp).unwrap();
        let mut ticks = u64::from(profile.interval());
        let mut fastest = u32::MAX;
        while profile.advance() {
            ticks += u64::from(profile.interval());
            fastest = fastest.min(profile.interval());
        }
        assert_eq!(u64::from(fastest), 1_000_000 * TICKS_PER_US / STEPS_S);

        let mut arm = SimulatedArm::default_arm(1);
        let settings = ControllerSettings::default();
        let mut drives = Axis::BOTH.map(|axis| AxisDrive::new(axis, &settings));
        for drive in &mut drives {
            drive.run(i64::from(steps), ramp);
        }
        let mut now_us = 0;
        while drives.iter().any(AxisDrive::is_moving) {
            for drive in &mut drives {
                drive.feed(&mut arm);
                drive.take_progress(&mut arm);
            }
            now_us += LATE_TICK_US;
            arm.set_now(now_us);
            for drive in &mut drives {
                drive.take_progress(&mut arm);
            }
        }
        let late_us = now_us - ticks / TICKS_PER_US;
        assert!(late_us < 2 * LATE_TICK_US, "{late_us}");
        for axis in Axis::BOTH {
            assert_eq!(arm.progress(axis).given, steps as i32);
        }
    }
}
