//! The shell around the companion: async tasks that move bytes, run timers, plan and serve flash.
//!
//! [`receive`](Shell::receive), [`transmit`](Shell::transmit) and [`run_timers`](Shell::run_timers)
//! run on the executor of higher priority; [`run_planner_and_flash`](Shell::run_planner_and_flash)
//! runs on the one below it, so a long plan never delays a setpoint. The companion is locked only
//! for the time of one of its calls, never across an `await`; neither executor runs another task
//! meanwhile ([`BasepriRawMutex`]).

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use companion::link::frame::{Framer, MAX_FRAME_LEN};
use companion::link::severity::Severity;
use companion::storage::store::{FlashRequest, MAX_READ_LEN};
use companion::{Event, Link, PlanRequests};
use embassy_futures::select::select;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_io_async::{Read, Write};
use heapless::Vec;

use crate::boards::BasepriRawMutex;
use crate::capacity::BoardCompanion;
use crate::flash::Flash;
use crate::planner::Planner;

/// Most bytes that are read from a UART at once.
const UART_CHUNK: usize = 256;
/// Pause after each read of a UART, so that bytes come in groups: a read costs as much processor
/// time as handling a hundred bytes.
const UART_POLL_EVERY: Duration = Duration::from_millis(1);
/// A task without work checks in this often; the watchdog is fed only while all tasks check in.
pub const CHECK_IN_EVERY: Duration = Duration::from_millis(100);
/// Least time between two STATUSTEXTs about the errors of one UART; the first is sent at once.
const UART_REPORT_EVERY: Duration = Duration::from_secs(10);
/// STATUSTEXT of each link: errors of its UART, and frames with a bad CRC or cut short.
const UART_ERROR_TEXTS: [&str; 2] =
    ["Autopilot line: # errors, # damaged frames", "Radio line: # errors, # damaged frames"];
/// Time from the request of a restart to the restart, milliseconds: queued messages are sent in it.
const FLUSH_BEFORE_RESTART_MS: u32 = 200;

type TaskSignal<T> = Signal<CriticalSectionRawMutex, T>;

/// The companion, and signals and counters that all tasks share.
pub struct Shell {
    companion: Mutex<BasepriRawMutex, RefCell<Option<&'static mut BoardCompanion>>>,
    /// For each link: wakes its transmit task, because the companion may have a frame to send.
    send_due: [TaskSignal<()>; 2],
    /// Wakes `run_timers`, because the companion's next timeout may have changed.
    timer_changed: TaskSignal<()>,
    /// Kinds of plan that the companion requested and that are not made yet.
    plan_requests: PlanRequests,
    /// Wakes `run_planner_and_flash`, because a plan or a flash operation may have been requested.
    plan_or_flash_due: TaskSignal<()>,
    /// Time at which a restart was requested, milliseconds since the start; 0 without a request.
    restart_requested_ms: AtomicU32,
    /// Whether an erasure, programming or reading of the flash runs.
    flash_busy: AtomicBool,
    /// Time of each task's last check-in, milliseconds since the start: receive tasks of both
    /// links, transmit tasks of both links, timer task.
    checked_in_ms: [AtomicU32; TASK_COUNT],
    /// Whether [`Shell::set_companion`] has stored a companion.
    has_companion: AtomicBool,
    setpoints: SetpointGaps,
    /// For each link: number of errors that its UART returned since the start.
    pub uart_errors: [AtomicU32; 2],
}

/// A [`FlashRequest`] without the bytes to program: offset and length in bytes.
enum FlashOperation {
    Erase(u32),
    Program(u32, usize),
    Read(u32, usize),
}

/// Waits for HEARTBEATs on `uart` and returns the autopilot's system id. An autopilot may forward
/// other autopilots' messages: of those heard until 1.1 s after the first HEARTBEAT, the id of the
/// one that sent most frames is returned. `None` if no HEARTBEAT comes within 3 s.
pub async fn wait_for_autopilot_id(uart: &mut impl Read) -> Option<u8> {
    let mut listener = AutopilotListener::new();
    let mut until = Instant::now() + FIRST_AUTOPILOT_WITHIN;
    let mut chunk = [0; UART_CHUNK];
    while let Ok(received) =
        with_timeout(until.saturating_duration_since(Instant::now()), uart.read(&mut chunk)).await
    {
        let known = listener.most_heard().is_some();
        // A UART error loses bytes, nothing else.
        listener.handle_bytes(&chunk[..received.unwrap_or_default()]);
        if !known && listener.most_heard().is_some() {
            until = Instant::now() + OTHER_AUTOPILOTS_WITHIN;
        }
    }
    listener.most_heard()
}

/// System id of a board that has heard no autopilot and has no id stored: files can be uploaded to
/// it. When the board hears an autopilot, it restarts and takes the autopilot's id.
pub const SYSTEM_ID_WITHOUT_AUTOPILOT: u8 = 250;
/// Time to wait for the first HEARTBEAT; an autopilot sends one each second.
const FIRST_AUTOPILOT_WITHIN: Duration = Duration::from_secs(3);
/// Time after the first HEARTBEAT in which other autopilots' HEARTBEATs are awaited.
const OTHER_AUTOPILOTS_WITHIN: Duration = Duration::from_millis(1100);
/// Most autopilots whose frames are counted; frames of further ones are ignored.
const MAX_AUTOPILOTS: usize = 8;

/// Counts the frames of each autopilot that is heard on a UART.
struct AutopilotListener {
    framer: Framer,
    /// Each autopilot's system id, number of its frames, and whether a HEARTBEAT was among them.
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
                None => _ = self.heard.push((frame.system, 1, beats)),
            }
        }
    }

    /// Of the autopilots that sent a HEARTBEAT, the one with most frames; the first of equals.
    fn most_heard(&self) -> Option<u8> {
        let beating = self.heard.iter().filter(|(_, _, beats)| *beats);
        beating.rev().max_by_key(|(_, frames, _)| *frames).map(|(id, ..)| *id)
    }
}

/// What a board does when it hears an autopilot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnAutopilot {
    /// It restarts: it started without one.
    Restart,
    /// It goes on.
    GoOn,
}

/// Longest start of a board, milliseconds: search of the flash, check of the roadmap, wait for an
/// autopilot. Until then the watchdog is fed although no task checks in.
pub const START_TIMEOUT_MS: u32 = 20_000;

/// Message id of HEARTBEAT.
const HEARTBEAT: u32 = 0;
const TASK_COUNT: usize = 5;
/// Index of the timer task in [`Shell::checked_in_ms`].
const TIMER_TASK: usize = 4;

/// Time since the board's start, in the companion's type.
pub fn now() -> companion::Instant {
    companion::Instant::from_micros(Instant::now().as_micros())
}

/// Time since the board's start, milliseconds; wraps after 49 days.
fn now_ms() -> u32 {
    Instant::now().as_millis() as u32
}

impl Shell {
    /// A shell without a companion; [`Self::set_companion`] stores it.
    pub const fn new() -> Self {
        Self {
            companion: Mutex::new(RefCell::new(None)),
            send_due: [Signal::new(), Signal::new()],
            timer_changed: Signal::new(),
            plan_requests: PlanRequests::new(),
            plan_or_flash_due: Signal::new(),
            restart_requested_ms: AtomicU32::new(0),
            flash_busy: AtomicBool::new(false),
            checked_in_ms: [const { AtomicU32::new(0) }; TASK_COUNT],
            has_companion: AtomicBool::new(false),
            setpoints: SetpointGaps::new(),
            uart_errors: [const { AtomicU32::new(0) }; 2],
        }
    }

    /// Stores the companion; to be called before any task of the links or timers is spawned. Before
    /// this call [`Self::may_feed_watchdog`] is true for the first [`START_TIMEOUT_MS`] only.
    pub fn set_companion(&self, companion: &'static mut BoardCompanion) {
        self.companion.lock(|held| *held.borrow_mut() = Some(companion));
        (0..TASK_COUNT).for_each(|task| self.check_in(task));
        self.has_companion.store(true, Ordering::Relaxed);
    }

    /// Calls `work` with the companion locked; handles no events and wakes no task.
    fn lock_companion<T>(&self, work: impl FnOnce(&mut BoardCompanion) -> T) -> T {
        self.companion.lock(|held| {
            work(
                held.borrow_mut()
                    .as_deref_mut()
                    .expect("the companion is put in before any task starts"),
            )
        })
    }

    /// Calls `work` with the companion and the time, handles the companion's events (plan and
    /// restart requests, report of setpoint gaps), and wakes all tasks.
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
                    Event::StateChanged { to, .. } if to.is_over() => {
                        if let Some(reported) = self.setpoints.take_setpoint_stats(now_ms()) {
                            companion.send_text_with_numbers(
                                Severity::Info,
                                "Setpoints: #, at most # ms apart",
                                reported,
                            );
                        }
                    }
                    // The companion has sent a STATUSTEXT about these already.
                    Event::StateChanged { .. }
                    | Event::WaitsForUnstartedVehicle { .. }
                    | Event::DetourSkippedWaypoints { .. } => {}
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
        self.plan_or_flash_due.signal(());
        self.timer_changed.signal(());
        result
    }

    /// Requests a restart of the board. A repeated request does not delay it.
    fn request_restart(&self) {
        let _ = self.restart_requested_ms.compare_exchange(
            0,
            now_ms().max(1),
            Ordering::Relaxed,
            Ordering::Relaxed,
        );
    }

    fn check_in(&self, task: usize) {
        self.checked_in_ms[task].store(now_ms(), Ordering::Relaxed);
    }

    /// Task: passes bytes from `uart` to the companion as those of `link`; reports UART errors as
    /// STATUSTEXT. `then` is what the board does when it hears an autopilot on this link.
    pub async fn receive(&'static self, link: Link, mut uart: impl Read, then: OnAutopilot) -> ! {
        let mut chunk = [0; UART_CHUNK];
        let mut listener = (then == OnAutopilot::Restart).then(AutopilotListener::new);
        let errors = &self.uart_errors[link as usize];
        let (mut reported, mut next_report_at) = (0, Instant::MIN);
        loop {
            match with_timeout(CHECK_IN_EVERY, uart.read(&mut chunk)).await {
                Ok(Ok(length)) => {
                    self.with_companion(|companion, now| {
                        companion.handle_bytes(link, now, &chunk[..length]);
                    });
                    if let Some(listener) = &mut listener {
                        listener.handle_bytes(&chunk[..length]);
                        if listener.most_heard().is_some() {
                            self.request_restart();
                        }
                    }
                }
                // Framing, noise or overrun error: the framer notices the lost bytes by the CRC.
                Ok(Err(_)) => _ = errors.fetch_add(1, Ordering::Relaxed),
                Err(_) => {}
            }
            let count = errors.load(Ordering::Relaxed);
            if count != reported && Instant::now() >= next_report_at {
                (reported, next_report_at) = (count, Instant::now() + UART_REPORT_EVERY);
                self.with_companion(|companion, _| {
                    let counters = companion.counters(link);
                    let damaged = counters.bad_crc.wrapping_add(counters.expired_partial);
                    companion.send_text_with_numbers(
                        Severity::Warning,
                        UART_ERROR_TEXTS[link as usize],
                        [count, damaged],
                    );
                });
            }
            self.check_in(link as usize);
            Timer::after(UART_POLL_EVERY).await;
        }
    }

    /// Task: sends the companion's frames for `link` by `uart`.
    pub async fn transmit(&'static self, link: Link, mut uart: impl Write) -> ! {
        let mut frame = [0; MAX_FRAME_LEN];
        loop {
            let length = self.lock_companion(|companion| companion.poll_transmit(link, &mut frame));
            if length == 0 {
                // Without a frame to send the task checks in after 100 ms at the latest.
                let _ = with_timeout(CHECK_IN_EVERY, self.send_due[link as usize].wait()).await;
            } else {
                if link == Link::Autopilot && is_setpoint(&frame[..length]) {
                    self.setpoints.note_setpoint(now_ms());
                }
                // There is room in the send queue: work that waited for it may go on.
                self.plan_or_flash_due.signal(());
                if uart.write_all(&frame[..length]).await.is_err() {
                    self.uart_errors[link as usize].fetch_add(1, Ordering::Relaxed);
                }
            }
            self.check_in(2 + link as usize);
        }
    }

    /// Task: calls the companion's `handle_timeout` whenever one of its timers is due.
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
            self.check_in(TIMER_TASK);
        }
    }

    /// Task: makes the plans that the companion requests and executes its flash requests, one after
    /// the other: so the flash is never erased while a plan reads the roadmap in it.
    pub async fn run_planner_and_flash(
        &'static self,
        planner: &mut Planner<'_>,
        flash: &mut impl Flash,
    ) -> ! {
        loop {
            if let Some(wanted) = self.plan_requests.take() {
                let requested =
                    self.lock_companion(|companion| planner.read_inputs(wanted, companion));
                let answer = planner.answer(requested.as_ref());
                self.with_companion(|companion, now| companion.handle_plan(now, wanted, answer));
                continue;
            }
            if !self.serve_flash(flash).await {
                self.plan_or_flash_due.wait().await;
            }
        }
    }

    /// Executes one flash request of the companion. Returns false if there is none, or if a restart
    /// was requested: the restart must not tear a word that is being programmed.
    async fn serve_flash(&'static self, flash: &mut impl Flash) -> bool {
        if self.restart_requested_ms.load(Ordering::Relaxed) != 0 {
            return false;
        }
        let mut bytes = [0; MAX_READ_LEN];
        let request = self.lock_companion(|companion| {
            Some(match companion.poll_flash()? {
                FlashRequest::Erase { at } => FlashOperation::Erase(at),
                FlashRequest::Read { at, len } => FlashOperation::Read(at, len),
                FlashRequest::Program { at, bytes: given } => {
                    bytes[..given.len()].copy_from_slice(given);
                    FlashOperation::Program(at, given.len())
                }
            })
        });
        let Some(request) = request else {
            // `poll_flash` may have queued an FTP reply or text that needs no flash operation.
            self.send_due.iter().for_each(|sends| sends.signal(()));
            return false;
        };
        self.flash_busy.store(true, Ordering::Relaxed);
        let outcome = match request {
            FlashOperation::Erase(at) => flash.erase(at).await.map(|()| 0),
            FlashOperation::Program(at, len) => flash.program(at, &bytes[..len]).await.map(|()| 0),
            FlashOperation::Read(at, len) => flash.read(at, &mut bytes[..len]).map(|()| len),
        };
        self.flash_busy.store(false, Ordering::Relaxed);
        let outcome = outcome.map(|len| &bytes[..len]);
        self.with_companion(|companion, now| companion.handle_flash(now, outcome));
        true
    }

    /// Whether the board may restart now: a restart was requested over 200 ms ago, so queued
    /// messages have been sent, and no flash operation runs.
    pub fn is_restart_due(&self) -> bool {
        let asked = self.restart_requested_ms.load(Ordering::Relaxed);
        asked != 0
            && now_ms().wrapping_sub(asked) > FLUSH_BEFORE_RESTART_MS
            && !self.flash_busy.load(Ordering::Relaxed)
    }

    /// Whether the watchdog may be fed: all tasks checked in within 0.4 s, and while setpoints are
    /// streamed the last was sent within 0.4 s; before [`Self::set_companion`], for the first 20 s.
    pub fn may_feed_watchdog(&self) -> bool {
        self.may_feed_watchdog_at(now_ms())
    }

    fn may_feed_watchdog_at(&self, now_ms: u32) -> bool {
        if !self.has_companion.load(Ordering::Relaxed) {
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

/// Number of setpoints in a flight and the longest gap between two, by the board's clock. The
/// stream ends when [`BoardCompanion::streams_setpoints`] turns false, not when no setpoint comes
/// for a while: else the longest gaps would not be counted.
struct SetpointGaps {
    count: AtomicU32,
    /// Longest gap, milliseconds: between two setpoints, from the stream's start to the first one,
    /// or from the last one to the stream's end.
    longest_gap_ms: AtomicU32,
    /// Time of the last setpoint or the stream's start, milliseconds; 0 while no stream runs.
    last_ms: AtomicU32,
}

impl SetpointGaps {
    const fn new() -> Self {
        Self {
            count: AtomicU32::new(0),
            longest_gap_ms: AtomicU32::new(0),
            last_ms: AtomicU32::new(0),
        }
    }

    /// Counts a setpoint that is sent now.
    fn note_setpoint(&self, now_ms: u32) {
        self.count.fetch_add(1, Ordering::Relaxed);
        self.set_last(now_ms, now_ms.max(1));
    }

    /// Notes that the companion streams setpoints; the stream begins now if none runs.
    fn begin_stream(&self, now_ms: u32) {
        let _ =
            self.last_ms.compare_exchange(0, now_ms.max(1), Ordering::Relaxed, Ordering::Relaxed);
    }

    /// Time since the last setpoint or the stream's start, ms; `None` while no stream runs.
    fn since_last_ms(&self, now_ms: u32) -> Option<u32> {
        elapsed_ms(self.last_ms.load(Ordering::Relaxed), now_ms)
    }

    /// Notes that the companion streams no setpoints.
    fn end_stream(&self, now_ms: u32) {
        self.set_last(now_ms, 0);
    }

    /// Counts the gap from the last setpoint, or the stream's start, to now; then sets `last_ms`.
    fn set_last(&self, now_ms: u32, next_ms: u32) {
        if let Some(gap_ms) = elapsed_ms(self.last_ms.swap(next_ms, Ordering::Relaxed), now_ms) {
            self.longest_gap_ms.fetch_max(gap_ms, Ordering::Relaxed);
        }
    }

    /// Ends the stream and returns the number of setpoints and the longest gap (ms) of the flight,
    /// and clears both; `None` if no setpoint was sent.
    fn take_setpoint_stats(&self, now_ms: u32) -> Option<[u32; 2]> {
        self.end_stream(now_ms);
        let reported =
            [&self.count, &self.longest_gap_ms].map(|number| number.swap(0, Ordering::Relaxed));
        (reported[0] > 0).then_some(reported)
    }
}

/// Time from `last_ms` to `now_ms`, milliseconds; `None` if `last_ms` is 0, which means no stream.
fn elapsed_ms(last_ms: u32, now_ms: u32) -> Option<u32> {
    (last_ms != 0).then(|| now_ms.wrapping_sub(last_ms))
}

/// Whether a MAVLink 2 frame is a SET_POSITION_TARGET_LOCAL_NED, by its message id (84).
fn is_setpoint(frame: &[u8]) -> bool {
    frame.get(7..10) == Some(&[84, 0, 0])
}

#[cfg(test)]
mod tests;
