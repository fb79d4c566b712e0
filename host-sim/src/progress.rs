//! Progress bars on a terminal, nothing in a pipe.

use std::io::{IsTerminal, Write as _};
use std::sync::Mutex;
use std::time::Duration;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};

/// Shows what is being done, on standard error, if that is a terminal.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    shown: bool,
}

impl Progress {
    /// Shown if standard error is a terminal.
    pub fn on_terminal() -> Self {
        Self { shown: std::io::stderr().is_terminal() }
    }

    /// Never shown.
    pub const fn hidden() -> Self {
        Self { shown: false }
    }

    /// A stage of unknown length; gone when dropped.
    pub fn begin_stage(self, name: &'static str) -> Stage {
        let bar = self.shown.then(|| {
            let bar = ProgressBar::new_spinner().with_message(name);
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        Stage { bar }
    }

    /// A stage of `length` steps; gone when dropped.
    pub fn begin_counted_stage(self, name: &'static str, length: u64) -> Stage {
        let style = ProgressStyle::with_template("{msg:12} {bar:40} {pos}/{len} {elapsed}");
        let bar = self.shown.then(|| {
            let bar = ProgressBar::new(length).with_message(name);
            bar.set_style(style.expect("the template is ours"));
            bar
        });
        Stage { bar }
    }
}

/// One line of progress.
pub struct Stage {
    bar: Option<ProgressBar>,
}

impl Stage {
    /// Shows the progress of the stage.
    pub fn set_position(&self, position: u64) {
        if let Some(bar) = &self.bar {
            bar.set_position(position);
        }
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Error with which standard output last refused a line.
static STDOUT_ERROR: Mutex<Option<std::io::Error>> = Mutex::new(None);

/// Prints a line: what [`say!`](crate::say) calls.
pub fn print_line(line: std::fmt::Arguments<'_>) {
    let mut out = std::io::stdout().lock();
    if let Err(error) =
        out.write_fmt(line).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush())
    {
        *STDOUT_ERROR.lock().expect("nobody panics with it") = Some(error);
    }
}

/// Whether everything was printed so far.
///
/// # Errors
/// Standard output did not take a line: its reader has gone away, or a disk is full.
pub fn check_printed() -> anyhow::Result<()> {
    match STDOUT_ERROR.lock().expect("nobody panics with it").take() {
        Some(error) => Err(error).context("cannot print: standard output"),
        None => Ok(()),
    }
}

/// Prints a line. Where that fails the work continues, since it may fly something;
/// [`check_printed`](crate::progress::check_printed) reports at its end.
#[macro_export]
macro_rules! say {
    () => { $crate::progress::print_line(format_args!("")) };
    ($($text:tt)*) => { $crate::progress::print_line(format_args!($($text)*)) };
}
