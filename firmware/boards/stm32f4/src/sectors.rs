//! The two sectors of flash that keep the settings.

use embassy_stm32::flash::{Blocking, Flash};
use embassy_stm32::pac;
use embassy_stm32::pac::flash::vals::Psize;
use gonia_firmware::hardware::NotSaved;
use gonia_firmware::store::{RECORD_MAX, Sectors};
use gonia_pins::check::sector_len;

use crate::alive;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Two sectors of the chip's own flash. By words, erasing one of 16 kB takes half a second at most, one of 128 kB two
/// (DS10693, table 44).
pub struct FlashSectors {
    flash: Flash<'static, Blocking>,
    offsets: [u32; 2],
}

impl FlashSectors {
    /// Sectors that begin at these bytes of the flash.
    pub fn new(flash: Flash<'static, Blocking>, offsets: [u32; 2]) -> Self {
        Self { flash, offsets }
    }

    fn place(&self, sector: usize, slot: usize) -> Result<u32, NotSaved> {
        let from = self.offsets.get(sector).ok_or(NotSaved)?;
        Ok(from + (slot * RECORD_MAX) as u32)
    }

    fn len(&self) -> u32 {
        let lengths = self.offsets.map(|at| sector_len(at).unwrap_or(0));
        lengths.into_iter().min().unwrap_or(0)
    }
}

impl Sectors for FlashSectors {
    fn slots(&self) -> usize {
        self.len() as usize / RECORD_MAX
    }

    fn read(&mut self, sector: usize, slot: usize, out: &mut [u8]) -> Result<(), NotSaved> {
        let from = self.place(sector, slot)?;
        self.flash.blocking_read(from, out).map_err(|_| NotSaved)
    }

    fn erase(&mut self, sector: usize) -> Result<(), NotSaved> {
        let from = self.place(sector, 0)?;
        let end = from + self.len();
        erase_by_words();
        // The processor waits for its instructions while this lasts.
        alive::stretched(|| self.flash.blocking_erase(from, end)).map_err(|_| NotSaved)
    }

    fn write(&mut self, sector: usize, slot: usize, bytes: &[u8]) -> Result<(), NotSaved> {
        let from = self.place(sector, slot)?;
        self.flash.blocking_write(from, bytes).map_err(|_| NotSaved)
    }
}

/// The width that an erase works with is the one that was set last: bytes, after a reset. At 3.3 V words are
/// allowed, and twice as fast.
fn erase_by_words() {
    if pac::FLASH.cr().read().lock() {
        for key in KEYS {
            pac::FLASH.keyr().write_value(key);
        }
    }
    pac::FLASH.cr().modify(|w| w.set_psize(Psize::PSIZE32));
    pac::FLASH.cr().modify(|w| w.set_lock(true));
}
