//! The firmware: a companion between an autopilot's serial port and a swarm's radio.
//!
//! Two executors, both in interrupts: links and setpoints above plans and flash. Thread mode only sleeps, by WFI. (Embassy's
//! executor for thread mode sleeps by WFE, which QEMU does not emulate: it would never sleep.)
#![no_std]
#![no_main]
#![expect(unsafe_code, reason = "the handler of faults, and where a static lies")]

use companion::mission_file::{self, MissionError, MissionView};
use companion::store::{ReadFlash, Store};
use companion::{Config, Link};
use cortex_m_rt::{ExceptionFrame, entry, exception};
use embassy_executor::{SendSpawner, task};
use embassy_time::Timer;
use firmware::boards::chosen::{self, LAYOUT, Receiver, Transmitter, Watchdog};
use firmware::boards::crash;
use firmware::boards::parts::Parts;
use firmware::capacity::VEHICLES;
use firmware::planner::{Memory, Planner};
use firmware::shell::{ALIVE_EVERY, BoardCompanion, NO_AUTOPILOT, Shell, hear_system_id};
use heapless::String;
use planner_core::Point;
use planner_core::frames::Geodetic;
use planner_core::roadmap::RoadmapView;
use static_cell::{ConstStaticCell, StaticCell};

/// Longest mission file.
const MISSION: usize = mission_file::encoded_len(VEHICLES, VEHICLES);
/// Where a board without a mission believes to be.
const NOWHERE: Geodetic = Geodetic { lat_deg: 0.0, lon_deg: 0.0, alt_m: 0.0 };
/// What a board says to which its mission gives nothing to do.
const STRANGER: &str = "This system id is not in the mission: no plan";

#[cfg_attr(any(feature = "nucleo-h743", feature = "qemu"), unsafe(link_section = ".dtcm"))]
static SHELL: StaticCell<Shell> = StaticCell::new();
static MEMORY: ConstStaticCell<Memory> = ConstStaticCell::new(Memory::new());
static MISSION_BYTES: ConstStaticCell<[u8; MISSION]> = ConstStaticCell::new([0; MISSION]);
static CRASH: StaticCell<String<50>> = StaticCell::new();

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
    #[cfg(any(feature = "nucleo-h743", feature = "qemu"))]
    // SAFETY: nothing runs yet.
    unsafe {
        firmware::boards::tcm::zero();
    }
    let crashed = crash::take();
    let parts = chosen::start();
    let plans = parts.plans;
    plans.spawn(work(parts, crashed).expect("there is one such task"));
    loop {
        cortex_m::asm::wfi();
    }
}

/// Brings the companion up, then plans and keeps the flash.
#[task]
async fn work(parts: Parts, crashed: Option<String<50>>) {
    let Parts { links, mut autopilot, swarm, mut flash, watchdog, .. } = parts;
    let mut store = Store::mount(LAYOUT, &mut flash);
    let roadmap = loop {
        let lies = store.roadmap().and_then(|r| flash.view(r.start, (r.end - r.start) as usize));
        match lies.and_then(|bytes| RoadmapView::parse(bytes).ok()) {
            None if store.refuse_roadmap() => {}
            found => break found,
        }
    };
    let bytes = MISSION_BYTES.take();
    // The mission is copied: the journal it lies in moves.
    let mission = store.mission().and_then(|r| {
        let bytes = bytes.get_mut(..(r.end - r.start) as usize)?;
        flash.read(r.start, bytes).ok()?;
        MissionView::parse(bytes).ok()
    });
    let mission = mission.filter(|m| roadmap.as_ref().is_some_and(|roadmap| m.fits(roadmap)));
    let known = match store.parameters().system_id() {
        Some(id) => Some(id),
        None => hear_system_id(&mut autopilot.0).await,
    };
    let system_id = known.unwrap_or(NO_AUTOPILOT);
    defmt::info!(
        "system {=u8}, roadmap {=bool}, mission {=bool}",
        system_id,
        roadmap.is_some(),
        mission.is_some()
    );
    let own = mission.as_ref().map(|mission| mission.config(system_id));
    let is_stranger = known.is_some() && matches!(own, Some(Err(MissionError::NotInRoster(_))));
    let config = own.and_then(Result::ok).unwrap_or_else(|| Config::new(system_id, Point::zeros(), NOWHERE));
    let mut companion = BoardCompanion::new(config).expect("every setting was checked");
    companion.mount(store);
    if let Some(text) = crashed {
        companion.say(true, CRASH.init(text).as_str());
    }
    if is_stranger {
        companion.say(true, STRANGER);
    }
    let shell = SHELL.init_with(Shell::new);
    shell.start(companion);
    let shell: &'static Shell = shell;
    start_links(links, shell, known.is_none(), autopilot, swarm);
    links.spawn(watch(shell, watchdog).expect("there is one such task"));
    let mut planner = Planner { roadmap, mission, system_id, memory: MEMORY.take() };
    shell.work(&mut planner, &mut flash).await
}

fn start_links(
    links: SendSpawner,
    shell: &'static Shell,
    for_autopilot: bool,
    autopilot: (Receiver, Transmitter),
    swarm: (Receiver, Transmitter),
) {
    let once = "there is one such task for each link";
    links.spawn(receive(shell, Link::Autopilot, autopilot.0, for_autopilot).expect(once));
    links.spawn(receive(shell, Link::Swarm, swarm.0, false).expect(once));
    links.spawn(transmit(shell, Link::Autopilot, autopilot.1).expect(once));
    links.spawn(transmit(shell, Link::Swarm, swarm.1).expect(once));
    links.spawn(keep_time(shell).expect(once));
}

#[task(pool_size = 2)]
async fn receive(shell: &'static Shell, link: Link, uart: Receiver, for_autopilot: bool) {
    shell.receive(link, uart, for_autopilot).await
}

#[task(pool_size = 2)]
async fn transmit(shell: &'static Shell, link: Link, uart: Transmitter) {
    shell.transmit(link, uart).await
}

#[task]
async fn keep_time(shell: &'static Shell) {
    shell.keep_time().await
}

/// Feeds the watchdog while all is well, and starts anew when that is asked for.
#[task]
async fn watch(shell: &'static Shell, mut watchdog: Watchdog) {
    watchdog.wake();
    loop {
        Timer::after(ALIVE_EVERY).await;
        if shell.wants_restart() {
            crash::restart();
        }
        if shell.is_alive() {
            watchdog.feed();
        }
    }
}
