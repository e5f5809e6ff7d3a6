//! The chip and what its board fits.
//!
//! The chip is rigless's STM32F427: its clock tree, timers, SPI, USART, flash interface and watchdog are
//! the F446's too, and are written from the reference manual register by register. What it lacks and this
//! image does not need stays as plain registers (EXTI, SYSCFG, RCC_DCKCFGR2).

use std::num::{NonZeroU32, NonZeroU64};

use anyhow::Result;
use gonia_pins::{Board as Pins, FLASH, FLASH_LEN};
use rigless::cpu::armv7m::windows;
use rigless::machine::{Board, Crystal, Supply, Target, armv7m};
use rigless::mcu::{Bare, Mcu, Operate};
use rigless::snapshot::Store;
use rigless::soc::stm32f427::{CPU, Stm32f427};
use rigless::soc::{Bus, Region};

/// The F446's memory: its flash can be programmed, which rigless's own map of the F427 leaves out.
static MEMORY: [Region; 3] = [
    Region::flash("flash", FLASH as u64, FLASH_LEN as u64)
        .erased_to(0xFF)
        .programmed_by("FLASH"),
    Region::system("system", 0x1FFF_0000, 32 << 10),
    Region::ram("sram", 0x2000_0000, 128 << 10),
];

/// Instructions a second at 168 MHz: one and a half cycles each, which the caches leave of five wait
/// states at worst for code like this.
const INSTRUCTIONS_S: u64 = 112_000_000;
const CLOCK_HZ: u64 = 168_000_000;
const RAIL_MV: u32 = 3_300;

/// The board: a chip, its crystal, its rail.
#[derive(Debug)]
pub struct Bench {
    /// The chip.
    pub chip: Stm32f427,
    /// The same peripherals over the memory that the core gets.
    map: Bare,
}

impl Bench {
    /// A chip that has just got its power, with nothing on its pins.
    pub fn new(of: &Pins) -> Result<Self> {
        let mut chip = Stm32f427::new()?;
        let crystal_hz = u64::from(of.crystal.hz);
        chip.rcc.attach_crystals(crystal_hz, Crystal::NONE.0);
        chip.set_supply(Supply(RAIL_MV).0);
        let peripherals: Vec<_> = chip.bus().peripherals().copied().collect();
        let map = Bare::new(Bus::builder(CPU, &MEMORY, peripherals))?;
        Ok(Self { chip, map })
    }
}

// No run here starts from a snapshot.
impl Store for Bench {}

impl Board for Bench {
    fn name(&self) -> &'static str {
        "gonia-arm"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["stm32f446"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.chip)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let lines = Operate::cpu(&self.chip).interrupt_lines;
        let core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: positive(CLOCK_HZ),
            interrupt_lines: NonZeroU32::new(u32::from(lines)).unwrap_or(NonZeroU32::MIN),
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).unwrap_or(NonZeroU32::MIN),
            instructions_per_second: positive(INSTRUCTIONS_S),
            boot: "flash",
        }
        .spec_with_parts(
            &windows(Mcu::bus(&self.chip)),
            armv7m::Fpu::FpV4Sp,
            armv7m::MpuRegions::Eight,
        );
        vec![Target::new("stm32f446", &mut self.map, core)]
    }
}

fn positive(value: u64) -> NonZeroU64 {
    NonZeroU64::new(value).unwrap_or(NonZeroU64::MIN)
}
