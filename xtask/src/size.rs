//! How much of a chip a board's program takes, from the sections of its ELF file.

use anyhow::{Context, Result, bail};
use std::path::Path;

/// What a board's program may take, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Code, constants, and the first values of variables.
    pub flash: u64,
    /// Variables; the stack has what is left.
    pub ram: u64,
}

/// The budget of a board: `None` for the one in QEMU, which ships nowhere and carries the simulated
/// machine beside the firmware, so that its size says nothing about a chip.
pub fn budget_of(board: &str) -> Option<Budget> {
    (board != "qemu-mps2").then_some(Budget {
        flash: 192 * 1024,
        ram: 32 * 1024,
    })
}

/// What a program takes, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Size {
    /// Sections that lie in flash.
    pub flash: u64,
    /// Sections that lie in RAM when it runs.
    pub ram: u64,
}

impl Size {
    /// Whether it fits.
    pub fn is_within(self, budget: Budget) -> bool {
        self.flash <= budget.flash && self.ram <= budget.ram
    }
}

const NO_BITS: u32 = 8;
const WRITE: u32 = 1;
const ALLOC: u32 = 2;

/// Reads a 32-bit little-endian ELF file.
pub fn size_of(elf: &Path) -> Result<Size> {
    let bytes = std::fs::read(elf).with_context(|| format!("{}", elf.display()))?;
    size_in(&bytes).with_context(|| format!("{}: not a program for a 32-bit chip", elf.display()))
}

fn size_in(elf: &[u8]) -> Result<Size> {
    if elf.get(..6) != Some(&[0x7F, b'E', b'L', b'F', 1, 1]) {
        bail!("no ELF header of 32 bits, little endian");
    }
    let (table, entry, count) = (word(elf, 32)? as usize, half(elf, 46)?, half(elf, 48)?);
    let mut size = Size::default();
    for i in 0..usize::from(count) {
        let at = table + i * usize::from(entry);
        elf.get(at..at + usize::from(entry)).context("cut short")?;
        let (kind, flags) = (word(elf, at + 4)?, word(elf, at + 8)?);
        let length = u64::from(word(elf, at + 20)?);
        if flags & ALLOC == 0 {
            continue;
        }
        // What is written to while the program runs lies in RAM; its first values, in flash too.
        if flags & WRITE != 0 {
            size.ram += length;
        }
        if kind != NO_BITS {
            size.flash += length;
        }
    }
    Ok(size)
}

/// Four bytes, little endian.
pub fn word(bytes: &[u8], at: usize) -> Result<u32> {
    let part = bytes.get(at..).and_then(|rest| rest.first_chunk::<4>());
    Ok(u32::from_le_bytes(*part.context("cut short")?))
}

/// Two bytes, little endian.
pub fn half(bytes: &[u8], at: usize) -> Result<u16> {
    let part = bytes.get(at..).and_then(|rest| rest.first_chunk::<2>());
    Ok(u16::from_le_bytes(*part.context("cut short")?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A header and section headers: kind, flags, length.
    fn elf(sections: &[(u32, u32, u32)]) -> Vec<u8> {
        let mut bytes = vec![0x7F, b'E', b'L', b'F', 1, 1];
        bytes.resize(52, 0);
        bytes[32..36].copy_from_slice(&52u32.to_le_bytes());
        bytes[46..48].copy_from_slice(&40u16.to_le_bytes());
        bytes[48..50].copy_from_slice(&(sections.len() as u16).to_le_bytes());
        for &(kind, flags, length) in sections {
            let mut header = [0; 40];
            header[4..8].copy_from_slice(&kind.to_le_bytes());
            header[8..12].copy_from_slice(&flags.to_le_bytes());
            header[20..24].copy_from_slice(&length.to_le_bytes());
            bytes.extend(header);
        }
        bytes
    }

    #[test]
    fn code_is_flash_bss_is_ram_data_is_both_and_debug_is_neither() {
        let elf = elf(&[(1, 6, 1000), (8, 3, 200), (1, 3, 30), (1, 0, 99_999)]);
        let size = size_in(&elf).expect("a good file");
        assert_eq!(
            size,
            Size {
                flash: 1030,
                ram: 230
            }
        );
        for n in 0..elf.len() {
            assert!(size_in(&elf[..n]).is_err(), "cut at {n}");
        }
    }

    #[test]
    fn a_board_over_its_budget_is_told_from_one_within() {
        let budget = budget_of("nucleo-f446re").expect("it ships");
        let full = Size {
            flash: budget.flash,
            ram: budget.ram,
        };
        assert!(full.is_within(budget));
        let over = Size {
            ram: budget.ram + 1,
            ..full
        };
        assert!(!over.is_within(budget));
        assert_eq!(budget_of("qemu-mps2"), None);
    }
}
