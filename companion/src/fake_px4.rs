//! A scripted autopilot, PX4 or ArduCopter, for unit tests: the modes, acks and streams the companion relies on, and a
//! vehicle that goes where the setpoint says at a limited speed. The real closed loop is host-sim's.

extern crate std;
use std::vec::Vec;

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::*;
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::deconflict::Method;
use planner_core::frames::{self, Geodetic};
use planner_core::path::Path;
use planner_core::schedule::VehiclePlan;

use crate::autopilot::Kind;
use crate::frame::{self, Frame, Framer, Header, MAX_SENT};
use crate::intent::{self, Intent};
use crate::{Companion, Config, Duration, Event, Instant, Link, RosterEntry, px4};

pub type Small = Companion<4, 16, 8>;

pub const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
/// 300 m away and 20 m up: frames that are mixed up fly into the ground.
pub const EKF_ORIGIN: Geodetic = Geodetic { lat_deg: 40.3350, lon_deg: -3.7640, alt_m: 720.0 };
pub const SYSTEM: u8 = 42;
pub const START: Point = Point::new(8.0, 12.0, 1.5);
pub const GOAL: Point = Point::new(16.0, 12.0, 3.5);

/// The autopilot, the radio's other end, and the companion between them.
pub struct Bench {
    pub kind: Kind,
    /// ArduCopter: message ids whose streams were asked for.
    pub streams: Vec<u16>,
    /// ArduCopter: flags of EKF_STATUS_REPORT.
    pub ekf_flags: u16,
    /// ArduCopter: NAV_TAKEOFF lifted it off.
    pub took_off: bool,
    /// ArduCopter: how long the motors take to lift it off.
    pub spool: Duration,
    lifts_at: Instant,
    pub timesyncs: Vec<(i64, i64)>,
    pub companion: Small,
    pub now: Instant,
    pub enu: Point,
    pub mode: u32,
    pub armed: bool,
    pub status: u8,
    pub battery: i8,
    /// Commands refused: `MAV_CMD` numbers.
    pub refused: Vec<u16>,
    /// No command is answered; a refused one is not answered either.
    pub mute: bool,
    /// SYS_STATUS does not come.
    pub no_battery: bool,
    /// The landing detector says ground, whatever the height.
    pub false_ground: bool,
    /// Vertical speed as reported, m/s.
    pub climbs_mps: f32,
    pub silent: bool,
    pub no_position: bool,
    /// What ESTIMATOR_STATUS reports, metres; none: it is not sent.
    pub accuracy_m: Option<f32>,
    /// ArduCopter: variance ratio of EKF_STATUS_REPORT.
    pub variance: f32,
    pub stays_armed: bool,
    /// Arming is accepted, and undone by the pilot before a HEARTBEAT shows it.
    pub never_arms: bool,
    /// No setpoint moves it.
    pub stuck: bool,
    pub never_lands: bool,
    pub events: Vec<Event>,
    pub setpoints: Vec<(Instant, Point, u16)>,
    pub commands: Vec<(u16, f32, f32, f32)>,
    pub texts: Vec<std::string::String>,
    pub swarm: Vec<Frame>,
    pub acks: Vec<(u16, u8, u8, u8)>,
    /// ArduCopter: the height NAV_TAKEOFF asked for.
    pub takeoff_m: f32,
    target: Option<Point>,
    framers: [Framer; 2],
    sequence: u8,
    gcs_sequence: u8,
    landed_at: Option<Instant>,
    idle_since: Option<Instant>,
    pub origin: Geodetic,
    pub answer_plan: Option<Result<VehiclePlan<16, 8>, crate::PlanFailure>>,
    /// Whether there is a way around: by y = 16.
    pub answer_detour: Option<Result<(), crate::PlanFailure>>,
    /// The first other vehicle of the roster, or 77, as it tells itself five times a second: place, flags of its intent, progress, CRC of its plan.
    pub neighbour: Option<(Point, u8, f32, u32)>,
    /// When it last knew where it is; none: always.
    pub neighbour_clock: Option<Instant>,
    told: u8,
}

pub fn config() -> Config<4> {
    let mut config = Config::new(SYSTEM, START, ORIGIN);
    config.method = Method::Priority;
    config.mission_crc = 0xC0FFEE;
    config
}

pub fn two_vehicles() -> Config<4> {
    let mut config = config();
    config.roster.push(RosterEntry { system_id: 77, start: Point::new(8.0, 20.0, 1.5) }).unwrap();
    config
}

pub fn plan() -> VehiclePlan<16, 8> {
    let mut path = Path::new();
    for point in [START, Point::new(16.0, 12.0, 1.5), GOAL] {
        path.push(point, 1.2).unwrap();
    }
    let gates = heapless::Vec::new();
    VehiclePlan { goal: Some(0), path, climb_m: 1.5, descent_m: 3.5, depart_s: 0.0, gates, plan_crc: 5 }
}

impl Bench {
    pub fn new(config: Config<4>) -> Self {
        Self {
            kind: Kind::Px4,
            streams: Vec::new(),
            ekf_flags: 0x33F,
            took_off: false,
            spool: Duration::default(),
            lifts_at: Instant::ZERO,
            timesyncs: Vec::new(),
            companion: Companion::new(config).unwrap(),
            now: Instant::ZERO,
            enu: Point::new(START.x, START.y, 0.0),
            mode: px4::HOLD,
            armed: false,
            status: 3,
            battery: 90,
            refused: Vec::new(),
            mute: false,
            no_battery: false,
            false_ground: false,
            climbs_mps: 0.0,
            silent: false,
            no_position: false,
            accuracy_m: Some(0.02),
            variance: 0.1,
            stays_armed: false,
            never_arms: false,
            stuck: false,
            never_lands: false,
            events: Vec::new(),
            setpoints: Vec::new(),
            commands: Vec::new(),
            texts: Vec::new(),
            swarm: Vec::new(),
            acks: Vec::new(),
            takeoff_m: 0.0,
            target: None,
            framers: [Framer::new(), Framer::new()],
            sequence: 0,
            gcs_sequence: 0,
            landed_at: None,
            idle_since: None,
            origin: EKF_ORIGIN,
            answer_plan: Some(Ok(plan())),
            answer_detour: Some(Ok(())),
            neighbour: None,
            neighbour_clock: None,
            told: 0,
        }
    }

    pub fn state(&self) -> crate::State {
        self.companion.state()
    }

    pub fn ned(&self) -> Vector3<f64> {
        let place = frames::enu_to_geodetic(&ORIGIN, &self.enu);
        frames::geodetic_to_ned(self.kind.projection(), &self.origin, &place)
    }

    pub fn bytes<M: MessageData>(&mut self, message: &M) -> Vec<u8> {
        let mut out = [0; MAX_SENT];
        let header = Header { system: SYSTEM, component: 1, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let len = frame::encode(header, message, &mut out);
        out[..len].to_vec()
    }

    pub fn tell<M: MessageData>(&mut self, message: &M) {
        let bytes = self.bytes(message);
        self.companion.handle_bytes(Link::Autopilot, self.now, &bytes);
        self.drain();
    }

    /// A command from the ground station, on the swarm link.
    pub fn command(&mut self, command: MavCmd, param1: f32, system: u8, component: u8) {
        let data = COMMAND_LONG_DATA {
            command,
            param1,
            target_system: system,
            target_component: component,
            ..Default::default()
        };
        let mut out = [0; MAX_SENT];
        let header = Header { system: 255, component: 190, sequence: self.gcs_sequence };
        self.gcs_sequence = self.gcs_sequence.wrapping_add(1);
        let len = frame::encode(header, &data, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..len]);
        self.drain();
    }

    pub fn start(&mut self) {
        self.command(MavCmd::MAV_CMD_MISSION_START, 0.0, SYSTEM, crate::COMPONENT);
    }

    pub fn drain(&mut self) {
        for link in [Link::Autopilot, Link::Swarm] {
            let mut out = [0; MAX_SENT];
            loop {
                let len = self.companion.poll_transmit(link, &mut out);
                if len == 0 {
                    break;
                }
                let mut input = &out[..len];
                let frame = self.framers[link as usize].next(self.now, &mut input).expect("a whole frame");
                assert_eq!((frame.system, frame.component), (SYSTEM, crate::COMPONENT));
                self.receive(link, frame);
            }
        }
        while let Some(event) = self.companion.poll_event() {
            self.events.push(event);
            if let Some(request) = self.companion.detour(|_| {}) {
                let answer = self.answer_detour.map(|answer| {
                    answer.map(|()| {
                        let mut path = Path::new();
                        path.push(request.here, 1.2).unwrap();
                        path.push(Point::new(13.0, 16.0, 2.0), 1.2).unwrap();
                        path.push(GOAL, 1.2).unwrap();
                        VehiclePlan { path, ..plan() }
                    })
                });
                if let (Event::PlanRequested, Some(answer)) = (event, answer) {
                    self.companion.handle_plan(self.now, answer.as_ref().map_err(|e| *e));
                }
            } else if event == Event::PlanRequested
                && let Some(answer) = self.answer_plan.clone()
            {
                self.companion.handle_plan(self.now, answer.as_ref().map_err(|e| *e));
            }
        }
    }

    pub fn send_origin(&mut self) {
        let origin = GPS_GLOBAL_ORIGIN_DATA {
            latitude: (self.origin.lat_deg * 1e7).round() as i32,
            longitude: (self.origin.lon_deg * 1e7).round() as i32,
            altitude: (self.origin.alt_m * 1e3) as i32,
        };
        self.tell(&origin);
    }

    fn receive(&mut self, link: Link, frame: Frame) {
        let p = frame.padded();
        if frame.message_id == COMMAND_ACK_DATA::ID {
            self.acks.push((u16::from_le_bytes([p[0], p[1]]), p[2], p[8], p[9]));
        }
        if let Some(text) = frame.decode::<STATUSTEXT_DATA>() {
            self.texts.push(text.text.to_str().unwrap().into());
        }
        if link == Link::Swarm {
            self.swarm.push(frame);
            return;
        }
        if let Some(s) = frame.decode::<SET_POSITION_TARGET_LOCAL_NED_DATA>() {
            assert_eq!((s.target_system, s.target_component), (SYSTEM, 1));
            assert_eq!(s.coordinate_frame, MavFrame::MAV_FRAME_LOCAL_NED);
            let ned = Vector3::new(f64::from(s.x), f64::from(s.y), f64::from(s.z));
            let place = frames::ned_to_geodetic(self.kind.projection(), &self.origin, &ned);
            let enu = frames::geodetic_to_enu(&ORIGIN, &place);
            // ArduCopter gives a take-off up for a setpoint that comes before the lift-off.
            self.took_off &= !self.on_ground();
            assert!(enu.iter().all(|c| c.is_finite()));
            self.target = (s.type_mask.bits() == self.kind.move_mask()).then_some(enu);
            self.setpoints.push((self.now, enu, s.type_mask.bits()));
        }
        if let Some(t) = frame.decode::<TIMESYNC_DATA>() {
            self.timesyncs.push((t.tc1, t.ts1));
        }
        if let Some(c) = frame.decode::<COMMAND_LONG_DATA>() {
            assert_eq!((c.target_system, c.target_component), (SYSTEM, 1));
            let number = c.command as u16;
            self.commands.push((number, c.param1, c.param2, c.param3));
            if self.silent {
                return;
            }
            // Neither autopilot disarms in the air, where it knows that it is there.
            let disarms_in_air = number == 400 && c.param1 == 0.0 && !self.on_ground() && self.armed;
            let takes_off_disarmed = number == 22 && !self.armed;
            let refused = self.refused.contains(&number) || disarms_in_air || takes_off_disarmed;
            if !self.mute {
                self.answer(number, if refused { 4 } else { 0 });
            }
            if refused {
                return;
            }
            match c.command {
                MavCmd::MAV_CMD_DO_SET_MODE => {
                    self.mode = match self.kind {
                        Kind::Px4 => (c.param2 as u32) << 16 | (c.param3 as u32) << 24,
                        Kind::ArduPilot => c.param2 as u32,
                    };
                }
                MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.armed = c.param1 == 1.0 && !self.never_arms,
                MavCmd::MAV_CMD_NAV_TAKEOFF => {
                    assert!(self.kind == Kind::ArduPilot && self.armed);
                    if !self.took_off {
                        self.lifts_at = self.now + self.spool;
                    }
                    (self.took_off, self.takeoff_m) = (true, c.param7);
                    self.target = Some(self.enu + Point::new(0.0, 0.0, c.param7 - 2.0));
                }
                MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => self.streams.push(c.param1 as u16),
                MavCmd::MAV_CMD_REQUEST_MESSAGE if c.param1 == 49.0 => {
                    self.send_origin();
                }
                _ => {}
            }
        }
    }

    /// COMMAND_ACK to the companion.
    pub fn answer(&mut self, command: u16, result: u8) {
        let [low, high] = command.to_le_bytes();
        let payload = [low, high, result, 0, 0, 0, 0, 0, SYSTEM, crate::COMPONENT];
        let header = Header { system: SYSTEM, component: 1, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut out = [0; MAX_SENT];
        let (id, seed) = (COMMAND_ACK_DATA::ID, COMMAND_ACK_DATA::EXTRA_CRC);
        let len = frame::encode_raw(header, id, seed, &payload, &mut out);
        self.companion.handle_bytes(Link::Autopilot, self.now, &out[..len]);
    }

    pub fn heartbeat(&mut self) -> Vec<u8> {
        let armed = if self.armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
        let mut data = HEARTBEAT_DATA { custom_mode: self.mode, base_mode: armed, ..Default::default() };
        data.autopilot = match self.kind {
            Kind::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
            Kind::ArduPilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        };
        data.system_status =
            if self.status >= 5 { MavState::MAV_STATE_CRITICAL } else { MavState::MAV_STATE_ACTIVE };
        self.bytes(&data)
    }

    /// An ArduCopter that has just booted.
    pub fn ardupilot(config: Config<4>) -> Self {
        Self { kind: Kind::ArduPilot, mode: 0, ..Self::new(config) }
    }

    /// Whether it lifts off, or has.
    fn lifts(&self) -> bool {
        self.kind == Kind::Px4 || self.took_off && self.now >= self.lifts_at
    }

    /// PX4 says all unasked, ArduCopter nothing.
    fn says(&self, id: u16) -> bool {
        self.kind == Kind::Px4 || self.streams.contains(&id)
    }

    fn tell_ardupilot(&mut self) {
        if self.says(193) {
            let flags = EkfStatusFlags::from_bits_retain(self.ekf_flags);
            let pos_horiz_variance = self.variance;
            self.tell(&EKF_STATUS_REPORT_DATA { flags, pos_horiz_variance, ..Default::default() });
        }
        if self.says(33) {
            // Home lies two metres below the pad.
            let relative_alt = ((self.enu.z + 2.0) * 1e3) as i32;
            self.tell(&GLOBAL_POSITION_INT_DATA { relative_alt, ..Default::default() });
        }
    }

    pub fn on_ground(&self) -> bool {
        self.enu.z < 0.05
    }

    /// 50 ms of flight and telemetry.
    pub fn tick(&mut self) {
        self.tell_neighbour();
        self.now = self.now + Duration::from_millis(50);
        self.companion.handle_timeout(self.now);
        self.drain();
        let step = 0.1;
        let target = match self.mode {
            mode if mode == self.kind.setpoint_mode() && self.lifts() => self.target,
            mode if mode == self.kind.land_mode() && !self.never_lands => {
                Some(Point::new(self.enu.x, self.enu.y, 0.0))
            }
            _ => None,
        };
        if let Some(target) = target.filter(|_| self.armed && !self.stuck) {
            let way = target - self.enu;
            self.enu += way * (step / way.norm().max(step));
        }
        let landing = self.mode == self.kind.land_mode() && self.on_ground() && self.armed;
        self.landed_at = if landing { self.landed_at.or(Some(self.now)) } else { None };
        if self.landed_at.is_some_and(|at| self.now - at > Duration::from_millis(2200)) && !self.stays_armed {
            self.armed = false;
        }
        self.disarm_by_itself();
        if self.silent {
            return;
        }
        let count = self.now.micros() / 50_000;
        if count.is_multiple_of(20) {
            let bytes = self.heartbeat();
            self.companion.handle_bytes(Link::Autopilot, self.now, &bytes);
            self.drain();
            if self.kind == Kind::Px4
                && let Some(pos_horiz_accuracy) = self.accuracy_m
            {
                self.tell(&ESTIMATOR_STATUS_DATA { pos_horiz_accuracy, ..Default::default() });
            }
            if self.says(1) && !self.no_battery {
                let status = SYS_STATUS_DATA { battery_remaining: self.battery, ..Default::default() };
                self.tell(&status);
            }
        }
        if count.is_multiple_of(4) && self.says(245) {
            let landed_state = if self.on_ground() || self.false_ground {
                MavLandedState::MAV_LANDED_STATE_ON_GROUND
            } else {
                MavLandedState::MAV_LANDED_STATE_IN_AIR
            };
            self.tell(&EXTENDED_SYS_STATE_DATA { landed_state, ..Default::default() });
        }
        if count.is_multiple_of(4) && self.kind == Kind::ArduPilot {
            self.tell_ardupilot();
        }
        if !self.no_position && self.says(32) {
            let ned = self.ned();
            self.tell(&LOCAL_POSITION_NED_DATA {
                time_boot_ms: self.now.boot_ms(),
                x: ned.x as f32,
                y: ned.y as f32,
                z: ned.z as f32,
                vz: -self.climbs_mps,
                ..Default::default()
            });
        }
    }

    /// Both autopilots disarm after 10 s on the ground with nothing to fly to (`COM_DISARM_PRFLT`, `DISARM_DELAY`).
    fn disarm_by_itself(&mut self) {
        let streamed = self.setpoints.last().is_some_and(|s| self.now - s.0 < Duration::from_secs(1));
        let takes_off = match self.kind {
            Kind::Px4 => streamed && self.mode == self.kind.setpoint_mode(),
            Kind::ArduPilot => self.took_off,
        };
        let idle = self.armed && self.on_ground() && !takes_off && !self.stays_armed;
        self.idle_since = if idle { self.idle_since.or(Some(self.now)) } else { None };
        if self.idle_since.is_some_and(|at| self.now - at > Duration::from_secs(10)) {
            self.armed = false;
        }
    }

    fn tell_neighbour(&mut self) {
        let Some((place, flags, progress_m, plan_crc)) = self.neighbour else { return };
        let roster = &self.companion.config.roster;
        let id = roster.iter().map(|entry| entry.system_id).find(|id| *id != SYSTEM).unwrap_or(77);
        self.told = self.told.wrapping_add(1);
        if !self.told.is_multiple_of(4) {
            return;
        }
        let intent = Intent {
            system_id: id,
            flags,
            mission_crc: 0xC0FFEE,
            plan_crc,
            progress_m,
            speed_mps: 0.0,
            heard: u32::MAX,
            ..Intent::default()
        };
        let mut payload = [0; 133];
        let len = intent.encode(&mut payload);
        let place = frames::enu_to_geodetic(&ORIGIN, &place);
        let place = GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.neighbour_clock.unwrap_or(self.now).boot_ms(),
            lat: (place.lat_deg * 1e7) as i32,
            lon: (place.lon_deg * 1e7) as i32,
            alt: (place.alt_m * 1e3) as i32,
            ..Default::default()
        };
        let head = |sequence| Header { system: id, component: crate::COMPONENT, sequence };
        let mut out = [0; MAX_SENT];
        let (id, seed) = (TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC);
        let n = frame::encode_raw(head(self.told), id, seed, &payload[..len], &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..n]);
        let n = frame::encode(head(self.told.wrapping_add(1)), &place, &mut out);
        self.companion.handle_bytes(Link::Swarm, self.now, &out[..n]);
    }

    pub fn run(&mut self, seconds: f32) {
        for _ in 0..(seconds * 20.0) as u32 {
            self.tick();
        }
    }

    /// Runs until a state is reached; panics with what happened if it is not within the time.
    pub fn until(&mut self, state: crate::State, seconds: f32) {
        for _ in 0..(seconds * 20.0) as u32 {
            if self.state() == state {
                return;
            }
            self.tick();
        }
        assert_eq!(self.state(), state, "{:?} at {:?}", self.texts, self.enu);
    }

    /// The same with vehicle 77 standing on its pad, from where it follows the plan.
    pub fn accompanied(config: Config<4>) -> Self {
        let mut bench = Self::new(config);
        bench.neighbour = Some((Point::new(8.0, 20.0, 0.0), intent::ON_PLAN | intent::GROUNDED, 0.0, 5));
        bench.until(crate::State::Ready, 6.0);
        bench.start();
        bench
    }

    /// A bench in the middle of its path.
    pub fn following(config: Config<4>) -> Self {
        let mut bench = Self::new(config);
        bench.until(crate::State::Ready, 6.0);
        bench.start();
        bench.until(crate::State::Follow, 20.0);
        bench.run(2.0);
        assert_eq!(bench.state(), crate::State::Follow);
        bench
    }
}
