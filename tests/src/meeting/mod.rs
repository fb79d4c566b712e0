//! Meetings: two to six whole companions, each with a light autopilot, on a radio that loses and delays.
//!
//! A meeting follows from its seed. [`fly`] flies it and says what went wrong; [`oracle`] is the judge. Nothing here uses the
//! safety filter's code.

pub mod autopilot;
pub mod dice;
pub mod oracle;
pub mod scene;

use companion::frame::{self, Framer, Header, MAX_SENT};
use companion::intent::Intent;
use companion::{COMPONENT, Companion, Config, Event, Instant, Link, PlanFailure, RosterEntry, State};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, GLOBAL_POSITION_INT_DATA, MavCmd, STATUSTEXT_DATA, TUNNEL_DATA,
};
use nalgebra::Vector3;
use planner_core::Point;
use planner_core::detour::{DetourRequest, KeepOff, Nature};
use planner_core::frames::{self, Geodetic};
use planner_core::path::Path;

use self::autopilot::{Autopilot, Flown, STEP_S};
use self::dice::Dice;
use self::oracle::{Heard, Oracle, Seen, Violation};
use self::scene::{
    CLIMB_MPS, CRUISE_MPS, GATES, Lie, Plan, SAFETY_M, Scene, VEHICLES, WAYPOINTS, What, floor_z, landing,
};
use crate::setpoints::{Limits, SetpointCheck, SetpointStats};

/// A meeting is over by then, seconds after its start.
pub const LIMIT_S: f32 = 180.0;
/// After everything has happened and everybody stands, this much is still flown, seconds.
const AFTERMATH_S: f32 = 3.0;
const ORIGIN: Geodetic = Geodetic { lat_deg: 40.3327, lon_deg: -3.7659, alt_m: 700.0 };
const STEP_MS: u64 = 25;
/// Nobody leaves this box, metres: minimum and maximum corner.
const FENCE: (Point, Point) = (Point::new(-40.0, -40.0, -5.0), Point::new(70.0, 70.0, 60.0));
/// A vehicle that has heard nobody for so long is deaf, seconds: it has stopped, and lands after 20 s.
const DEAF_S: f32 = 20.0;
/// A vehicle that is faster is not stopped, m/s.
const MOVES_MPS: f32 = 0.7;
/// Speed of a setpoint, m/s: nominal, and what it may run over where it catches up.
const SPEED_MPS: f32 = 2.2;

type Mate = Companion<VEHICLES, WAYPOINTS, GATES>;

/// How a meeting ended.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Its seed.
    pub seed: u64,
    /// Its geometry.
    pub kind: &'static str,
    /// Whether the vehicles shared a plan.
    pub on_plan: bool,
    /// Whether a vehicle's reports were wrong.
    pub lies: bool,
    /// Vehicles.
    pub vehicles: usize,
    /// Times at which two vehicles were nearer than the safety distance.
    pub violations: Vec<Violation>,
    /// Touches by own motion: seconds, the vehicle that moved, the other, metres.
    pub touches: Vec<(f32, usize, usize, f32)>,
    /// Indices of vehicles that were not on the ground at the end, and their states.
    pub stuck: Vec<(usize, State)>,
    /// Smallest distance, metres.
    pub least_m: f32,
    /// When it was over, seconds.
    pub ended_s: f32,
    /// Setpoints of all vehicles.
    pub setpoints: SetpointStats,
    /// Setpoints that were not fit: vehicle, seconds, what.
    pub unfit: Vec<(usize, f64, String)>,
    /// Vehicles that landed at their goals.
    pub arrived: usize,
    /// How often the safety filter stopped one.
    pub filter_stops: u32,
    /// For how long at most, seconds.
    pub longest_stop_s: f32,
    /// What happened, if that was asked for.
    pub trace: Vec<String>,
}

impl Outcome {
    /// Violations that a stop would have prevented.
    pub fn failures(&self) -> impl Iterator<Item = &Violation> {
        self.violations.iter().filter(|violation| violation.is_failure())
    }

    /// Whether a rule was broken: of an honest meeting, or of one with a liar.
    pub fn is_bad(&self) -> bool {
        let near = !self.lies && self.failures().next().is_some();
        near || !self.touches.is_empty() || !self.stuck.is_empty()
    }
}

/// What a radio frame says, for the judge.
#[derive(Clone, Debug)]
enum Said {
    Position(Point, Point, u32),
    Intent(Intent),
    Other,
}

struct Packet {
    at: Instant,
    from: usize,
    bytes: Vec<u8>,
    said: Said,
}

struct Member {
    companion: Mate,
    autopilot: Autopilot,
    inbox: Vec<Packet>,
    heard: Vec<Heard>,
    framer: Framer,
    dead: bool,
    sends: bool,
    hears: bool,
    bytes: Vec<u8>,
    commands: u8,
    /// Stops by the safety filter so far, and since when the last one lasts.
    stops: u32,
    stopped_since: Option<Instant>,
    longest_stop_s: f32,
}

struct World<'a> {
    scene: &'a Scene,
    members: Vec<Member>,
    now: Instant,
    dice: Dice,
    trace: Option<Vec<String>>,
}

/// Flies a meeting; with `traced` the outcome says what happened.
pub fn fly(scene: &Scene, traced: bool) -> Outcome {
    let mut world = World::new(scene, traced);
    let mut oracle = Oracle::new(scene.vehicles.len());
    let mut next = 0;
    let mut rested_s = 0.0;
    let steps = ((scene::START_S + LIMIT_S) / STEP_S) as usize;
    let mut ended_s = 0.0;
    for step in 0..steps {
        let now_s = step as f32 * STEP_S;
        world.now = Instant::from_millis(step as u64 * STEP_MS);
        while let Some(happening) = scene.happenings.get(next).filter(|h| h.at_s <= now_s) {
            world.happens(happening.vehicle, happening.what);
            next += 1;
        }
        world.step();
        let seen: Vec<_> = world.members.iter().map(|member| member.seen(now_s)).collect();
        let heard = |a: usize, b: usize| world.members[a].heard[b].clone();
        oracle.observe(&seen, heard, |place| floor_z(&scene.vehicles, place), step % 2 == 0);
        if traced && step % 20 == 0 {
            world.trace_places(now_s);
        }
        ended_s = now_s;
        let rest = next == scene.happenings.len()
            && now_s > scene::START_S + 5.0
            && world.members.iter().all(Member::rests);
        rested_s = if rest { rested_s + STEP_S } else { 0.0 };
        if rested_s > AFTERMATH_S {
            break;
        }
    }
    oracle.finish();
    world.outcome(oracle, ended_s)
}

fn config(scene: &Scene, i: usize) -> Config<VEHICLES> {
    let own = &scene.vehicles[i];
    let start = |vehicle: &scene::Vehicle| vehicle.plan.path.waypoints()[0].position;
    let mut config = Config::new(own.id, start(own), ORIGIN);
    config.roster.clear();
    for vehicle in &scene.vehicles {
        let entry = RosterEntry { system_id: vehicle.id, start: start(vehicle) };
        config.roster.push(entry).expect("a meeting fits");
    }
    config.mission_crc = 0xC0FFEE;
    config.cruise_mps = CRUISE_MPS;
    config.climb_mps = CLIMB_MPS;
    config.safety_distance_m = SAFETY_M;
    config.geofence = Some(FENCE);
    config
}

impl Member {
    fn new(scene: &Scene, i: usize) -> Self {
        let vehicle = &scene.vehicles[i];
        let ekf_origin = Geodetic {
            lat_deg: ORIGIN.lat_deg + 0.00002 * i as f64,
            lon_deg: ORIGIN.lon_deg - 0.00003 * i as f64,
            alt_m: ORIGIN.alt_m + i as f64,
        };
        let ned = |point: &Point| {
            let place = frames::enu_to_geodetic(&ORIGIN, point);
            frames::geodetic_to_ned(vehicle.kind.projection(), &ekf_origin, &place).cast::<f32>()
        };
        let (low, high) = (ned(&FENCE.0), ned(&FENCE.1));
        let (low, high) = (low.inf(&high), low.sup(&high));
        let slack = Vector3::repeat(0.05);
        let limits = Limits { speed_mps: SPEED_MPS, fence: Some((low - slack, high + slack)) };
        let mut autopilot = Autopilot::new(
            vehicle.kind,
            vehicle.id,
            (ORIGIN, ekf_origin),
            vehicle.pad,
            vehicle.phase,
            SetpointCheck::new(limits),
        );
        autopilot.on_loss = vehicle.on_loss;
        Self {
            companion: Mate::new(config(scene, i)).expect("a sound configuration"),
            autopilot,
            inbox: Vec::new(),
            heard: vec![Heard::default(); scene.vehicles.len()],
            framer: Framer::new(),
            dead: false,
            sends: true,
            hears: true,
            bytes: Vec::new(),
            commands: 0,
            stops: 0,
            stopped_since: None,
            longest_stop_s: 0.0,
        }
    }

    /// A stop by the filter lasts until nobody is waited for, or the vehicle flies.
    fn note_stops(&mut self, now: Instant) {
        let stops = self.companion.filter_stops();
        if core::mem::replace(&mut self.stops, stops) != stops {
            self.stopped_since.get_or_insert(now);
        } else if self.companion.waiting_for() == 0 || self.autopilot.velocity.norm() > MOVES_MPS {
            self.stopped_since = None;
        }
        if let Some(since) = self.stopped_since {
            self.longest_stop_s = self.longest_stop_s.max((now - since).secs_f32());
        }
    }

    fn seen(&self, now_s: f32) -> Seen {
        let lately = |heard: &Heard| heard.position.is_some_and(|(.., at_s)| now_s - at_s < DEAF_S);
        let lands = self.autopilot.flown() == Flown::Commanded
            && self.autopilot.mode == self.autopilot.kind.land_mode();
        Seen {
            position: self.autopilot.position,
            velocity: self.autopilot.velocity,
            airborne: self.autopilot.is_airborne(),
            own: !self.dead && self.autopilot.armed && self.autopilot.flown() != Flown::Other,
            lands,
            deaf: !self.heard.iter().any(lately),
        }
    }

    fn rests(&self) -> bool {
        let over = matches!(self.companion.state(), State::Done | State::Aborted);
        !self.autopilot.armed && !self.autopilot.is_airborne() && (over || self.dead)
    }
}

impl<'a> World<'a> {
    fn new(scene: &'a Scene, traced: bool) -> Self {
        Self {
            scene,
            members: (0..scene.vehicles.len()).map(|i| Member::new(scene, i)).collect(),
            now: Instant::ZERO,
            dice: Dice::new(scene.seed ^ 0x5EED),
            trace: traced.then(Vec::new),
        }
    }

    fn say(&mut self, vehicle: usize, what: &str) {
        let (now, id) = (self.now, self.scene.vehicles[vehicle].id);
        if let Some(trace) = &mut self.trace {
            trace.push(format!("{:7.2} s  {id}: {what}", now.micros() as f64 * 1e-6));
        }
    }

    fn trace_places(&mut self, now_s: f32) {
        let mut line = format!("{now_s:7.2} s ");
        for member in &self.members {
            let (p, v) = (member.autopilot.position, member.autopilot.velocity);
            line += &format!(
                " | {:?} {:.2} {:.2} {:.2} ({:.1} {:.1} {:.1})",
                member.companion.state(),
                p.x,
                p.y,
                p.z,
                v.x,
                v.y,
                v.z
            );
            if let Some(target) = member.autopilot.asked() {
                line += &format!(" to {:.2} {:.2} {:.2}", target.x, target.y, target.z);
            }
            if member.companion.waiting_for() != 0 {
                line += &format!(" for {}", member.companion.waiting_for());
            }
        }
        let members = &self.members;
        for (i, a) in members.iter().enumerate() {
            for (j, b) in members.iter().enumerate().skip(i + 1) {
                let apart_m = (a.autopilot.position - b.autopilot.position).norm();
                if apart_m < 3.0 {
                    line += &format!(" | {}-{} {apart_m:.2} m", i + 1, j + 1);
                }
            }
        }
        if let Some(trace) = &mut self.trace {
            trace.push(line);
        }
    }

    fn happens(&mut self, vehicle: usize, what: What) {
        self.say(vehicle, &format!("{what:?}"));
        let now = self.now;
        let member = &mut self.members[vehicle];
        let airborne = member.autopilot.is_airborne();
        match what {
            What::Start => self.command(vehicle, MavCmd::MAV_CMD_MISSION_START, 0.0),
            What::Pause => self.command(vehicle, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 0.0),
            What::Resume => self.command(vehicle, MavCmd::MAV_CMD_DO_PAUSE_CONTINUE, 1.0),
            What::Return => self.command(vehicle, MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0),
            What::Land => self.command(vehicle, MavCmd::MAV_CMD_NAV_LAND, 0.0),
            What::PilotTakes(velocity) if airborne => member.autopilot.take_over(velocity),
            What::PilotReturns if airborne => member.autopilot.give_back(now),
            What::PilotLands if airborne && member.autopilot.flown() == Flown::Other => {
                member.autopilot.pilot_lands();
            }
            // A dead companion's ArduCopter stays in Guided.
            What::PilotLands if airborne && member.dead => member.autopilot.pilot_lands(),
            What::Fails(how) if airborne => member.autopilot.fail(how),
            What::PilotTakes(_) | What::PilotReturns | What::PilotLands | What::Fails(_) => {}
            What::Dies => member.dead = true,
            What::Cut { sends, hears } => (member.sends, member.hears) = (!sends, !hears),
            What::Healed => (member.sends, member.hears) = (true, true),
        }
    }

    /// A command of the ground station; it is not lost.
    fn command(&mut self, vehicle: usize, command: MavCmd, param1: f32) {
        let member = &mut self.members[vehicle];
        if member.dead {
            return;
        }
        let data = COMMAND_LONG_DATA {
            command,
            param1,
            target_system: self.scene.vehicles[vehicle].id,
            target_component: COMPONENT,
            ..Default::default()
        };
        let mut out = [0; MAX_SENT];
        let header = Header { system: 255, component: 190, sequence: member.commands };
        member.commands = member.commands.wrapping_add(1);
        let len = frame::encode(header, &data, &mut out);
        member.companion.handle_bytes(Link::Swarm, self.now, &out[..len]);
        self.drain(vehicle);
    }

    fn step(&mut self) {
        let now = self.now;
        for i in 0..self.members.len() {
            let floor = floor_z(&self.scene.vehicles, &self.members[i].autopilot.position);
            let member = &mut self.members[i];
            let mut bytes = core::mem::take(&mut member.bytes);
            member.autopilot.step(now, floor, &mut bytes);
            let mut arrived = Vec::new();
            member.inbox.retain_mut(|packet| {
                let due = packet.at <= now;
                if due {
                    let none = Packet { at: now, from: 0, bytes: Vec::new(), said: Said::Other };
                    arrived.push(core::mem::replace(packet, none));
                }
                !due
            });
            if member.dead {
                continue;
            }
            if !bytes.is_empty() {
                member.companion.handle_bytes(Link::Autopilot, now, &bytes);
            }
            bytes.clear();
            member.bytes = bytes;
            for packet in arrived.into_iter().filter(|_| member.hears) {
                member.companion.handle_bytes(Link::Swarm, now, &packet.bytes);
                let heard = &mut member.heard[packet.from];
                let now_s = now.micros() as f32 * 1e-6;
                match packet.said {
                    Said::Position(place, velocity, boot_ms) => {
                        if heard.position.is_none_or(|(_, _, known, _)| boot_ms > known) {
                            heard.position = Some((place, velocity, boot_ms, now_s));
                        }
                    }
                    Said::Intent(intent) => heard.intent = Some(intent),
                    Said::Other => {}
                }
            }
            if member.companion.poll_timeout().is_some_and(|due| due <= now) {
                member.companion.handle_timeout(now);
                member.note_stops(now);
            }
            self.drain(i);
        }
    }

    fn drain(&mut self, i: usize) {
        let mut buffer = [0; MAX_SENT];
        loop {
            let length = self.members[i].companion.poll_transmit(Link::Autopilot, &mut buffer);
            if length == 0 {
                break;
            }
            let (now, member) = (self.now, &mut self.members[i]);
            member.autopilot.check.urgent = member.companion.stops_urgently();
            member.autopilot.handle_bytes(now, &buffer[..length], &mut member.bytes);
        }
        loop {
            let length = self.members[i].companion.poll_transmit(Link::Swarm, &mut buffer);
            if length == 0 {
                break;
            }
            self.broadcast(i, &buffer[..length]);
        }
        while let Some(event) = self.members[i].companion.poll_event() {
            match event {
                Event::PlanRequested => self.plan(i),
                Event::StateChanged { from, to, text, .. } => {
                    self.say(i, &format!("{from:?} → {to:?} {text}"));
                }
                Event::RestartRequested | Event::WaitsForStart { .. } => {}
            }
        }
    }

    fn broadcast(&mut self, from: usize, bytes: &[u8]) {
        let now = self.now;
        let mut input = bytes;
        let Some(mut frame) = self.members[from].framer.next(now, &mut input) else { return };
        let mut bytes = bytes.to_vec();
        if let Some((liar, lie)) = self.scene.liar
            && liar == from
            && let Some(forged) = forge(&frame, lie)
        {
            bytes = forged;
            let mut input = &bytes[..];
            frame = Framer::new().next(now, &mut input).expect("a forged frame is whole");
        }
        let said = if let Some(data) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
            let (place, velocity) = place_of(&data);
            Said::Position(place, velocity, data.time_boot_ms)
        } else if frame.message_id == TUNNEL_DATA::ID {
            Intent::decode(frame.padded(), frame.system).map_or(Said::Other, Said::Intent)
        } else {
            if let Some(data) = frame.decode::<STATUSTEXT_DATA>()
                && let Ok(text) = data.text.to_str()
            {
                self.say(from, &format!("\"{text}\""));
            }
            Said::Other
        };
        if !self.members[from].sends {
            return;
        }
        let (low, high) = self.scene.delay_s;
        for to in (0..self.members.len()).filter(|to| *to != from) {
            let lost = self.dice.chance(self.scene.loss);
            let delay_s = self.dice.real(low, high);
            if !lost {
                let at = now + companion::Duration::from_micros((delay_s * 1e6) as u64);
                let packet = Packet { at, from, bytes: bytes.clone(), said: said.clone() };
                self.members[to].inbox.push(packet);
            }
        }
    }

    fn plan(&mut self, i: usize) {
        let own = &self.scene.vehicles[i].plan;
        let mut keep = Vec::new();
        let member = &mut self.members[i];
        match member.companion.detour(|obstacle| keep.push(obstacle)) {
            Some(request) => {
                let answer = around(&request, &keep, own);
                let text = if answer.is_some() { "a way around" } else { "no way around" };
                let answer = answer.as_ref().ok_or(PlanFailure::Unreachable);
                member.companion.handle_plan(self.now, answer);
                self.say(i, text);
            }
            None => member.companion.handle_plan(self.now, Ok(own)),
        }
    }

    fn outcome(self, oracle: Oracle, ended_s: f32) -> Outcome {
        let scene = self.scene;
        let mut setpoints = SetpointStats::default();
        let mut unfit = Vec::new();
        let mut stuck = Vec::new();
        let mut arrived = 0;
        for (i, member) in self.members.iter().enumerate() {
            setpoints.merge(&member.autopilot.check.stats);
            unfit.extend(member.autopilot.check.faults.iter().map(|(at_s, what)| (i, *at_s, what.clone())));
            if member.autopilot.armed || member.autopilot.is_airborne() {
                stuck.push((i, member.companion.state()));
            }
            let goal = landing(&scene.vehicles[i].plan);
            arrived += usize::from(goal.is_some_and(|goal| (goal - member.autopilot.position).norm() < 0.7));
        }
        Outcome {
            seed: scene.seed,
            kind: scene.kind,
            on_plan: scene.on_plan,
            lies: scene.liar.is_some(),
            vehicles: scene.vehicles.len(),
            violations: oracle.violations,
            touches: oracle.touches,
            stuck,
            least_m: oracle.least_m,
            ended_s,
            setpoints,
            unfit,
            arrived,
            filter_stops: self.members.iter().map(|member| member.stops).sum(),
            longest_stop_s: self.members.iter().map(|m| m.longest_stop_s).fold(0.0, f32::max),
            trace: self.trace.unwrap_or_default(),
        }
    }
}

fn place_of(data: &GLOBAL_POSITION_INT_DATA) -> (Point, Point) {
    let place = Geodetic {
        lat_deg: f64::from(data.lat) * 1e-7,
        lon_deg: f64::from(data.lon) * 1e-7,
        alt_m: f64::from(data.alt) * 1e-3,
    };
    let cm = Vector3::new(f32::from(data.vx), f32::from(data.vy), f32::from(data.vz));
    (frames::geodetic_to_enu(&ORIGIN, &place), frames::swap_enu_ned(&(cm * 0.01)))
}

/// The frame with the lie in it; none where it does not concern it.
fn forge(frame: &frame::Frame, lie: Lie) -> Option<Vec<u8>> {
    let header = Header { system: frame.system, component: frame.component, sequence: frame.sequence };
    let mut out = [0; MAX_SENT];
    if let Some(mut data) = frame.decode::<GLOBAL_POSITION_INT_DATA>() {
        let (mut place, mut velocity) = place_of(&data);
        match lie {
            Lie::Position(off) => place += off,
            Lie::Velocity(off) => velocity += off,
            Lie::Still => velocity = Point::zeros(),
            Lie::Progress(_) | Lie::Points(_) => return None,
        }
        let wrong = frames::enu_to_geodetic(&ORIGIN, &place);
        data.lat = (wrong.lat_deg * 1e7).round() as i32;
        data.lon = (wrong.lon_deg * 1e7).round() as i32;
        data.alt = (wrong.alt_m * 1e3).round() as i32;
        let cm = frames::swap_enu_ned(&velocity) * 100.0;
        (data.vx, data.vy, data.vz) = (cm.x as i16, cm.y as i16, cm.z as i16);
        let length = frame::encode(header, &data, &mut out);
        return Some(out[..length].to_vec());
    }
    if frame.message_id != TUNNEL_DATA::ID {
        return None;
    }
    let mut intent = Intent::decode(frame.padded(), frame.system)?;
    match lie {
        Lie::Progress(ahead_m) => intent.progress_m += ahead_m,
        Lie::Points(off) => intent.points.iter_mut().for_each(|point| *point += off),
        _ => return None,
    }
    let mut payload = [0; 133];
    let length = intent.encode(&mut payload);
    let length =
        frame::encode_raw(header, TUNNEL_DATA::ID, TUNNEL_DATA::EXTRA_CRC, &payload[..length], &mut out);
    Some(out[..length].to_vec())
}

/// A way around in the open: straight, or past one or two points beside and above.
fn around(request: &DetourRequest, keep: &[KeepOff], own: &Plan) -> Option<Plan> {
    let last = own.path.waypoints().last()?.position;
    let ground = last - Point::new(0.0, 0.0, request.descent_m);
    let here = request.here;
    let clear = |from: Point, to: Point| {
        keep.iter().all(|k| {
            let now_m = oracle::distance((here, here), (k.from, k.to));
            let apart_m = k.radius_m.min((now_m - 0.002).max(0.0));
            let solid = if k.nature == Nature::Landing { (k.from, k.from) } else { (k.from, k.to) };
            oracle::distance((from, to), solid) >= apart_m
        })
    };
    let mut ways: Vec<Vec<Point>> = Vec::new();
    let offs = (0..8).map(|i| {
        let angle = i as f32 * core::f32::consts::FRAC_PI_4;
        Point::new(angle.cos(), angle.sin(), 0.0)
    });
    let offs: Vec<Point> = offs.collect();
    if request.aside {
        for length in [3.0, 5.0, 8.0] {
            for off in &offs {
                ways.push(vec![here, here + off * length]);
            }
        }
        let rests =
            |at: &Point| keep.iter().all(|k| oracle::distance((*at, *at), (k.from, k.to)) >= k.radius_m);
        let way = ways.into_iter().find(|way| clear(way[0], way[1]) && rests(&way[1]))?;
        return along(&way, own, request.descent_m);
    }
    ways.push(vec![here, last]);
    for length in [2.5, 4.0, 6.0] {
        for off in &offs {
            for rise in [0.0, 2.5] {
                let beside = off * length + Point::new(0.0, 0.0, rise);
                ways.push(vec![here, here + beside, last]);
                ways.push(vec![here, last + beside, last]);
                ways.push(vec![here, here + beside, last + beside, last]);
            }
        }
    }
    let length = |way: &Vec<Point>| way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum::<f32>();
    ways.sort_by(|a, b| length(a).total_cmp(&length(b)));
    let way = ways.into_iter().find(|way| {
        way.iter().all(|p| p.z > 0.5)
            && way.windows(2).all(|leg| clear(leg[0], leg[1]))
            && keep.iter().all(|k| oracle::distance((last, ground), (k.from, k.to)) >= k.radius_m)
    })?;
    along(&way, own, request.descent_m)
}

fn along(way: &[Point], own: &Plan, descent_m: f32) -> Option<Plan> {
    let mut path = Path::new();
    for point in way {
        path.push(*point, 2.0).ok()?;
    }
    Some(Plan { path, descent_m, gates: heapless::Vec::new(), ..own.clone() })
}

/// One line about a meeting.
pub fn line(outcome: &Outcome) -> String {
    let Outcome { seed, kind, vehicles, ended_s, least_m, arrived, .. } = outcome;
    let plan = if outcome.on_plan { "on plan" } else { "off plan" };
    let lies = if outcome.lies { ", a liar" } else { "" };
    let mut line = format!(
        "seed {seed}: {kind}, {vehicles} vehicles {plan}{lies}, {ended_s:.0} s, nearest {least_m:.2} m, {arrived} arrived"
    );
    for violation in &outcome.violations {
        let Violation { pair, at_s, least_m, kept_m, warned_s } = violation;
        let verdict = if violation.is_failure() { "TOO NEAR" } else { "unavoidable" };
        line += &format!(
            "; {verdict} {}-{} at {at_s:.1} s {least_m:.2} m (warned {warned_s:.1?}, kept {kept_m:.2})",
            pair.0 + 1,
            pair.1 + 1
        );
    }
    for (at_s, from, to, apart_m) in &outcome.touches {
        line += &format!("; TOUCH {} of {} at {at_s:.1} s {apart_m:.2} m", from + 1, to + 1);
    }
    for (i, state) in &outcome.stuck {
        line += &format!("; STUCK {} in {state:?}", i + 1);
    }
    line
}

/// Counts over many meetings.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Meetings without a liar, and with one.
    pub meetings: [usize; 2],
    /// Of those: too near although a stop would have kept apart.
    pub too_near: [usize; 2],
    /// Too near, and no stop would have helped.
    pub unavoidable: [usize; 2],
    /// Touches by own motion.
    pub touches: [usize; 2],
    /// Somebody had not landed in the end.
    pub stuck: [usize; 2],
    /// Vehicles, and those that landed at their goals.
    pub arrived: (usize, usize),
}

/// Counts.
pub fn summary(outcomes: &[Outcome]) -> Summary {
    let mut sum = Summary::default();
    for outcome in outcomes {
        let at = usize::from(outcome.lies);
        let failed = outcome.failures().next().is_some();
        sum.meetings[at] += 1;
        sum.too_near[at] += usize::from(failed);
        sum.unavoidable[at] += usize::from(!failed && !outcome.violations.is_empty());
        sum.touches[at] += usize::from(!outcome.touches.is_empty());
        sum.stuck[at] += usize::from(!outcome.stuck.is_empty());
        sum.arrived.0 += outcome.vehicles;
        sum.arrived.1 += outcome.arrived;
    }
    sum
}

impl Summary {
    /// Whether a rule was broken.
    pub fn is_bad(&self) -> bool {
        self.too_near[0] > 0
            || self.touches != [0; 2]
            || self.stuck != [0; 2]
            || self.unavoidable[0] * 20 > self.meetings[0]
    }
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (at, name) in ["honest", "with a liar"].iter().enumerate() {
            writeln!(
                f,
                "{name}: {} meetings, {} too near although a stop would have kept apart, {} too near unavoidably, {} \
                 with a touch by own motion, {} stuck",
                self.meetings[at], self.too_near[at], self.unavoidable[at], self.touches[at], self.stuck[at]
            )?;
        }
        write!(f, "{} of {} vehicles landed at their goals", self.arrived.1, self.arrived.0)
    }
}
