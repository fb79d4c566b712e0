//! The shell around the companion: what moves bytes, keeps time and plans.
//!
//! [`receive`](Shell::receive), [`transmit`](Shell::transmit) and [`run_timers`](Shell::run_timers)
//! are tasks of an interrupt's executor; [`run_planner_and_flash`](Shell::run_planner_and_flash) is
//! a task of another one below it, so a long plan never holds a setpoint up. The companion is held
//! only for the time of one of its calls, never across an `await`, and both executors wait for so
//! long ([`HoldsExecutors`]).

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use companion::link::frame::{Framer, MAX_FRAME_LEN};
use companion::storage::store::{FlashRequest, MAX_READ};
use companion::{Event, Link, PlanFailure, PlanRequests, State};
use embassy_futures::select::select;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_io_async::{Read, Write};
use heapless::Vec;

use crate::boards::HoldsExecutors;
use crate::capacity::BoardCompanion;
use crate::flash::Flash;
use crate::planner::Planner;

/// Bytes taken from a UART at once.
const UART_CHUNK: usize = 256;
/// Time between two polls of a UART, so that bytes come in handfuls: each poll costs as much as a
/// hundred bytes.
const UART_POLL_EVERY: Duration = Duration::from_millis(1);
/// Period at which a link task without work checks in, so that a task that hangs is known.
pub const CHECK_IN_EVERY: Duration = Duration::from_millis(100);
/// Least time between two reports of errors of a line; the first is reported at once.
const LINE_REPORT_EVERY: Duration = Duration::from_secs(10);
/// Reports of a line: errors that the UART reported, and frames that were damaged or cut.
const LINE_TEXTS: [&str; 2] =
    ["Autopilot line: # errors, # damaged frames", "Radio line: # errors, # damaged frames"];

/// Time that queued messages have to go out before a restart, milliseconds.
const FLUSH_BEFORE_RESTART_MS: u32 = 200;

type TaskSignal<T> = Signal<CriticalSectionRawMutex, T>;

/// State that the tasks share.
pub struct Shell {
    companion: Mutex<HoldsExecutors, RefCell<Option<&'static mut BoardCompanion>>>,
    /// Signals that a link may have bytes to send.
    send_due: [TaskSignal<()>; 2],
    /// The companion's next step may be due earlier than thought.
    timer_changed: TaskSignal<()>,
    /// The plans that the companion asks for.
    plan_requests: PlanRequests,
    /// Signals that long work may be waiting.
    work_due: TaskSignal<()>,
    /// When a restart was asked for, milliseconds; 0 if none was.
    restart_ms: AtomicU32,
    /// Whether the flash is at work.
    flash_busy: AtomicBool,
    /// When each task last came by, milliseconds: receiving and transmitting of both links, and
    /// time.
    checked_in_ms: [AtomicU32; TASK_COUNT],
    /// Whether there is a companion.
    started: AtomicBool,
    setpoints: SetpointGaps,
    /// Errors that the UARTs reported.
    pub line_errors: [AtomicU32; 2],
}

/// A request of the companion, its bytes aside.
enum Request {
    Erase(u32),
    Program(u32, usize),
    Read(u32, usize),
}

/// The system id of the autopilot: of those whose heartbeat comes within a while after the first
/// one, that of which most is heard, since an autopilot may pass on those of others. `None` where
/// none comes in time.
pub async fn wait_for_system_id(uart: &mut impl Read) -> Option<u8> {
    let mut ear = AutopilotListener::new();
    let mut until = Instant::now() + FIRST_AUTOPILOT_WITHIN;
    let mut chunk = [0; UART_CHUNK];
    while let Ok(received) =
        with_timeout(until.saturating_duration_since(Instant::now()), uart.read(&mut chunk)).await
    {
        let known = ear.most_heard().is_some();
        // A line error loses bytes, no more.
        ear.handle_bytes(&chunk[..received.unwrap_or_default()]);
        if !known && ear.most_heard().is_some() {
            until = Instant::now() + OTHER_AUTOPILOTS_WITHIN;
        }
    }
    ear.most_heard()
}

/// System id of a board without an autopilot: files can be uploaded to it. When it hears an
/// autopilot it restarts.
pub const ID_WITHOUT_AUTOPILOT: u8 = 250;
/// Time within which the first autopilot is heard: an autopilot reports its state once a second.
const FIRST_AUTOPILOT_WITHIN: Duration = Duration::from_secs(3);
/// Time after the first autopilot within which every other one on the line is heard.
const OTHER_AUTOPILOTS_WITHIN: Duration = Duration::from_millis(1100);
/// Most autopilots that are distinguished.
const MAX_AUTOPILOTS: usize = 8;

/// Listens for autopilots.
struct AutopilotListener {
    framer: Framer,
    /// System id, frames, and whether a heartbeat was among them.
    heard: Vec<(u8, u32, bool), MAX_AUTOPILOTS>,
}

impl AutopilotListener {
    const fn new() -> Self {
        Self { framer: Framer::new(), heard: Vec::new() }
    }

    fn handle_bytes(&mut self, mut input: &[u8]) {
        while let Some(frame) = self.framer.next(now(), &mut input) {
            if frame.component != companion::AUTOPILOT_COMPONENT || frame.system == 0 {
                continue;
            }
            let beats = frame.message_id == HEARTBEAT;
            match self.heard.iter_mut().find(|(id, ..)| *id == frame.system) {
                Some((_, frames, beat)) => (*frames, *beat) = (*frames + 1, *beat || beats),
                // More autopilots than these are not distinguished.
                None => _ = self.heard.push((frame.system, 1, beats)),
            }
        }
    }

    /// The system id of the autopilot of which most is heard; the first of several.
    fn most_heard(&self) -> Option<u8> {
        let beating = self.heard.iter().filter(|(_, _, beats)| *beats);
        beating.rev().max_by_key(|(_, frames, _)| *frames).map(|(id, ..)| *id)
    }
}

/// Longest start of a board, milliseconds: the search through the flash, the check of the roadmap
/// and the wait for an autopilot. The watchdog is fed this long without any task of links or time.
pub const START_TIMEOUT_MS: u32 = 20_000;

const HEARTBEAT: u32 = 0;
const TASK_COUNT: usize = 5;
const TIME_TASK: usize = 4;

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
        Self {
            companion: Mutex::new(RefCell::new(None)),
            send_due: [Signal::new(), Signal::new()],
            timer_changed: Signal::new(),
            plan_requests: PlanRequests::new(),
            work_due: Signal::new(),
            restart_ms: AtomicU32::new(0),
            flash_busy: AtomicBool::new(false),
            checked_in_ms: [const { AtomicU32::new(0) }; TASK_COUNT],
            started: AtomicBool::new(false),
            setpoints: SetpointGaps::new(),
            line_errors: [const { AtomicU32::new(0) }; 2],
        }
    }

    /// Stores the companion, before any task of links or time starts. Until then the board is
    /// alive for no longer than [`START_TIMEOUT_MS`].
    pub fn start(&self, companion: &'static mut BoardCompanion) {
        self.companion.lock(|held| *held.borrow_mut() = Some(companion));
        (0..TASK_COUNT).for_each(|task| self.check_in(task));
        self.started.store(true, Ordering::Relaxed);
    }

    /// Holds the companion for the time of `run_planner_and_flash`.
    fn lock_companion<T>(&self, work: impl FnOnce(&mut BoardCompanion) -> T) -> T {
        self.companion.lock(|held| {
            work(
                held.borrow_mut()
                    .as_deref_mut()
                    .expect("the companion is put in before any task starts"),
            )
        })
    }

    /// Does something with the companion, at a time no earlier than that of the last, and hands on
    /// what came of it.
    fn with_companion<T>(
        &'static self,
        work: impl FnOnce(&mut BoardCompanion, companion::Instant) -> T,
    ) -> T {
        let result = self.lock_companion(|companion| {
            let result = work(companion, now());
            while let Some(event) = companion.poll_event() {
                match event {
                    Event::PlanRequested(wanted) => self.plan_requests.add(wanted),
                    Event::RestartRequested => self.request_restart(),
                    Event::StateChanged { to: State::Done | State::Aborted, .. } => {
                        if let Some(reported) = self.setpoints.take_setpoint_stats(now_ms()) {
                            companion.send_text_with_numbers(
                                false,
                                "Setpoints: #, at most # ms apart",
                                reported,
                            );
                        }
                    }
                    // The event's text is reported already.
                    Event::StateChanged { .. }
                    | Event::WaitsForStart { .. }
                    | Event::FlownAround { .. } => {}
                }
            }
            if companion.streams_setpoints() {
                self.setpoints.begin_stream(now_ms());
            } else {
                self.setpoints.end_stream(now_ms());
            }
            result
        });
        self.send_due.iter().for_each(|sends| sends.signal(()));
        self.work_due.signal(());
        self.timer_changed.signal(());
        result
    }

    /// Requests a restart. A repeated request does not delay it.
    fn request_restart(&self) {
        let _ = self.restart_ms.compare_exchange(
            0,
            now_ms().max(1),
            Ordering::Relaxed,
            Ordering::Relaxed,
        );
    }

    fn check_in(&self, task: usize) {
        self.checked_in_ms[task].store(now_ms(), Ordering::Relaxed);
    }

    /// Takes what a UART receives to the companion.
    ///
    /// A board without an autopilot restarts when it hears one, if `for_autopilot`.
    pub async fn receive(&'static self, link: Link, mut uart: impl Read, for_autopilot: bool) -> ! {
        let mut chunk = [0; UART_CHUNK];
        let mut ear = for_autopilot.then(AutopilotListener::new);
        let errors = &self.line_errors[link as usize];
        let (mut reported, mut tells_at) = (0, Instant::MIN);
        loop {
            match with_timeout(CHECK_IN_EVERY, uart.read(&mut chunk)).await {
                Ok(Ok(length)) => {
                    self.with_companion(|companion, now| {
                        companion.handle_bytes(link, now, &chunk[..length]);
                    });
                    if let Some(ear) = &mut ear {
                        ear.handle_bytes(&chunk[..length]);
                        if ear.most_heard().is_some() {
                            self.request_restart();
                        }
                    }
                }
                // Framing, noise or overrun: what was lost the framer finds out.
                Ok(Err(_)) => _ = errors.fetch_add(1, Ordering::Relaxed),
                Err(_) => {}
            }
            let count = errors.load(Ordering::Relaxed);
            if count != reported && Instant::now() >= tells_at {
                (reported, tells_at) = (count, Instant::now() + LINE_REPORT_EVERY);
                self.with_companion(|companion, _| {
                    let counters = companion.counters(link);
                    let damaged = counters.bad_crc.wrapping_add(counters.expired);
                    companion.send_text_with_numbers(
                        true,
                        LINE_TEXTS[link as usize],
                        [count, damaged],
                    );
                });
            }
            self.check_in(link as usize);
            Timer::after(UART_POLL_EVERY).await;
        }
    }

    /// Takes what the companion has for a link to its UART.
    pub async fn transmit(&'static self, link: Link, mut uart: impl Write) -> ! {
        let mut frame = [0; MAX_FRAME_LEN];
        loop {
            let length = self.lock_companion(|companion| companion.poll_transmit(link, &mut frame));
            if length == 0 {
                // Late or not, it comes by.
                let _ = with_timeout(CHECK_IN_EVERY, self.send_due[link as usize].wait()).await;
            } else {
                if link == Link::Autopilot && is_setpoint(&frame[..length]) {
                    self.setpoints.note_setpoint(now_ms());
                }
                // Work that waited for room for its report may continue.
                self.work_due.signal(());
                if uart.write_all(&frame[..length]).await.is_err() {
                    self.line_errors[link as usize].fetch_add(1, Ordering::Relaxed);
                }
            }
            self.check_in(2 + link as usize);
        }
    }

    /// Calls the companion whenever one of its timers is due.
    pub async fn run_timers(&'static self) -> ! {
        loop {
            let now = now();
            let due = self.lock_companion(|companion| companion.poll_timeout());
            let due =
                due.unwrap_or(now + companion::Duration::from_micros(CHECK_IN_EVERY.as_micros()));
            if due <= now {
                self.with_companion(BoardCompanion::handle_timeout);
            } else {
                select(Timer::at(Instant::from_micros(due.as_micros())), self.timer_changed.wait())
                    .await;
            }
            self.check_in(TIME_TASK);
        }
    }

    /// Answers the companion's requests for plans and for its flash, one after the other: the flash
    /// is never erased while a roadmap in it is planned on.
    pub async fn run_planner_and_flash(
        &'static self,
        planner: &mut Planner<'_>,
        flash: &mut impl Flash,
    ) -> ! {
        loop {
            if let Some(wanted) = self.plan_requests.take() {
                let detour =
                    self.lock_companion(|companion| planner.read_inputs(wanted, companion));
                let answer: Result<_, PlanFailure> = planner.answer(wanted, detour.as_ref());
                self.with_companion(|companion, now| companion.handle_plan(now, wanted, answer));
                continue;
            }
            if !self.serve_flash(flash).await {
                self.work_due.wait().await;
            }
        }
    }

    /// Executes one flash request of the companion; false if it asks for none, or is about to
    /// restart: that must not tear what is being written.
    async fn serve_flash(&'static self, flash: &mut impl Flash) -> bool {
        if self.restart_ms.load(Ordering::Relaxed) != 0 {
            return false;
        }
        let mut bytes = [0; MAX_READ];
        let request = self.lock_companion(|companion| {
            Some(match companion.poll_flash()? {
                FlashRequest::Erase { at } => Request::Erase(at),
                FlashRequest::Read { at, len } => Request::Read(at, len),
                FlashRequest::Program { at, bytes: given } => {
                    bytes[..given.len()].copy_from_slice(given);
                    Request::Program(at, given.len())
                }
            })
        });
        let Some(request) = request else {
            // The companion may have an answer to send.
            self.send_due.iter().for_each(|sends| sends.signal(()));
            return false;
        };
        self.flash_busy.store(true, Ordering::Relaxed);
        let outcome = match request {
            Request::Erase(at) => flash.erase(at).await.map(|()| 0),
            Request::Program(at, len) => flash.program(at, &bytes[..len]).await.map(|()| 0),
            Request::Read(at, len) => flash.read(at, &mut bytes[..len]).map(|()| len),
        };
        self.flash_busy.store(false, Ordering::Relaxed);
        let outcome = outcome.map(|len| &bytes[..len]);
        self.with_companion(|companion, now| companion.handle_flash(now, outcome));
        true
    }

    /// Whether a restart was asked for, what was to be said before has had time to go out, and the
    /// flash is at rest.
    pub fn is_restart_due(&self) -> bool {
        let asked = self.restart_ms.load(Ordering::Relaxed);
        asked != 0
            && now_ms().wrapping_sub(asked) > FLUSH_BEFORE_RESTART_MS
            && !self.flash_busy.load(Ordering::Relaxed)
    }

    /// Whether every task of the links and of time came by lately, and so did the last setpoint
    /// where they are to flow: else the watchdog is left to bite.
    pub fn is_alive(&self) -> bool {
        self.is_alive_at(now_ms())
    }

    fn is_alive_at(&self, now_ms: u32) -> bool {
        if !self.started.load(Ordering::Relaxed) {
            return now_ms < START_TIMEOUT_MS;
        }
        let limit = 4 * CHECK_IN_EVERY.as_millis() as u32;
        self.checked_in_ms
            .iter()
            .all(|seen| now_ms.wrapping_sub(seen.load(Ordering::Relaxed)) < limit)
            && self.setpoints.since_last_ms(now_ms).is_none_or(|passed| passed < limit)
    }
}

impl Default for Shell {
    fn default() -> Self {
        Self::new()
    }
}

/// Number of setpoints in a flight and the gaps between them, by the board's own time. A stream
/// lasts as long as the companion reports it, not until a pause: else the longest pauses would not
/// be seen.
struct SetpointGaps {
    count: AtomicU32,
    /// The longest time between two, or from the stream's begin to the first or from the last to
    /// its end, milliseconds.
    gap_ms: AtomicU32,
    /// When the last went out, or the stream began, milliseconds; 0 while there is no stream.
    last_ms: AtomicU32,
}

impl SetpointGaps {
    const fn new() -> Self {
        Self { count: AtomicU32::new(0), gap_ms: AtomicU32::new(0), last_ms: AtomicU32::new(0) }
    }

    /// Notes a setpoint that goes out.
    fn note_setpoint(&self, now_ms: u32) {
        self.count.fetch_add(1, Ordering::Relaxed);
        self.set_last(now_ms, now_ms.max(1));
    }

    /// The companion streams them, from now on if it did not before.
    fn begin_stream(&self, now_ms: u32) {
        let _ =
            self.last_ms.compare_exchange(0, now_ms.max(1), Ordering::Relaxed, Ordering::Relaxed);
    }

    /// Time since the last, if more are to come, milliseconds.
    fn since_last_ms(&self, now_ms: u32) -> Option<u32> {
        elapsed_ms(self.last_ms.load(Ordering::Relaxed), now_ms)
    }

    /// The companion streams none, for now.
    fn end_stream(&self, now_ms: u32) {
        self.set_last(now_ms, 0);
    }

    fn set_last(&self, now_ms: u32, next_ms: u32) {
        if let Some(gap_ms) = elapsed_ms(self.last_ms.swap(next_ms, Ordering::Relaxed), now_ms) {
            self.gap_ms.fetch_max(gap_ms, Ordering::Relaxed);
        }
    }

    /// Returns the count and the longest gap of the setpoints of a flight that is over, and clears
    /// both; `None` without any.
    fn take_setpoint_stats(&self, now_ms: u32) -> Option<[u32; 2]> {
        self.end_stream(now_ms);
        let reported = [&self.count, &self.gap_ms].map(|number| number.swap(0, Ordering::Relaxed));
        (reported[0] > 0).then_some(reported)
    }
}

/// Time since the last setpoint, if there was one.
fn elapsed_ms(last_ms: u32, now_ms: u32) -> Option<u32> {
    (last_ms != 0).then(|| now_ms.wrapping_sub(last_ms))
}

/// SET_POSITION_TARGET_LOCAL_NED, by the message id of a MAVLink 2 frame.
fn is_setpoint(frame: &[u8]) -> bool {
    frame.get(7..10) == Some(&[84, 0, 0])
}

#[cfg(test)]
mod tests;
