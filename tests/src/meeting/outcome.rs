//! How meetings ended: one in a line, and many as counts.

use companion::State;

use super::referee::Violation;
use crate::setpoints::SetpointStats;

/// How one meeting ended.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Seed of the meeting.
    pub seed: u64,
    /// Geometry of the meeting, one of `KINDS` or `PASSINGS`.
    pub kind: &'static str,
    /// Whether the vehicles flew one common plan.
    pub on_plan: bool,
    /// Whether one vehicle lied in its reports.
    pub has_liar: bool,
    /// Number of vehicles.
    pub vehicle_count: usize,
    /// Approaches of two vehicles below the safety distance.
    pub violations: Vec<Violation>,
    /// Touches: time in seconds, index of the vehicle that moved toward the other one, index of the
    /// other one, distance in metres.
    pub touches: Vec<(f32, usize, usize, f32)>,
    /// Number of touches of a vehicle that was carried off unheard.
    pub unforeseen_touches: usize,
    /// Indices of the vehicles not on the ground at the end, and their companions' states.
    pub not_landed: Vec<(usize, State)>,
    /// Number of vehicles held above another one by what catches them, or where their pilot left
    /// them.
    pub held_above_another: usize,
    /// Smallest distance of two vehicles, metres.
    pub min_distance_m: f32,
    /// When the meeting ended, seconds.
    pub ended_s: f32,
    /// Statistics of the setpoints of all vehicles.
    pub setpoints: SetpointStats,
    /// Setpoints unfit to be flown: vehicle, seconds, and why.
    pub unfit_setpoints: Vec<(usize, f64, String)>,
    /// Number of vehicles that landed at their goals.
    pub arrived_count: usize,
    /// Number of stops by the safety filter, of all vehicles.
    pub filter_stops: u32,
    /// Longest stop by the safety filter for a neighbour that was heard, seconds.
    pub longest_stop_s: f32,
    /// Longest stop by the safety filter for a neighbour that was silent for more than a second.
    pub longest_unheard_stop_s: f32,
    /// Greatest number of times that one vehicle found its path blocked.
    pub max_blocked_count: u32,
    /// Log of what happened, if that was requested.
    pub trace: Vec<String>,
}

impl Outcome {
    /// The approaches that a stop would have prevented.
    pub fn failures(&self) -> impl Iterator<Item = &Violation> {
        self.violations.iter().filter(|violation| violation.is_failure())
    }

    /// Whether the meeting broke a rule; a meeting with a liar may have vehicles too near.
    pub fn breaks_rule(&self) -> bool {
        let near = !self.has_liar && self.failures().next().is_some();
        near || !self.touches.is_empty() || !self.not_landed.is_empty()
    }
}

/// One line of text about a meeting.
pub fn outcome_line(outcome: &Outcome) -> String {
    let Outcome {
        seed,
        kind,
        vehicle_count: vehicles,
        ended_s,
        min_distance_m: least_m,
        arrived_count: arrived,
        ..
    } = outcome;
    let plan = if outcome.on_plan { "on plan" } else { "off plan" };
    let lies = if outcome.has_liar { ", a liar" } else { "" };
    let mut line = format!(
        "seed {seed}: {kind}, {vehicles} vehicles {plan}{lies}, {ended_s:.0} s, nearest {least_m:.2} m, {arrived} arrived"
    );
    for violation in &outcome.violations {
        let Violation {
            pair,
            at_s,
            min_distance_m: least_m,
            distance_if_stopped_m: kept_m,
            sets_near_since_s: warned_s,
        } = violation;
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
    for (i, state) in &outcome.not_landed {
        line += &format!("; STUCK {} in {state:?}", i + 1);
    }
    line
}

/// Counts over many meetings; in arrays, those without a liar, then those with one.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Number of meetings.
    pub meetings: [usize; 2],
    /// Meetings with vehicles too near although a stop would have kept them apart.
    pub too_near: [usize; 2],
    /// Meetings with vehicles too near, where no stop would have helped.
    pub unavoidable: [usize; 2],
    /// Meetings with a touch by a vehicle's own motion.
    pub touches: [usize; 2],
    /// Meetings with a touch of a vehicle that was carried off unheard.
    pub unforeseen_touches: usize,
    /// Meetings with a vehicle that had not landed at the end.
    pub not_landed: [usize; 2],
    /// Meetings with a vehicle that waits above another one where its pilot left it.
    pub held_above_another: usize,
    /// Number of vehicles, and of those that landed at their goals.
    pub arrived: (usize, usize),
}

/// Counts the outcomes of meetings.
pub fn summary(outcomes: &[Outcome]) -> Summary {
    let mut sum = Summary::default();
    for outcome in outcomes {
        let at = usize::from(outcome.has_liar);
        let failed = outcome.failures().next().is_some();
        sum.meetings[at] += 1;
        sum.too_near[at] += usize::from(failed);
        sum.unavoidable[at] += usize::from(!failed && !outcome.violations.is_empty());
        sum.touches[at] += usize::from(!outcome.touches.is_empty());
        sum.unforeseen_touches += usize::from(outcome.unforeseen_touches > 0);
        sum.not_landed[at] += usize::from(!outcome.not_landed.is_empty());
        sum.held_above_another += usize::from(outcome.held_above_another > 0);
        sum.arrived.0 += outcome.vehicle_count;
        sum.arrived.1 += outcome.arrived_count;
    }
    sum
}

impl Summary {
    /// Whether a rule was broken: also if over 5 % of honest meetings were unavoidably too near.
    pub fn breaks_rule(&self) -> bool {
        self.too_near[0] > 0
            || self.touches != [0; 2]
            || self.not_landed != [0; 2]
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
                self.not_landed[at]
            )?;
        }
        writeln!(
            f,
            "{} with one that waits above another where its pilot left it",
            self.held_above_another
        )?;
        writeln!(
            f,
            "{} with a touch of a vehicle that was carried off unheard",
            self.unforeseen_touches
        )?;
        write!(f, "{} of {} vehicles landed at their goals", self.arrived.1, self.arrived.0)
    }
}
