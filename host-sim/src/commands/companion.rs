//! `host-sim companion`: one vehicle's companion in its own process, beside a simulated, SITL or
//! real autopilot.

use std::path::PathBuf;
use std::process::ExitCode;
use std::thread::sleep;
use std::time::{Duration, Instant as Clock};

use companion::link::frame::MAX_FRAME_LEN;
use companion::storage::store::{MAX_READ_LEN, Store};
use companion::{Config, Event, Instant, Link, State};
use heapless::Vec as FixedVec;

use super::load_supported;
use crate::capacity::{HostCompanion, MAX_VEHICLES, new_companion};
use crate::flash::{self, HostFlash};
use crate::link::{self, LinkUrl};
use crate::mission::PreparedMission;
use crate::mission::planner::HostPlanner;
use crate::progress::Progress;
use crate::say;
use crate::shortage;
use crate::swarm::ground_station::encode_mission_start;
use crate::swarm::simulated_vehicle::is_finished;
use crate::swarm::vehicles::companion_config;

/// Arguments of `host-sim companion`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scenario of the whole swarm
    scenario: PathBuf,
    /// Link to the autopilot: udp:HOST:PORT, udp-listen:HOST:PORT, tcp:HOST:PORT,
    /// tcp-listen:HOST:PORT or serial:PATH:BAUD
    #[arg(long, value_name = "URL")]
    autopilot: LinkUrl,
    /// Link to the other companions; without it this vehicle flies alone
    #[arg(long, value_name = "URL")]
    swarm: Option<LinkUrl>,
    /// MAVLink system id of this companion's vehicle in the scenario
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    id: u8,
    /// Start the mission as soon as it is ready, without a ground station's command
    #[arg(long)]
    start: bool,
    /// File for what ground stations upload and set, as a board keeps it in its flash; without it
    /// that is lost at the end
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
}

/// Sleep between two polls of the links.
const POLL_SLEEP: Duration = Duration::from_millis(1);
/// Time for which a companion whose mission has ended continues to report that to other vehicles
/// and ground stations; on a board it continues for ever.
const REPORT_END_FOR: Duration = Duration::from_secs(2);
/// Silence of the autopilot after which this command no longer waits for the vehicle's landing.
const MAX_AUTOPILOT_SILENCE: companion::Duration = companion::Duration::from_secs(5);

/// Runs the companion until its mission ends. Exit code 0 if the mission was flown to its end, and
/// the plan did not leave this vehicle without a goal although a goal is unserved.
///
/// # Errors
/// Bad input, or a link that fails permanently; the error names it.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let scenario = load_supported(&args.scenario, None)?;
    // Opens the flash first, so that a bad file fails before the planning, which takes long.
    let mut flash = HostFlash::open(args.flash.as_deref())?;
    let mut mission = PreparedMission::prepare(scenario, &Progress::on_terminal())?;
    let index = mission.index_of(args.id)?;
    let plan = mission.plan()?;
    let left = mission.unserved(&plan);
    // Whether this vehicle has no goal although one is left.
    let is_short = left.vehicles.contains(&args.id) && !left.goals.is_empty();
    if is_short {
        shortage::shortage_lines(&mission, &plan).iter().for_each(|line| say!("left       {line}"));
    }
    let mut config = companion_config(&mission, args.id)?;
    if args.swarm.is_none() {
        say!("no --swarm link: vehicle {} flies as the only one", args.id);
        config.roster = config
            .roster
            .iter()
            .filter(|e| e.system_id == args.id)
            .copied()
            .collect::<FixedVec<_, _>>();
    }
    let mut companion = companion_with_store(&config, &mut flash)?;
    let mut planner = HostPlanner::new(&mission, &plan);
    let mut links: Vec<(Link, Box<dyn link::ByteLink>)> =
        vec![(Link::Autopilot, args.autopilot.open()?)];
    if let Some(swarm) = &args.swarm {
        links.push((Link::Swarm, swarm.open()?));
    }
    let began = Clock::now();
    let now = || Instant::from_micros(began.elapsed().as_micros() as u64);
    let mut buffer = [0; 2048];
    let mut read = [0; MAX_READ_LEN];
    let mut finished_at = None;
    loop {
        for (link, io) in &mut links {
            loop {
                let length = io.receive(&mut buffer)?;
                if length == 0 {
                    break;
                }
                companion.handle_bytes(*link, now(), &buffer[..length]);
            }
        }
        if companion.poll_timeout().is_some_and(|due| due <= now()) {
            companion.handle_timeout(now());
        }
        while let Some(request) = companion.poll_flash() {
            let outcome = flash.execute_request(request, &mut read);
            companion.handle_flash(now(), outcome);
        }
        let mut restarts = false;
        while let Some(event) = companion.poll_event() {
            match event {
                Event::RestartRequested => restarts = true,
                Event::WaitsForUnstartedVehicle { id } => {
                    say!(
                        "{:9.3} s  waiting for vehicle {id}: not started",
                        began.elapsed().as_secs_f32()
                    );
                }
                Event::DetourSkippedWaypoints { count: left } => {
                    say!(
                        "{:9.3} s  flown around: {left} waypoints are left",
                        began.elapsed().as_secs_f32()
                    );
                }
                Event::PlanRequested(wanted) => {
                    let mut own = planner.answer(index, wanted, &mut companion).cloned();
                    if let (Ok(own), None) = (&mut own, &args.swarm) {
                        own.gates.clear();
                        own.depart_s = 0.0;
                    }
                    companion.handle_plan(now(), wanted, own.as_ref().map_err(|failure| *failure));
                }
                Event::StateChanged { from, to, text, .. } => {
                    say!("{:9.3} s  {from:?} → {to:?}  {text}", began.elapsed().as_secs_f32());
                    if args.start && to == State::Ready {
                        let mut frame = [0; MAX_FRAME_LEN];
                        let length =
                            encode_mission_start(config.ground_stations[0], args.id, &mut frame);
                        companion.handle_bytes(Link::Swarm, now(), &frame[..length]);
                    }
                }
            }
        }
        for (link, io) in &mut links {
            loop {
                let length = companion.poll_transmit(*link, &mut buffer);
                if length == 0 {
                    break;
                }
                io.send(&buffer[..length])?;
            }
        }
        if restarts {
            say!("{:9.3} s  restart commanded", began.elapsed().as_secs_f32());
            companion = companion_with_store(&config, &mut flash)?;
        }
        let state = companion.state();
        // In the air the mission may continue: a pilot may hand the vehicle back.
        let t = companion.telemetry();
        let heard = t.heartbeat_age(now()) < MAX_AUTOPILOT_SILENCE;
        let flies = t.armed && t.last_reported_flight() && heard;
        if !is_finished(state) || flies {
            finished_at = None;
        } else if finished_at.get_or_insert_with(Clock::now).elapsed() > REPORT_END_FOR {
            return Ok(if state == State::Done && !is_short {
                ExitCode::SUCCESS
            } else {
                ExitCode::FAILURE
            });
        }
        sleep(POLL_SLEEP);
    }
}

/// A new companion with the store in its flash, which holds parameters and uploaded files.
fn companion_with_store(
    config: &Config<MAX_VEHICLES>,
    flash: &mut HostFlash,
) -> anyhow::Result<Box<HostCompanion>> {
    let store = Store::mount(flash::HOST_FLASH_LAYOUT, flash);
    let mut companion = new_companion(config.clone())?;
    companion.attach_store(store);
    Ok(companion)
}
