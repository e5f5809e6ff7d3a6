//! Both arms and their wires in virtual time. Between two events nothing is computed: the clock
//! jumps.

use std::collections::VecDeque;

use gonia_brdf::direction::{Direction, angle_between};
use gonia_firmware::controller::ArmController;
use gonia_firmware::node::{ControllerNode, identity};
use gonia_firmware::store::Stored;
use gonia_protocol::message::{ControllerState, ResetReason};
use gonia_protocol::{NODE_CAMERA, NODE_LIGHT};

use crate::arm::SimulatedArm;
use crate::fault::{Arm, Fault, FaultEvent, FaultPlan};
use crate::plant::EncoderSays;
use crate::record::{StopRecord, TriggerRecord};
use crate::wire::Wire;

#[derive(Debug)]
struct ArmSim {
    address: u8,
    node: ControllerNode,
    hardware: SimulatedArm,
    to_device: Wire,
    to_host: Wire,
    boot_id: u32,
    lost_triggers: u32,
    /// The next pulse is seen so much later, µs.
    trigger_late_us: u64,
    /// When the pulses that are late are seen.
    late_edges_us: VecDeque<u64>,
    is_safe: bool,
}

#[derive(Debug)]
pub(crate) struct World {
    now_us: u64,
    arms: [ArmSim; 2],
    events: Vec<FaultEvent>,
    next_event: usize,
    interlock_open_until_us: u64,
    bumper_deg: f64,
    triggers: Vec<TriggerRecord>,
    stops: Vec<StopRecord>,
    trace: u64,
}

impl World {
    pub(crate) fn new(seed: u64, mut plan: FaultPlan, arms: [SimulatedArm; 2]) -> Self {
        plan.events.sort_by_key(|event| event.at_us);
        let [light, camera] = arms;
        let arm = |address: u8, mut hardware: SimulatedArm| {
            let wire_seed = seed.wrapping_add(u64::from(address) << 32);
            ArmSim {
                address,
                node: boot(address, 1, ResetReason::PowerOn, 0, hardware.open_store()),
                hardware,
                to_device: Wire::new(plan.wire, wire_seed),
                to_host: Wire::new(plan.wire, wire_seed + 1),
                boot_id: 1,
                lost_triggers: 0,
                trigger_late_us: 0,
                late_edges_us: VecDeque::new(),
                is_safe: false,
            }
        };
        Self {
            now_us: 0,
            arms: [arm(NODE_LIGHT, light), arm(NODE_CAMERA, camera)],
            events: plan.events,
            next_event: 0,
            interlock_open_until_us: 0,
            bumper_deg: 0.0,
            triggers: Vec::new(),
            stops: Vec::new(),
            trace: 0xCBF2_9CE4_8422_2325,
        }
    }

    pub(crate) fn now_us(&self) -> u64 {
        self.now_us
    }

    pub(crate) fn triggers(&self) -> &[TriggerRecord] {
        &self.triggers
    }

    pub(crate) fn stops(&self) -> &[StopRecord] {
        &self.stops
    }

    pub(crate) fn trace(&self) -> u64 {
        self.trace
    }

    /// An arm as it is now.
    pub(crate) fn hardware(&mut self, arm: Arm) -> &mut SimulatedArm {
        let hardware = &mut self.arms[arm as usize].hardware;
        hardware.set_now(self.now_us);
        hardware
    }

    pub(crate) fn send(&mut self, arm: Arm, bytes: &[u8]) {
        self.arms[arm as usize].to_device.send(self.now_us, bytes);
    }

    /// Lets time pass until bytes for the host arrive from this arm, or until the deadline.
    pub(crate) fn receive(&mut self, arm: Arm, out: &mut Vec<u8>, deadline_us: u64) {
        loop {
            let before = out.len();
            while let Some(byte) = self.arms[arm as usize].to_host.take(self.now_us) {
                out.push(byte);
            }
            if out.len() > before || self.now_us >= deadline_us {
                return;
            }
            self.advance(deadline_us.min(self.arms[arm as usize].to_host.next_us()));
        }
    }

    /// Goes to the next event, at most to `limit_us`.
    fn advance(&mut self, limit_us: u64) {
        let event_us = self
            .events
            .get(self.next_event)
            .map_or(u64::MAX, |e| e.at_us);
        let next = self
            .arms
            .iter()
            .map(ArmSim::next_us)
            .fold(limit_us.min(event_us), u64::min);
        self.now_us = self.now_us.max(next);
        if event_us <= self.now_us {
            let event = self.events[self.next_event];
            self.next_event += 1;
            self.strike(event);
        }
        for i in 0..2 {
            self.run_arm(i);
            self.note_stop(i);
        }
    }

    fn run_arm(&mut self, i: usize) {
        let now_us = self.now_us;
        let arm = &mut self.arms[i];
        if arm.next_us() > now_us {
            return;
        }
        let wakes = arm.node.wake_us() <= now_us;
        arm.hardware.set_now(now_us);
        if wakes {
            let other_holds = self.arms[1 - i].hardware.holds_interlock_open();
            let closed =
                !other_holds && now_us >= self.interlock_open_until_us && !self.arms_touch();
            let arm = &mut self.arms[i];
            arm.hardware.set_interlock_closed(closed);
            arm.node.poll(now_us, &mut arm.hardware);
        }
        let arm = &mut self.arms[i];
        while let Some(byte) = arm.to_device.take(now_us) {
            arm.node.receive(byte, now_us, &mut arm.hardware);
            if arm.hardware.take_death() {
                self.restart(i);
                return;
            }
        }
        while arm.late_edges_us.front().is_some_and(|&at| at <= now_us) {
            arm.late_edges_us.pop_front();
            arm.node.trigger_edge(now_us, now_us, &mut arm.hardware);
        }
        let edges = arm.hardware.take_rising_edges();
        if arm.hardware.take_fall() {
            let source = Arm::BOTH[i];
            let ended = self.triggers.iter_mut().rev().find(|t| t.source == source);
            if let Some(trigger) = ended {
                trigger.width_us = Some(now_us - trigger.time_us);
            }
        }
        self.send_packets(i);
        for _ in 0..edges {
            self.trigger(i);
        }
    }

    /// Whether the switch between the arms is open.
    fn arms_touch(&mut self) -> bool {
        if self.bumper_deg <= 0.0 {
            return false;
        }
        let now_us = self.now_us;
        let [light, view] = self.arms.each_mut().map(|arm| {
            arm.hardware.set_now(now_us);
            let [theta, phi] = arm.hardware.true_deg(now_us);
            Direction::from_deg(theta, phi).to_vec3()
        });
        angle_between(light, view).to_degrees() < self.bumper_deg
    }

    fn send_packets(&mut self, i: usize) {
        let arm = &mut self.arms[i];
        while let Some(packet) = arm.node.take_packet() {
            for &byte in &packet {
                self.trace = (self.trace ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
            }
            arm.to_host.send(self.now_us, &packet);
        }
    }

    /// A rising edge on the trigger wire: the camera exposes, the other arm latches.
    fn trigger(&mut self, source: usize) {
        let now_us = self.now_us;
        for arm in &mut self.arms {
            arm.hardware.set_now(now_us);
        }
        let record = TriggerRecord {
            sequence: self.triggers.len() as u32,
            time_us: now_us,
            width_us: None,
            source: Arm::BOTH[source],
            light_deg: self.arms[0].hardware.true_deg(now_us),
            camera_deg: self.arms[1].hardware.true_deg(now_us),
        };
        self.triggers.push(record);
        let follower = &mut self.arms[1 - source];
        if follower.lost_triggers > 0 {
            follower.lost_triggers -= 1;
            return;
        }
        let late_us = std::mem::take(&mut follower.trigger_late_us);
        if late_us > 0 {
            follower.late_edges_us.push_back(now_us + late_us);
            return;
        }
        follower
            .node
            .trigger_edge(now_us, now_us, &mut follower.hardware);
        self.send_packets(1 - source);
    }

    fn strike(&mut self, event: FaultEvent) {
        let now_us = self.now_us;
        let i = event.arm as usize;
        let arm = &mut self.arms[i];
        arm.hardware.set_now(now_us);
        match event.fault {
            Fault::LoseCycles { axis, cycles } => arm.hardware.axis(axis).lose_cycles(cycles),
            Fault::Stall { axis, for_us } => arm.hardware.axis(axis).stall_until(now_us + for_us),
            Fault::Slip { axis, udeg } => arm.hardware.axis(axis).slip(udeg),
            Fault::EncoderLost { axis, for_us } => {
                arm.hardware.axis(axis).lose_encoder_until(now_us + for_us);
            }
            Fault::EncoderJump { axis, udeg } => arm.hardware.axis(axis).shift_encoder(udeg),
            Fault::SwitchStuck { axis, at_home } => arm.hardware.axis(axis).stick_switch(at_home),
            Fault::SwitchCut { axis } => arm.hardware.axis(axis).cut_switch(),
            Fault::DriverAlarm { axis, for_us } => {
                arm.hardware.raise_alarm_until(axis, now_us + for_us);
            }
            Fault::DriverReset { axis } => {
                // One that is set by hand has nothing to lose.
                if let Some(driver) = arm.hardware.driver(axis) {
                    driver.reset();
                }
            }
            Fault::EncoderWarns { axis } => {
                arm.hardware
                    .axis(axis)
                    .let_encoder_say(EncoderSays::Warning);
            }
            Fault::EdgesLost { axis, counts } => arm.hardware.ring(axis).lose_edges(counts),
            Fault::IndexCut { axis } => arm.hardware.ring(axis).cut_index(),
            Fault::InterlockOpen { for_us } => self.interlock_open_until_us = now_us + for_us,
            Fault::Bumper { deg } => self.bumper_deg = deg,
            Fault::Unplugged { for_us } => {
                arm.to_device.unplug_until(now_us + for_us);
                arm.to_host.unplug_until(now_us + for_us);
            }
            Fault::BrownOut => self.restart(i),
            Fault::TriggerLost { pulses } => arm.lost_triggers += pulses,
            Fault::TriggerLate { by_us } => arm.trigger_late_us = by_us,
            Fault::TornSave { after_bytes } => arm.hardware.die_while_saving(after_bytes),
            Fault::EncoderNoise { axis, udeg, for_us } => {
                let plant = arm.hardware.axis(axis);
                plant.disturb_encoder_until(now_us + for_us, udeg);
            }
            Fault::SwitchBounces { axis, bounce_us } => {
                arm.hardware.axis(axis).wear_switch(bounce_us);
            }
        }
    }

    /// The supply sags: the controller starts anew, and whatever was under way is lost.
    fn restart(&mut self, i: usize) {
        let now_us = self.now_us;
        let arm = &mut self.arms[i];
        arm.boot_id += 1;
        arm.hardware.reset_outputs();
        arm.to_device.clear();
        arm.to_host.clear();
        let stored = arm.hardware.open_store();
        arm.node = boot(
            arm.address,
            arm.boot_id,
            ResetReason::BrownOut,
            now_us,
            stored,
        );
        self.stops.push(StopRecord {
            time_us: now_us,
            arm: Arm::BOTH[i],
            state: ControllerState::Boot,
        });
    }

    /// Notes when an arm that has latched a fault comes to rest.
    fn note_stop(&mut self, i: usize) {
        let arm = &mut self.arms[i];
        let controller = arm.node.controller();
        let state = controller.state();
        let is_safe = matches!(state, ControllerState::Fault(_) | ControllerState::EStop)
            && !controller.is_moving();
        if is_safe && !arm.is_safe {
            self.stops.push(StopRecord {
                time_us: self.now_us,
                arm: Arm::BOTH[i],
                state,
            });
        }
        arm.is_safe = is_safe;
    }
}

impl ArmSim {
    /// When something happens on this arm next, µs.
    fn next_us(&self) -> u64 {
        let edge = self.late_edges_us.front().copied().unwrap_or(u64::MAX);
        self.node.wake_us().min(self.to_device.next_us()).min(edge)
    }
}

fn boot(
    address: u8,
    boot_id: u32,
    reset: ResetReason,
    now_us: u64,
    stored: Option<Stored>,
) -> ControllerNode {
    let identity = identity("sim", boot_id, reset, "");
    ControllerNode::new(
        address,
        identity,
        ArmController::new(now_us, stored.as_deref()),
    )
}
