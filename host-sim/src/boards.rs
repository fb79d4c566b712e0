//! Boards in QEMU that run in lock step with the simulation's time.
//!
//! A board runs the firmware built for `qemu`, on an emulated Cortex-M7 on which an instruction
//! takes 2 ns (`-icount shift=1,sleep=off`). It runs for the time that the host grants it, and then
//! stands still until the next grant. So its behaviour depends neither on the host's clock nor on
//! the host's load ([`lock_step`] has the protocol).

mod flash_image;
mod probe;

use std::io::{BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use companion::Link as Port;
use lock_step::{COMMAND_LINE, FromBoard, HEADER_LEN, MAX_MESSAGE_LEN, ToBoard};

pub use self::flash_image::flash_bank_image;
use crate::quote::printable_path;

/// Length of a board's stack, bytes.
pub const STACK_LEN: usize = 88 << 10;
/// Wall-clock time without an answer after which a board counts as hung.
const BOARD_HUNG_AFTER: Duration = Duration::from_secs(10);

/// Shell command that starts a board. Semihosting prints the board's log to standard output, so the
/// board's answers use file descriptor 3.
const START_COMMAND: &str = r#"exec qemu-system-arm "$@" 3>&1 >"$LOG""#;

/// Bytes that a port of a board receives or has sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortBytes {
    /// The port: autopilot or swarm radio.
    pub port: Port,
    /// Time of receiving or sending, microseconds of the board's time.
    pub at_us: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Result of granting time to a board.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct GrantResult {
    /// The board's time at the end of the grant, microseconds since its start.
    pub now_us: u64,
    /// Whether the board started or reset instead of finishing the grant: its time then begins at
    /// zero, and `sent` is empty.
    pub restarted: bool,
    /// Bytes that the board sent during the grant, in order.
    pub sent: Vec<PortBytes>,
    /// Bytes of the board's memory, in the answer to a request to read them; otherwise empty.
    memory: Vec<u8>,
}

/// A board in a QEMU process; dropping it kills the process.
#[derive(Debug)]
pub struct EmulatedBoard {
    /// The process.
    qemu: Child,
    /// QEMU's standard input, by which the host sends messages.
    input: ChildStdin,
    /// The board's answers, which a thread reads from QEMU's file descriptor 3.
    answers: Receiver<anyhow::Result<GrantResult>>,
    /// The board's time since its start, as last answered, microseconds.
    now_us: u64,
}

impl EmulatedBoard {
    /// Starts a board with empty flash. It writes its log, in defmt's encoding, to the file `log`.
    ///
    /// # Errors
    /// QEMU or the firmware does not start, or the firmware is not built for lock step.
    pub fn start(program: &Path, log: &Path) -> anyhow::Result<Self> {
        ensure!(
            program.is_file(),
            "no firmware: {}\nhint: `cargo xtask build --board qemu` builds it",
            printable_path(program)
        );
        let mut qemu = Command::new("sh");
        qemu.args(["-c", START_COMMAND, "sh"])
            .args(["-machine", "mps2-an500", "-icount", "shift=1,sleep=off"])
            .args(["-display", "none", "-monitor", "none", "-serial", "none"])
            .arg("-semihosting-config")
            .arg(format!("enable=on,target=native,arg={COMMAND_LINE}"))
            .arg("-kernel")
            .arg(program)
            .env("LOG", log)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let mut qemu = qemu.spawn().context("qemu-system-arm does not start")?;
        let input = qemu.stdin.take().context("its input is piped")?;
        let output = qemu.stdout.take().context("its output is piped")?;
        let (to_us, answers) = channel();
        thread::spawn(move || {
            let mut output = BufReader::new(output);
            loop {
                let answer = read_answer(&mut output);
                let ended = answer.is_err();
                if to_us.send(answer).is_err() || ended {
                    return;
                }
            }
        });
        let mut board = Self { qemu, input, answers, now_us: 0 };
        ensure!(
            board.wait_for_grant_end()?.restarted,
            "the firmware is none for lock step: {}",
            printable_path(program)
        );
        Ok(board)
    }

    /// Time of the board after its last grant, microseconds since its start.
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// Grants the board time until `until_us`, and hands over `received`: the bytes that its ports
    /// receive until then, sorted by time. The caller has to call
    /// [`wait_for_grant_end`](Self::wait_for_grant_end) next.
    ///
    /// # Errors
    /// The QEMU process has ended, or the bytes are too many for one message.
    pub fn begin_grant(&mut self, until_us: u64, received: &[PortBytes]) -> anyhow::Result<()> {
        let mut message = Vec::new();
        for PortBytes { port, at_us, bytes } in received {
            let (port, due_us) = (*port as u8, *at_us);
            for bytes in bytes.chunks(u16::MAX.into()) {
                let len = bytes.len() as u16;
                message.extend(ToBoard::Bytes { port, len, due_us }.to_bytes());
                message.extend(bytes);
            }
        }
        message.extend(ToBoard::Run { until_us }.to_bytes());
        self.send(&message)
    }

    /// Waits until the board has used up its grant, or has reset.
    ///
    /// # Errors
    /// The board does not answer within 10 s, or its process has ended.
    pub fn wait_for_grant_end(&mut self) -> anyhow::Result<GrantResult> {
        self.wait_for_grant_end_within(BOARD_HUNG_AFTER)
    }

    /// As [`wait_for_grant_end`](Self::wait_for_grant_end), with another limit of wall-clock
    /// time: a board that hangs until its watchdog resets it takes the host seconds.
    ///
    /// # Errors
    /// As [`wait_for_grant_end`](Self::wait_for_grant_end).
    pub fn wait_for_grant_end_within(&mut self, timeout: Duration) -> anyhow::Result<GrantResult> {
        let answer = match self.answers.recv_timeout(timeout) {
            Ok(answer) => answer?,
            Err(RecvTimeoutError::Timeout) => {
                bail!("the board hangs: no answer in {} s", timeout.as_secs())
            }
            Err(RecvTimeoutError::Disconnected) => bail!("the board is gone"),
        };
        self.now_us = answer.now_us;
        Ok(answer)
    }

    /// Grants the board time until `until_us`, and waits until it has used it up.
    ///
    /// # Errors
    /// As [`begin_grant`](Self::begin_grant) and [`wait_for_grant_end`](Self::wait_for_grant_end).
    pub fn run_grant(
        &mut self,
        until_us: u64,
        received: &[PortBytes],
    ) -> anyhow::Result<GrantResult> {
        self.begin_grant(until_us, received)?;
        self.wait_for_grant_end()
    }

    /// Sends a message to the board, with its length before it.
    fn send(&mut self, message: &[u8]) -> anyhow::Result<()> {
        ensure!(
            message.len() <= MAX_MESSAGE_LEN,
            "{} bytes at once are too many for a board",
            message.len()
        );
        let length = (message.len() as u32).to_le_bytes();
        self.input.write_all(&[&length, message].concat()).context("the board is gone")
    }
}

impl Drop for EmulatedBoard {
    fn drop(&mut self) {
        // An error means that the process has already ended.
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// Reads records of the board up to the one that ends an answer ([`FromBoard::Waits`]) or reports a
/// start or reset of the board ([`FromBoard::Started`]).
fn read_answer(output: &mut BufReader<ChildStdout>) -> anyhow::Result<GrantResult> {
    let mut answer = GrantResult::default();
    loop {
        let mut head = [0; HEADER_LEN];
        output.read_exact(&mut head).context("the board is gone")?;
        let record = FromBoard::from_bytes(&head).context("the board says what is no record")?;
        let mut bytes = vec![0; record.payload_len()];
        output.read_exact(&mut bytes).context("the board is gone")?;
        match record {
            FromBoard::Started => {
                return Ok(GrantResult { restarted: true, ..GrantResult::default() });
            }
            FromBoard::Sent { port, at_us, .. } => {
                let port =
                    if port == Port::Autopilot as u8 { Port::Autopilot } else { Port::Swarm };
                answer.sent.push(PortBytes { port, at_us, bytes });
            }
            FromBoard::Memory { .. } => answer.memory.extend(bytes),
            FromBoard::Waits { now_us } => return Ok(GrantResult { now_us, ..answer }),
        }
    }
}
