//! An SPI that reads an encoder: mode 2, at what its divider makes of its bus.

use core::convert::Infallible;

use embassy_stm32::gpio::{AfType, Pull};
use embassy_stm32::pac::spi::Spi;
use embassy_stm32::pac::spi::vals::{Br, Cpha, Cpol, Mstr};
use embassy_stm32::{pac, peripherals, rcc};
use embedded_hal::spi::{ErrorType, SpiBus};
use gonia_pins::Encoder;
use gonia_pins::signals::Signal;

use crate::gpio::{DRIVEN, give};

/// An SPI as master, with no output.
pub struct EncoderSpi(Spi);

impl EncoderSpi {
    /// Clock 328,125 Hz, which is what 50 m of cable allow and dividers make of both buses' clocks exactly (84 MHz
    /// by 256, 42 MHz by 128).
    pub fn start(encoder: Encoder) -> Self {
        let (spi, divider) = match encoder.spi {
            1 => {
                rcc::enable_and_reset::<peripherals::SPI1>();
                (pac::SPI1, Br::DIV256)
            }
            2 => {
                rcc::enable_and_reset::<peripherals::SPI2>();
                (pac::SPI2, Br::DIV128)
            }
            3 => {
                rcc::enable_and_reset::<peripherals::SPI3>();
                (pac::SPI3, Br::DIV128)
            }
            _ => {
                rcc::enable_and_reset::<peripherals::SPI4>();
                (pac::SPI4, Br::DIV256)
            }
        };
        give(encoder.clock, Signal::SpiClock(encoder.spi), DRIVEN);
        let input = AfType::input(Pull::None);
        give(encoder.data, Signal::SpiData(encoder.spi), input);
        spi.cr1().write(|w| {
            w.set_cpol(Cpol::IDLE_HIGH);
            w.set_cpha(Cpha::FIRST_EDGE);
            w.set_mstr(Mstr::MASTER);
            w.set_br(divider);
            w.set_ssm(true);
            w.set_ssi(true);
        });
        spi.cr1().modify(|w| w.set_spe(true));
        Self(spi)
    }
}

impl ErrorType for EncoderSpi {
    type Error = Infallible;
}

impl SpiBus for EncoderSpi {
    fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        for word in words {
            // What goes out has no pin: it makes the clock.
            self.0.dr().write(|w| w.set_dr(0));
            while !self.0.sr().read().rxne() {}
            *word = self.0.dr().read().dr() as u8;
        }
        Ok(())
    }

    fn write(&mut self, words: &[u8]) -> Result<(), Infallible> {
        for &word in words {
            self.read(&mut [word])?;
        }
        Ok(())
    }

    fn transfer(&mut self, read: &mut [u8], _: &[u8]) -> Result<(), Infallible> {
        self.read(read)
    }

    fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        self.read(words)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
