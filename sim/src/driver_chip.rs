//! A motor's driver that is set by wire, as its data sheet has it: what it answers, counts and forgets.

use gonia_firmware::driver::registers::{
    CHOPCONF, Condition, DRV_STATUS, GCONF, GSTAT, GSTAT_DRIVER_ERROR, GSTAT_RESET,
    GSTAT_UNDERVOLTAGE, IFCNT, IOIN_2209, IOIN_5160, drv_status, version,
};
use gonia_firmware::driver::tmc2209;
use gonia_firmware::driver::{DriverBus, tmc5160};
use gonia_firmware::hardware::DriverBytes;

/// What is wrong with a driver's wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriverTrouble {
    /// Nothing.
    #[default]
    None,
    /// No answer: no supply, or the wire is cut.
    Silent,
    /// SPI: the data line from it is shorted to ground; it hears.
    DataLow,
    /// A bit of every answer is bent on its way.
    Bent,
    /// Writes do not arrive; reads do.
    Deaf,
}

/// A TMC2209 or a TMC5160.
#[derive(Debug)]
pub struct DriverChip {
    bus: DriverBus,
    address: u8,
    registers: [u32; 0x80],
    /// SPI: the register that the datagram before asked for.
    asked: u8,
    writes: u8,
    events: u32,
    /// How it and its motor are.
    pub condition: Condition,
    /// Its charge pump has too little voltage.
    pub undervoltage: bool,
    /// What is wrong with its wire.
    pub trouble: DriverTrouble,
}

/// CHOPCONF after a reset, as both data sheets have it: of the TMC2209 and of the TMC5160.
const CHOPPER_2209: u32 = 0x1000_0053;
const CHOPPER_5160: u32 = 0x1041_0150;

impl DriverChip {
    /// A chip that has just got its supply.
    pub fn new(bus: DriverBus, address: u8) -> Self {
        let mut chip = Self {
            bus,
            address,
            registers: [0; 0x80],
            asked: 0,
            writes: 0,
            events: 0,
            condition: Condition::default(),
            undervoltage: false,
            trouble: DriverTrouble::None,
        };
        chip.reset();
        chip
    }

    /// How it is spoken with.
    pub fn bus(&self) -> DriverBus {
        self.bus
    }

    /// Its supply was away: all that was written is gone.
    pub fn reset(&mut self) {
        self.registers = [0; 0x80];
        let (config, chopper) = match self.bus {
            DriverBus::OneWire => (0x0000_0141, CHOPPER_2209),
            DriverBus::Spi => (0, CHOPPER_5160),
        };
        self.registers[usize::from(GCONF)] = config;
        self.registers[usize::from(CHOPCONF)] = chopper;
        self.writes = 0;
        self.events = GSTAT_RESET;
    }

    /// What was last written to a register.
    pub fn written(&self, register: u8) -> u32 {
        self.registers[usize::from(register & 0x7F)]
    }

    /// Whether its outputs drive the motor.
    pub fn drives(&self) -> bool {
        !self.condition.is_shorted && !self.condition.is_too_hot
    }

    /// A datagram on the one wire; the answer, if there is one.
    pub fn one_wire(&mut self, request: &[u8]) -> Option<DriverBytes> {
        if self.trouble == DriverTrouble::Silent || self.bus != DriverBus::OneWire {
            return None;
        }
        let (check, bytes) = request.split_last()?;
        if *check != tmc2209::crc(bytes) {
            return None;
        }
        match *bytes {
            [0x05, address, register] if address == self.address => {
                let mut answer = tmc2209::answer(register, self.value(register));
                if self.trouble == DriverTrouble::Bent {
                    answer[4] ^= 0x10;
                }
                Some(answer)
            }
            [0x05, address, register, a, b, c, d]
                if address == self.address && register & 0x80 != 0 =>
            {
                self.write(register & 0x7F, u32::from_be_bytes([a, b, c, d]));
                None
            }
            _ => None,
        }
    }

    /// A datagram by SPI, and what comes back while it is sent.
    pub fn spi(&mut self, datagram: [u8; tmc5160::DATAGRAM_LEN]) -> [u8; tmc5160::DATAGRAM_LEN] {
        let out = self.spi_out();
        self.spi_take(datagram);
        out
    }

    /// What it puts on the line during the next datagram: its state, and what the one before asked for.
    pub fn spi_out(&self) -> [u8; tmc5160::DATAGRAM_LEN] {
        if self.trouble == DriverTrouble::Silent || self.bus != DriverBus::Spi {
            return [0xFF; tmc5160::DATAGRAM_LEN];
        }
        if self.trouble == DriverTrouble::DataLow {
            return [0; tmc5160::DATAGRAM_LEN];
        }
        let [a, b, c, d] = self.value(self.asked).to_be_bytes();
        let bent = if self.trouble == DriverTrouble::Bent {
            0x10
        } else {
            0
        };
        [self.events() as u8 & 3, a, b ^ bent, c, d]
    }

    /// A datagram is over.
    pub fn spi_take(&mut self, datagram: [u8; tmc5160::DATAGRAM_LEN]) {
        if self.trouble == DriverTrouble::Silent || self.bus != DriverBus::Spi {
            return;
        }
        let [register, a, b, c, d] = datagram;
        self.asked = register & 0x7F;
        if register & tmc5160::WRITE != 0 {
            self.write(self.asked, u32::from_be_bytes([a, b, c, d]));
        }
    }

    fn value(&self, register: u8) -> u32 {
        match register {
            GSTAT => self.events(),
            IFCNT => u32::from(self.writes),
            IOIN_2209 if self.bus == DriverBus::OneWire => version(self.bus) << 24,
            IOIN_5160 if self.bus == DriverBus::Spi => version(self.bus) << 24,
            DRV_STATUS => drv_status(self.bus, self.condition),
            _ => self.written(register),
        }
    }

    fn events(&self) -> u32 {
        let set = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
        self.events
            | set(!self.drives(), GSTAT_DRIVER_ERROR)
            | set(self.undervoltage, GSTAT_UNDERVOLTAGE)
    }

    fn write(&mut self, register: u8, value: u32) {
        if self.trouble == DriverTrouble::Deaf {
            return;
        }
        self.writes = self.writes.wrapping_add(1);
        if register == GSTAT {
            self.events &= !value;
        } else {
            self.registers[usize::from(register & 0x7F)] = value;
        }
    }
}
