//! The smallest board: everything that the shell needs from a board, here implemented on a PC.
//!
//! A board has a clock (embassy-time's driver), two UARTs (embedded-io-async), a flash for files
//! and parameters, and executors for the tasks. `src/boards/pico2` is the same on a chip: links and
//! setpoints run in an interrupt above planning, and a watchdog is fed while
//! `Shell::may_feed_watchdog`.
//!
//! `cargo run -p firmware --example smallest_board`

use std::sync::OnceLock;
use std::task::Waker;

use companion::link::frame::{self, Header, MAX_FRAME_LEN};
use companion::planner::PlanFiles;
use companion::storage::store::{FlashFault, FlashLayout, ReadFlash, Store};
use companion::{AUTOPILOT_COMPONENT, Config, Link};
use embassy_futures::block_on;
use embassy_futures::join::{join, join5};
use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_time::{Duration, Timer};
use firmware::capacity::{BoardCompanion, VEHICLES, WAYPOINTS};
use firmware::flash::Flash;
use firmware::planner::{OwnPlanMemory, Planner, PlanningMemory};
use firmware::shell::{OnAutopilot, Shell, wait_for_autopilot_id};
use firmware::workspace::WorkspaceOverlay;
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use planner_core::plan::SwarmPlan;
use static_cell::{ConstStaticCell, StaticCell};

/// The clock: microseconds since its first use.
struct Clock(OnceLock<std::time::Instant>);

impl embassy_time_driver::Driver for Clock {
    fn now(&self) -> u64 {
        self.0.get_or_init(std::time::Instant::now).elapsed().as_micros() as u64
    }

    /// Wakes the task at once, which polls again until it is due; a board would set a timer and
    /// sleep.
    fn schedule_wake(&self, _at: u64, waker: &Waker) {
        waker.wake_by_ref();
    }
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock(OnceLock::new()));

/// Bytes in one direction of a serial line.
type Line = Pipe<CriticalSectionRawMutex, 4096>;
static FROM_AUTOPILOT: Line = Line::new();
static TO_AUTOPILOT: Line = Line::new();
static FROM_RADIO: Line = Line::new();
static TO_RADIO: Line = Line::new();

/// A flash in RAM, which does not outlast the program; erased bytes are 0xff.
const LAYOUT: FlashLayout = FlashLayout::PICO2;
struct Ram(Vec<u8>);

impl ReadFlash for Ram {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        let bytes = self.0.get(at as usize..at as usize + out.len()).ok_or(FlashFault)?;
        out.copy_from_slice(bytes);
        Ok(())
    }
}

impl Flash for Ram {
    async fn erase(&mut self, at: u32) -> Result<(), FlashFault> {
        let sector = at as usize..(at + LAYOUT.sector_len) as usize;
        self.0.get_mut(sector).ok_or(FlashFault)?.fill(0xff);
        Ok(())
    }

    async fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashFault> {
        let words = self.0.get_mut(at as usize..at as usize + bytes.len()).ok_or(FlashFault)?;
        words.copy_from_slice(bytes);
        Ok(())
    }
}

// Large objects are statics, as on a board.
static SHELL: Shell = Shell::new();
static COMPANION: StaticCell<BoardCompanion> = StaticCell::new();
static WORKSPACE: ConstStaticCell<WorkspaceOverlay> = ConstStaticCell::new(WorkspaceOverlay::new());
static SWARM: ConstStaticCell<SwarmPlan<VEHICLES, WAYPOINTS>> =
    ConstStaticCell::new(SwarmPlan::new());
static OWN: ConstStaticCell<OwnPlanMemory> = ConstStaticCell::new(OwnPlanMemory::new());

/// Starts a companion and runs its tasks. No mission is uploaded, so it only reports.
async fn board() {
    let mut flash = Ram(vec![0xff; LAYOUT.len() as usize]);
    let store = Store::mount(LAYOUT, &mut flash);
    let system_id =
        wait_for_autopilot_id(&mut &FROM_AUTOPILOT).await.expect("an autopilot is connected");
    let nowhere = Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 };
    let settings = Config::new(system_id, Point::zeros(), nowhere)
        .checked()
        .expect("these settings are sound");
    let companion = BoardCompanion::init_in_place(COMPANION.uninit(), settings);
    companion.attach_store(store);
    SHELL.set_companion(companion);
    let memory = PlanningMemory::new(WORKSPACE.take(), SWARM.take(), OWN.take());
    let mut planner = Planner { files: PlanFiles::default(), system_id, files_checksum: 0, memory };
    let links = join5(
        SHELL.receive(Link::Autopilot, &FROM_AUTOPILOT, OnAutopilot::GoOn),
        SHELL.receive(Link::Swarm, &FROM_RADIO, OnAutopilot::GoOn),
        SHELL.transmit(Link::Autopilot, &TO_AUTOPILOT),
        SHELL.transmit(Link::Swarm, &TO_RADIO),
        SHELL.run_timers(),
    );
    join(links, SHELL.run_planner_and_flash(&mut planner, &mut flash)).await;
}

/// The autopilot at the other end of the serial line: sends a HEARTBEAT each second for 5 s.
/// Returns the number of bytes that the board sent to it.
async fn autopilot() -> usize {
    let heartbeat =
        HEARTBEAT_DATA { autopilot: MavAutopilot::MAV_AUTOPILOT_PX4, ..HEARTBEAT_DATA::DEFAULT };
    let (mut heard, mut bytes) = (0, [0; MAX_FRAME_LEN]);
    for sequence in 0..50 {
        if sequence % 10 == 0 {
            let header = Header { system: 7, component: AUTOPILOT_COMPONENT, sequence };
            let length = frame::encode(header, &heartbeat, &mut bytes);
            FROM_AUTOPILOT.write_all(&bytes[..length]).await;
        }
        Timer::after(Duration::from_millis(100)).await;
        while let Ok(length) = TO_AUTOPILOT.try_read(&mut bytes) {
            heard += length;
        }
    }
    heard
}

fn main() {
    let heard = std::cell::Cell::new(0);
    block_on(select(board(), async { heard.set(autopilot().await) }));
    assert!(
        SHELL.may_feed_watchdog() && heard.get() > 0,
        "the board lives, and talks to its autopilot"
    );
    println!("the board sent {} bytes to its autopilot", heard.get());
}
