//! One axis as a machine: stepper, worm gear, shaft, ring encoder, home switch.
//!
//! The motor is moved by events (a step at a time); everything else is a function of time, worked
//! out when it is read. So an axis at rest costs nothing.
//!
//! Effects and where they sit:
//! step → *lost magnetic cycles* → motor → *gear error, backlash* → shaft → *ringing* → true angle
//! → *eccentricity, noise, counts* → encoder.

use core::f64::consts::TAU;

use gonia_firmware::hardware::{EncoderLost, EncoderWord};
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::swing::Swing;

/// What an axis is made of. Angles of the shaft in µdeg.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantConfig {
    /// Driver steps a turn of the shaft.
    pub steps_per_turn: u32,
    /// Driver steps of one magnetic cycle: four full steps. Steps are only ever lost by whole cycles.
    pub steps_per_cycle: u32,
    /// Above this rate the motor has no torque left, steps/s.
    pub pull_out_steps_s: f64,
    /// The largest change of rate from one step to the next that the rotor follows, steps/s.
    pub pull_in_steps_s: f64,
    /// Play of the gear.
    pub backlash_udeg: f64,
    /// Amplitude of the gear's error, periodic in the worm's turn.
    pub gear_error_udeg: f64,
    /// The worm's turn at the shaft.
    pub worm_turn_udeg: f64,
    /// Amplitude of the motor's deviation between full steps, periodic in the magnetic cycle.
    pub microstep_error_udeg: f64,
    /// Frequency at which the arm swings on its gear, Hz; 0 for a stiff arm.
    pub ring_hz: f64,
    /// Time in which the swing falls to 1/e, s.
    pub ring_decay_s: f64,
    /// Encoder counts a turn.
    pub encoder_counts: u32,
    /// The count at which the index of a quadrature ring is high.
    pub encoder_index: u32,
    /// Standard deviation of a reading.
    pub encoder_noise_udeg: f64,
    /// Amplitude of the encoder's error, periodic in the turn: the ring's eccentricity.
    pub eccentricity_udeg: f64,
    /// Where that error is zero.
    pub eccentricity_phase_udeg: f64,
    /// The home switch works at this angle, coming from above.
    pub home_udeg: f64,
    /// Where else it works.
    pub home_cam: HomeCam,
    /// The contact of the home switch opens at home: normally closed.
    pub home_opens: bool,
    /// How long the switch chatters after it changes, µs.
    pub bounce_us: u64,
    /// Where the shaft stands at first.
    pub start_udeg: f64,
}

/// What the home switch runs on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomeCam {
    /// A dog that the axis takes along over its whole travel: at home it works the switch, and everywhere below.
    Below,
    /// A cam on the shaft: it works the switch over so much, and so once every turn.
    EveryTurn {
        /// How wide it is, µdeg.
        width_udeg: f64,
    },
}

impl HomeCam {
    /// Whether it works the switch of an axis that stands so far above home, µdeg.
    fn works(self, above_home_udeg: f64) -> bool {
        match self {
            HomeCam::Below => above_home_udeg <= 0.0,
            HomeCam::EveryTurn { width_udeg } => {
                let below_udeg = -above_home_udeg;
                below_udeg - 360e6 * libm::floor(below_udeg / 360e6) <= width_udeg
            }
        }
    }
}

impl PlantConfig {
    /// The axis that the default settings are made for (see `gonia_protocol::settings`): 1.8°
    /// motor, 8 microsteps, 90:1 worm, 18-bit ring encoder.
    ///
    /// Play 0.015° and gear error ±0.003° are those of a good worm stage (54 and 11 arc seconds).
    /// The arm swings at 10 Hz, as one of 10 kg·m² does on a gear of 40 kN·m/rad, and 8 % damping let
    /// it die down in 0.2 s; 90°/s² bend it by 90/(2π·10)² = 0.023°. Pull-out at 600 rpm of the
    /// motor. Noise of half a count, and 0.004° of eccentricity left after calibration, which a
    /// 70 mm ring has at 2.5 µm off centre.
    pub fn worm_axis(home_udeg: f64, start_udeg: f64) -> Self {
        Self {
            steps_per_turn: 144_000,
            steps_per_cycle: 32,
            pull_out_steps_s: 16_000.0,
            pull_in_steps_s: 1_200.0,
            backlash_udeg: 15_000.0,
            gear_error_udeg: 3_000.0,
            worm_turn_udeg: 4e6,
            microstep_error_udeg: 400.0,
            ring_hz: 10.0,
            ring_decay_s: 0.2,
            encoder_counts: 1 << 18,
            encoder_index: 0,
            encoder_noise_udeg: 700.0,
            eccentricity_udeg: 4_000.0,
            eccentricity_phase_udeg: 0.0,
            home_udeg,
            home_cam: HomeCam::Below,
            home_opens: true,
            bounce_us: 3_000,
            start_udeg,
        }
    }

    /// The same without what comes by chance or dies down with time: where it stands follows from its
    /// steps alone, whenever it is read.
    pub fn quiet(self) -> Self {
        Self {
            ring_hz: 0.0,
            encoder_noise_udeg: 0.0,
            bounce_us: 0,
            ..self
        }
    }
}

/// What an encoder says of itself beside its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderSays {
    /// All is well.
    Nothing,
    /// It is near its limits.
    Warning,
    /// The position is not valid.
    Error,
}

/// One axis in motion.
#[derive(Debug)]
pub struct AxisPlant {
    config: PlantConfig,
    rng: Xoshiro256PlusPlus,
    step_udeg: f64,
    motor_udeg: f64,
    output_udeg: f64,
    /// Shaft against gear: what a slip or a knock has left.
    slipped_udeg: f64,
    /// Steps/s of the last step, signed.
    rate: f64,
    swing: Swing,
    last_step_us: u64,
    at_home: bool,
    switch_chatters_until_us: u64,
    stalled_until_us: u64,
    encoder_lost_until_us: u64,
    encoder_says: EncoderSays,
    encoder_offset_udeg: f64,
    extra_noise_udeg: f64,
    noisy_until_us: u64,
    switch_stuck: Option<bool>,
    switch_is_cut: bool,
    /// The motor has its current, and no brake holds it.
    can_turn: bool,
    lost_cycles: u32,
}

impl AxisPlant {
    /// An axis at rest. The same seed gives the same noise.
    pub fn new(config: PlantConfig, seed: u64) -> Self {
        Self {
            rng: Xoshiro256PlusPlus::seed_from_u64(seed),
            step_udeg: 360e6 / f64::from(config.steps_per_turn.max(1)),
            motor_udeg: config.start_udeg,
            output_udeg: config.start_udeg,
            slipped_udeg: 0.0,
            rate: 0.0,
            swing: Swing::new(config.ring_hz, config.ring_decay_s),
            last_step_us: 0,
            at_home: config.home_cam.works(config.start_udeg - config.home_udeg),
            switch_chatters_until_us: 0,
            stalled_until_us: 0,
            encoder_lost_until_us: 0,
            encoder_says: EncoderSays::Nothing,
            encoder_offset_udeg: 0.0,
            extra_noise_udeg: 0.0,
            noisy_until_us: 0,
            switch_stuck: None,
            switch_is_cut: false,
            can_turn: true,
            lost_cycles: 0,
            config,
        }
    }

    /// What it is made of.
    pub fn config(&self) -> &PlantConfig {
        &self.config
    }

    /// The driver gets a step.
    pub fn step(&mut self, forward: bool, at_us: u64) {
        let direction = if forward { 1.0 } else { -1.0 };
        let interval_us = (at_us.saturating_sub(self.last_step_us)).max(1);
        self.last_step_us = at_us;
        if at_us < self.stalled_until_us || !self.can_turn {
            return;
        }
        let rate = direction * 1e6 / interval_us as f64;
        let jump = libm::fabs(rate - self.rate);
        self.rate = rate;
        self.swing.step(direction * self.step_udeg, at_us);
        if jump > self.config.pull_in_steps_s && libm::fabs(rate) > self.config.pull_in_steps_s
            || libm::fabs(rate) > self.config.pull_out_steps_s
        {
            self.lose_cycles(direction as i32);
        }
        self.motor_udeg += direction * self.step_udeg;
        self.pull_output();
    }

    /// The true angle of the shaft, µdeg.
    pub fn true_udeg(&self, now_us: u64) -> f64 {
        let config = &self.config;
        let cycle_udeg = self.step_udeg * f64::from(config.steps_per_cycle);
        let motor = self.motor_udeg;
        let gear = config.gear_error_udeg * libm::sin(TAU * (motor / config.worm_turn_udeg))
            + config.microstep_error_udeg * libm::sin(TAU * (motor / cycle_udeg));
        self.output_udeg + self.slipped_udeg + gear + self.swing.udeg(now_us)
    }

    /// The encoder's reading, in counts of one turn; `None` when it does not answer.
    pub fn encoder_counts(&mut self, now_us: u64) -> Option<u32> {
        if now_us < self.encoder_lost_until_us {
            return None;
        }
        let shaft = self.true_udeg(now_us);
        let noisy = now_us < self.noisy_until_us;
        let extra_noise_udeg = if noisy { self.extra_noise_udeg } else { 0.0 };
        let config = &self.config;
        let phase = TAU * ((shaft - config.eccentricity_phase_udeg) / 360e6);
        let seen = shaft
            + config.eccentricity_udeg * libm::sin(phase)
            + libm::hypot(config.encoder_noise_udeg, extra_noise_udeg) * gaussian(&mut self.rng)
            + self.encoder_offset_udeg;
        let counts = libm::floor(seen * f64::from(config.encoder_counts) / 360e6 + 0.5);
        Some((counts as i64).rem_euclid(i64::from(config.encoder_counts)) as u32)
    }

    /// What the encoder says, with its error and warning bits.
    pub fn encoder_word(&mut self, now_us: u64) -> Result<EncoderWord, EncoderLost> {
        let counts = self.encoder_counts(now_us).ok_or(EncoderLost::Silent)?;
        match self.encoder_says {
            EncoderSays::Nothing => Ok(counts.into()),
            EncoderSays::Warning => Ok(EncoderWord {
                warns: true,
                ..counts.into()
            }),
            EncoderSays::Error => Err(EncoderLost::Invalid),
        }
    }

    /// The encoder's error or warning bit is set from now on, or neither.
    pub fn let_encoder_say(&mut self, says: EncoderSays) {
        self.encoder_says = says;
    }

    /// Whether the contact of the home switch is closed.
    pub fn switch_closed(&mut self, now_us: u64) -> bool {
        if self.switch_is_cut {
            return false;
        }
        if let Some(stuck) = self.switch_stuck {
            return stuck != self.config.home_opens;
        }
        let stands_udeg = self.output_udeg + self.slipped_udeg;
        let at_home = self
            .config
            .home_cam
            .works(stands_udeg - self.config.home_udeg);
        if at_home != self.at_home {
            self.at_home = at_home;
            self.switch_chatters_until_us = now_us + self.config.bounce_us;
        }
        if now_us < self.switch_chatters_until_us {
            self.rng.next_u32() & 1 == 0
        } else {
            at_home != self.config.home_opens
        }
    }

    /// The motor falls back by magnetic cycles: positive ones cost way upwards.
    pub fn lose_cycles(&mut self, cycles: i32) {
        let cycle_udeg = self.step_udeg * f64::from(self.config.steps_per_cycle);
        self.lost_cycles += cycles.unsigned_abs();
        self.motor_udeg -= f64::from(cycles) * cycle_udeg;
        self.pull_output();
    }

    /// Cycles lost so far.
    pub fn lost_cycles(&self) -> u32 {
        self.lost_cycles
    }

    /// The motor turns no more until then.
    pub fn stall_until(&mut self, until_us: u64) {
        self.stalled_until_us = until_us;
    }

    /// The encoder does not answer until then.
    pub fn lose_encoder_until(&mut self, until_us: u64) {
        self.encoder_lost_until_us = until_us;
    }

    /// The encoder is off by so much from now on.
    pub fn shift_encoder(&mut self, udeg: f64) {
        self.encoder_offset_udeg += udeg;
    }

    /// The encoder's readings scatter by so much more until then.
    pub fn disturb_encoder_until(&mut self, until_us: u64, udeg: f64) {
        self.noisy_until_us = until_us;
        self.extra_noise_udeg = udeg;
    }

    /// From now on the switch chatters for so long whenever it changes.
    pub fn wear_switch(&mut self, bounce_us: u64) {
        self.config.bounce_us = bounce_us;
    }

    /// The shaft slips against the gear, or is knocked.
    pub fn slip(&mut self, udeg: f64) {
        self.slipped_udeg += udeg;
    }

    /// The switch sticks as at home or as above it, or is let go.
    pub fn stick_switch(&mut self, at_home: Option<bool>) {
        self.switch_stuck = at_home;
    }

    /// The cable of the home switch is cut.
    pub fn cut_switch(&mut self) {
        self.switch_is_cut = true;
    }

    /// The motor has its current and no brake holds it, or one of both is not so: steps are lost then.
    pub fn let_turn(&mut self, can_turn: bool) {
        self.can_turn = can_turn;
    }

    /// A worm cannot be driven back: the shaft moves only when a flank of the gear pushes it.
    fn pull_output(&mut self) {
        let half = 0.5 * self.config.backlash_udeg;
        self.output_udeg = self
            .output_udeg
            .clamp(self.motor_udeg - half, self.motor_udeg + half);
    }
}

/// A number of mean 0 and variance 1, from four uniform ones of 16 bits: bell-shaped to ±3.4, which
/// is what an encoder's noise is.
fn gaussian(rng: &mut Xoshiro256PlusPlus) -> f64 {
    let bits = rng.next_u64();
    let sum = (0..4)
        .map(|i| (bits >> (16 * i)) as u16)
        .map(f64::from)
        .sum::<f64>();
    // Each has variance (2³²−1)/12.
    (sum - 2.0 * 65_535.0) * 2.642_936e-5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet() -> PlantConfig {
        PlantConfig {
            gear_error_udeg: 0.0,
            microstep_error_udeg: 0.0,
            eccentricity_udeg: 0.0,
            bounce_us: 3_000,
            ..PlantConfig::worm_axis(-5e6, 10e6).quiet()
        }
    }

    /// Steps at a constant, slow rate.
    fn walk(plant: &mut AxisPlant, steps: i32, from_us: u64) -> u64 {
        (0..steps.unsigned_abs()).fold(from_us, |t, _| {
            plant.step(steps > 0, t + 2000);
            t + 2000
        })
    }

    #[test]
    fn a_turn_back_first_takes_up_the_play() {
        let mut plant = AxisPlant::new(quiet(), 1);
        let t = walk(&mut plant, 400, 0);
        let up = plant.true_udeg(t);
        let t = walk(&mut plant, -6, t);
        assert_eq!(plant.true_udeg(t), up);
        let t = walk(&mut plant, -400, t);
        assert_eq!(plant.true_udeg(t), up - 400.0 * 2500.0);
    }

    #[test]
    fn a_start_that_is_too_fast_loses_whole_cycles() {
        let mut plant = AxisPlant::new(quiet(), 1);
        for i in 0..10 {
            plant.step(true, 1_000_000 + i * 200);
        }
        assert_eq!(plant.lost_cycles(), 1);
        let mut gentle = AxisPlant::new(quiet(), 1);
        walk(&mut gentle, 10, 1_000_000);
        assert_eq!(gentle.lost_cycles(), 0);
    }

    #[test]
    fn noise_is_the_seeds_and_of_the_stated_size() {
        let read = |seed| {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            (0..20_000).map(|_| gaussian(&mut rng)).collect::<Vec<_>>()
        };
        assert_eq!(read(3), read(3));
        let values = read(3);
        let mean = values.iter().sum::<f64>() / 20_000.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!(
            mean.abs() < 0.03 && (variance - 1.0).abs() < 0.03,
            "{mean} {variance}"
        );
    }

    #[test]
    fn eccentricity_parts_the_encoder_from_the_true_angle() {
        let config = PlantConfig {
            eccentricity_udeg: 50_000.0,
            start_udeg: 90e6,
            ..quiet()
        };
        let mut plant = AxisPlant::new(config, 1);
        let seen = f64::from(plant.encoder_counts(0).unwrap()) * 360e6 / f64::from(1 << 18);
        assert!((seen - plant.true_udeg(0) - 50_000.0).abs() < 700.0);
    }

    #[test]
    fn the_switch_chatters_and_then_holds() {
        let mut plant = AxisPlant::new(
            PlantConfig {
                start_udeg: -5e6 + 1.0,
                ..quiet()
            },
            1,
        );
        assert!(plant.switch_closed(10_000), "normally closed");
        let t = walk(&mut plant, -100, 10_000);
        let readings: Vec<bool> = (0..40).map(|i| plant.switch_closed(t + i * 100)).collect();
        assert!(readings.contains(&true) && readings[30..].iter().all(|&closed| !closed));
    }
}
