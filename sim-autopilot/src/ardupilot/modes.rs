//! ArduCopter's flight modes, their numbers, and what each needs.

/// ArduCopter's flight modes that the simulation supports; the number is HEARTBEAT's `custom_mode`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CopterMode {
    /// Sticks control attitude and throttle; no remote control is simulated, the throttle is low:
    /// it descends.
    Stabilize = 0,
    /// Sticks control the altitude; the throttle is low: it descends.
    AltHold = 2,
    /// Flies the uploaded mission.
    Auto = 3,
    /// Follows setpoints.
    Guided = 4,
    /// Sticks control the position; the throttle is low: it descends at `PILOT_SPEED_DN`, or at
    /// `PILOT_SPEED_UP` if that is 0.
    Loiter = 5,
    /// Climbs, flies home and lands.
    Rtl = 6,
    /// Lands at its position.
    Land = 9,
    /// Stops and holds its position.
    Brake = 17,
}

const MODES: [CopterMode; 8] = [
    CopterMode::Stabilize,
    CopterMode::AltHold,
    CopterMode::Auto,
    CopterMode::Guided,
    CopterMode::Loiter,
    CopterMode::Rtl,
    CopterMode::Land,
    CopterMode::Brake,
];

impl From<CopterMode> for u32 {
    fn from(mode: CopterMode) -> Self {
        mode.number()
    }
}

impl CopterMode {
    /// Value of `custom_mode`.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// The mode of this number; `None` if it is not supported.
    pub fn from_number(number: u32) -> Option<Self> {
        MODES.into_iter().find(|mode| mode.number() == number)
    }

    /// Whether it can be entered only with a position estimate (while armed).
    pub(super) fn needs_position(self) -> bool {
        matches!(self, Self::Auto | Self::Guided | Self::Loiter | Self::Rtl | Self::Brake)
    }

    pub(super) fn allows_arming(self) -> bool {
        matches!(self, Self::Stabilize | Self::AltHold | Self::Guided | Self::Loiter)
    }
}
