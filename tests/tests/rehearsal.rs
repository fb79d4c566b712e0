//! Rehearses docs/companion.md: `host-sim companion` and an autopilot in two processes, over every
//! kind of link, through a pilot's takeover, lost setpoints and a reboot. All in real time, with
//! long timeouts.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::{self, sleep};
use std::time::{Duration, Instant as Clock};

use companion::Instant;
use companion::link::frame::{self, Framer, Header};
use flockmate_tests::{
    ChildGuard, free_port, host_sim_path, start_autopilot, start_listening, workspace,
};
use host_sim::link::{ByteLink, LinkUrl};
use serialport::TTYPort;

/// Timeout of a wait. A machine may stand still for long; no step that works takes half as long.
const PATIENCE: Duration = Duration::from_secs(150);
/// ArduCopter, whose estimator is ready sooner than the real one's.
const ARDUPILOT: &[&str] = &["--personality", "ardupilot", "--ready-after", "3"];
const GROUND_STATION: Header = Header { system: 255, component: 190, sequence: 0 };
const PX4_HOLD: [f32; 3] = [1.0, 4.0, 3.0];
const PX4_OFFBOARD: [f32; 3] = [1.0, 6.0, 0.0];

/// A companion of the lobby's first vehicle, started at once, and what it prints.
struct Flight {
    process: ChildGuard,
    lines: Receiver<String>,
    seen: Vec<String>,
}

impl Flight {
    fn begin(autopilot: &str) -> Self {
        let mut child = Command::new(host_sim_path())
            .args(["companion", "--id", "1", "--start", "--autopilot", autopilot])
            .arg(workspace().join("host-sim/scenarios/lobby.toml"))
            .stdout(Stdio::piped())
            .spawn()
            .expect("the companion starts");
        let output = BufReader::new(child.stdout.take().expect("stdout is piped"));
        let (sender, lines) = channel();
        thread::spawn(move || {
            output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        Self { process: ChildGuard(child), lines, seen: Vec::new() }
    }

    /// Waits for a line that contains `text`, and calls `meanwhile` every half second.
    fn until(&mut self, text: &str, mut meanwhile: impl FnMut()) {
        let began = Clock::now();
        while !self.seen.last().is_some_and(|line| line.contains(text)) {
            assert!(began.elapsed() < PATIENCE, "no {text:?} in {:#?}", self.seen);
            match self.lines.recv_timeout(Duration::from_millis(500)) {
                Ok(line) => self.seen.push(line),
                Err(RecvTimeoutError::Timeout) => meanwhile(),
                Err(RecvTimeoutError::Disconnected) => {
                    panic!("it ended without {text:?}: {:#?}", self.seen)
                }
            }
        }
    }

    /// Its exit code, once it has ended by itself.
    fn end(mut self) -> (Option<i32>, Vec<String>) {
        let status = self.process.wait_for(PATIENCE);
        self.seen.extend(self.lines.iter());
        (status.and_then(|status| status.code()), self.seen)
    }

    fn signal(&self, name: &str) {
        let kill = Command::new("kill").args([name, &self.process.0.id().to_string()]).status();
        assert!(kill.expect("kill starts").success());
    }
}

/// A pilot's or operator's link.
struct Ground {
    link: Box<dyn ByteLink>,
    framer: Framer,
    sequence: u8,
    began: Clock,
}

impl Ground {
    fn new(url: &str) -> Self {
        let link = url.parse::<LinkUrl>().unwrap().open().unwrap();
        Self { link, framer: Framer::new(), sequence: 0, began: Clock::now() }
    }

    fn send(&mut self, id: u32, payload: &[u8]) {
        let header = Header { sequence: self.sequence, ..GROUND_STATION };
        self.sequence = self.sequence.wrapping_add(1);
        let mut out = [0; frame::MAX_FRAME_LEN];
        let length =
            frame::encode_raw(header, id, frame::extra_crc(id).unwrap(), payload, &mut out);
        self.link.send(&out[..length]).unwrap();
    }

    /// COMMAND_LONG to a component of vehicle 1.
    fn command(&mut self, component: u8, command: u16, params: [f32; 3]) {
        let mut payload = [0; 33];
        for (k, param) in params.iter().enumerate() {
            payload[4 * k..4 * k + 4].copy_from_slice(&param.to_le_bytes());
        }
        payload[28..30].copy_from_slice(&command.to_le_bytes());
        payload[30..32].copy_from_slice(&[1, component]);
        self.send(76, &payload);
    }

    fn set_integer(&mut self, name: &str, value: i32) {
        let mut payload = [0; 23];
        payload[..4].copy_from_slice(&value.to_le_bytes());
        payload[4..6].copy_from_slice(&[1, 1]);
        payload[6..6 + name.len()].copy_from_slice(name.as_bytes());
        payload[22] = 6;
        self.send(23, &payload);
    }

    /// Waits for the autopilot's HEARTBEAT with this MAV_STATE.
    fn until_state(&mut self, state: u8) {
        let mut buffer = [0; 2048];
        let began = Clock::now();
        while began.elapsed() < PATIENCE {
            let length = self.link.receive(&mut buffer).unwrap();
            let now = Instant::from_micros(self.began.elapsed().as_micros() as u64);
            let mut input = &buffer[..length];
            while let Some(heard) = self.framer.next(now, &mut input) {
                if heard.message_id == 0 && heard.padded_payload()[7] == state {
                    return;
                }
            }
            if length == 0 {
                sleep(Duration::from_millis(5));
            }
        }
        panic!("no HEARTBEAT with state {state}");
    }
}

fn assert_done((code, lines): (Option<i32>, Vec<String>)) {
    assert!(
        code == Some(0) && lines.iter().any(|line| line.contains("Landed")),
        "{code:?} {lines:#?}"
    );
}

/// A radio with this share of losses, and the addresses of its links.
fn radio(links: usize, loss: &str) -> (ChildGuard, Vec<String>) {
    let mut command = Command::new(host_sim_path());
    command.args(["radio", "--delay", "0.02", "--loss", loss]);
    (0..links).for_each(|_| {
        command.args(["--listen", "udp-listen:127.0.0.1:0"]);
    });
    start_listening(command, links)
}

/// Uploads a file; returns what the program prints.
fn upload(link: &str, file: &std::path::Path) -> String {
    let done = Command::new(host_sim_path()).args(["upload", "--link", link]).arg(file).output();
    let done = done.expect("the upload starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// Two pseudo terminals joined by a wire: the paths of its ends.
fn wire() -> [String; 2] {
    let ends = [(), ()].map(|()| {
        let (mut near, far) = TTYPort::pair().unwrap();
        serialport::SerialPort::set_timeout(&mut near, Duration::from_millis(2)).unwrap();
        let path = serialport::SerialPort::name(&far).unwrap();
        (near, path)
    });
    let [(mut a, path_a), (mut b, path_b)] = ends;
    // Before both ends are open, and after they are closed, reads fail: errors count as silence.
    thread::spawn(move || {
        let mut buffer = [0; 1024];
        loop {
            let from_a = a.read(&mut buffer).unwrap_or(0);
            let _ = b.write_all(&buffer[..from_a]);
            let from_b = b.read(&mut buffer).unwrap_or(0);
            let _ = a.write_all(&buffer[..from_b]);
            if from_a + from_b == 0 {
                sleep(Duration::from_millis(1));
            }
        }
    });
    [path_a, path_b]
}

#[test]
fn arducopter_is_flown_over_tcp_and_waits_for_a_companion_that_stalls() {
    let (_autopilot, at) = start_autopilot(&["tcp-listen:127.0.0.1:0"], ARDUPILOT);
    let mut flight = Flight::begin(&format!("tcp:{}", at[0]));
    flight.until("Climb → Follow", || ());
    flight.signal("-STOP");
    sleep(Duration::from_secs(2));
    flight.signal("-CONT");
    assert_done(flight.end());
}

#[test]
fn arducopter_is_flown_over_a_serial_line() {
    let [near, far] = wire();
    let _autopilot = start_autopilot(&[&format!("serial:{near}:57600")], ARDUPILOT);
    assert_done(Flight::begin(&format!("serial:{far}:57600")).end());
}

#[test]
fn px4_is_flown_over_udp_and_given_back_by_its_pilot() {
    let port = free_port();
    let (_autopilot, at) =
        start_autopilot(&[&format!("udp:127.0.0.1:{port}"), "udp-listen:127.0.0.1:0"], &[]);
    let mut pilot = Ground::new(&format!("udp:{}", at[1]));
    let mut operator = Ground::new(&format!("udp:127.0.0.1:{port}"));
    let mut flight = Flight::begin(&format!("udp-listen:127.0.0.1:{port}"));
    flight.until("Climb → Follow", || ());
    flight.until("Pilot has control: mission stopped", || pilot.command(1, 176, PX4_HOLD));
    // Offboard alone does not continue the mission; the operator's command does.
    flight.until("Resumed after the pilot", || {
        pilot.command(1, 176, PX4_OFFBOARD);
        operator.command(191, 193, [1.0, 0.0, 0.0]);
    });
    assert_done(flight.end());
}

#[test]
fn px4_lands_when_its_companion_stalls_and_gets_no_setpoint_afterwards() {
    let port = free_port();
    let (_autopilot, at) =
        start_autopilot(&[&format!("udp:127.0.0.1:{port}"), "udp-listen:127.0.0.1:0"], &[]);
    let mut pilot = Ground::new(&format!("udp:{}", at[1]));
    let mut flight = Flight::begin(&format!("udp-listen:127.0.0.1:{port}"));
    // The message is repeated: an address that is silent for long is sent nothing any more.
    flight.until("Climb → Follow", || pilot.set_integer("COM_OBL_RC_ACT", 4));
    pilot.set_integer("COM_OBL_RC_ACT", 4);
    flight.signal("-STOP");
    pilot.until_state(5);
    flight.signal("-CONT");
    flight.until("Autopilot failsafe: setpoints stopped", || ());
    let (code, lines) = flight.end();
    assert!(
        code == Some(1) && lines.last().unwrap().contains("Landed after failsafe"),
        "{code:?} {lines:#?}"
    );
}

#[test]
fn an_arducopter_that_reboots_in_flight_ends_the_mission_on_the_ground() {
    let port = free_port();
    let (mut first, at) = start_autopilot(&[&format!("tcp-listen:127.0.0.1:{port}")], ARDUPILOT);
    let mut flight = Flight::begin(&format!("tcp:{}", at[0]));
    flight.until("Climb → Follow", || ());
    let killed = |child: &mut Child| child.kill().and_then(|()| child.wait());
    killed(&mut first.0).expect("it can be ended");
    let _second = start_autopilot(&[&format!("tcp-listen:{}", at[0])], ARDUPILOT);
    flight.until("Disarmed in flight: mission over", || ());
    let (code, lines) = flight.end();
    assert_eq!(code, Some(1), "{lines:#?}");
}

#[test]
fn files_go_up_through_the_autopilot_and_over_a_radio_that_loses() {
    let files = tempfile::tempdir().expect("a directory");
    let lobby = workspace().join("host-sim/scenarios/lobby.toml");
    let mut plan = Command::new(host_sim_path());
    plan.arg("plan").arg(&lobby).arg("--out").arg(files.path()).stdout(Stdio::null());
    assert!(plan.status().expect("host-sim starts").success());
    let port = free_port();
    let (_autopilot, at) =
        start_autopilot(&[&format!("udp:127.0.0.1:{port}"), "udp-listen:127.0.0.1:0"], &[]);
    let (_radio, ends) = radio(2, "0.1");
    let companion = Command::new(host_sim_path())
        .args(["companion", "--id", "1", "--autopilot", &format!("udp-listen:127.0.0.1:{port}")])
        .args(["--swarm", &format!("udp:{}", ends[0])])
        .arg(&lobby)
        .stdout(Stdio::null())
        .spawn()
        .expect("the companion starts");
    let _companion = ChildGuard(companion);
    let said = upload(&format!("udp:{}", ends[1]), &files.path().join("mission.bin"));
    assert!(said.contains("vehicle 1's mission.bin") && said.contains("CRC-32 right"), "{said}");
    let said = upload(&format!("udp:{}", at[1]), &files.path().join("roadmap.bin"));
    assert!(said.contains("vehicle 1's roadmap.bin") && said.contains("CRC-32 right"), "{said}");
}
