//! Progress bars on a terminal (none in a pipe), and printing that survives a closed output.

use std::io::{IsTerminal, Write as _};
use std::sync::Mutex;
use std::time::Duration;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};

/// Makes progress bars on standard error if that is a terminal, else none.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Whether bars are shown.
    shown: bool,
}

impl Progress {
    /// Bars are drawn if standard error is a terminal.
    pub fn on_terminal() -> Self {
        Self { shown: std::io::stderr().is_terminal() }
    }

    /// No bars are drawn.
    pub const fn hidden() -> Self {
        Self { shown: false }
    }

    /// Begins a stage of unknown length: a spinner until the returned [`Stage`] is dropped.
    pub fn begin_stage(self, name: &'static str) -> Stage {
        let bar = self.shown.then(|| {
            let bar = ProgressBar::new_spinner().with_message(name);
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        Stage { bar }
    }

    /// Begins a stage of `length` steps: a bar until the returned [`Stage`] is dropped.
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

/// The progress bar of one stage; cleared from the terminal when dropped.
pub struct Stage {
    /// The bar; `None` if none is shown.
    bar: Option<ProgressBar>,
}

impl Stage {
    /// Sets how many steps of the stage are done.
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

/// The last error of writing a line to standard output; [`check_printed`] takes it.
static STDOUT_ERROR: Mutex<Option<std::io::Error>> = Mutex::new(None);

/// Prints a line to standard output and flushes it: what [`say!`](crate::say) expands to.
pub fn print_line(line: std::fmt::Arguments<'_>) {
    let mut out = std::io::stdout().lock();
    if let Err(error) =
        out.write_fmt(line).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush())
    {
        *STDOUT_ERROR.lock().expect("nobody panics with it") = Some(error);
    }
}

/// Fails if a line printed since the last call did not reach standard output.
///
/// # Errors
/// Standard output refused a line: its reader has gone away, or a disk is full.
pub fn check_printed() -> anyhow::Result<()> {
    match STDOUT_ERROR.lock().expect("nobody panics with it").take() {
        Some(error) => Err(error).context("cannot print: standard output"),
        None => Ok(()),
    }
}

/// Prints a line to standard output. If that fails the command goes on, since it may control a
/// flight; [`check_printed`](crate::progress::check_printed) reports the error at the command's
/// end.
#[macro_export]
macro_rules! say {
    () => { $crate::progress::print_line(format_args!("")) };
    ($($text:tt)*) => { $crate::progress::print_line(format_args!($($text)*)) };
}
