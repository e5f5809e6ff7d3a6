//! An 18-bit absolute ring encoder with SSI: clock and data over RS-422, read by an SPI.
//!
//! The data line rests high. The first falling edge of the clock latches the position; each rising
//! edge puts out a bit, most significant first, which is read at the falling edge after it. So 24
//! clocks bring one high bit, 18 bits of position, the error bit (low: the position is not valid),
//! the warning bit, and three that say nothing. RLS AksIM-2 rings ordered with SSI are of this kind;
//! compare with the data sheet of yours.

use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{Config, MODE_2, Spi};
use embassy_stm32::time::Hertz;
use embassy_time::{Duration, Instant};
use gonia_firmware::hardware::EncoderLost;

/// The encoder needs this long after a frame before it latches anew.
const PAUSE: Duration = Duration::from_micros(50);

/// One encoder on its SPI.
pub struct Encoder {
    spi: Spi<'static, Blocking, Master>,
    last: Result<u32, EncoderLost>,
    read_at: Option<Instant>,
}

impl Encoder {
    /// SPI settings that speak SSI at 1 MHz, which 50 m of cable allow.
    pub fn config() -> Config {
        let mut config = Config::default();
        config.mode = MODE_2;
        config.frequency = Hertz(1_000_000);
        config
    }

    /// An encoder that has not been read.
    pub fn new(spi: Spi<'static, Blocking, Master>) -> Self {
        Self {
            spi,
            last: Err(EncoderLost),
            read_at: None,
        }
    }

    /// The position in counts. Within the encoder's pause the last one, which is not older than it.
    pub fn counts(&mut self) -> Result<u32, EncoderLost> {
        let now = Instant::now();
        if self.read_at.is_none_or(|at| now >= at + PAUSE) {
            let mut frame = [0u8; 3];
            let read = self.spi.blocking_read(&mut frame);
            self.last = read.map_err(|_| EncoderLost).and_then(|()| decode(frame));
            self.read_at = Some(Instant::now());
        }
        self.last
    }
}

/// A line that is cut or shorted reads all ones or all zeros, and neither is a position.
fn decode(frame: [u8; 3]) -> Result<u32, EncoderLost> {
    let [a, b, c] = frame.map(u32::from);
    let bits = a << 16 | b << 8 | c;
    let (rest, valid) = (bits >> 23 & 1, bits >> 4 & 1);
    if rest == 0 || valid == 0 || bits == 0xFF_FFFF {
        return Err(EncoderLost);
    }
    Ok(bits >> 5 & 0x3_FFFF)
}
