//! How meetings ended: one, in a line, and many, counted.

use companion::State;

use super::oracle::Violation;
use crate::setpoints::SetpointStats;

/// How a meeting ended.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Its seed.
    pub seed: u64,
    /// Its geometry.
    pub kind: &'static str,
    /// Whether the vehicles shared a plan.
    pub on_plan: bool,
    /// Whether a vehicle's reports were wrong.
    pub lies: bool,
    /// Vehicles.
    pub vehicles: usize,
    /// Times at which two vehicles were nearer than the safety distance.
    pub violations: Vec<Violation>,
    /// Touches by own motion: seconds, the vehicle that moved, the other, metres.
    pub touches: Vec<(f32, usize, usize, f32)>,
    /// Touches of a vehicle that was carried off unheard.
    pub unforeseen: usize,
    /// Indices of vehicles that were not on the ground at the end, and their states.
    pub stuck: Vec<(usize, State)>,
    /// Smallest distance, metres.
    pub least_m: f32,
    /// When it was over, seconds.
    pub ended_s: f32,
    /// Setpoints of all vehicles.
    pub setpoints: SetpointStats,
    /// Setpoints that were not fit: vehicle, seconds, what.
    pub unfit: Vec<(usize, f64, String)>,
    /// Vehicles that landed at their goals.
    pub arrived: usize,
    /// How often the safety filter stopped one.
    pub filter_stops: u32,
    /// For how long at most, seconds.
    pub longest_stop_s: f32,
    /// How often one vehicle found its path blocked, at most.
    pub most_blocked: u32,
    /// What happened, if that was asked for.
    pub trace: Vec<String>,
}

impl Outcome {
    /// Violations that a stop would have prevented.
    pub fn failures(&self) -> impl Iterator<Item = &Violation> {
        self.violations.iter().filter(|violation| violation.is_failure())
    }

    /// Whether a rule was broken: of an honest meeting, or of one with a liar.
    pub fn is_bad(&self) -> bool {
        let near = !self.lies && self.failures().next().is_some();
        near || !self.touches.is_empty() || !self.stuck.is_empty()
    }
}

/// One line about a meeting.
pub fn line(outcome: &Outcome) -> String {
    let Outcome { seed, kind, vehicles, ended_s, least_m, arrived, .. } = outcome;
    let plan = if outcome.on_plan { "on plan" } else { "off plan" };
    let lies = if outcome.lies { ", a liar" } else { "" };
    let mut line = format!(
        "seed {seed}: {kind}, {vehicles} vehicles {plan}{lies}, {ended_s:.0} s, nearest {least_m:.2} m, {arrived} arrived"
    );
    for violation in &outcome.violations {
        let Violation { pair, at_s, least_m, kept_m, warned_s } = violation;
        let verdict = if violation.is_failure() { "TOO NEAR" } else { "unavoidable" };
        line += &format!(
            "; {verdict} {}-{} at {at_s:.1} s {least_m:.2} m (warned {warned_s:.1?}, kept {kept_m:.2})",
            pair.0 + 1,
            pair.1 + 1
        );
    }
    for (at_s, from, to, apart_m) in &outcome.touches {
        line += &format!("; TOUCH {} of {} at {at_s:.1} s {apart_m:.2} m", from + 1, to + 1);
    }
    for (i, state) in &outcome.stuck {
        line += &format!("; STUCK {} in {state:?}", i + 1);
    }
    line
}

/// Counts over many meetings.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Meetings without a liar, and with one.
    pub meetings: [usize; 2],
    /// Of those: too near although a stop would have kept apart.
    pub too_near: [usize; 2],
    /// Too near, and no stop would have helped.
    pub unavoidable: [usize; 2],
    /// Touches by own motion.
    pub touches: [usize; 2],
    /// With a touch of a vehicle that was carried off unheard.
    pub unforeseen: usize,
    /// Somebody had not landed in the end.
    pub stuck: [usize; 2],
    /// Vehicles, and those that landed at their goals.
    pub arrived: (usize, usize),
}

/// Counts.
pub fn summary(outcomes: &[Outcome]) -> Summary {
    let mut sum = Summary::default();
    for outcome in outcomes {
        let at = usize::from(outcome.lies);
        let failed = outcome.failures().next().is_some();
        sum.meetings[at] += 1;
        sum.too_near[at] += usize::from(failed);
        sum.unavoidable[at] += usize::from(!failed && !outcome.violations.is_empty());
        sum.touches[at] += usize::from(!outcome.touches.is_empty());
        sum.unforeseen += usize::from(outcome.unforeseen > 0);
        sum.stuck[at] += usize::from(!outcome.stuck.is_empty());
        sum.arrived.0 += outcome.vehicles;
        sum.arrived.1 += outcome.arrived;
    }
    sum
}

impl Summary {
    /// Whether a rule was broken.
    pub fn is_bad(&self) -> bool {
        self.too_near[0] > 0
            || self.touches != [0; 2]
            || self.stuck != [0; 2]
            || self.unavoidable[0] * 20 > self.meetings[0]
    }
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (at, name) in ["honest", "with a liar"].iter().enumerate() {
            writeln!(
                f,
                "{name}: {} meetings, {} too near although a stop would have kept apart, {} too near unavoidably, {} \
                 with a touch by own motion, {} stuck",
                self.meetings[at],
                self.too_near[at],
                self.unavoidable[at],
                self.touches[at],
                self.stuck[at]
            )?;
        }
        writeln!(f, "{} with a touch of a vehicle that was carried off unheard", self.unforeseen)?;
        write!(f, "{} of {} vehicles landed at their goals", self.arrived.1, self.arrived.0)
    }
}
