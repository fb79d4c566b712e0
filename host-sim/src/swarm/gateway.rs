//! The link to a real ground station that watches and commands the simulated swarm:
//! `fly --qgc URL`.
//!
//! Each autopilot has one more port for the ground station, with a ground station's stream rates
//! ([`sim_autopilot::link::port::GROUND_STREAMS`]). Of the packets that companions broadcast,
//! heartbeats, texts and command acknowledgements go to the ground station too. What the ground
//! station sends goes to every autopilot and by radio to every companion; each obeys what is
//! addressed to it, as behind a real telemetry radio.

use std::io;
use std::rc::Rc;

use companion::link::frame::Framer;
use companion::time::Instant;
use planner_core::Point;

use super::radio::Radio;
use super::simulated_vehicle::SimulatedVehicle;
use crate::link::ByteLink;

/// Message ids passed on from companions: HEARTBEAT, COMMAND_ACK, STATUSTEXT.
const FORWARDED_MESSAGE_IDS: [u32; 3] = [0, 77, 253];
/// Longest datagram, bytes: within the MTU of any usual network path.
const MAX_DATAGRAM: usize = 1400;

/// A link to a ground station, and the datagram that is being filled for it.
pub struct Gateway {
    link: Box<dyn ByteLink>,
    /// Frames that are not sent yet.
    datagram: Vec<u8>,
}

impl Gateway {
    /// A gateway on an open link.
    pub fn new(link: Box<dyn ByteLink>) -> Self {
        Self { link, datagram: Vec::new() }
    }

    /// Gives every vehicle's autopilot a port for the ground station.
    pub fn add_ground_ports(&self, vehicles: &mut [SimulatedVehicle]) {
        vehicles.iter_mut().for_each(|vehicle| vehicle.autopilot.add_ground_port());
    }

    /// Passes on what the ground station sent since the last step. Then sends the ground station
    /// the packets among `overheard` that are for it, and the autopilots' frames.
    ///
    /// # Errors
    /// The link is gone for good.
    pub fn step(
        &mut self,
        now_us: u64,
        vehicles: &mut [SimulatedVehicle],
        radio: &mut Radio,
        places: &[Point],
        overheard: &[Rc<[u8]>],
    ) -> io::Result<()> {
        let mut buffer = [0; 2048];
        loop {
            let length = self.link.receive(&mut buffer)?;
            if length == 0 {
                break;
            }
            let bytes = &buffer[..length];
            vehicles.iter_mut().for_each(|vehicle| vehicle.handle_qgc_bytes(now_us, bytes));
            radio.broadcast(now_us, None, places, bytes);
        }
        for packet in overheard.iter().filter(|packet| is_for_ground(packet)) {
            self.append_frames(packet)?;
        }
        for vehicle in vehicles {
            loop {
                let length = vehicle.poll_qgc_transmit(now_us, &mut buffer[..MAX_DATAGRAM]);
                if length == 0 {
                    break;
                }
                self.append_frames(&buffer[..length])?;
            }
        }
        self.flush()
    }

    /// Appends whole frames to the datagram, which [`Self::flush`] sends. If they do not fit any
    /// more, the datagram is sent first.
    fn append_frames(&mut self, frames: &[u8]) -> io::Result<()> {
        if self.datagram.len() + frames.len() > MAX_DATAGRAM {
            self.flush()?;
        }
        self.datagram.extend_from_slice(frames);
        Ok(())
    }

    /// Sends the datagram if it is not empty.
    fn flush(&mut self) -> io::Result<()> {
        if !self.datagram.is_empty() {
            self.link.send(&self.datagram)?;
            self.datagram.clear();
        }
        Ok(())
    }
}

/// Whether a companion's packet, which holds one frame, is of a message among
/// [`FORWARDED_MESSAGE_IDS`].
fn is_for_ground(packet: &[u8]) -> bool {
    let mut input = packet;
    let frame = Framer::new().next(Instant::ZERO, &mut input);
    frame.is_some_and(|frame| FORWARDED_MESSAGE_IDS.contains(&frame.message_id))
}
