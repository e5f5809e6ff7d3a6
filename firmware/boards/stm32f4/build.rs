//! Compares the pins with the chip's description, and writes each board's memory.x where its linker looks.

use std::error::Error;
use std::fmt::Write;
use std::path::PathBuf;

use gonia_pins::boards::BOARDS;
use gonia_pins::check::{check, image_end};
use gonia_pins::signals::{Signal, TABLE};
use gonia_pins::{Board, FLASH};
use stm32_metapac::metadata::METADATA;

fn main() -> Result<(), Box<dyn Error>> {
    compare_with_chip()?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    for board in BOARDS {
        let mut faults = String::new();
        check(board, |fault| {
            faults += &format!("{}: {fault}\n", board.name);
        });
        if !faults.is_empty() {
            return Err(faults.into());
        }
        let folder = out.join(board.name);
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join("memory.x"), memory(board)?)?;
        let (name, folder) = (board.name, folder.display());
        println!("cargo:rustc-link-arg-bin=gonia-{name}=-L{folder}");
    }
    Ok(())
}

/// The last kilobyte of RAM keeps the last panic.
fn memory(board: &Board) -> Result<String, std::fmt::Error> {
    let layout = board.layout;
    let (origin, length) = (FLASH + layout.image, image_end(board) - layout.image);
    let mut text = format!(
        "MEMORY\n{{\n  FLASH   : ORIGIN = {origin:#010X}, LENGTH = {length}\n  \
         RAM     : ORIGIN = 0x20000000, LENGTH = 127K\n  \
         PANDUMP : ORIGIN = 0x2001FC00, LENGTH = 1K\n}}\n\n\
         _panic_dump_start = ORIGIN(PANDUMP);\n\
         _panic_dump_end   = ORIGIN(PANDUMP) + LENGTH(PANDUMP);\n"
    );
    if let Some(program) = layout.program {
        writeln!(text, "_stext = {:#010X};", FLASH + program)?;
    }
    Ok(text)
}

/// Every row of the table of alternate functions, against the chip's own.
fn compare_with_chip() -> Result<(), Box<dyn Error>> {
    for &(signal, pin, function) in TABLE {
        let (peripheral, name) = match signal {
            Signal::Timer(timer, channel) => (format!("TIM{timer}"), format!("CH{channel}")),
            Signal::TimerComplement(timer, channel) => {
                (format!("TIM{timer}"), format!("CH{channel}N"))
            }
            Signal::SpiClock(spi) => (format!("SPI{spi}"), "SCK".into()),
            Signal::SpiData(spi) => (format!("SPI{spi}"), "MISO".into()),
            Signal::SpiOut(spi) => (format!("SPI{spi}"), "MOSI".into()),
            Signal::UartTx(uart) => (format!("USART{uart}"), "TX".into()),
            Signal::UartRx(uart) => (format!("USART{uart}"), "RX".into()),
        };
        let peripheral = METADATA.peripherals.iter().find(|p| p.name == peripheral);
        let is_so = peripheral.is_some_and(|peripheral| {
            let mut pins = peripheral.pins.iter();
            pins.any(|p| p.pin == pin.to_string() && p.signal == name && p.af == Some(function))
        });
        if !is_so {
            let wrong = format!("signals.rs: the chip has no {signal} on {pin} by AF{function}");
            return Err(wrong.into());
        }
    }
    Ok(())
}
