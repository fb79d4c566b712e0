//! Progress bars on a terminal, nothing in a pipe.

use std::io::IsTerminal;
use std::time::Duration;

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
    pub fn stage(self, name: &'static str) -> Stage {
        let bar = self.shown.then(|| {
            let bar = ProgressBar::new_spinner().with_message(name);
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        Stage { bar }
    }

    /// A stage of `length` steps; gone when dropped.
    pub fn steps(self, name: &'static str, length: u64) -> Stage {
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
    /// How far it has come.
    pub fn at(&self, position: u64) {
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

/// Prints a line. A reader that has gone away, as in `host-sim plan … | head -1`, is no error of ours.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}
