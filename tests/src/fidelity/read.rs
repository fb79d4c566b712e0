//! Reads a recorded flight from `data/flights/RUN.csv`: one row per setpoint, report or event.

use std::path::Path;

use nalgebra::Vector3;
use planner_core::geo::frames::Geodetic;
use sim_autopilot::SimulatedKind;

use super::recording::{Message, Recording, Sample, Setpoint};

/// The parameters between a command's brackets, and the text after them.
fn parse_parameters(text: &str) -> Option<([f32; 7], &str)> {
    let (inside, after) = text.split_once('[')?.1.split_once(']')?;
    let mut params = [0.0; 7];
    for (param, word) in params.iter_mut().zip(inside.split_whitespace()) {
        *param = word.parse().ok()?;
    }
    Some((params, after))
}

fn parse_message(text: &str) -> Option<Message> {
    if let Some(rest) = text.strip_prefix("companion param set GUID_TIMEOUT ") {
        return Some(Message::GuidedTimeout(rest.split_whitespace().next()?.parse().ok()?));
    }
    let (from, rest) = text.split_once(" command ")?;
    let (params, after) = parse_parameters(rest)?;
    let command: u16 = rest.split_whitespace().next()?.parse().ok()?;
    // Commands that fly the vehicle; requests for streams change no flight.
    let flies = matches!(command, 20 | 21 | 22 | 176 | 400);
    match from {
        "companion" if flies && !after.contains("/0") => {
            Some(Message::Command(1, 191, command, params))
        }
        "gcs" if flies && after.contains("component 1") => {
            Some(Message::Command(255, 190, command, params))
        }
        _ => None,
    }
}

/// State of reading the event rows of a recording.
struct EventReader {
    /// Commands without an ack so far (only accepted ones are replayed), and all PARAM_SETs.
    unacknowledged: Vec<(f64, Message)>,
    armed: bool,
}

impl EventReader {
    fn take_event(&mut self, t_s: f64, text: &str, recording: &mut Recording) {
        if let Some(place) = text.strip_prefix("autopilot origin ") {
            let numbers: Vec<f64> = place.split(' ').filter_map(|n| n.parse().ok()).collect();
            recording.ekf_origin =
                Geodetic { lat_deg: numbers[0], lon_deg: numbers[1], alt_m: numbers[2] };
        }
        if text.contains("Stabilize") {
            recording.autopilot = SimulatedKind::Ardupilot;
        }
        if let Some(message) = parse_message(text) {
            self.unacknowledged.push((t_s, message));
        }
        if let Some(ack) = text.strip_prefix("autopilot ack ") {
            self.take_ack(t_s, ack, recording);
        }
        if text.starts_with("autopilot disarmed")
            && self.armed
            && t_s > recording.armed_span_s.0 + 3.0
        {
            recording.armed_span_s.1 = t_s;
            self.armed = false;
        }
        if text.contains("-> Follow") && recording.follow_span_s.0.is_infinite() {
            recording.follow_span_s.0 = t_s;
        }
        if text.contains("-> Land") && recording.follow_span_s.1.is_infinite() {
            recording.follow_span_s.1 = t_s;
        }
    }

    fn take_ack(&mut self, t_s: f64, ack: &str, recording: &mut Recording) {
        let mut words = ack.split(' ');
        let command: u16 = words.next().and_then(|w| w.parse().ok()).expect("an ack's command");
        let result: u8 = words.nth(1).and_then(|w| w.parse().ok()).expect("an ack's result");
        let first = self.unacknowledged.iter().position(
            |(_, message)| matches!(message, Message::Command(_, _, id, _) if *id == command),
        );
        if let Some(first) = first {
            let (at_s, message) = self.unacknowledged.remove(first);
            if result == 0 {
                if let Message::Command(.., 400, params) = message {
                    self.armed = params[0] == 1.0;
                    if self.armed {
                        recording.armed_span_s.0 = t_s;
                    }
                }
                recording.messages.push((at_s, message));
            }
        }
    }
}

/// Reads the flight of one vehicle of a run.
pub(super) fn read(path: &Path, run: &str, vehicle: u8) -> Recording {
    let text = std::fs::read_to_string(path).expect("a recording can be read");
    let mut recording = Recording {
        run: run.into(),
        vehicle,
        autopilot: SimulatedKind::Px4,
        ekf_origin: Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 },
        estimate: Vec::new(),
        truth: Vec::new(),
        armed_span_s: (f64::INFINITY, f64::INFINITY),
        follow_span_s: (f64::INFINITY, f64::INFINITY),
        setpoints: Vec::new(),
        messages: Vec::new(),
    };
    let mut events = EventReader { unacknowledged: Vec::new(), armed: false };
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.splitn(16, ',').collect();
        let number = |k: usize| cells[k].parse::<f64>().unwrap_or(0.0);
        let vector = |k: usize| Vector3::new(number(k), number(k + 1), number(k + 2));
        let t_s = number(0);
        if cells[1] != vehicle.to_string() {
            continue;
        }
        match cells[2] {
            "estimate" => {
                recording.estimate.push(Sample { t_s, position: vector(3), velocity: vector(6) });
            }
            "truth" => {
                recording.truth.push(Sample { t_s, position: vector(3), velocity: vector(6) });
            }
            "setpoint" => {
                let f32s = |k: usize| [0, 1, 2].map(|axis| number(k + axis) as f32);
                recording.setpoints.push(Setpoint {
                    t_s,
                    mask: number(12) as u16,
                    position: f32s(3),
                    velocity: f32s(6),
                    acceleration: f32s(9),
                    yaw: number(14) as f32,
                });
            }
            _ => {
                events.take_event(t_s, cells[15].trim_matches('"'), &mut recording);
            }
        }
    }
    recording.messages.extend(
        events.unacknowledged.into_iter().filter(|(_, m)| matches!(m, Message::GuidedTimeout(_))),
    );
    recording.messages.sort_by(|a, b| a.0.total_cmp(&b.0));
    recording
}
