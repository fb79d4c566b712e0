//! The drain contract as a run loop: bytes and time in, bytes and events out.
//!
//! Here the clock counts steps of 10 ms, and the autopilot sends only a HEARTBEAT each second. A
//! real shell reads a clock, reads and writes two ports, and plans
//! (`companion::planner::answer_plan_request`).
//!
//! `cargo run -p companion --example run_loop`

use companion::config::PlanFailure;
use companion::link::frame::{self, Header, MAX_FRAME_LEN};
use companion::{AUTOPILOT_COMPONENT, Companion, Config, Event, Instant, Link, State};
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;

/// At most 8 vehicles, 64 waypoints and 64 gates.
type Small = Companion<8, 64, 64>;

fn main() {
    let origin = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
    let config = Config::new(1, Point::new(0.0, 0.0, 2.0), origin);
    let mut companion = Small::new(config).expect("these settings are sound");
    let mut sent = 0;
    for step in 0..500 {
        let now = Instant::from_millis(10 * step);
        // 1. Bytes in, as they come, then a drain.
        if let Some(bytes) = received(step) {
            companion.handle_bytes(Link::Autopilot, now, &bytes);
            sent += drain(&mut companion, now);
        }
        // 2. Time in, when it is due, then a drain.
        if companion.poll_timeout().is_some_and(|due| due <= now) {
            companion.handle_timeout(now);
            sent += drain(&mut companion, now);
        }
    }
    assert_eq!(companion.state(), State::WaitPosition, "it hears an autopilot and no position");
    println!("{sent} bytes sent");
}

/// 3. Takes all that the companion has to say: events until `None`, frames of both links until 0.
///    Returns the number of bytes sent.
///
/// A shell with a flash also drains `poll_flash`, and answers by `handle_flash`.
fn drain(companion: &mut Small, now: Instant) -> usize {
    while let Some(event) = companion.poll_event() {
        println!("{now:?} {event:?}");
        if let Event::PlanRequested(wanted) = event {
            // The answer may come any time later: setpoints do not wait for it.
            companion.handle_plan(now, wanted, Err(PlanFailure::RoadmapUnusable));
        }
    }
    let (mut sent, mut buffer) = (0, [0; MAX_FRAME_LEN]);
    for link in [Link::Autopilot, Link::Swarm] {
        while let length @ 1.. = companion.poll_transmit(link, &mut buffer) {
            // Here a shell writes `buffer[..length]` to the port.
            sent += length;
        }
    }
    sent
}

/// What the autopilot's port has received by this step: once a second the HEARTBEAT of a PX4.
fn received(step: u64) -> Option<Vec<u8>> {
    let heartbeat =
        HEARTBEAT_DATA { autopilot: MavAutopilot::MAV_AUTOPILOT_PX4, ..HEARTBEAT_DATA::DEFAULT };
    let header = Header { system: 1, component: AUTOPILOT_COMPONENT, sequence: (step / 100) as u8 };
    let mut bytes = vec![0; MAX_FRAME_LEN];
    let length = frame::encode(header, &heartbeat, &mut bytes);
    bytes.truncate(length);
    step.is_multiple_of(100).then_some(bytes)
}
