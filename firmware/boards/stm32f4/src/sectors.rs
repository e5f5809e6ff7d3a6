//! The two sectors of flash that keep the settings.

use embassy_stm32::flash::{Blocking, Flash};
use gonia_firmware::hardware::NotSaved;
use gonia_firmware::store::Sectors;

/// Offsets of sectors 6 and 7, 128 kB each. Erasing one takes up to two seconds.
const SECTORS: [u32; 2] = [0x4_0000, 0x6_0000];
const SECTOR_LEN: u32 = 0x2_0000;

/// Sectors 6 and 7 of the chip's own flash.
pub struct FlashSectors(pub Flash<'static, Blocking>);

impl Sectors for FlashSectors {
    fn read(&mut self, sector: usize, out: &mut [u8]) -> Result<(), NotSaved> {
        let from = SECTORS.get(sector).ok_or(NotSaved)?;
        self.0.blocking_read(*from, out).map_err(|_| NotSaved)
    }

    fn erase(&mut self, sector: usize) -> Result<(), NotSaved> {
        let from = *SECTORS.get(sector).ok_or(NotSaved)?;
        let erased = self.0.blocking_erase(from, from + SECTOR_LEN);
        erased.map_err(|_| NotSaved)
    }

    fn write(&mut self, sector: usize, bytes: &[u8]) -> Result<(), NotSaved> {
        let from = SECTORS.get(sector).ok_or(NotSaved)?;
        self.0.blocking_write(*from, bytes).map_err(|_| NotSaved)
    }
}
