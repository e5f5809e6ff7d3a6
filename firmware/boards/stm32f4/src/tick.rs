//! TIM1's interrupt, 57,600 times a second while something wants it: the one wire to motors' drivers, and samples of
//! quadrature rings.
//!
//! It comes behind those of steps and trigger, which may delay it by microseconds.

use embassy_stm32::interrupt::typelevel::{Interrupt, TIM1_UP_TIM10};
use embassy_stm32::interrupt::{self, Priority};
use embassy_stm32::pac::TIM1;
use embassy_stm32::pac::timer::regs::SrAdv;
use embassy_stm32::pac::timer::vals::Urs;
use embassy_stm32::{peripherals, rcc};
use gonia_firmware::single_wire::TICK_HZ;

use crate::{drivers, quadrature};

/// TIM1's clock.
const TIM1_HZ: u32 = 168_000_000;

/// Sets the timer up. It counts from when somebody sets its counter's enable bit.
pub fn start() {
    rcc::enable_and_reset::<peripherals::TIM1>();
    TIM1.arr()
        .write(|w| w.set_arr((TIM1_HZ / TICK_HZ - 1) as u16));
    TIM1.cr1().write(|w| w.set_urs(Urs::COUNTER_ONLY));
    TIM1.dier().write(|w| w.set_uie(true));
    TIM1_UP_TIM10::set_priority(Priority::P2);
    // SAFETY: the handler shares data with the main loop through critical sections only.
    unsafe { TIM1_UP_TIM10::enable() };
}

#[embassy_stm32::interrupt]
fn TIM1_UP_TIM10() {
    TIM1.sr().write_value(SrAdv(!1));
    critical_section::with(|cs| {
        // The samples first: they are the ones that must not be late.
        let samples = quadrature::on_tick(cs);
        let speaks = drivers::on_tick(cs);
        if !samples && !speaks {
            TIM1.cr1().modify(|w| w.set_cen(false));
        }
    });
}
