//! Quadrature rings: three plain inputs an axis, sampled by TIM1's interrupt (`tick`) while the settings say that
//! there is such a ring.

use core::cell::RefCell;

use critical_section::{CriticalSection, Mutex};
use embassy_stm32::pac::TIM1;
use gonia_firmware::hardware::{EncoderLost, EncoderWord};
use gonia_firmware::quadrature::Quadrature;
use gonia_pins::Axis as AxisPins;
use gonia_protocol::settings::Axis;

use crate::gpio::Inputs;

/// A ring and its reader.
struct Ring {
    reader: Quadrature,
    /// A, B and index, where the board has pins for them.
    levels: Option<Inputs>,
    is_read: bool,
}

static RINGS: Mutex<RefCell<[Ring; 2]>> = Mutex::new(RefCell::new(
    [const {
        Ring {
            reader: Quadrature::new(),
            levels: None,
            is_read: false,
        }
    }; 2],
));

/// Gives the inputs their pull-ups.
pub fn start(axes: &[AxisPins; 2]) {
    critical_section::with(|cs| {
        for (ring, pins) in RINGS.borrow_ref_mut(cs).iter_mut().zip(axes) {
            ring.levels = pins
                .quadrature
                .map(|wires| Inputs::pulled_up([wires.first, wires.second, wires.index]));
        }
    });
}

/// Whether the board has pins for it.
pub fn has_pins(axis: Axis) -> bool {
    critical_section::with(|cs| RINGS.borrow_ref(cs)[axis.index()].levels.is_some())
}

/// What the reader of an axis says; from the first call on the ring is sampled.
pub fn word(axis: Axis, turn: u32) -> Result<EncoderWord, EncoderLost> {
    critical_section::with(|cs| {
        let ring = &mut RINGS.borrow_ref_mut(cs)[axis.index()];
        ring.reader.set_turn(turn);
        ring.sample();
        ring.is_read = true;
        TIM1.cr1().modify(|w| w.set_cen(true));
        ring.reader.word()
    })
}

/// The axis has another ring: its inputs are left alone.
pub fn leave(axis: Axis) {
    critical_section::with(|cs| {
        let ring = &mut RINGS.borrow_ref_mut(cs)[axis.index()];
        if ring.is_read {
            ring.is_read = false;
            ring.reader = Quadrature::new();
        }
    });
}

/// A sample of every ring that is read; whether there is one.
#[inline]
pub fn on_tick(cs: CriticalSection) -> bool {
    let mut any = false;
    for ring in RINGS.borrow_ref_mut(cs).iter_mut() {
        if ring.is_read {
            any = true;
            ring.sample();
        }
    }
    any
}

impl Ring {
    #[inline]
    fn sample(&mut self) {
        if let Some(levels) = &self.levels {
            let [first, second, index] = levels.read();
            self.reader.sample(first, second, index);
        }
    }
}
