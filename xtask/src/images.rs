//! The boards' images as files for those without Rust: `target/images`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gonia_pins::boards::BOARDS;
use gonia_pins::check::sector_len;
use gonia_pins::{Board, FLASH, FLASH_LEN};

use crate::boards;
use crate::load::{Part, flat, parts};
use crate::tools::root;
use crate::{dfu, hex};

/// RAM of the chip: the stack begins at its end or below, on a multiple of 8.
const RAM: std::ops::RangeInclusive<u32> = 0x2000_0000..=0x2002_0000;

/// Builds every board and leaves its files in `target/images`.
pub fn images() -> Result<()> {
    boards::build()?;
    let root = root()?;
    let out = root.join("target/images");
    write_all(&root, &out)?;
    println!("{}", out.display());
    Ok(())
}

/// Writes the files of every board that has been built, and checks them.
pub fn write_all(root: &Path, out: &Path) -> Result<()> {
    for board in BOARDS {
        let path = boards::elf(root, board.name)?;
        let elf = std::fs::read(&path).with_context(|| format!("{}", path.display()))?;
        let files = files(board, &elf).with_context(|| format!("{}", path.display()))?;
        for (name, bytes) in files {
            let path: PathBuf = out.join(name);
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).with_context(|| format!("{}", folder.display()))?;
            }
            std::fs::write(&path, &bytes).with_context(|| format!("{}", path.display()))?;
        }
    }
    Ok(())
}

/// Every file of a board's image: name, bytes.
fn files(board: &Board, elf: &[u8]) -> Result<Vec<(String, Vec<u8>)>> {
    let parts = parts(elf)?;
    check(board, &parts)?;
    let name = format!("gonia-{}-{}", board.name, env!("CARGO_PKG_VERSION"));
    let plain = flat(&parts)?.bytes;
    let dfu = dfu::file(&name, &parts)?;
    if dfu::parts_of(&dfu)? != parts {
        bail!("the DFU file does not hold the image");
    }
    let mut files = vec![
        (format!("{name}.elf"), elf.to_vec()),
        (format!("{name}.hex"), hex::file(&parts).into_bytes()),
        (format!("{name}.dfu"), dfu),
    ];
    if board.layout.image != 0 {
        // What a bootloader takes from an SD card, by the one name that it looks for.
        files.push((
            format!("sd-card-{}/firmware.bin", board.name),
            plain.clone(),
        ));
    }
    files.push((format!("{name}.bin"), plain));
    Ok(files)
}

/// Whether this is an image of this board: where it lies, and what its vector table begins with.
fn check(board: &Board, parts: &[Part]) -> Result<()> {
    let begins = FLASH + board.layout.image;
    let table = parts.first().context("nothing to load")?;
    if table.address != begins {
        bail!(
            "begins at {:#x}; the board's vector table lies at {begins:#x}",
            table.address
        );
    }
    let (stack, reset) = (
        crate::size::word(&table.bytes, 0)?,
        crate::size::word(&table.bytes, 4)?,
    );
    if !RAM.contains(&stack) || !stack.is_multiple_of(8) {
        bail!("its stack begins at {stack:#x}, which is not in RAM");
    }
    let at = reset & !1;
    let is_code = parts
        .iter()
        .any(|part| (part.address..).contains(&at) && u64::from(at) < part.end());
    if reset & 1 == 0 || !is_code {
        bail!("its reset vector is {reset:#x}, which is no code of it");
    }
    let flash_end = u64::from(FLASH) + u64::from(FLASH_LEN);
    for part in parts {
        for settings in board.layout.settings {
            let from = FLASH + settings;
            let to = u64::from(from) + u64::from(sector_len(settings).unwrap_or(0));
            if u64::from(part.address) < to && part.end() > u64::from(from) {
                bail!(
                    "{:#x} lies in the settings' sector at {from:#x}",
                    part.address
                );
            }
        }
        if part.end() > flash_end {
            bail!("ends at {:#x}, beyond the flash", part.end());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::tests::{elf, part};
    use gonia_pins::boards::{BTT_OCTOPUS, NUCLEO_F446RE};

    /// A vector table of 8 bytes, and the rest of it.
    fn table(address: u32, stack: u32, reset: u32) -> Part {
        let mut bytes = stack.to_le_bytes().to_vec();
        bytes.extend(reset.to_le_bytes());
        bytes.resize(0x1C4, 0);
        Part { address, bytes }
    }

    fn octopus(reset: u32) -> Vec<Part> {
        vec![
            table(0x0800_8000, 0x2001_FC00, reset),
            part(0x0800_9000, &[0; 64]),
        ]
    }

    fn nucleo() -> Vec<Part> {
        vec![
            table(0x0800_0000, 0x2001_FC00, 0x0800_C001),
            part(0x0800_C000, &[1; 64]),
        ]
    }

    #[test]
    fn an_image_is_written_in_every_form_and_each_holds_it() {
        let files = files(&BTT_OCTOPUS, &elf(&octopus(0x0800_9001))).unwrap();
        let of = |end: &str| {
            let file = files.iter().find(|(name, _)| name.ends_with(end));
            &file.unwrap_or_else(|| panic!("no {end}")).1
        };
        // From the vector table to the last byte, and so at its place behind the bootloader.
        assert_eq!(of(".bin").len(), 0x1040);
        assert_eq!(of("/firmware.bin"), of("0.bin"));
        assert_eq!(dfu::parts_of(of(".dfu")).unwrap(), octopus(0x0800_9001));
        assert!(of(".hex").starts_with(b":020000040800F2\n:10800000"));
    }

    #[test]
    fn the_settings_between_table_and_program_are_in_no_dfu_file() {
        let files = files(&NUCLEO_F446RE, &elf(&nucleo())).unwrap();
        assert!(
            files
                .iter()
                .all(|(name, _)| !name.ends_with("firmware.bin"))
        );
        let (_, dfu) = files
            .iter()
            .find(|(name, _)| name.ends_with(".dfu"))
            .unwrap();
        let parts = dfu::parts_of(dfu).unwrap();
        let lengths: Vec<usize> = parts.iter().map(|part| part.bytes.len()).collect();
        assert_eq!(lengths, [0x1C4, 64]);
    }

    #[test]
    fn an_image_of_another_board_or_of_nothing_is_refused() {
        let refused = |board: &Board, parts: &[Part]| check(board, parts).unwrap_err().to_string();
        let good = octopus(0x0800_9001);
        check(&BTT_OCTOPUS, &good).unwrap();
        check(&NUCLEO_F446RE, &nucleo()).unwrap();
        assert!(refused(&NUCLEO_F446RE, &good).contains("begins at 0x8008000"));
        assert!(refused(&BTT_OCTOPUS, &nucleo()).contains("begins at 0x8000000"));
        assert!(refused(&BTT_OCTOPUS, &[]).contains("nothing"));
        assert!(refused(&BTT_OCTOPUS, &octopus(0x0800_9000)).contains("reset vector"));
        assert!(refused(&BTT_OCTOPUS, &octopus(0x0800_A001)).contains("reset vector"));
        let mut high = good.clone();
        high[0] = table(0x0800_8000, 0x2002_0008, 0x0800_9001);
        assert!(refused(&BTT_OCTOPUS, &high).contains("stack"));
        let mut long = good.clone();
        long.push(part(0x0804_0000, &[0]));
        assert!(refused(&BTT_OCTOPUS, &long).contains("settings"));
        let mut across = nucleo();
        across[0].bytes.resize(0x4001, 0);
        assert!(refused(&NUCLEO_F446RE, &across).contains("settings"));
    }
}
