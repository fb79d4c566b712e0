//! Boards in QEMU whose time is the simulation's: lock step.
//!
//! A board is the firmware as it is built for `qemu`, on a Cortex-M7 whose instructions take 2 ns
//! each (`-icount shift=1,sleep=off`). It runs for as long as it is granted, and stands still until
//! the next grant; so what it does depends on no clock and no load of this machine ([`lock_step`]
//! has the protocol).

mod bank;
mod probe;

use std::io::{BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use companion::Link as Port;
use lock_step::{COMMAND_LINE, FromBoard, HEAD, LONGEST, ToBoard};

pub use self::bank::flash_bank_image;
pub use self::probe::STACK_LEN;
use crate::quote::quoted_path;

/// Wall time without an answer after which a board counts as hanging.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);

/// Shell command that starts a board. Semihosting prints the board's log to standard output, so the
/// board answers by another descriptor.
const START_COMMAND: &str = r#"exec qemu-system-arm "$@" 3>&1 >"$LOG""#;

/// Bytes that a port of a board receives or sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortBytes {
    /// The port.
    pub port: Port,
    /// When, microseconds of the board's time.
    pub at_us: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Result of a grant to a board.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct GrantResult {
    /// The board's time, microseconds since its start.
    pub now_us: u64,
    /// Whether it started again instead: its time begins at zero.
    pub restarted: bool,
    /// Bytes that the board sent, in order.
    pub sent: Vec<PortBytes>,
    /// Bytes that were read of the board's memory.
    memory: Vec<u8>,
}

/// A board that waits for the desk or runs on a grant; it ends with us.
#[derive(Debug)]
pub struct EmulatedBoard {
    qemu: Child,
    input: ChildStdin,
    answers: Receiver<anyhow::Result<GrantResult>>,
    now_us: u64,
}

impl EmulatedBoard {
    /// Switches a board on, its flash empty. It logs to `log`, in defmt's encoding.
    ///
    /// # Errors
    /// QEMU or the program does not start.
    pub fn start(program: &Path, log: &Path) -> anyhow::Result<Self> {
        ensure!(program.is_file(), "no firmware: {}", quoted_path(program));
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
            board.finish_grant()?.restarted,
            "the firmware is none for lock step: {}",
            quoted_path(program)
        );
        Ok(board)
    }

    /// The board's time, microseconds since its start.
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// Grants it time until `until_us`, with what its ports receive meanwhile, in order of time.
    /// [`finish_grant`](Self::finish_grant) has to follow.
    ///
    /// # Errors
    /// The board is gone.
    pub fn begin_grant(&mut self, until_us: u64, pieces: &[PortBytes]) -> anyhow::Result<()> {
        let mut message = Vec::new();
        for PortBytes { port, at_us, bytes } in pieces {
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

    /// Waits until the grant has ended.
    ///
    /// # Errors
    /// The board hangs, or is gone.
    pub fn finish_grant(&mut self) -> anyhow::Result<GrantResult> {
        self.finish_grant_within(ANSWER_TIMEOUT)
    }

    /// The same with another patience: a board that goes nowhere until its watchdog resets it takes
    /// this machine seconds.
    ///
    /// # Errors
    /// As [`finish_grant`](Self::finish_grant).
    pub fn finish_grant_within(&mut self, patience: Duration) -> anyhow::Result<GrantResult> {
        let answer = match self.answers.recv_timeout(patience) {
            Ok(answer) => answer?,
            Err(RecvTimeoutError::Timeout) => {
                bail!("the board hangs: no answer in {} s", patience.as_secs())
            }
            Err(RecvTimeoutError::Disconnected) => bail!("the board is gone"),
        };
        self.now_us = answer.now_us;
        Ok(answer)
    }

    /// Begins a grant and waits for its end.
    ///
    /// # Errors
    /// As [`begin_grant`](Self::begin_grant) and [`finish_grant`](Self::finish_grant).
    pub fn run_grant(
        &mut self,
        until_us: u64,
        pieces: &[PortBytes],
    ) -> anyhow::Result<GrantResult> {
        self.begin_grant(until_us, pieces)?;
        self.finish_grant()
    }

    fn send(&mut self, message: &[u8]) -> anyhow::Result<()> {
        ensure!(
            message.len() <= LONGEST,
            "{} bytes at once are too many for a board",
            message.len()
        );
        let length = (message.len() as u32).to_le_bytes();
        self.input.write_all(&[&length, message].concat()).context("the board is gone")
    }
}

impl Drop for EmulatedBoard {
    fn drop(&mut self) {
        // The process may have ended by itself.
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// Reads up to the end of an answer, or the board's start.
fn read_answer(output: &mut BufReader<ChildStdout>) -> anyhow::Result<GrantResult> {
    let mut answer = GrantResult::default();
    loop {
        let mut head = [0; HEAD];
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
