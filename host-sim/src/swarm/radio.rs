//! An emulated broadcast radio of the swarm: range, loss and delay, packet by packet.

use std::collections::VecDeque;
use std::rc::Rc;

use planner_core::Point;
use rand_pcg::Pcg32;

use super::serial::uniform_unit;

/// Properties of the emulated radio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadioConfig {
    /// Distance between two stations beyond which they do not hear each other, metres.
    pub range_m: f32,
    /// Probability that a receiver misses a packet, independent for each receiver.
    pub loss_probability: f64,
    /// Time from sending a packet to its reception, seconds.
    pub delay_s: f64,
}

/// Which directions of a station's radio have failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RadioOutage {
    /// The station sends nothing.
    pub tx_failed: bool,
    /// The station hears nothing.
    pub rx_failed: bool,
}

/// A radio shared by several stations; time in microseconds since the start of the simulation.
#[derive(Debug)]
pub struct Radio {
    /// Loss, delay and range.
    config: RadioConfig,
    /// Source of losses and delays.
    rng: Pcg32,
    /// Which directions of each station's radio have failed.
    outages: Vec<RadioOutage>,
    /// Packets on their way to each station, with the time of reception, microseconds.
    queues: Vec<VecDeque<(u64, Rc<[u8]>)>>,
    /// Packets that stations sent since the last [`Self::take_recorded`]; `None`: not recorded.
    recorded: Option<Vec<Rc<[u8]>>>,
}

impl Radio {
    /// A radio with `stations` stations that has carried nothing yet.
    pub fn new(config: RadioConfig, stations: usize, seed: u64) -> Self {
        let queues = (0..stations).map(|_| VecDeque::new()).collect();
        let outages = vec![RadioOutage::default(); stations];
        Self { config, rng: Pcg32::new(seed, u64::from(u32::MAX)), outages, queues, recorded: None }
    }

    /// Records the packets that stations send from now on, for [`Self::take_recorded`].
    pub fn start_recording(&mut self) {
        self.recorded = Some(Vec::new());
    }

    /// Takes the packets that stations sent since the last call, without loss and delay; empty if
    /// nothing is recorded.
    pub fn take_recorded(&mut self) -> Vec<Rc<[u8]>> {
        self.recorded.as_mut().map(core::mem::take).unwrap_or_default()
    }

    /// Sets which directions of a station's radio have failed: none by default.
    pub fn set_outage(&mut self, station: usize, cut: RadioOutage) {
        self.outages[station] = cut;
    }

    /// Broadcasts a packet to every other station in range of station `from`; from the ground
    /// station (`None`) to all.
    pub fn broadcast(&mut self, now_us: u64, from: Option<usize>, places: &[Point], packet: &[u8]) {
        if from.is_some_and(|from| self.outages[from].tx_failed) {
            return;
        }
        let packet: Rc<[u8]> = packet.into();
        if let (Some(overheard), Some(_)) = (&mut self.recorded, from) {
            overheard.push(Rc::clone(&packet));
        }
        let hears_us = now_us + (self.config.delay_s * 1e6) as u64;
        for (to, queue) in self.queues.iter_mut().enumerate() {
            let in_range = |from: usize| (places[from] - places[to]).norm() <= self.config.range_m;
            let lost = self.config.loss_probability > 0.0
                && uniform_unit(&mut self.rng) < self.config.loss_probability;
            if from != Some(to) && from.is_none_or(in_range) && !lost && !self.outages[to].rx_failed
            {
                queue.push_back((hears_us, Rc::clone(&packet)));
            }
        }
    }

    /// The next packet that the station has received by `now_us`; `None` if there is none yet.
    pub fn receive(&mut self, now_us: u64, station: usize) -> Option<Rc<[u8]>> {
        let queue = &mut self.queues[station];
        let heard = queue.front().is_some_and(|&(hears_us, _)| hears_us <= now_us);
        if heard { queue.pop_front().map(|(_, packet)| packet) } else { None }
    }
}

#[cfg(test)]
mod tests;
