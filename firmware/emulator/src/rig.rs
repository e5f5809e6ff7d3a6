//! A run as a script sees it: a clock to let go on, a host to ask through, a world to look at.

use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use gonia_pins::boards::named;
use gonia_pins::{Board, FLASH, HOST_UART};
use gonia_protocol::NODE_ANY;
use gonia_protocol::link::{IncomingPacket, NextAction, Requester, RetryPolicy};
use gonia_protocol::message::{
    Completed, Hello, Identity, Latch, Message, RequestOutcome, RequestRefusal, Status,
};
use gonia_protocol::packet::Decoder;
use rigless::emulator::{Start, run};
use rigless::image::Image;
use rigless::session::Session;
use rigless::time::VirtualNanos;

use crate::bench::{Command, Wiring};
use crate::chips::{DriverBusSpi, HostWire, Ring, Shared, lock};
use crate::part::Bench;
use crate::world::World;

/// The clock stands this often, µs: how late the host hears.
const SLICE_US: u64 = 500;
/// The host asks for the status this often while it waits, µs, which keeps its watchdog quiet.
const HEARTBEAT_US: u64 = 250_000;
/// The chip's side has so long for a slice.
const PATIENCE: Duration = Duration::from_secs(120);

/// The board whose image this is: `gonia-NAME`.
pub fn board_of(elf: &Path) -> Result<&'static Board> {
    let name = elf.file_stem().and_then(|stem| stem.to_str());
    let name = name.and_then(|stem| stem.strip_prefix("gonia-"));
    name.and_then(named).with_context(|| {
        let elf = elf.display();
        format!("{elf}: no image of a board; name it gonia-NAME, by a board of gonia-pins")
    })
}

/// What a board is sold with, at its worst: it leaves SysTick running, with a handler of its own that never
/// returns, an interrupt pending, its own vector table and stack; and jumps to the image.
fn bootloader(image: u32) -> Result<Image> {
    /// 256 bytes below the end of the RAM that the image's stack does not reach.
    const STACK: u32 = 0x2000_1000;
    /// Of its code, the lowest bit set: Thumb. The vector table has 16 + 97 words.
    const CODE: u32 = FLASH + 0x200;
    let code: [u16; 20] = [
        0x4809, // ldr r0, SYST_CSR
        0x490A, // ldr r1, 1000: a tick every 1000 cycles
        0x6041, // str r1, [r0, #4]: SYST_RVR
        0x6081, // str r1, [r0, #8]: SYST_CVR
        0x2107, // movs r1, #7: on, with interrupt, by the processor's clock
        0x6001, // str r1, [r0]
        0x4808, // ldr r0, NVIC_ISER
        0x4909, // ldr r1, the bit of USART2, 38 - 32
        0x6041, // str r1, [r0, #4]
        0x30FF, // adds r0, #0xFF
        0x3001, // adds r0, #1: NVIC_ISPR
        0xB672, // cpsid i
        0x6041, // str r1, [r0, #4]: pending
        0x4807, // ldr r0, the image's vector table
        0x6840, // ldr r0, [r0, #4]
        0x4700, // bx r0, with interrupts off: as soon as the image allows them, they come
        0xE7FE, // b .
        0xBF00, 0xBF00, 0xBF00,
    ];
    let words = [0xE000_E010, 1000, 0xE000_E100, 1 << 6, FLASH + image];
    let mut bytes = Vec::new();
    bytes.extend(STACK.to_le_bytes());
    bytes.extend((CODE | 1).to_le_bytes());
    let hangs = CODE + 2 * 16 + 1;
    while bytes.len() < (CODE - FLASH) as usize {
        bytes.extend(hangs.to_le_bytes());
    }
    for half in code {
        bytes.extend(half.to_le_bytes());
    }
    for word in words {
        bytes.extend(u32::to_le_bytes(word));
    }
    let path = Path::new("bootloader");
    Image::new(path, bytes, Some(u64::from(FLASH))).map_err(|error| anyhow!("bootloader: {error}"))
}

/// A chip under way, its arm and its host.
pub struct Rig {
    /// What the chip sits on.
    pub board: &'static Board,
    /// The arm and all that is wired to the chip.
    pub world: Shared,
    commands: Sender<Command>,
    done: Receiver<u32>,
    thread: Option<JoinHandle<Result<Vec<String>>>>,
    now_us: u64,
    link: Requester,
    decoder: Decoder,
    completed: Vec<Completed>,
    /// Pulses that were reported.
    pub latches: Vec<Latch>,
    heartbeat_us: u64,
}

impl Rig {
    /// Puts the image into a chip and switches it on.
    pub fn power_on(elf: &Path) -> Result<Self> {
        let of = board_of(elf)?;
        let image =
            Image::read(elf, None).map_err(|error| anyhow!("{}: {error}", elf.display()))?;
        let world: Shared = Arc::new(Mutex::new(World::new()));
        let (commands, from_script) = channel();
        let (to_script, done) = channel();
        let wired = world.clone();
        let body = move || -> Result<Vec<String>> {
            let mut board = Bench::new(of)?;
            for (axis, pins) in of.axes.iter().enumerate() {
                let world = wired.clone();
                let spi = usize::from(pins.encoder.spi) - 1;
                board.chip.spi[spi].attach(Ring { world, axis });
            }
            if let Some(drivers) = of.drivers {
                let world = wired.clone();
                let spi = usize::from(drivers.spi.spi) - 1;
                board.chip.spi[spi].attach(DriverBusSpi { world });
            }
            let wire = HostWire {
                world: wired.clone(),
            };
            board.chip.usart[usize::from(HOST_UART) - 1].attach(wire);
            let session = Session::new(Box::new(board), 0, VirtualNanos(1))?;
            let driver = Wiring::new(of, wired, from_script, to_script);
            let mut images = vec![image];
            if of.layout.image != 0 {
                images.push(bootloader(of.layout.image)?);
            }
            let finished = run(session, &Start::new(&images), driver)?;
            let told = finished.session.told().map(|told| format!("{told:?}"));
            let mut gaps: Vec<String> = told.collect();
            let unmapped = finished.session.unmapped();
            gaps.extend(unmapped.iter().map(|gap| format!("{gap}")));
            Ok(gaps)
        };
        let thread = std::thread::Builder::new()
            .name("chip".into())
            .spawn(body)?;
        let rig = Self {
            board: of,
            world,
            commands,
            done,
            thread: Some(thread),
            now_us: 0,
            link: Requester::new(NODE_ANY, 0, RetryPolicy::default()),
            decoder: Decoder::new(),
            completed: Vec::new(),
            latches: Vec::new(),
            heartbeat_us: 0,
        };
        rig.wait()?;
        Ok(rig)
    }

    fn wait(&self) -> Result<u32> {
        let value = self.done.recv_timeout(PATIENCE);
        value.context("the emulated chip has stopped answering")
    }

    /// Virtual time, µs.
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// Does something to the chip while the clock stands.
    pub fn act(&mut self, command: Command) -> Result<u32> {
        self.commands.send(command).context("the chip has gone")?;
        self.wait()
    }

    /// Lets the time pass; the host only listens.
    pub fn run_us(&mut self, us: u64) -> Result<()> {
        let until_us = self.now_us + us;
        while self.now_us < until_us {
            self.slice(until_us)?;
        }
        Ok(())
    }

    fn slice(&mut self, until_us: u64) -> Result<()> {
        self.now_us = until_us.min(self.now_us + SLICE_US);
        self.act(Command::Run(self.now_us * 1000))?;
        Ok(())
    }

    /// A register of the chip.
    pub fn peek(&mut self, address: u64) -> Result<u32> {
        self.act(Command::Peek(address))
    }

    /// What has come from the chip: the answer to the request under way, if it is among it.
    fn listen(&mut self) -> Option<Message> {
        let bytes = lock(&self.world).wire.take();
        let mut answer = None;
        for byte in bytes {
            let Some(received) = self.decoder.push(byte) else {
                continue;
            };
            let Ok(message) = received.message else {
                continue;
            };
            match self.link.sort(&received.header) {
                IncomingPacket::Answer => answer = Some(message),
                IncomingPacket::Event => match message {
                    Message::Completed(completed) => self.completed.push(completed),
                    Message::Pulse(latch) => self.latches.push(latch),
                    _ => {}
                },
                IncomingPacket::Stray => {}
            }
        }
        answer
    }

    /// Asks, repeats as the host does, and gives up when it would. Returns the request's number too.
    pub fn ask(&mut self, message: &Message) -> Result<(u16, Message)> {
        let (id, packet) = self
            .link
            .begin(message, self.now_us)
            .map_err(|_| anyhow!("the request is too long"))?;
        let packet = packet.to_vec();
        lock(&self.world).wire.send(&packet, self.now_us * 1000);
        loop {
            self.slice(self.now_us + SLICE_US)?;
            if let Some(answer) = self.listen() {
                return Ok((id, answer));
            }
            match self.link.poll(self.now_us) {
                NextAction::Repeat(packet) => {
                    let packet = packet.to_vec();
                    lock(&self.world).wire.send(&packet, self.now_us * 1000);
                }
                NextAction::GiveUp => bail!("no answer, and the host gave up"),
                NextAction::WaitUntil(_) | NextAction::Nothing => {}
            }
        }
    }

    /// Asks without waiting for an answer.
    pub fn send(&mut self, message: &Message) -> Result<()> {
        let request = self.link.begin(message, self.now_us);
        let (_, packet) = request.map_err(|_| anyhow!("the request is too long"))?;
        let packet = packet.to_vec();
        lock(&self.world).wire.send(&packet, self.now_us * 1000);
        Ok(())
    }

    /// A request that must be accepted.
    pub fn begin(&mut self, message: &Message) -> Result<u16> {
        match self.ask(message)? {
            (id, Message::Accepted) => Ok(id),
            (_, other) => bail!("{message:?} was answered by {other:?}"),
        }
    }

    /// A request that must be refused.
    pub fn refusal(&mut self, message: &Message) -> Result<RequestRefusal> {
        match self.ask(message)?.1 {
            Message::Refused(refusal) => Ok(refusal),
            other => bail!("{message:?} was answered by {other:?}"),
        }
    }

    /// Says hello.
    pub fn hello(&mut self, session: u32) -> Result<Identity> {
        self.link.set_node(NODE_ANY);
        let identity = match self.ask(&Message::Hello(Hello { session }))?.1 {
            Message::Identity(identity) => identity,
            other => bail!("hello was answered by {other:?}"),
        };
        self.link.set_node(gonia_protocol::NODE_LIGHT);
        Ok(identity)
    }

    /// Its status.
    pub fn status(&mut self) -> Result<Status> {
        match self.ask(&Message::GetStatus)?.1 {
            Message::Status(status) => Ok(status),
            other => bail!("the status was answered by {other:?}"),
        }
    }

    /// Waits for the end of a request.
    pub fn outcome(&mut self, id: u16, limit_us: u64) -> Result<RequestOutcome> {
        let until_us = self.now_us + limit_us;
        while self.now_us < until_us {
            if let Some(i) = self.completed.iter().position(|end| end.request == id) {
                return Ok(self.completed.remove(i).outcome);
            }
            if self.now_us >= self.heartbeat_us {
                self.heartbeat_us = self.now_us + HEARTBEAT_US;
                self.status()?;
            } else {
                self.slice(until_us)?;
                self.listen();
            }
        }
        bail!("request {id} has not ended after {} ms", limit_us / 1000)
    }

    /// Does it and waits until it is done.
    pub fn complete(&mut self, message: &Message, limit_us: u64) -> Result<()> {
        let id = self.begin(message)?;
        match self.outcome(id, limit_us)? {
            RequestOutcome::Done => Ok(()),
            other => bail!("{message:?} ended as {other:?}"),
        }
    }

    /// Ends the run. Returns what the emulator could not stand in for.
    pub fn end(mut self) -> Result<Vec<String>> {
        self.stop()
    }

    fn stop(&mut self) -> Result<Vec<String>> {
        let _ = self.commands.send(Command::End);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(outcome)) => outcome,
            Some(Err(_)) => bail!("the emulator panicked"),
            None => Ok(Vec::new()),
        }
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        // Its thread ends with it; what it says then, nobody asks for.
        let _ = self.stop();
    }
}
