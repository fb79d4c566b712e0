//! One direction of an emulated serial link: baud rate, latency, corruption and stalls.
//!
//! A byte takes ten bit times (8N1). A write that does not fit the transmit buffer is lost, as on a
//! UART without flow control.

use std::collections::VecDeque;

use rand_core::Rng;
use rand_pcg::Pcg32;

/// Properties of a simulated serial link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedSerialConfig {
    /// Bits per second.
    pub baud: u32,
    /// Time from a byte's last bit to the moment the receiver can read it, seconds.
    pub latency_s: f64,
    /// Probability that a byte arrives with one bit changed.
    pub corruption_per_byte: f64,
    /// Size of the transmit buffer, bytes.
    pub transmit_buffer_len: usize,
}

/// Share of bytes lost, or of writes damaged, above which the link is named as a cause of failure.
const MIN_REPORTED_SHARE: f64 = 0.02;
/// The usual baud rates, bits per second.
const BAUDS: [u64; 8] = [9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600];

/// One direction of a serial link; time in microseconds since the start of the simulation.
#[derive(Debug)]
pub struct SerialLink {
    config: SimulatedSerialConfig,
    /// Source of the changed bytes.
    rng: Pcg32,
    /// When the last bit of all writes so far leaves the transmitter.
    busy_until_us: u64,
    /// Bytes of all writes under way.
    bytes: VecDeque<u8>,
    /// Time of arrival (microseconds) and length of each write under way.
    writes: VecDeque<(u64, usize)>,
    /// Until when nothing is delivered.
    stalled_until_us: u64,
    /// Bytes given to [`Self::write`] so far.
    pub offered_bytes: u64,
    /// Bytes lost so far: those of all writes that did not fit the transmit buffer.
    pub overrun_bytes: u64,
    /// Number of writes so far, lost ones included.
    pub writes_offered: u64,
    /// Number of writes so far of which a byte was changed.
    pub writes_damaged: u64,
}

impl SerialLink {
    /// An idle link; `seed` and `stream` choose its sequence of random numbers.
    pub fn new(config: SimulatedSerialConfig, seed: u64, stream: u64) -> Self {
        Self {
            config,
            rng: Pcg32::new(seed, stream),
            busy_until_us: 0,
            bytes: VecDeque::new(),
            writes: VecDeque::new(),
            stalled_until_us: 0,
            offered_bytes: 0,
            overrun_bytes: 0,
            writes_offered: 0,
            writes_damaged: 0,
        }
    }

    /// What was wrong with the link in `lasted_s` seconds, and a remedy, as text; `None` if
    /// nothing.
    pub fn describe_fault(&self, lasted_s: f64) -> Option<String> {
        let share = |part: u64, whole: u64| part as f64 / whole.max(1) as f64;
        let lost = share(self.overrun_bytes, self.offered_bytes);
        if lost > MIN_REPORTED_SHARE {
            let offered = (self.offered_bytes as f64 / lasted_s.max(1e-3)) as u64;
            let enough =
                BAUDS.iter().find(|baud| *baud / 10 > offered).unwrap_or(&BAUDS[BAUDS.len() - 1]);
            return Some(format!(
                "its serial link lost {:.0} % of the bytes: {} baud carry {} bytes a second, {offered} were to be sent; \
                 simulation.serial_baud of {enough} would do",
                100.0 * lost,
                self.config.baud,
                self.config.baud / 10
            ));
        }
        let damaged = share(self.writes_damaged, self.writes_offered);
        (damaged > MIN_REPORTED_SHARE).then(|| {
            format!(
                "its serial link damaged {:.0} % of what it carried, and damaged messages are dropped: {} of its bytes \
                 change; a simulation.serial_corruption of {:.0e} damages less than {:.0} %",
                100.0 * damaged,
                self.config.corruption_per_byte as f32,
                self.config.corruption_per_byte * MIN_REPORTED_SHARE / damaged,
                100.0 * MIN_REPORTED_SHARE
            )
        })
    }

    /// Sends bytes as one write; all of them are lost if they do not fit the transmit buffer.
    pub fn write(&mut self, now_us: u64, data: &[u8]) {
        self.offered_bytes += data.len() as u64;
        self.writes_offered += 1;
        if self.bytes.len() + data.len() > self.config.transmit_buffer_len {
            self.overrun_bytes += data.len() as u64;
            return;
        }
        let took_us = data.len() as u64 * 10_000_000 / u64::from(self.config.baud);
        self.busy_until_us = self.busy_until_us.max(now_us) + took_us;
        let arrives_us = self.busy_until_us + (self.config.latency_s * 1e6) as u64;
        self.writes.push_back((arrives_us, data.len()));
        self.bytes.extend(data);
        if self.config.corruption_per_byte > 0.0 {
            let sent = self.bytes.len() - data.len();
            let mut damaged = false;
            for byte in self.bytes.range_mut(sent..) {
                if uniform_unit(&mut self.rng) < self.config.corruption_per_byte {
                    *byte ^= 1 << (self.rng.next_u32() % 8);
                    damaged = true;
                }
            }
            self.writes_damaged += u64::from(damaged);
        }
    }

    /// Replaces the content of `out` by the bytes that have arrived by `now_us`.
    pub fn read(&mut self, now_us: u64, out: &mut Vec<u8>) {
        out.clear();
        while let Some((_, bytes)) = self.take_write_by(now_us) {
            out.extend(bytes);
        }
    }

    /// Takes the next write whose last byte arrives by `until_us`: its time of arrival and its
    /// bytes. `until_us` may be in the future; `None` if there is none, or the link is stalled at
    /// that time.
    pub fn take_write_by(&mut self, until_us: u64) -> Option<(u64, Vec<u8>)> {
        let &(arrives_us, length) = self.writes.front()?;
        if arrives_us > until_us || until_us < self.stalled_until_us {
            return None;
        }
        self.writes.pop_front();
        Some((arrives_us.max(self.stalled_until_us), self.bytes.drain(..length).collect()))
    }

    /// Sets the probability that a byte arrives changed.
    pub fn set_corruption(&mut self, corruption: f64) {
        self.config.corruption_per_byte = corruption;
    }

    /// Delivers nothing until `until_us`.
    pub fn stall(&mut self, until_us: u64) {
        self.stalled_until_us = until_us;
    }
}

/// A uniformly distributed random number from 0 to below 1.
pub fn uniform_unit(rng: &mut Pcg32) -> f64 {
    f64::from(rng.next_u32()) / (f64::from(u32::MAX) + 1.0)
}

#[cfg(test)]
mod tests;
