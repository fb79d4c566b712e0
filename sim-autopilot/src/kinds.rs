//! Kinds of autopilot and of estimator that a scenario can choose, and whether GPS has a fix.

/// The autopilot that is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SimulatedKind {
    /// PX4 1.17, commanded in Offboard.
    #[default]
    Px4,
    /// ArduCopter 4.6, commanded in Guided.
    Ardupilot,
}

/// Error model of an autopilot's position estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EstimatorErrors {
    /// No error: the estimate is the true position.
    #[default]
    Perfect,
    /// Errors of a GPS receiver with fixed RTK: at most 0.1 m horizontally and 0.15 m in height.
    Rtk,
    /// Errors as in the recorded flights of this kind of autopilot.
    Recorded,
}

/// Whether the GPS receiver has a fix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpsFix {
    /// No fix: the autopilot counts as without a position, so by default its failsafe lands.
    Lost,
    /// A fix.
    Held,
}
