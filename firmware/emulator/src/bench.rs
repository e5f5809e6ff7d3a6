//! Pins and wires: what the chip's outputs do to the world, and the world to its inputs.

use std::sync::mpsc::{Receiver, Sender};

use gonia_pins::signals::{Signal, function};
use gonia_pins::{
    Board, CLOCK_TIMER, FLASH, FLASH_LEN, LIFE_TIMER, Level as Wanted, Pin as PinOf, SECTORS,
    STEP_TIMERS, StepEdge, TimerOutput,
};
use gonia_sim::quadrature::Levels;
use rigless::device::Level;
use rigless::emulator::{Access, AccessKind, Driver, Host, Settled, Stop};
use rigless::mcu::Operate;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::peripherals::gpio::{Gpio, Pin};
use rigless::soc::stm32f427::peripherals::tim::Channel;
use rigless::time::VirtualNanos;

use crate::chips::{Shared, lock};
use crate::nvic;
use crate::part::Bench;
use crate::world::Axis;

/// What the script asks of the chip's side while the clock stands.
#[derive(Debug)]
pub enum Command {
    /// Lets the time pass until then, ns.
    Run(u64),
    /// Stops the processor, or lets it go on; the rest of the chip is not asked.
    HoldCore(bool),
    /// The processor's next access here ends in a bus fault.
    Fail(u64),
    /// A register of a peripheral.
    Peek(u64),
    /// An interrupt in the core's NVIC, as [`nvic::Interrupt::to_word`] has it.
    Interrupt(usize),
    /// The other arm raises the trigger wire, or lets it go.
    TriggerIn(bool),
    /// The reset pin goes low and comes back.
    Reset,
    /// The run is over.
    End,
}

/// What drives an output of the chip, where its pin is given to it.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// The port's own register.
    Plain,
    /// Alternate function, general-purpose timer (TIM2 to TIM5 as 0 to 3), channel.
    Timer(u8, usize, u8),
    /// Alternate function, channel of TIM8, and whether it is the complementary output.
    Tim8(u8, u8, bool),
}

/// An output: its pin, what drives it, and the level at which what hangs on it is on.
#[derive(Clone, Copy, Debug)]
struct Output {
    pin: PinOf,
    source: Source,
    on: Level,
}

/// The outputs of a board.
#[derive(Debug)]
struct Outputs {
    steps: [Output; 2],
    directions: [Output; 2],
    enables: Vec<Output>,
    relay: Output,
    brakes: Option<Output>,
    trigger: Output,
    /// The drivers' lines, which are on while they are high.
    driver_lines: Vec<Output>,
}

impl Outputs {
    fn of(board: &Board) -> Self {
        let high = |pin, source| Output {
            pin,
            source,
            on: Level::High,
        };
        let [theta, phi] = board.axes;
        let step = |i: usize, axis: gonia_pins::Axis| match axis.edge {
            StepEdge::Timer(channel) => {
                high(axis.step.pin, timer(axis.step.pin, STEP_TIMERS[i], channel))
            }
            StepEdge::Interrupt => high(axis.step.pin, Source::Plain),
        };
        let out = board.trigger_out;
        let of_tim8 = |output: TimerOutput| {
            let signal = if output.is_complementary {
                Signal::TimerComplement(LIFE_TIMER, output.channel)
            } else {
                Signal::Timer(LIFE_TIMER, output.channel)
            };
            let given = function(output.wire.pin, signal).unwrap_or(0);
            let source = Source::Tim8(given, output.channel, output.is_complementary);
            high(output.wire.pin, source)
        };
        let enables = board.enables.iter().map(|enable| Output {
            pin: enable.wire.pin,
            source: Source::Plain,
            on: match enable.on {
                Wanted::High => Level::High,
                Wanted::Low => Level::Low,
            },
        });
        Self {
            steps: [step(0, theta), step(1, phi)],
            directions: [theta, phi].map(|axis| high(axis.direction.pin, Source::Plain)),
            enables: enables.collect(),
            relay: of_tim8(board.relay),
            brakes: board.brakes.map(of_tim8),
            driver_lines: board
                .drivers
                .iter()
                .flat_map(|drivers| drivers.lines)
                .map(|line| high(line.pin, Source::Plain))
                .collect(),
            trigger: high(out.wire.pin, timer(out.wire.pin, CLOCK_TIMER, out.channel)),
        }
    }
}

fn timer(pin: PinOf, timer: u8, channel: u8) -> Source {
    let given = function(pin, Signal::Timer(timer, channel)).unwrap_or(0);
    Source::Timer(given, usize::from(timer) - 2, channel)
}

const TIM2: usize = 0;
const TIM3: usize = 1;
const TIM4: usize = 2;
const TIM5: usize = 3;
/// TIM8 among the advanced timers.
const TIM8: usize = 1;

/// Which internal trigger of a timer is which (RM0390, tables of TIMx_SMCR): TIM8 gates TIM2 and TIM5,
/// TIM3 clocks TIM4.
const ITR_TIM8_OF_TIM2: u8 = 1;
const ITR_TIM8_OF_TIM5: u8 = 3;
const ITR_TIM3_OF_TIM4: u8 = 2;

const GPIO: core::ops::Range<u64> = 0x4002_0000..0x4002_2C00;
const TIMERS: core::ops::Range<u64> = 0x4000_0000..0x4000_1000;
const ADVANCED_TIMERS: core::ops::Range<u64> = 0x4001_0000..0x4001_0800;
/// CR1 of SPI1 to SPI4, and whether it is on APB2.
const SPI_CR1: [(u64, bool); 4] = [
    (0x4001_3000, true),
    (0x4000_3800, false),
    (0x4000_3C00, false),
    (0x4001_3400, true),
];
const FLASH_CR: u64 = 0x4002_3C10;
const FLASH_SR: u64 = 0x4002_3C0C;
const STRT: u64 = 1 << 16;
const SER: u64 = 1 << 1;
const BSY: u32 = 1 << 16;

/// The chip's side of the run.
pub struct Wiring {
    /// What it is wired to.
    pub world: Shared,
    /// From the script.
    pub commands: Receiver<Command>,
    /// To the script: the clock stands, with the value that was asked for.
    pub done: Sender<u32>,
    board: &'static Board,
    outputs: Outputs,
    state: State,
    /// The script's next instant, which one of the wires may come before.
    until_ns: u64,
}

/// Levels as they were last seen or driven.
#[derive(Debug, Default)]
struct State {
    has_resistors: bool,
    steps: [bool; 2],
    trigger: bool,
    gate: Option<Level>,
    time_pulses: u64,
    inputs: [Option<Level>; 5],
    waves: [Option<Levels>; 2],
    resets: usize,
    is_erasing: bool,
    core_is_held: bool,
}

impl Wiring {
    /// Wires a chip up.
    pub fn new(
        board: &'static Board,
        world: Shared,
        commands: Receiver<Command>,
        done: Sender<u32>,
    ) -> Self {
        Self {
            world,
            commands,
            done,
            board,
            outputs: Outputs::of(board),
            state: State::default(),
            until_ns: 0,
        }
    }

    /// After anything that may have changed an output.
    fn look(&mut self, chip: &mut Stm32f427, at: VirtualNanos) {
        self.link_timers(chip, at);
        if !self.state.has_resistors {
            self.state.has_resistors = true;
            self.board.for_each_use(|this| {
                let level = this
                    .resistor
                    .map(|level| Level::from(level == Wanted::High));
                if level.is_some() {
                    drive(chip, at, this.wire.pin, level);
                }
            });
        }
        let mut world = lock(&self.world);
        world.now_ns = at.0;
        let outputs = &self.outputs;
        let enabled = outputs.enables.iter().all(|&enable| is_on(chip, enable));
        let released = outputs.brakes.is_none_or(|brakes| is_on(chip, brakes));
        world.see_power(enabled, released);
        for i in 0..2 {
            let up = is_on(chip, outputs.directions[i]);
            let axis = &mut world.axes[i];
            if up != axis.up {
                axis.up = up;
                axis.turned_ns = at.0;
            }
            let step = is_on(chip, outputs.steps[i]);
            match (self.state.steps[i], step) {
                (false, true) => axis.step(at.0),
                (true, false) => axis.fall(at.0),
                _ => {}
            }
            self.state.steps[i] = step;
        }
        let trigger = is_on(chip, outputs.trigger);
        if trigger != self.state.trigger {
            world.trigger.push((at.0, trigger));
            self.state.trigger = trigger;
        }
        for (axis, line) in world.axes.iter_mut().zip(&outputs.driver_lines) {
            let is_high = is_on(chip, *line);
            axis.select(!is_high);
            let Some(wire) = &mut axis.driver else {
                continue;
            };
            wire.see(is_high, at.0);
            let (pulled, pulls) = (wire.pulls(), wire.poll(at.0));
            if pulls != pulled {
                drive(chip, at, line.pin, pulls.then_some(Level::Low));
            }
        }
        world.relay.energise(is_on(chip, outputs.relay), at.0);
        let now_us = at.0 / 1000;
        let switches = [0, 1].map(|i| world.axes[i].plant.switch_closed(now_us));
        let alarms = [0, 1].map(|i| world.axes[i].alarm_closed);
        let closed = world.chain_is_closed();
        let waves = [0, 1].map(|i| world.axes[i].levels(at.0));
        drop(world);
        self.show_waves(chip, at, waves);
        let [theta, phi] = self.board.axes;
        let mut inputs = vec![
            (theta.home_switch.pin, switches[0]),
            (phi.home_switch.pin, switches[1]),
            (self.board.interlock.pin, closed),
        ];
        let wires = self.board.alarms.iter().flatten();
        inputs.extend(wires.zip(alarms).map(|(wire, closed)| (wire.pin, closed)));
        for (known, (pin, closed)) in self.state.inputs.iter_mut().zip(inputs) {
            // A closed contact leads to ground; an open one leaves the pin to its pull-up.
            let drives = closed.then_some(Level::Low);
            if *known != Some(Level::from(!closed)) {
                *known = Some(Level::from(!closed));
                drive(chip, at, pin, drives);
            }
        }
    }

    /// The line receivers of quadrature rings.
    fn show_waves(&mut self, chip: &mut Stm32f427, at: VirtualNanos, waves: [Option<Levels>; 2]) {
        for (i, axis) in self.board.axes.iter().enumerate() {
            let (Some(wires), Some(levels)) = (axis.quadrature, waves[i]) else {
                continue;
            };
            if self.state.waves[i].replace(levels) == Some(levels) {
                continue;
            }
            let pins = [wires.first.pin, wires.second.pin, wires.index.pin];
            for (pin, level) in pins.into_iter().zip(levels) {
                drive(chip, at, pin, Some(Level::from(level)));
            }
        }
    }

    /// Triggers from timer to timer, which the chip wires inside.
    fn link_timers(&mut self, chip: &mut Stm32f427, at: VirtualNanos) {
        let (gate, _) = chip.advanced_timer(TIM8).0.trigger_output();
        if self.state.gate != Some(gate) {
            self.state.gate = Some(gate);
            for (timer, itr) in [(TIM2, ITR_TIM8_OF_TIM2), (TIM5, ITR_TIM8_OF_TIM5)] {
                chip.drive_timer(at, timer, |tim, registers, context| {
                    tim.drive_internal_trigger(itr, gate, registers, context);
                });
            }
        }
        let (_, pulses) = chip.timer(TIM3).0.trigger_output();
        let new = pulses.saturating_sub(self.state.time_pulses);
        self.state.time_pulses = pulses;
        for _ in 0..new {
            for edge in [Level::High, Level::Low] {
                chip.drive_timer(at, TIM4, |tim, registers, context| {
                    tim.drive_internal_trigger(ITR_TIM3_OF_TIM4, edge, registers, context);
                });
            }
        }
    }

    /// A write that means something outside the chip.
    fn take_write(&mut self, session: &mut Session<Bench>, host: &mut dyn Host, access: &Access) {
        let chip = &mut session.board_mut().chip;
        for (i, axis) in self.board.axes.iter().enumerate() {
            let (cr1, is_fast) = SPI_CR1[usize::from(axis.encoder.spi) - 1];
            if cr1 == access.address {
                let divider = 2u64 << (access.value >> 3 & 7);
                let hz = self.board.crystal.hz;
                let bus = if is_fast {
                    pclk2(chip, hz)
                } else {
                    pclk1(chip, hz)
                };
                lock(&self.world).axes[i].ssi_hz = bus as f64 / divider as f64;
            }
        }
        if access.address == FLASH_CR && access.value & STRT != 0 && access.value & SER != 0 {
            erase(host, (access.value >> 3 & 0xF) as usize);
            lock(&self.world).erases += 1;
            // The processor fetches from the flash that is being erased: it waits.
            self.state.is_erasing = true;
            host.hold(true);
        }
        let flash = u64::from(FLASH)..u64::from(FLASH + FLASH_LEN);
        if flash.contains(&access.address) {
            program(host, access);
        }
    }

    fn after_stop(&mut self, session: &mut Session<Bench>, host: &mut dyn Host, at: VirtualNanos) {
        let resets = session.resets().len();
        if resets != self.state.resets {
            for reset in &session.resets()[self.state.resets..] {
                let cause = format!("{:?}", reset.cause);
                lock(&self.world).resets.push((reset.at.0, cause));
            }
            self.state = State {
                resets,
                core_is_held: self.state.core_is_held,
                ..State::default()
            };
            // An erase that was under way is no more.
            host.hold(self.state.core_is_held);
        }
        let chip = &mut session.board_mut().chip;
        if self.state.is_erasing && peek(chip, at, FLASH_SR) & BSY == 0 {
            self.state.is_erasing = false;
            host.hold(self.state.core_is_held);
        }
    }
}

impl Driver<Bench> for Wiring {
    fn on_settled(&mut self, session: &mut Session<Bench>, host: &mut dyn Host, settled: Settled) {
        match settled {
            Settled::Access { access, .. } => {
                if access.kind == AccessKind::Write {
                    self.take_write(session, host, &access);
                }
                let ranges = [GPIO, TIMERS, ADVANCED_TIMERS];
                if access.kind == AccessKind::Write
                    && ranges.iter().any(|range| range.contains(&access.address))
                {
                    self.look(&mut session.board_mut().chip, access.virtual_time);
                }
            }
            Settled::Stop(stop) => {
                self.after_stop(session, host, stop.at);
                self.look(&mut session.board_mut().chip, stop.at);
            }
            _ => {}
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Bench>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let due = |world: &Shared| {
            let world = lock(world);
            let due = world.axes.iter().filter_map(Axis::due_ns);
            due.min().unwrap_or(u64::MAX)
        };
        if stop.at.0 < self.until_ns {
            let next_ns = self.until_ns.min(due(&self.world));
            return Some(VirtualNanos(next_ns.max(stop.at.0 + 1)));
        }
        let mut answer = 0;
        loop {
            // The script has gone: so does the run.
            self.done.send(answer).ok()?;
            answer = 0;
            match self.commands.recv().ok()? {
                Command::Run(until) => {
                    self.until_ns = until;
                    let next_ns = until.min(due(&self.world));
                    return Some(VirtualNanos(next_ns.max(stop.at.0 + 1)));
                }
                Command::HoldCore(held) => {
                    self.state.core_is_held = held;
                    host.hold(held);
                }
                Command::Fail(address) => session.fail_next(address, address + 4),
                Command::Peek(address) => {
                    answer = peek(&mut session.board_mut().chip, stop.at, address);
                }
                Command::Interrupt(number) => {
                    let lines = Operate::cpu(&session.board_mut().chip).interrupt_lines;
                    let state = host.save_state().unwrap_or_default();
                    let found = nvic::find(&state, usize::from(lines), number);
                    answer = found.map_or(u32::MAX, nvic::Interrupt::to_word);
                }
                Command::TriggerIn(high) => {
                    let chip = &mut session.board_mut().chip;
                    let input = self.board.trigger_in;
                    drive(chip, stop.at, input.wire.pin, Some(Level::from(high)));
                    if let Some(channel) = Channel::new(input.channel) {
                        chip.drive_timer(stop.at, TIM3, |tim, registers, context| {
                            tim.drive_input(channel, Level::from(high), registers, context);
                        });
                    }
                }
                Command::Reset => {
                    session.reset_by_pin(stop.at, stop.instruction_count, host);
                }
                Command::End => return None,
            }
        }
    }
}

/// Whether what hangs on an output is on.
fn is_on(chip: &mut Stm32f427, output: Output) -> bool {
    let Output { pin, source, on } = output;
    let (port, number) = (usize::from(pin.port_index()), Pin::new(pin.number));
    let (gpio, registers) = chip.port(port);
    let plain = number.map(|pin| gpio.level(pin, registers));
    let given = number.and_then(|pin| Gpio::function(pin, registers));
    let level = match source {
        Source::Plain => plain,
        Source::Timer(function, timer, channel) => {
            let (tim, registers) = chip.timer(timer);
            let level = Channel::new(channel).and_then(|channel| tim.output(channel, registers));
            level.filter(|_| given == Some(function))
        }
        Source::Tim8(function, channel, is_complementary) => {
            let (tim, registers) = chip.advanced_timer(TIM8);
            let level = Channel::new(channel).and_then(|channel| {
                if is_complementary {
                    tim.complementary_output(channel, registers)
                } else {
                    tim.output(channel, registers)
                }
            });
            level.filter(|_| given == Some(function))
        }
    };
    level == Some(on)
}

fn drive(chip: &mut Stm32f427, at: VirtualNanos, pin: PinOf, level: Option<Level>) {
    let port = usize::from(pin.port_index());
    let Some(pin) = Pin::new(pin.number) else {
        return;
    };
    chip.drive_port(at, port, |gpio, registers, context| {
        gpio.drive(pin, level, registers, context);
    });
}

fn peek(chip: &mut Stm32f427, at: VirtualNanos, address: u64) -> u32 {
    let value = Operate::peek(chip, at, address, Width::W32);
    value.unwrap_or_default() as u32
}

/// Clock of the AHB by the clock tree's registers (RM0390, 6.3.2 and 6.3.3), Hz.
fn hclk(chip: &mut Stm32f427, crystal_hz: u32) -> u64 {
    let crystal = u64::from(crystal_hz);
    let at = VirtualNanos(0);
    let (pll, cfgr) = (peek(chip, at, 0x4002_3804), peek(chip, at, 0x4002_3808));
    let (m, n, p) = (pll & 0x3F, pll >> 6 & 0x1FF, 2 * ((pll >> 16 & 3) + 1));
    let system = match cfgr >> 2 & 3 {
        0 => 16_000_000,
        1 => crystal,
        _ => crystal / u64::from(m.max(1)) * u64::from(n) / u64::from(p),
    };
    let ahb = cfgr >> 4 & 0xF;
    let shift = [0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 6, 7, 8, 9][ahb as usize];
    system >> shift
}

fn apb_shift(field: u32) -> u32 {
    if field & 4 == 0 { 0 } else { (field & 3) + 1 }
}

fn pclk1(chip: &mut Stm32f427, crystal_hz: u32) -> u64 {
    let shift = apb_shift(peek(chip, VirtualNanos(0), 0x4002_3808) >> 10 & 7);
    hclk(chip, crystal_hz) >> shift
}

fn pclk2(chip: &mut Stm32f427, crystal_hz: u32) -> u64 {
    let shift = apb_shift(peek(chip, VirtualNanos(0), 0x4002_3808) >> 13 & 7);
    hclk(chip, crystal_hz) >> shift
}

/// A sector becomes ones.
fn erase(host: &mut dyn Host, sector: usize) {
    let from = FLASH + SECTORS.iter().take(sector).sum::<u32>();
    let length = SECTORS.get(sector).copied().unwrap_or(0);
    for at in (u64::from(from)..u64::from(from + length)).step_by(4) {
        // Whatever this image's map lacks is not erased, and shows as such when it is read.
        let _ = host.program(at, Width::W32, u64::from(u32::MAX));
    }
}

/// A store to flash: bits go from one to zero, never back.
fn program(host: &mut dyn Host, access: &Access) {
    let Ok(old) = host.read(access.address, access.width) else {
        return;
    };
    let _ = host.program(access.address, access.width, old & access.value);
}
