//! A client, a bad link and the FTP server.

extern crate std;

use std::collections::BTreeMap;
use std::vec;
use std::vec::Vec;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

use super::super::packet::{ACK, NAK, op};
use super::super::*;
use crate::link::frame::{self, Framer, Header};
use crate::storage::store::MAX_READ_LEN;
use crate::testing::fake_flash::{Flash, execute, started};

/// System id and component id of the server.
const US: (u8, u8) = (7, crate::COMPANION_COMPONENT);
/// Index of the link by which the client sends.
const LINK: usize = 1;

/// A reply of the server; `answers` is the request's opcode, `last` whether the burst is complete.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Packet {
    pub(super) sequence: u16,
    pub(super) session: u8,
    pub(super) opcode: u8,
    pub(super) answers: u8,
    pub(super) last: bool,
    pub(super) offset: u32,
    pub(super) data: Vec<u8>,
}

/// The server with its flash, and a client behind a lossy link.
pub(super) struct World {
    pub(super) flash: Flash,
    pub(super) store: Store,
    pub(super) ftp: Ftp,
    pub(super) erasing: ErasePermission,
    pub(super) now: Instant,
    pub(super) rng: Pcg32,
    /// Share of frames lost, in 256ths.
    pub(super) loss: u32,
    /// Share of frames repeated, in 256ths.
    pub(super) repeats: u32,
    /// Requests under way to the server.
    pub(super) under_way: Vec<Vec<u8>>,
    /// Replies that arrived at the client.
    pub(super) heard: Vec<Packet>,
    /// STATUSTEXTs of the server.
    pub(super) texts: Vec<&'static str>,
    /// System id and component id.
    pub(super) client: (u8, u8),
    pub(super) sequence: u16,
}

impl World {
    pub(super) fn new(seed: u64, loss: u32, repeats: u32) -> Self {
        let mut flash = Flash::new(seed);
        let store = started(&mut flash);
        Self {
            flash,
            store,
            ftp: Ftp::default(),
            erasing: ErasePermission::Allowed,
            now: Instant::from_millis(1),
            rng: Pcg32::seed_from_u64(seed),
            loss,
            repeats,
            under_way: Vec::new(),
            heard: Vec::new(),
            texts: Vec::new(),
            client: (255, 190),
            sequence: 0,
        }
    }

    /// Restarts the server with the same flash.
    pub(super) fn restart(&mut self) {
        self.store = started(&mut self.flash);
        self.ftp = Ftp::default();
    }

    /// True with a probability of `share` 256ths.
    pub(super) fn chance(&mut self, share: u32) -> bool {
        self.rng.next_u32() % 256 < share
    }

    /// The payload of a request with the next sequence number.
    pub(super) fn packet(
        &mut self,
        session: u8,
        opcode: u8,
        size: u8,
        offset: u32,
        data: &[u8],
    ) -> Vec<u8> {
        let mut p = vec![0; PAYLOAD_LEN];
        (p[1], p[2]) = US;
        p[3..5].copy_from_slice(&self.sequence.to_le_bytes());
        self.sequence = self.sequence.wrapping_add(1);
        p[5..8].copy_from_slice(&[session, opcode, size]);
        p[11..15].copy_from_slice(&offset.to_le_bytes());
        p[15..15 + data.len()].copy_from_slice(data);
        p
    }

    pub(super) fn send(&mut self, packet: &[u8]) {
        if !self.chance(self.loss) {
            self.under_way.push(packet.to_vec());
        }
        if self.chance(self.repeats) {
            self.under_way.push(packet.to_vec());
        }
    }

    /// Lets 5 ms pass: requests under way arrive in random order, the server works, and its replies
    /// come back.
    pub(super) fn step(&mut self) {
        self.now = self.now + Duration::from_millis(5);
        while !self.under_way.is_empty() {
            // The requests that stay under way are overtaken by later ones.
            if self.under_way.len() > 1 && self.chance(40) {
                break;
            }
            let pick = self.rng.next_u32() as usize % self.under_way.len().min(2);
            let payload = self.under_way.remove(pick);
            let mut bytes = [0; frame::MAX_FRAME_LEN];
            let header = Header { system: self.client.0, component: self.client.1, sequence: 0 };
            let length = frame::encode_raw(header, MESSAGE_ID, 84, &payload, &mut bytes);
            let frame = Framer::new().next(self.now, &mut &bytes[..length]).expect("it is whole");
            self.ftp.queue_request(LINK, self.now, &frame);
        }
        let mut read = [0; MAX_READ_LEN];
        for _ in 0..2000 {
            self.ftp.continue_work(&mut self.store, self.now, self.erasing);
            self.texts.extend(self.ftp.take_text().map(|(_, text)| text));
            assert!(self.ftp.poll_reply(0).is_none(), "answered where it was asked");
            let answer = self.ftp.poll_reply(LINK);
            if let Some(p) = answer {
                assert_eq!((p[1], p[2]), self.client);
                if !self.chance(self.loss) {
                    let size = usize::from(p[7]);
                    self.heard.push(Packet {
                        sequence: u16::from_le_bytes([p[3], p[4]]),
                        session: p[5],
                        opcode: p[6],
                        answers: p[8],
                        last: p[9] == 1,
                        offset: u32::from_le_bytes([p[11], p[12], p[13], p[14]]),
                        data: p[15..15 + size].to_vec(),
                    });
                }
            }
            let Some(request) = self.store.poll_request(self.erasing) else {
                if answer.is_none() {
                    return;
                }
                continue;
            };
            let outcome =
                execute(&mut self.flash, request, self.erasing, &mut read).expect("no power cut");
            if let Some(answer) = self.store.handle_flash_outcome(outcome.map(|len| &read[..len])) {
                self.ftp.handle_read_outcome(answer);
            }
        }
    }

    /// Sends a request until it is answered, as clients do.
    pub(super) fn ask(&mut self, session: u8, opcode: u8, offset: u32, data: &[u8]) -> Packet {
        let request = self.packet(session, opcode, data.len() as u8, offset, data);
        self.ask_again(&request)
    }

    /// Sends this request until it is answered.
    pub(super) fn ask_again(&mut self, request: &[u8]) -> Packet {
        let sequence = u16::from_le_bytes([request[3], request[4]]).wrapping_add(1);
        for _ in 0..200 {
            self.send(request);
            self.step();
            if let Some(at) =
                self.heard.iter().position(|p| p.sequence == sequence && p.answers == request[6])
            {
                return self.heard.remove(at);
            }
        }
        panic!("no answer to opcode {}", request[6]);
    }

    /// Uploads as pymavlink does, with five pieces under way.
    pub(super) fn upload(&mut self, name: &str, file: &[u8], piece: usize) -> Packet {
        let opened = self.ask(0, op::CREATE, 0, name.as_bytes());
        assert_eq!(opened.opcode, ACK, "{opened:?}");
        let session = opened.session;
        // Pieces by the sequence number of their answer, so that late answers of an earlier upload
        // are ignored.
        let mut missing: BTreeMap<u16, Vec<u8>> = BTreeMap::new();
        for (i, part) in file.chunks(piece).enumerate() {
            let packet =
                self.packet(session, op::WRITE, part.len() as u8, (i * piece) as u32, part);
            missing.insert(self.sequence, packet);
        }
        for _ in 0..20_000 {
            if missing.is_empty() {
                return self.ask(session, op::TERMINATE, 0, &[]);
            }
            let next: Vec<_> = missing.values().take(5).cloned().collect();
            next.iter().for_each(|packet| self.send(packet));
            self.step();
            for answer in self.heard.drain(..).filter(|p| p.answers == op::WRITE) {
                if let Some(packet) = missing.remove(&answer.sequence) {
                    assert_eq!((answer.opcode, answer.session), (ACK, session), "{answer:?}");
                    assert_eq!(answer.offset.to_le_bytes(), packet[11..15]);
                }
            }
        }
        panic!("it never ends");
    }

    /// Reads a whole file by single read requests.
    pub(super) fn download(&mut self, name: &str, piece: u8) -> Vec<u8> {
        let opened = self.ask(0, op::OPEN_READ, 0, name.as_bytes());
        assert_eq!(opened.opcode, ACK, "{opened:?}");
        let size = u32::from_le_bytes(opened.data[..4].try_into().unwrap());
        let mut file = Vec::new();
        loop {
            let request = self.packet(opened.session, op::READ, piece, file.len() as u32, &[]);
            let answer = self.ask_again(&request);
            if answer.opcode == NAK {
                assert_eq!(answer.data, [6]);
                assert_eq!(file.len() as u32, size);
                assert_eq!(self.ask(opened.session, op::TERMINATE, 0, &[]).opcode, ACK);
                return file;
            }
            file.extend_from_slice(&answer.data);
        }
    }
}
