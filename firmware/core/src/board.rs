//! The main loop of every board, and what a board gives it.
//!
//! A board implements [`Board`] and calls [`run`] in its main task. How to add one stands in
//! `firmware/boards/README.md`.

use core::future::Future;
#[cfg(target_os = "none")]
use core::sync::atomic::{AtomicU32, Ordering};

use crate::hardware::Hardware;
use crate::node::ControllerNode;

/// Why the loop goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    /// The time has come.
    Time,
    /// So many bytes of the wire are in the buffer.
    Bytes(usize),
    /// The other controller raised the trigger wire at this time, µs.
    TriggerEdge(u64),
}

/// Clock, wire and pins of one controller.
pub trait Board {
    /// Its pins, encoders and memory.
    type Pins: Hardware;

    /// Time since the start, µs. Never goes back.
    fn now_us(&self) -> u64;

    /// The pins as they are at this time, µs.
    fn pins(&mut self, now_us: u64) -> &mut Self::Pins;

    /// Puts a packet on the wire. One that cannot be sent is dropped: the host repeats its request, or
    /// sees a gap in the numbers of the events.
    fn send(&mut self, packet: &[u8]) -> impl Future<Output = ()>;

    /// Sleeps until this time, µs, until bytes of the wire are in `bytes`, or until the trigger wire
    /// rises. Called once a round: the place to restart the chip's watchdog.
    fn sleep(&mut self, until_us: u64, bytes: &mut [u8]) -> impl Future<Output = Wake>;
}

/// Bytes of the wire that are taken at once.
const CHUNK: usize = 64;

/// Runs a controller for ever: bytes in, steps and packets out, and sleep until the next of either.
pub async fn run(node: &mut ControllerNode, board: &mut impl Board) -> ! {
    let mut bytes = [0; CHUNK];
    loop {
        let now_us = board.now_us();
        node.poll(now_us, board.pins(now_us));
        while let Some(packet) = node.take_packet() {
            board.send(&packet).await;
        }
        match board.sleep(node.wake_us(), &mut bytes).await {
            Wake::Time => {}
            Wake::TriggerEdge(edge_us) => {
                let now_us = board.now_us();
                node.trigger_edge(now_us, edge_us, board.pins(now_us));
            }
            Wake::Bytes(received) => {
                for &byte in bytes.iter().take(received) {
                    // A request may take long, such as one that saves settings.
                    let now_us = board.now_us();
                    node.receive(byte, now_us, board.pins(now_us));
                }
            }
        }
    }
}

/// Counts the starts of the chip, in memory that a reset leaves alone and that holds anything after
/// power came on. The linker script must have the section `.uninit`, as that of cortex-m-rt has.
#[cfg(target_os = "none")]
pub fn next_boot_id() -> u32 {
    // Not cleared at the start: what stands here as its first value is never written.
    #[unsafe(link_section = ".uninit.boots")]
    static BOOTS: AtomicU32 = AtomicU32::new(0);
    let boots = BOOTS.load(Ordering::Relaxed).wrapping_add(1);
    BOOTS.store(boots, Ordering::Relaxed);
    boots
}

#[cfg(test)]
mod tests {
    use core::pin::pin;
    use core::task::{Context, Poll, Waker};

    use gonia_protocol::NODE_LIGHT;
    use gonia_protocol::message::{ControllerState, Hello, Message, ResetReason};
    use gonia_protocol::packet::{Decoder, PacketBytes, encode};
    use gonia_protocol::settings::Axis;
    use heapless::Vec;

    use super::*;
    use crate::controller::ArmController;
    use crate::driver::DriverBus;
    use crate::hardware::{
        DriverAnswer, DriverBytes, EncoderKind, EncoderLost, EncoderSetup, EncoderWord, NotSaved,
    };
    use crate::node::identity;
    use crate::steps::{Period, StepProgress};

    /// An arm at rest.
    struct Pins;

    impl Hardware for Pins {
        fn queue_step(&mut self, _: Axis, _: Period) {}
        fn progress(&mut self, _: Axis) -> StepProgress {
            StepProgress::default()
        }
        fn halt(&mut self, _: Axis) {}
        fn has_encoder(&self, _: Axis, _: EncoderKind) -> bool {
            true
        }
        fn encoder_word(&mut self, _: Axis, _: EncoderSetup) -> Result<EncoderWord, EncoderLost> {
            Ok(1000.into())
        }
        fn has_driver_bus(&self, _: DriverBus) -> bool {
            false
        }
        fn ask_driver(&mut self, _: Axis, _: DriverBus, _: DriverBytes, _: usize) -> bool {
            false
        }
        fn driver_answer(&mut self, _: Axis, _: DriverBus) -> DriverAnswer {
            DriverAnswer::Waiting
        }
        fn home_switch_closed(&mut self, _: Axis) -> bool {
            false
        }
        fn alarm_closed(&mut self, _: Axis) -> bool {
            false
        }
        fn switch_drivers(&mut self, _: bool) {}
        fn release_brakes(&mut self, _: bool) {}
        fn interlock_closed(&mut self) -> bool {
            true
        }
        fn hold_interlock_open(&mut self, _: bool) {}
        fn begin_pulse(&mut self, now_us: u64, _: u32) -> u64 {
            now_us
        }
        fn end_pulse(&mut self) {}
        fn save_settings(&mut self, _: &[u8]) -> Result<(), NotSaved> {
            Ok(())
        }
    }

    /// A board that gets its bytes once, then sleeps as long as it may, twice, and then for ever.
    struct Bare {
        now_us: u64,
        naps: u32,
        incoming: Option<PacketBytes>,
        sent: Vec<PacketBytes, 4>,
        pins: Pins,
    }

    impl Board for Bare {
        type Pins = Pins;

        fn now_us(&self) -> u64 {
            self.now_us
        }

        fn pins(&mut self, now_us: u64) -> &mut Pins {
            assert_eq!(now_us, self.now_us);
            &mut self.pins
        }

        async fn send(&mut self, packet: &[u8]) {
            let packet = PacketBytes::from_slice(packet).unwrap();
            self.sent.push(packet).unwrap();
        }

        async fn sleep(&mut self, until_us: u64, bytes: &mut [u8]) -> Wake {
            let Some(incoming) = self.incoming.take() else {
                if self.naps == 0 {
                    core::future::pending::<()>().await;
                }
                self.naps -= 1;
                self.now_us = until_us;
                return Wake::Time;
            };
            bytes[..incoming.len()].copy_from_slice(&incoming);
            Wake::Bytes(incoming.len())
        }
    }

    #[test]
    fn the_loop_answers_on_the_wire_and_wakes_for_its_ticks() {
        let identity = identity("test", 1, ResetReason::PowerOn, "");
        let mut node = ControllerNode::new(NODE_LIGHT, identity, ArmController::new(0, None));
        let hello = Message::Hello(Hello { session: 7 });
        let mut board = Bare {
            now_us: 0,
            naps: 2,
            incoming: Some(encode(NODE_LIGHT, 1, &hello).unwrap()),
            sent: Vec::new(),
            pins: Pins,
        };
        let polled = pin!(run(&mut node, &mut board)).poll(&mut Context::from_waker(Waker::noop()));
        assert_eq!(polled, Poll::Pending);
        assert!(board.now_us > 0, "it slept until a tick");
        assert_eq!(node.controller().state(), ControllerState::Unhomed);
        let mut decoder = Decoder::new();
        let answer = board.sent[0].iter().find_map(|&byte| decoder.push(byte));
        assert!(matches!(answer.unwrap().message, Ok(Message::Identity(_))));
        assert_eq!(board.sent.len(), 1);
    }
}
