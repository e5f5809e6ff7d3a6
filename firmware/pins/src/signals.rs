//! Which pin of an STM32F446 carries which signal, by which alternate function.
//!
//! Only what the firmware may use. From the data sheet (DS10693, table 11); the board's build compares every
//! row with the chip's description in the crate `stm32-metapac`.

use core::fmt;

use crate::Pin;

/// A signal inside the chip that a pin can carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Timer, channel.
    Timer(u8, u8),
    /// Timer, channel: its complementary output.
    TimerComplement(u8, u8),
    /// The clock of an SPI.
    SpiClock(u8),
    /// What an SPI reads as master: MISO.
    SpiData(u8),
    /// What an SPI writes as master: MOSI.
    SpiOut(u8),
    /// What a UART sends.
    UartTx(u8),
    /// What a UART receives.
    UartRx(u8),
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Timer(timer, channel) => write!(f, "TIM{timer}_CH{channel}"),
            Self::TimerComplement(timer, channel) => write!(f, "TIM{timer}_CH{channel}N"),
            Self::SpiClock(spi) => write!(f, "SPI{spi}_SCK"),
            Self::SpiData(spi) => write!(f, "SPI{spi}_MISO"),
            Self::SpiOut(spi) => write!(f, "SPI{spi}_MOSI"),
            Self::UartTx(uart) => write!(f, "USART{uart}_TX"),
            Self::UartRx(uart) => write!(f, "USART{uart}_RX"),
        }
    }
}

/// The number of the alternate function by which a pin carries a signal, if it does.
pub fn function(pin: Pin, signal: Signal) -> Option<u8> {
    let row = TABLE.iter().find(|row| row.0 == signal && row.1 == pin);
    row.map(|row| row.2)
}

const fn row(signal: Signal, port: char, number: u8, function: u8) -> (Signal, Pin, u8) {
    (signal, Pin::new(port, number), function)
}

/// Signal, pin, alternate function.
pub const TABLE: &[(Signal, Pin, u8)] = &{
    use Signal::{SpiClock, SpiData, SpiOut, Timer, TimerComplement, UartRx, UartTx};
    [
        row(Timer(2, 1), 'A', 0, 1),
        row(Timer(2, 1), 'A', 5, 1),
        row(Timer(2, 1), 'A', 15, 1),
        row(Timer(2, 1), 'B', 8, 1),
        row(Timer(2, 2), 'A', 1, 1),
        row(Timer(2, 2), 'B', 3, 1),
        row(Timer(2, 2), 'B', 9, 1),
        row(Timer(2, 3), 'A', 2, 1),
        row(Timer(2, 3), 'B', 10, 1),
        row(Timer(2, 4), 'A', 3, 1),
        row(Timer(2, 4), 'B', 2, 1),
        row(Timer(2, 4), 'B', 11, 1),
        row(Timer(3, 2), 'A', 7, 2),
        row(Timer(3, 2), 'B', 5, 2),
        row(Timer(3, 2), 'C', 7, 2),
        row(Timer(3, 3), 'B', 0, 2),
        row(Timer(3, 3), 'C', 8, 2),
        row(Timer(3, 4), 'B', 1, 2),
        row(Timer(3, 4), 'C', 9, 2),
        row(Timer(5, 1), 'A', 0, 2),
        row(Timer(5, 2), 'A', 1, 2),
        row(Timer(5, 3), 'A', 2, 2),
        row(Timer(5, 4), 'A', 3, 2),
        row(Timer(8, 1), 'C', 6, 3),
        row(Timer(8, 2), 'C', 7, 3),
        row(Timer(8, 3), 'C', 8, 3),
        row(Timer(8, 4), 'C', 9, 3),
        row(TimerComplement(8, 1), 'A', 5, 3),
        row(TimerComplement(8, 1), 'A', 7, 3),
        row(TimerComplement(8, 2), 'B', 0, 3),
        row(TimerComplement(8, 2), 'B', 14, 3),
        row(TimerComplement(8, 3), 'B', 1, 3),
        row(TimerComplement(8, 3), 'B', 15, 3),
        row(SpiClock(1), 'A', 5, 5),
        row(SpiClock(1), 'B', 3, 5),
        row(SpiData(1), 'A', 6, 5),
        row(SpiData(1), 'B', 4, 5),
        row(SpiClock(2), 'B', 10, 5),
        row(SpiClock(2), 'B', 13, 5),
        row(SpiClock(2), 'C', 7, 5),
        row(SpiClock(2), 'D', 3, 5),
        row(SpiData(2), 'B', 14, 5),
        row(SpiData(2), 'C', 2, 5),
        row(SpiClock(3), 'B', 3, 6),
        row(SpiClock(3), 'C', 10, 6),
        row(SpiData(3), 'B', 4, 6),
        row(SpiData(3), 'C', 11, 6),
        row(SpiClock(4), 'E', 2, 5),
        row(SpiClock(4), 'E', 12, 5),
        row(SpiClock(4), 'G', 11, 6),
        row(SpiData(4), 'E', 5, 5),
        row(SpiData(4), 'E', 13, 5),
        row(SpiData(4), 'G', 12, 6),
        row(SpiOut(1), 'A', 7, 5),
        row(SpiOut(1), 'B', 5, 5),
        row(SpiOut(2), 'B', 15, 5),
        row(SpiOut(2), 'C', 1, 7),
        row(SpiOut(2), 'C', 3, 5),
        row(SpiOut(3), 'B', 5, 6),
        row(SpiOut(3), 'C', 12, 6),
        row(SpiOut(4), 'E', 6, 5),
        row(SpiOut(4), 'E', 14, 5),
        row(UartTx(2), 'A', 2, 7),
        row(UartTx(2), 'D', 5, 7),
        row(UartRx(2), 'A', 3, 7),
        row(UartRx(2), 'D', 6, 7),
    ]
};
