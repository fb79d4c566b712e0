//! One MAVLink port of the simulated autopilot: framing, sequence numbers, stream rates, send
//! queue.

use mavlink::MessageData;

use crate::link::frame::{self, CheckedFrame, MAX_FRAME_LEN, PortFramer};
use crate::link::msg::{COMMAND_ACK, STATUSTEXT};

/// Component id of an autopilot (MAV_COMP_ID_AUTOPILOT1).
pub const AUTOPILOT_COMPONENT: u8 = 1;
/// Most bytes that may wait in the send queue while telemetry is still queued; beyond that
/// telemetry is dropped, as PX4 drops it when its buffer is full.
const MAX_QUEUED_TELEMETRY: usize = 4096;
/// Stream rates of the ground station's port: message id and interval in µs. A real ground station
/// requests about these rates.
pub const GROUND_STREAMS: [(u32, u32); 11] = [
    (0, 1_000_000),   // HEARTBEAT
    (1, 1_000_000),   // SYS_STATUS
    (24, 1_000_000),  // GPS_RAW_INT
    (30, 100_000),    // ATTITUDE
    (32, 200_000),    // LOCAL_POSITION_NED
    (33, 200_000),    // GLOBAL_POSITION_INT
    (74, 250_000),    // VFR_HUD
    (141, 250_000),   // ALTITUDE
    (147, 2_000_000), // BATTERY_STATUS
    (242, 2_000_000), // HOME_POSITION
    (245, 500_000),   // EXTENDED_SYS_STATE
];
/// Most bytes in the send queue, so that a port that is not drained does not grow without limit.
const MAX_QUEUED_BYTES: usize = 65_536;
/// Most components that a port remembers as reachable.
const MAX_ROUTES: usize = 64;

/// One telemetry stream of a port.
#[derive(Clone, Copy, Debug)]
pub struct Stream {
    /// Message id.
    pub id: u32,
    /// Interval between messages, microseconds; 0: off.
    pub interval_us: u32,
    /// Time at which the next message is due, microseconds since boot.
    pub due_us: u64,
}

/// A COMMAND_ACK that waits until it is due.
#[derive(Clone, Copy, Debug)]
pub struct PendingAck {
    /// Number of the command (MAV_CMD).
    pub command: u16,
    /// Result (MAV_RESULT).
    pub result: u8,
    /// System and component id of the command's sender.
    pub to: (u8, u8),
}

/// Sender of a frame, and the port at which it arrived.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sender {
    /// Index of the port.
    pub(crate) port: usize,
    /// System id.
    pub(crate) system: u8,
    /// Component id.
    pub(crate) component: u8,
}

impl Sender {
    /// System and component id of the sender, without its port.
    pub(crate) fn system_and_component(self) -> (u8, u8) {
        (self.system, self.component)
    }
}

/// A MAVLink port: decodes received bytes and encodes messages to send, whatever the transport.
#[derive(Clone, Debug)]
pub struct Port {
    framer: PortFramer,
    /// System id of the autopilot.
    system_id: u8,
    /// Sequence number of the next frame.
    sequence: u8,
    /// Encoded frames; the first `sent_bytes` bytes have been fetched already.
    queue: Vec<u8>,
    /// Number of bytes of `queue` that have been fetched.
    sent_bytes: usize,
    /// Number of messages dropped because the send queue was full.
    pub dropped_messages: u64,
    /// Telemetry streams, in a fixed order.
    pub streams: Vec<Stream>,
    /// Earliest time at which a stream may be due, microseconds since boot.
    next_due_us: u64,
    /// COMMAND_ACKs that wait, each with the time at which it is due, microseconds since boot.
    pub pending_acks: Vec<(u64, PendingAck)>,
    /// Ids of messages to be sent once, at the end of the step.
    pub requested_once: Vec<u32>,
    /// Index of the next parameter of a PARAM_REQUEST_LIST that is being answered. `None` without
    /// one.
    pub param_cursor: Option<usize>,
    /// Number of PING messages sent.
    pub pings: u32,
    /// Components heard at this port: system and component id.
    reachable: Vec<(u8, u8)>,
}

impl Port {
    /// A port with the default streams of an autopilot: message id and interval in µs.
    pub fn new(system_id: u8, streams: &[(u32, u32)]) -> Self {
        // Start times are spread over the first interval, so that not all messages are due in one
        // step.
        let streams = streams
            .iter()
            .enumerate()
            .map(|(k, &(id, interval_us))| Stream {
                id,
                interval_us,
                due_us: (k as u64 * 12_000) % u64::from(interval_us.max(1)),
            })
            .collect();
        Self {
            framer: PortFramer::default(),
            system_id,
            sequence: 0,
            queue: Vec::new(),
            sent_bytes: 0,
            dropped_messages: 0,
            streams,
            next_due_us: 0,
            pending_acks: Vec::new(),
            requested_once: Vec::new(),
            param_cursor: None,
            pings: 0,
            reachable: Vec::new(),
        }
    }

    /// A port for a ground station: the messages of `streams` at the rates of [`GROUND_STREAMS`];
    /// those that are not listed there are off.
    pub fn for_ground(system_id: u8, streams: &[(u32, u32)]) -> Self {
        let rate =
            |id| GROUND_STREAMS.iter().find(|ground| ground.0 == id).map_or(0, |ground| ground.1);
        let streams: Vec<_> = streams.iter().map(|&(id, _)| (id, rate(id))).collect();
        Self::new(system_id, &streams)
    }

    /// The next whole frame in the received bytes; takes bytes from `input`. `None` if no frame is
    /// complete.
    pub fn next_frame(&mut self, now_us: u64, input: &mut &[u8]) -> Option<CheckedFrame> {
        self.framer.next(now_us, input)
    }

    /// Own system id, component id, and the sequence number of the next frame, which it counts.
    fn next_sender(&mut self) -> (u8, u8, u8) {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        (self.system_id, AUTOPILOT_COMPONENT, sequence)
    }

    /// Whether the send queue has room for one more frame; if not, counts the frame as dropped.
    fn admit_frame(&mut self) -> bool {
        if self.sent_bytes == self.queue.len() {
            self.queue.clear();
            self.sent_bytes = 0;
        }
        let room = self.queue.len() - self.sent_bytes <= MAX_QUEUED_BYTES - MAX_FRAME_LEN;
        self.dropped_messages += u64::from(!room);
        room
    }

    /// Remembers that this component can be reached by this port.
    pub fn learn_route(&mut self, sender: (u8, u8)) {
        if !self.reachable.contains(&sender) && self.reachable.len() < MAX_ROUTES {
            self.reachable.push(sender);
        }
    }

    /// Whether a component that the target (system, component) addresses was heard at this port; 0
    /// addresses all.
    pub fn is_route_to(&self, (system, component): (u8, u8)) -> bool {
        let meant =
            |&(s, c): &(u8, u8)| (system == 0 || s == system) && (component == 0 || c == component);
        self.reachable.iter().any(meant)
    }

    /// Queues another sender's frame with its ids and sequence number unchanged.
    pub fn forward_frame(&mut self, frame: &CheckedFrame) {
        if self.admit_frame() {
            frame.write(&mut self.queue);
        }
    }

    /// Queues a message.
    pub fn send<M: MessageData>(&mut self, message: &M) {
        if self.admit_frame() {
            let sender = self.next_sender();
            frame::write_message(sender, message, &mut self.queue);
        }
    }

    /// Queues a message with an encoded payload, for contents that the crate's types cannot hold.
    /// An id that the dialect does not know is ignored.
    pub fn send_raw(&mut self, id: u32, payload: &[u8]) {
        if let Some(seed) = frame::crc_extra(id) {
            self.send_with_crc_extra(id, seed, payload);
        }
    }

    /// Queues a message that the dialect does not know; `seed` is its CRC_EXTRA.
    pub fn send_with_crc_extra(&mut self, id: u32, seed: u8, payload: &[u8]) {
        if self.admit_frame() {
            let sender = self.next_sender();
            frame::write_raw(sender, id, seed, payload, &mut self.queue);
        }
    }

    /// Queues a COMMAND_ACK; the command may be unknown to the crate.
    pub fn send_ack(&mut self, ack: PendingAck) {
        let [low, high] = ack.command.to_le_bytes();
        self.send_raw(COMMAND_ACK, &[low, high, ack.result, 0, 0, 0, 0, 0, ack.to.0, ack.to.1]);
    }

    /// Queues a STATUSTEXT, cut to 50 bytes.
    pub fn send_text(&mut self, severity: u8, text: &str) {
        let mut payload = [0; 54];
        payload[0] = severity;
        let len = text.len().min(50);
        payload[1..=len].copy_from_slice(&text.as_bytes()[..len]);
        self.send_raw(STATUSTEXT, &payload);
    }

    /// Queues the COMMAND_ACKs that are due.
    pub fn send_due_acks(&mut self, now_us: u64) {
        let mut waiting = core::mem::take(&mut self.pending_acks);
        waiting.retain(|&(due_us, ack)| {
            let due = now_us >= due_us;
            if due {
                self.send_ack(ack);
            }
            !due
        });
        self.pending_acks = waiting;
    }

    /// Whether the send queue is so full that telemetry is dropped.
    pub fn is_congested(&self) -> bool {
        self.queue.len() - self.sent_bytes > MAX_QUEUED_TELEMETRY
    }

    /// Whether any stream has a message due.
    pub fn has_due_stream(&self, now_us: u64) -> bool {
        now_us >= self.next_due_us
    }

    /// Puts the ids of all due streams into `due`, in order, and schedules their next messages. If
    /// the queue is congested, drops the due messages and leaves `due` empty.
    pub fn take_due(&mut self, now_us: u64, due: &mut Vec<u32>) {
        due.clear();
        let mut next = u64::MAX;
        for stream in self.streams.iter_mut().filter(|stream| stream.interval_us > 0) {
            if now_us >= stream.due_us {
                due.push(stream.id);
                stream.due_us += u64::from(stream.interval_us);
                if stream.due_us <= now_us {
                    stream.due_us = now_us + u64::from(stream.interval_us);
                }
            }
            next = next.min(stream.due_us);
        }
        self.next_due_us = next;
        if self.is_congested() {
            self.dropped_messages += due.len() as u64;
            due.clear();
        }
    }

    /// Sets a stream's interval (0: off); false if the port has no such stream.
    pub fn set_interval(&mut self, id: u32, interval_us: u32, now_us: u64) -> bool {
        let Some(stream) = self.streams.iter_mut().find(|stream| stream.id == id) else {
            return false;
        };
        stream.interval_us = interval_us;
        stream.due_us = now_us;
        self.next_due_us = self.next_due_us.min(now_us);
        true
    }

    /// Moves queued bytes into `out`, as many whole frames as fit, and returns the number of bytes.
    /// 280 bytes hold any frame.
    pub fn poll_transmit(&mut self, out: &mut [u8]) -> usize {
        let waiting = &self.queue[self.sent_bytes..];
        let mut len = 0;
        while let Some(&[_, payload]) = waiting.get(len..len + 2) {
            let end = len + 12 + usize::from(payload);
            if end > out.len() {
                break;
            }
            len = end;
        }
        out[..len].copy_from_slice(&waiting[..len]);
        self.sent_bytes += len;
        len
    }
}
