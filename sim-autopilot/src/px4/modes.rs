//! PX4's flight modes, their numbers, and what each needs.

/// PX4's flight modes that the simulation supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Px4Mode {
    /// Manual: without stick input the simulated vehicle holds its position.
    Manual,
    /// Altitude: without stick input the simulated vehicle holds its position.
    Altitude,
    /// Position: without stick input the vehicle holds its position.
    Position,
    /// AUTO.MISSION.
    Mission,
    /// AUTO.LOITER, "Hold" in QGroundControl.
    Hold,
    /// AUTO.RTL.
    Return,
    /// AUTO.TAKEOFF.
    Takeoff,
    /// AUTO.LAND.
    Land,
    /// OFFBOARD.
    Offboard,
}

/// Each mode with its main mode and sub mode in `custom_mode`.
const MODES: [(Px4Mode, u8, u8); 9] = [
    (Px4Mode::Manual, 1, 0),
    (Px4Mode::Altitude, 2, 0),
    (Px4Mode::Position, 3, 0),
    (Px4Mode::Mission, 4, 4),
    (Px4Mode::Hold, 4, 3),
    (Px4Mode::Return, 4, 5),
    (Px4Mode::Takeoff, 4, 2),
    (Px4Mode::Land, 4, 6),
    (Px4Mode::Offboard, 6, 0),
];

impl Px4Mode {
    /// `custom_mode` of HEARTBEAT: main mode << 16 | sub mode << 24.
    pub fn custom_mode(self) -> u32 {
        MODES
            .iter()
            .find(|(mode, ..)| *mode == self)
            .map_or(0, |&(_, main, sub)| u32::from(main) << 16 | u32::from(sub) << 24)
    }

    /// The mode of a `custom_mode`; `None` if it is not supported.
    pub fn from_custom_mode(custom_mode: u32) -> Option<Self> {
        Self::from_main_sub((custom_mode >> 16) as u8, (custom_mode >> 24) as u8)
    }

    /// The mode of a main and sub mode number; `None` if it is not supported. Only main mode 4
    /// (AUTO) has sub modes.
    pub fn from_main_sub(main: u8, sub: u8) -> Option<Self> {
        MODES
            .iter()
            .find(|&&(_, m, s)| m == main && (s == sub || main != 4))
            .map(|&(mode, ..)| mode)
    }

    /// Whether a disarmed vehicle leaves this mode for the one requested before.
    pub(super) fn is_left_on_disarm(self) -> bool {
        matches!(self, Self::Return | Self::Takeoff | Self::Land)
    }

    /// Whether its main mode is AUTO.
    pub(super) fn is_auto(self) -> bool {
        matches!(self, Self::Mission | Self::Hold | Self::Return | Self::Takeoff | Self::Land)
    }

    /// Whether a pilot's sticks fly it.
    pub(super) fn needs_sticks(self) -> bool {
        matches!(self, Self::Manual | Self::Altitude | Self::Position)
    }
}

impl From<Px4Mode> for u32 {
    fn from(mode: Px4Mode) -> Self {
        mode.custom_mode()
    }
}
