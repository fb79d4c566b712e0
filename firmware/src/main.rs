//! The firmware: a companion between an autopilot's serial port and a swarm's radio.
//!
//! Two Embassy executors run in interrupts: links and setpoints at a higher priority than plans and
//! flash. Thread mode only sleeps, by WFI. (Embassy's executor for thread mode sleeps by WFE, which
//! QEMU does not emulate: the processor would never sleep.)
#![no_std]
#![no_main]
#![expect(unsafe_code, reason = "the handler of faults, and where a static lies")]

use core::fmt::Write as _;

use companion::link::severity::Severity;
use companion::planner::PlanFiles;
use companion::storage::mission_file::{self, MissionError, MissionView};
use companion::storage::store::{ReadFlash, Store};
use companion::{Config, Link};
use cortex_m_rt::{ExceptionFrame, entry, exception};
use embassy_executor::{SendSpawner, task};
use embassy_time::Timer;
use firmware::boards::chosen::{self, Flash, LAYOUT, Parts, Receiver, Transmitter, Watchdog};
use firmware::boards::resources::MAX_WARNINGS;
use firmware::boards::{crash, sleep};
use firmware::capacity::{BoardCompanion, VEHICLES, WAYPOINTS};
use firmware::crash_record::FileWork;
use firmware::flash_lender::LentFlash;
use firmware::planner::{OwnPlanMemory, Planner, PlanningMemory};
use firmware::shell::{
    CHECK_IN_EVERY, OnAutopilot, SYSTEM_ID_WITHOUT_AUTOPILOT, Shell, wait_for_autopilot_id,
};
use firmware::workspace::WorkspaceOverlay;
use heapless::{String, Vec};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::map::field::FieldView;
use planner_core::plan::SwarmPlan;
use planner_core::roadmap::RoadmapView;
use static_cell::{ConstStaticCell, StaticCell};

/// Longest mission file that the board can read, bytes.
const MISSION_LEN: usize = mission_file::MAX_BYTES;
/// Origin of the mission frame on a board without a mission.
const UNKNOWN_ORIGIN: Geodetic = Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 };
/// STATUSTEXT of a board whose system id is known but is not in the mission's roster.
const NOT_IN_MISSION: &str = "This system id is not in the mission: no plan";

/// STATUSTEXTs about files that brought three starts down and are no longer used.
const ROADMAP_SET_ASIDE: &str = "Roadmap set aside: it crashed 3 starts in a row";
const MISSION_SET_ASIDE: &str = "Mission set aside: it crashed 3 starts in a row";

// `memory.x` places these statics by name in separate memories. Their initial values are all zeros.
static SHELL: StaticCell<Shell> = StaticCell::new();
static COMPANION: StaticCell<BoardCompanion> = StaticCell::new();
static WORKSPACE: ConstStaticCell<WorkspaceOverlay> = ConstStaticCell::new(WorkspaceOverlay::new());
static SWARM_PLAN: ConstStaticCell<SwarmPlan<VEHICLES, WAYPOINTS>> =
    ConstStaticCell::new(SwarmPlan::new());
static OWN_PLAN: ConstStaticCell<OwnPlanMemory> = ConstStaticCell::new(OwnPlanMemory::new());
static MISSION_BYTES: ConstStaticCell<[u8; MISSION_LEN]> = ConstStaticCell::new([0; MISSION_LEN]);
static CRASH_TEXT: StaticCell<String<50>> = StaticCell::new();
static MISSION_REFUSAL_TEXT: StaticCell<String<50>> = StaticCell::new();

defmt::timestamp!("{=u64:us}", embassy_time::Instant::now().as_micros());

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    crash::panicked(info)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    crash::faulted(frame.pc())
}

#[entry]
fn main() -> ! {
    let cause = chosen::reset_cause();
    // SAFETY: no task runs yet, and `reset_cause` has switched the memories' clocks on.
    unsafe { chosen::zero_sections() };
    let crashed = crash::take_report(cause);
    let parts = chosen::start();
    let shell: &'static Shell = SHELL.init_with(Shell::new);
    let Parts { links, plans, autopilot, swarm, flash, watchdog, warnings } = parts;
    links.spawn(watchdog_task(shell, watchdog).expect("there is one such task"));
    let said = StartReport { crashed, warnings };
    plans.spawn(
        planner_and_flash_task(shell, links, autopilot, swarm, flash, said)
            .expect("there is one such task"),
    );
    loop {
        sleep();
    }
}

/// Both halves of a UART.
type UartEnds = (Receiver, Transmitter);

/// Messages about the start, sent to the operator by STATUSTEXT.
struct StartReport {
    /// Text about the last run's end; `None` if there is nothing to report.
    crashed: Option<String<50>>,
    /// Warnings, in the order in which they are sent.
    warnings: Vec<&'static str, MAX_WARNINGS>,
}

/// Mounts the store, loads roadmap and mission, starts the companion and the tasks of the links;
/// then makes plans and serves the companion's flash requests for ever.
#[task]
async fn planner_and_flash_task(
    shell: &'static Shell,
    links: SendSpawner,
    mut autopilot: UartEnds,
    swarm: UartEnds,
    mut flash: Flash,
    said: StartReport,
) {
    let mut store = Store::mount(LAYOUT, &mut flash);
    let (lent, roadmap_aside) = find_roadmap_or_field(&mut store, &mut flash);
    let roadmap = lent.as_deref().and_then(|bytes| RoadmapView::parse(bytes).ok());
    let field = lent.as_deref().and_then(|bytes| FieldView::parse(bytes).ok());
    let map_crc =
        roadmap.as_ref().map(RoadmapView::crc).or(field.as_ref().map(FieldView::crc)).unwrap_or(0);
    let FoundMission { mission, files_checksum: files, set_aside: mission_aside, parse_error } =
        find_mission(&store, &mut flash, roadmap.as_ref(), map_crc);
    let known = match store.parameters().system_id() {
        Some(id) => Some(id),
        None => wait_for_autopilot_id(&mut autopilot.0).await,
    };
    let system_id = known.unwrap_or(SYSTEM_ID_WITHOUT_AUTOPILOT);
    defmt::info!(
        "system {=u8}, roadmap {=bool}, mission {=bool}",
        system_id,
        roadmap.is_some(),
        mission.is_some()
    );
    let aside = [(roadmap_aside, ROADMAP_SET_ASIDE), (mission_aside, MISSION_SET_ASIDE)];
    let aside = aside.into_iter().filter_map(|(is, text)| is.then_some(text));
    let own = mission.as_ref().map(|mission| mission.companion_config(system_id));
    let is_stranger = known.is_some() && matches!(own, Some(Err(MissionError::NotInRoster(_))));
    let unfit = own.as_ref().and_then(|own| own.as_ref().err().copied());
    let refused =
        parse_error.or(unfit.filter(|error| !matches!(error, MissionError::NotInRoster(_))));
    let config = own
        .and_then(Result::ok)
        .unwrap_or_else(|| Config::new(system_id, Point::zeros(), UNKNOWN_ORIGIN));
    // Neither the stack nor the task's own memory has room for a companion that is then moved, so
    // it is built in its static. `expect` would format the error with the name in it, which takes 3
    // kB of flash.
    let Ok(settings) = config.checked() else { panic!("every setting was checked") };
    let companion = BoardCompanion::init_in_place(COMPANION.uninit(), settings);
    companion.attach_store(store);
    if let Some(text) = said.crashed {
        companion.send_text(Severity::Warning, CRASH_TEXT.init(text).as_str());
    }
    let warnings = said.warnings.iter().copied().chain(aside);
    warnings.for_each(|text| companion.send_text(Severity::Warning, text));
    if is_stranger {
        companion.send_text(Severity::Warning, NOT_IN_MISSION);
    }
    if let Some(error) = refused {
        let mut text = String::new();
        // Text that does not fit is cut; a test checks that every error fits.
        let _ = write!(text, "Mission: {error}");
        companion.send_text(Severity::Warning, MISSION_REFUSAL_TEXT.init(text).as_str());
    }
    shell.set_companion(companion);
    let then = if known.is_some() { OnAutopilot::GoOn } else { OnAutopilot::Restart };
    spawn_link_tasks(links, shell, then, autopilot, swarm);
    let memory = PlanningMemory::new(WORKSPACE.take(), SWARM_PLAN.take(), OWN_PLAN.take());
    let mut planner = Planner {
        files: PlanFiles { mission, roadmap, field },
        system_id,
        files_checksum: files,
        memory,
    };
    shell.run_planner_and_flash(&mut planner, &mut flash).await
}

/// Lends the newest stored roadmap or field that parses. The flag says whether a newer one was
/// skipped because it brought three starts in a row down.
fn find_roadmap_or_field(store: &mut Store, flash: &mut Flash) -> (Option<LentFlash>, bool) {
    let mut aside = false;
    loop {
        let lies = store.map_range();
        if let Some(lent) = lies.and_then(|r| flash.lend(r.start, (r.end - r.start) as usize)) {
            // The last 4 bytes of a roadmap or field are its CRC-32.
            let sum = lent.last_chunk().copied().map_or(0, u32::from_le_bytes);
            let begun = crash::begin_work(FileWork::CheckRoadmap, sum);
            aside |= !begun;
            let is_one =
                begun && (RoadmapView::parse(&lent).is_ok() || FieldView::parse(&lent).is_ok());
            crash::finish_work();
            if is_one {
                return (Some(lent), aside);
            }
            flash.take_back(lent);
        }
        if !store.fall_back_to_older_roadmap() {
            return (None, aside);
        }
    }
}

/// Result of [`find_mission`].
#[derive(Default)]
struct FoundMission {
    /// The mission, if it parses and fits the roadmap in use, or needs no roadmap.
    mission: Option<MissionView<'static>>,
    /// Checksum over mission and roadmap (or field), by which the crash record names the pair.
    files_checksum: u32,
    /// Whether the mission is not used because reading or planning it brought three starts in a row
    /// down.
    set_aside: bool,
    /// Parse error of the stored mission; `None` if it has none.
    parse_error: Option<MissionError>,
}

/// Reads the stored mission and checks it against the roadmap in use. The mission is copied into
/// RAM, because the flash journal moves its records. `map_crc` is the CRC of the roadmap or field
/// in use, 0 without one.
fn find_mission(
    store: &Store,
    flash: &mut Flash,
    roadmap: Option<&RoadmapView<'_>>,
    map_crc: u32,
) -> FoundMission {
    let bytes = MISSION_BYTES.take();
    let found = store.mission_range().and_then(|r| {
        let bytes = bytes.get_mut(..(r.end - r.start) as usize)?;
        flash.read(r.start, bytes).ok()?;
        Some(&*bytes)
    });
    let Some(bytes) = found else { return FoundMission::default() };
    let sum = bytes.last_chunk().copied().map_or(0, u32::from_le_bytes);
    let files = map_crc ^ sum.rotate_left(1);
    // Both kinds of work may have crashed on these files: reading the mission, and planning it.
    if !crash::may_begin(FileWork::Plan, files) || !crash::begin_work(FileWork::ReadMission, files)
    {
        return FoundMission { files_checksum: files, set_aside: true, ..FoundMission::default() };
    }
    let read = MissionView::parse(bytes);
    crash::finish_work();
    let parse_error = read.err();
    let mission = read.ok().filter(|mission| mission.can_be_planned_with(roadmap));
    FoundMission { mission, files_checksum: files, parse_error, set_aside: false }
}

/// Starts the tasks that receive from and transmit to both links.
fn spawn_link_tasks(
    links: SendSpawner,
    shell: &'static Shell,
    then: OnAutopilot,
    autopilot: UartEnds,
    swarm: UartEnds,
) {
    let once = "there is one such task for each link";
    links.spawn(receive_task(shell, Link::Autopilot, autopilot.0, then).expect(once));
    links.spawn(receive_task(shell, Link::Swarm, swarm.0, OnAutopilot::GoOn).expect(once));
    links.spawn(transmit_task(shell, Link::Autopilot, autopilot.1).expect(once));
    links.spawn(transmit_task(shell, Link::Swarm, swarm.1).expect(once));
    links.spawn(timer_task(shell).expect(once));
}

#[task(pool_size = 2)]
async fn receive_task(shell: &'static Shell, link: Link, uart: Receiver, then: OnAutopilot) {
    shell.receive(link, uart, then).await
}

#[task(pool_size = 2)]
async fn transmit_task(shell: &'static Shell, link: Link, uart: Transmitter) {
    shell.transmit(link, uart).await
}

#[task]
async fn timer_task(shell: &'static Shell) {
    shell.run_timers().await
}

/// Feeds the watchdog every 100 ms as long as [`Shell::may_feed_watchdog`], and restarts the board
/// when a restart is due.
#[task]
async fn watchdog_task(shell: &'static Shell, mut watchdog: Watchdog) {
    loop {
        Timer::after(CHECK_IN_EVERY).await;
        if shell.is_restart_due() {
            crash::restart();
        }
        if shell.may_feed_watchdog() {
            watchdog.feed();
        }
    }
}
