//! Memory-mapped registers of the board.

/// A 32-bit register at a fixed address of the mps2-an386's memory map.
pub struct Register(pub usize);

impl Register {
    /// Its value.
    pub fn read(&self) -> u32 {
        // SAFETY: every address used in this crate is an aligned peripheral register of the board
        // that may be read at any time.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    /// Changes its value.
    pub fn write(&self, value: u32) {
        // SAFETY: as above, and no such register changes memory.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }
}
