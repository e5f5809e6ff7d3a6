//! Step and direction pins of a stepper driver, over `embedded-hal`.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;

/// A driver's step and direction inputs.
#[derive(Debug)]
pub struct StepDir<S, D, T> {
    step: S,
    direction: D,
    delay: T,
    forward: Option<bool>,
    pulse_ns: u32,
}

impl<S: OutputPin, D: OutputPin<Error = S::Error>, T: DelayNs> StepDir<S, D, T> {
    /// Pins of a driver that needs `pulse_ns` between edges (TMC2209: 100 ns; A4988: 1000 ns;
    /// optocoupled industrial drivers: 2500 ns).
    pub fn new(step: S, direction: D, delay: T, pulse_ns: u32) -> Self {
        Self {
            step,
            direction,
            delay,
            forward: None,
            pulse_ns,
        }
    }

    /// Gives one step. The direction is set first, and early enough for the driver to see it.
    pub fn step(&mut self, forward: bool) -> Result<(), S::Error> {
        if self.forward != Some(forward) {
            self.direction.set_state(forward.into())?;
            self.forward = Some(forward);
            self.delay.delay_ns(self.pulse_ns);
        }
        self.step.set_high()?;
        self.delay.delay_ns(self.pulse_ns);
        self.step.set_low()
    }
}

#[cfg(test)]
mod tests {
    use core::cell::RefCell;
    use core::convert::Infallible;

    use embedded_hal::digital::ErrorType;

    use super::*;

    type Trace = RefCell<heapless::String<64>>;
    struct Pin<'a>(&'a Trace, [char; 2]);
    struct Wait<'a>(&'a Trace);

    impl ErrorType for Pin<'_> {
        type Error = Infallible;
    }
    impl OutputPin for Pin<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().push(self.1[0]).unwrap();
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            self.0.borrow_mut().push(self.1[1]).unwrap();
            Ok(())
        }
    }
    impl DelayNs for Wait<'_> {
        fn delay_ns(&mut self, _: u32) {
            self.0.borrow_mut().push('.').unwrap();
        }
    }

    #[test]
    fn direction_settles_before_the_step_and_only_when_it_changes() {
        let trace = Trace::default();
        let mut driver = StepDir::new(
            Pin(&trace, ['s', 'S']),
            Pin(&trace, ['d', 'D']),
            Wait(&trace),
            100,
        );
        for forward in [true, true, false] {
            driver.step(forward).unwrap();
        }
        assert_eq!(trace.borrow().as_str(), "D.S.sS.sd.S.s");
    }
}
