//! ArduCopter's flight modes, and what each needs.

/// ArduCopter's flight modes, as far as the simulation flies them. The number is HEARTBEAT's
/// `custom_mode`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Sticks, which nobody holds: throttle low, it sinks.
    Stabilize = 0,
    /// Likewise.
    AltHold = 2,
    /// The mission.
    Auto = 3,
    /// Setpoints.
    Guided = 4,
    /// Likewise by sticks: with the throttle low it sinks at `PILOT_SPEED_UP`.
    Loiter = 5,
    /// Climbs, comes home and lands.
    Rtl = 6,
    /// Lands where it is.
    Land = 9,
    /// Stops and holds.
    Brake = 17,
}

const MODES: [Mode; 8] = [
    Mode::Stabilize,
    Mode::AltHold,
    Mode::Auto,
    Mode::Guided,
    Mode::Loiter,
    Mode::Rtl,
    Mode::Land,
    Mode::Brake,
];

impl From<Mode> for u32 {
    fn from(mode: Mode) -> Self {
        mode.number()
    }
}

impl Mode {
    /// `custom_mode`.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// The mode of a number.
    pub fn from_number(number: u32) -> Option<Self> {
        MODES.into_iter().find(|mode| mode.number() == number)
    }

    pub(super) fn needs_position(self) -> bool {
        matches!(self, Self::Auto | Self::Guided | Self::Loiter | Self::Rtl | Self::Brake)
    }

    pub(super) fn allows_arming(self) -> bool {
        matches!(self, Self::Stabilize | Self::AltHold | Self::Guided | Self::Loiter)
    }
}
