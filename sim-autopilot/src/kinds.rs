//! Kinds of autopilot and of estimate: what a scenario names and the simulation makes.

/// Which autopilot is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AutopilotKind {
    /// PX4 1.17, Offboard.
    #[default]
    Px4,
    /// ArduCopter 4.6, Guided.
    Ardupilot,
}

/// Quality of an estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// The truth.
    #[default]
    Perfect,
    /// A receiver with fixed RTK: at most 0.1 m across and 0.15 m in height.
    Rtk,
    /// Gusts as those of the recorded flights.
    Recorded,
}
