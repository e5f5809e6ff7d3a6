//! Registers after the start, against the reference manual (RM0390) and the data sheet of the F446.

use anyhow::{Context, Result, ensure};
use gonia_pins::Board;

use crate::bench::Command;
use crate::chips::lock;
use crate::nvic::Interrupt;
use crate::rig::Rig;

/// What a register must hold: name, address, the bits that count, their value, why.
type Expected = (&'static str, u64, u32, u32, &'static str);

/// The same on every board.
const EXPECTED: &[Expected] = &[
    (
        "RCC_CFGR",
        0x4002_3808,
        0xFCF3 & 0xFCFF,
        0x940A & 0xFCF3,
        "PLL; AHB / 1, APB1 / 4, APB2 / 2 (6.3.3)",
    ),
    (
        "FLASH_ACR",
        0x4002_3C00,
        0x70F,
        0x705,
        "5 wait states at 168 MHz, prefetch, caches (3.8.1)",
    ),
    (
        "FLASH_OPTCR",
        0x4002_3C14,
        0xC,
        0,
        "brown-out level 3: reset below 2.7 V, which 168 MHz and erasing by words need (2.6, 3.6.2)",
    ),
    (
        "TIM3_PSC",
        0x4000_0428,
        0xFFFF,
        83,
        "84 MHz / 84: microseconds",
    ),
    (
        "TIM4_SMCR",
        0x4000_0808,
        0x77,
        0x27,
        "counts ITR2, which is TIM3's update (table of TIM4_SMCR)",
    ),
    (
        "TIM5_SMCR",
        0x4000_0C08,
        0x77,
        0x35,
        "gated by ITR3, which is TIM8 (table of TIM5_SMCR)",
    ),
    (
        "TIM2_SMCR",
        0x4000_0008,
        0x77,
        0x15,
        "gated by ITR1, which is TIM8 (table of TIM2_SMCR)",
    ),
    ("TIM2_OR", 0x4000_0050, 0xC00, 0, "ITR1 is TIM8"),
    (
        "TIM8_PSC",
        0x4001_0428,
        0xFFFF,
        16_799,
        "168 MHz / 16,800: 10 kHz",
    ),
    ("TIM8_ARR", 0x4001_042C, 0xFFFF, 100, "10 ms"),
    ("TIM8_CR1", 0x4001_0400, 0x9, 0x9, "one pulse, running"),
    (
        "TIM8_CR2",
        0x4001_0404,
        0x70,
        0x10,
        "its enable is its trigger output",
    ),
    (
        "TIM1_ARR",
        0x4001_002C,
        0xFFFF,
        2_915,
        "168 MHz / 2916 = 57.6 kHz: six ticks a bit of 9600 baud",
    ),
    ("IWDG_PR", 0x4000_3004, 7, 3, "/ 32: 1 kHz"),
    ("IWDG_RLR", 0x4000_3008, 0xFFF, 100, "100 ms"),
    (
        "DBGMCU_APB1_FZ",
        0xE004_2008,
        0x100F,
        0x100F,
        "a debugger's halt stops TIM2 to TIM5 and the watchdog",
    ),
    ("DBGMCU_APB2_FZ", 0xE004_200C, 2, 2, "and TIM8"),
];

/// What depends on the board: the divider of its crystal, its relay's channel, its encoders' SPIs.
fn of_board(board: &Board) -> Vec<Expected> {
    let prediv = board.crystal.hz / 2_000_000;
    let mut expected: Vec<Expected> = vec![(
        "RCC_PLLCFGR",
        0x4002_3804,
        0x0043_7FFF,
        0x0040_2A00 | prediv,
        "HSE to 2 MHz, · 168 / 2 = 168 MHz (6.3.2)",
    )];
    let mut enabled = 0;
    for output in [Some(board.relay), board.brakes].into_iter().flatten() {
        let channel = u32::from(output.channel) - 1;
        let shift = 8 * (channel % 2);
        expected.push((
            "TIM8_CCMR of relay or brakes",
            0x4001_0418 + 4 * u64::from(channel / 2),
            0x73 << shift,
            0x70 << shift,
            "PWM 2: low at rest",
        ));
        enabled |= if output.is_complementary { 4 } else { 1 } << (4 * channel);
    }
    expected.push((
        "TIM8_CCER",
        0x4001_0420,
        0xFFFF,
        enabled,
        "the outputs of relay and brakes, and no other",
    ));
    for axis in board.axes {
        expected.push(match axis.encoder.spi {
            1 => ("SPI1_CR1", 0x4001_3000, 0x3B, 0x3A, SSI_BY_256),
            2 => ("SPI2_CR1", 0x4000_3800, 0x3B, 0x32, SSI_BY_128),
            3 => ("SPI3_CR1", 0x4000_3C00, 0x3B, 0x32, SSI_BY_128),
            _ => ("SPI4_CR1", 0x4001_3400, 0x3B, 0x3A, SSI_BY_256),
        });
    }
    if let Some(drivers) = board.drivers {
        expected.push(match drivers.spi.spi {
            1 => ("SPI1_CR1", 0x4001_3000, 0x3B, 0x2B, DRIVERS_BY_64),
            2 => ("SPI2_CR1", 0x4000_3800, 0x3B, 0x23, DRIVERS_BY_32),
            3 => ("SPI3_CR1", 0x4000_3C00, 0x3B, 0x23, DRIVERS_BY_32),
            _ => ("SPI4_CR1", 0x4001_3400, 0x3B, 0x2B, DRIVERS_BY_64),
        });
    }
    expected
}

const DRIVERS_BY_64: &str = "84 MHz / 64 = 1.3 MHz, mode 3";
const DRIVERS_BY_32: &str = "42 MHz / 32 = 1.3 MHz, mode 3";
const SSI_BY_256: &str = "84 MHz / 256 = 328 kHz, clock high at rest";
const SSI_BY_128: &str = "42 MHz / 128 = 328 kHz, clock high at rest";

/// An interrupt: its number (RM0390, table 38), and the priority that it must have, 0 first.
const PRIORITIES: &[(&str, usize, u8)] = &[
    ("TIM2, φ's steps", 28, 0),
    ("TIM5, θ's steps", 50, 0),
    ("TIM3, time and trigger", 29, 1),
    ("TIM1, drivers' wire and quadrature rings", 25, 2),
    ("USART2, the host", 38, 4),
];
/// SCB_AIRCR.PRIGROUP up to which all four priority bits preempt.
const ALL_PREEMPT: u8 = 3;

/// Fastest clock for 50 m of cable, Hz.
const SSI_HZ: f64 = 400_000.0;

/// Compares every register and priority, on a chip that has started.
pub fn as_the_manual_says(rig: &mut Rig) -> Result<String> {
    let mut wrong = Vec::new();
    let mut all = of_board(rig.board);
    all.extend(EXPECTED);
    for &(name, address, mask, expected, why) in &all {
        let is = rig.peek(address)? & mask;
        if is != expected {
            wrong.push(format!("{name} is {is:#x} where {expected:#x} means {why}"));
        }
    }
    for &(name, number, expected) in PRIORITIES {
        let word = rig.act(Command::Interrupt(number))?;
        let is =
            Interrupt::from_word(word).context("the core's state has no NVIC that is known")?;
        if !is.is_enabled || is.priority != expected || is.group > ALL_PREEMPT {
            wrong.push(format!(
                "interrupt {number} ({name}) is {is:?}, not of priority {expected}"
            ));
        }
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("; "));
    let hz = [0, 1].map(|i| lock(&rig.world).axes[i].ssi_hz);
    ensure!(hz.iter().all(|&hz| hz <= SSI_HZ), "SSI at {hz:?} Hz");
    Ok(format!(
        "{} registers, {} priorities; SSI at {:.0} and {:.0} Hz",
        all.len(),
        PRIORITIES.len(),
        hz[0],
        hz[1]
    ))
}
