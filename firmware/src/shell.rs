//! The shell around the companion: what moves bytes, keeps time and plans.
//!
//! [`receive`](Shell::receive), [`transmit`](Shell::transmit) and [`keep_time`](Shell::keep_time) are tasks of an interrupt's
//! executor; [`plan`](Shell::plan) is below them, in thread mode, so a long plan never holds a setpoint up. The companion is held
//! only for the time of one of its calls, never across an `await`.

use core::sync::atomic::{AtomicU32, Ordering};

use companion::frame::MAX_SENT;
use companion::{Companion, Event, Link, PlanFailure};
use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_io_async::{Read, Write};

use crate::capacity::{GATES, VEHICLES, WAYPOINTS};
use crate::planner::Planner;

/// A companion with a board's capacities.
pub type BoardCompanion = Companion<VEHICLES, WAYPOINTS, GATES>;

/// Bytes taken from a UART at once.
const CHUNK: usize = 128;
/// A link task that has nothing to do comes by this often all the same, so that one that hangs is known.
pub const ALIVE_EVERY: Duration = Duration::from_millis(100);
/// Setpoints further apart than this are late: twice in a row would be its autopilot's failsafe.
pub const SETPOINT_WITHIN: Duration = Duration::from_millis(150);

type Shared<T> = Signal<CriticalSectionRawMutex, T>;

/// What the tasks share.
pub struct Shell {
    companion: Mutex<CriticalSectionRawMutex, Option<BoardCompanion>>,
    /// Something may be to be sent.
    sends: [Shared<()>; 2],
    /// The companion's next step may be due earlier than thought.
    steps: Shared<()>,
    /// The companion asks for a plan.
    wants_plan: Shared<()>,
    /// When each task last came by, milliseconds: receiving and transmitting of both links, and time.
    seen_ms: [AtomicU32; TASKS],
    /// When the last setpoint went out, milliseconds.
    setpoint_ms: AtomicU32,
    /// The longest time between two setpoints, milliseconds.
    gap_ms: AtomicU32,
    /// Errors that the UARTs reported.
    pub line_errors: [AtomicU32; 2],
}

const TASKS: usize = 5;
const TIME: usize = 4;

/// Now, as the companion counts time.
pub fn now() -> companion::Instant {
    companion::Instant::from_micros(Instant::now().as_micros())
}

fn now_ms() -> u32 {
    Instant::now().as_millis() as u32
}

impl Shell {
    /// Without a companion.
    pub const fn new() -> Self {
        const ZERO: AtomicU32 = AtomicU32::new(0);
        Self {
            companion: Mutex::new(None),
            sends: [Signal::new(), Signal::new()],
            steps: Signal::new(),
            wants_plan: Signal::new(),
            seen_ms: [ZERO; TASKS],
            setpoint_ms: ZERO,
            gap_ms: ZERO,
            line_errors: [ZERO; 2],
        }
    }

    /// Puts the companion in, before any task starts.
    pub fn start(&mut self, companion: BoardCompanion) {
        *self.companion.get_mut() = Some(companion);
    }

    /// Does something with the companion and hands on what came of it.
    async fn with<T>(&self, work: impl FnOnce(&mut BoardCompanion) -> T) -> T {
        let mut held = self.companion.lock().await;
        let companion = held.as_mut().expect("the companion is put in before any task starts");
        let result = work(companion);
        while let Some(event) = companion.poll_event() {
            match event {
                Event::PlanRequested => self.wants_plan.signal(()),
                Event::StateChanged { .. } => {}
            }
        }
        drop(held);
        self.sends.iter().for_each(|sends| sends.signal(()));
        self.steps.signal(());
        result
    }

    fn seen(&self, task: usize) {
        self.seen_ms[task].store(now_ms(), Ordering::Relaxed);
    }

    /// Takes what a UART receives to the companion.
    pub async fn receive(&self, link: Link, mut uart: impl Read) -> ! {
        let mut chunk = [0; CHUNK];
        loop {
            match with_timeout(ALIVE_EVERY, uart.read(&mut chunk)).await {
                Ok(Ok(length)) => self.with(|c| c.handle_bytes(link, now(), &chunk[..length])).await,
                // Framing, noise or overrun: what was lost the framer finds out.
                Ok(Err(_)) => _ = self.line_errors[link as usize].fetch_add(1, Ordering::Relaxed),
                Err(_) => {}
            }
            self.seen(link as usize);
        }
    }

    /// Takes what the companion has for a link to its UART.
    pub async fn transmit(&self, link: Link, mut uart: impl Write) -> ! {
        let mut frame = [0; MAX_SENT];
        loop {
            let length = {
                let mut held = self.companion.lock().await;
                held.as_mut().map_or(0, |companion| companion.poll_transmit(link, &mut frame))
            };
            if length == 0 {
                // Late or not, it comes by.
                let _ = with_timeout(ALIVE_EVERY, self.sends[link as usize].wait()).await;
            } else {
                if link == Link::Autopilot && is_setpoint(&frame[..length]) {
                    self.note_setpoint();
                }
                if uart.write_all(&frame[..length]).await.is_err() {
                    self.line_errors[link as usize].fetch_add(1, Ordering::Relaxed);
                }
            }
            self.seen(2 + link as usize);
        }
    }

    /// Lets the companion's time pass.
    pub async fn keep_time(&self) -> ! {
        loop {
            let due = {
                let held = self.companion.lock().await;
                held.as_ref().and_then(BoardCompanion::poll_timeout)
            };
            let now = now();
            let due = due.unwrap_or(now + companion::Duration::from_micros(ALIVE_EVERY.as_micros()));
            if due <= now {
                self.with(|companion| companion.handle_timeout(now)).await;
            } else {
                select(Timer::at(Instant::from_micros(due.micros())), self.steps.wait()).await;
            }
            self.seen(TIME);
        }
    }

    /// Answers the companion's requests for plans.
    pub async fn plan(&self, planner: &mut Planner<'_>) -> ! {
        loop {
            self.wants_plan.wait().await;
            let detour = {
                let held = self.companion.lock().await;
                held.as_ref().and_then(|companion| planner.note_detour(companion))
            };
            let answer: Result<_, PlanFailure> = planner.answer(detour.as_ref());
            self.with(|companion| companion.handle_plan(now(), answer)).await;
        }
    }

    /// Whether the planner has something to do: asked with interrupts off, before the core sleeps.
    pub fn wants_plan(&self) -> bool {
        self.wants_plan.signaled()
    }

    /// Whether every task of the links came by lately and setpoints that flow are not late: else the watchdog is left to bite.
    pub fn is_alive(&self) -> bool {
        let now = now_ms();
        let limit = 4 * ALIVE_EVERY.as_millis() as u32;
        self.seen_ms.iter().all(|seen| now.wrapping_sub(seen.load(Ordering::Relaxed)) < limit)
    }

    fn note_setpoint(&self) {
        let now = now_ms();
        let gap = now.wrapping_sub(self.setpoint_ms.swap(now, Ordering::Relaxed));
        // A longer one is no gap: they had not flowed.
        if gap < 1000 {
            self.gap_ms.fetch_max(gap, Ordering::Relaxed);
        }
    }
}

impl Default for Shell {
    fn default() -> Self {
        Self::new()
    }
}

/// SET_POSITION_TARGET_LOCAL_NED, by the message id of a MAVLink 2 frame.
fn is_setpoint(frame: &[u8]) -> bool {
    frame.get(7..10) == Some(&[84, 0, 0])
}
