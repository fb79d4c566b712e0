//! A faulty serial line: the shell counts, reports and survives overruns and framing errors that
//! the UART driver returns. The test drives the clock.

use std::collections::VecDeque;
use std::pin::pin;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Waker};

use companion::link::frame::{self, Frame, Framer, Header};
use companion::{Config, Link};
use embassy_time_driver::Driver;
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use firmware::capacity::BoardCompanion;
use firmware::shell::{OnAutopilot, Shell};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavAutopilot, STATUSTEXT_DATA};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;

/// The test's clock. The test polls all tasks at every step, so no task has to be woken.
struct TestClock(AtomicU64);

impl Driver for TestClock {
    fn now(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    fn schedule_wake(&self, _at: u64, _waker: &Waker) {}
}

embassy_time_driver::time_driver_impl!(static CLOCK: TestClock = TestClock(AtomicU64::new(0)));

/// A serial line whose far end is the test: what the shell receives next, and what it sent.
#[derive(Default)]
struct Line {
    received: Mutex<VecDeque<Result<Vec<u8>, ErrorKind>>>,
    sent: Mutex<Vec<u8>>,
}

struct End<'a>(&'a Line);

impl ErrorType for End<'_> {
    type Error = ErrorKind;
}

impl Read for End<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        let next = std::future::poll_fn(|_| match self.0.received.lock().unwrap().pop_front() {
            Some(next) => std::task::Poll::Ready(next),
            None => std::task::Poll::Pending,
        });
        let bytes = next.await?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

impl Write for End<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        self.0.sent.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// An autopilot's heartbeat.
fn beat() -> Vec<u8> {
    let data =
        HEARTBEAT_DATA { autopilot: MavAutopilot::MAV_AUTOPILOT_PX4, ..HEARTBEAT_DATA::DEFAULT };
    let mut out = [0; frame::MAX_FRAME_LEN];
    let length = frame::encode(Header { system: 1, component: 1, sequence: 0 }, &data, &mut out);
    out[..length].to_vec()
}

/// The texts among bytes that were sent.
fn texts(bytes: &[u8]) -> Vec<String> {
    let (mut framer, mut input) = (Framer::new(), bytes);
    let frames = std::iter::from_fn(|| framer.next(companion::Instant::ZERO, &mut input));
    let text = |frame: Frame| {
        frame.decode::<STATUSTEXT_DATA>().map(|data| data.text.to_str().unwrap().to_owned())
    };
    frames.filter(|frame| frame.message_id == STATUSTEXT_DATA::ID).filter_map(text).collect()
}

#[test]
fn errors_of_a_line_are_counted_and_reported_and_what_comes_after_is_heard() {
    let config =
        Config::new(1, Point::zeros(), Geodetic { lat_deg: 47.0, lon_deg: 8.0, alt_m: 500.0 });
    let shell: &'static Shell = Box::leak(Box::new(Shell::new()));
    shell.set_companion(Box::leak(Box::new(
        BoardCompanion::new(config).expect("the settings are good"),
    )));
    let lines = [Line::default(), Line::default()];
    let mut receives = pin!(shell.receive(Link::Autopilot, End(&lines[0]), OnAutopilot::GoOn));
    let mut transmits = pin!(shell.transmit(Link::Autopilot, End(&lines[0])));
    let mut transmits_to_swarm = pin!(shell.transmit(Link::Swarm, End(&lines[1])));
    let mut keeps_time = pin!(shell.run_timers());
    let mut run = |ms: u32| {
        let mut cx = Context::from_waker(Waker::noop());
        for _ in 0..ms {
            CLOCK.0.fetch_add(1000, Ordering::Relaxed);
            // None of the tasks ends.
            assert!(receives.as_mut().poll(&mut cx).is_pending());
            assert!(transmits.as_mut().poll(&mut cx).is_pending());
            assert!(transmits_to_swarm.as_mut().poll(&mut cx).is_pending());
            assert!(keeps_time.as_mut().poll(&mut cx).is_pending());
        }
    };
    let receive = |next| lines[0].received.lock().unwrap().push_back(next);
    run(100);
    // An overrun in the middle of a frame, then a framing error, then a whole frame.
    receive(Ok(beat()[..9].to_vec()));
    receive(Err(ErrorKind::Other));
    receive(Err(ErrorKind::InvalidData));
    run(300);
    receive(Ok(beat()));
    run(300);
    let reported = |link: usize| texts(&lines[link].sent.lock().unwrap());
    let errors = |link: usize| {
        reported(link).into_iter().filter(|text| text.contains("errors")).collect::<Vec<_>>()
    };
    assert_eq!(shell.uart_errors[0].load(Ordering::Relaxed), 2);
    assert!(reported(0).contains(&"Autopilot found".to_owned()), "{:?}", reported(0));
    // The first error is reported at once, on both links; those of the next ten seconds together.
    assert_eq!(errors(0), ["Autopilot line: 1 errors, 0 damaged frames"]);
    assert_eq!(errors(1), errors(0));
    (0..500).for_each(|_| receive(Err(ErrorKind::Other)));
    run(9_000);
    assert_eq!(errors(0).len(), 1);
    run(1_000);
    assert_eq!(errors(0)[1..], ["Autopilot line: 502 errors, 1 damaged frames"]);
    run(30_000);
    assert_eq!(errors(0).len(), 2, "no more errors, no more texts");
    assert_eq!(shell.uart_errors[1].load(Ordering::Relaxed), 0);
}
