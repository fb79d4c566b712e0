//! Coverage missions flown, and judged by where their pictures were truly taken.

use std::fmt::Write as _;

use host_sim::coverage::check::Picture;
use host_sim::coverage::flown;
use host_sim::mission::Mission;
use host_sim::progress::Progress;
use host_sim::report::{Event, Level};
use host_sim::result::MissionResult;
use host_sim::swarm::Flight;
use host_sim::{scenario, swarm};

/// Reason why a vehicle that was not struck lands short of its part: the rule for those that no
/// majority hears, or the lost one hovers where it was to fly.
pub const EXPLAINED: [&str; 10] = [
    "Neighbours still silent: landing",
    "Vehicle on the path for 90 s: landing",
    "Vehicle on the path: planning the way home",
    "Yielded for 60 s: landing",
    "Yielded for 60 s: planning the way home",
    "Path blocked for 2 min: planning the way home",
    "No progress for 10 min: planning the way home",
    "No way around: landing",
    "No progress for 10 min: landing",
    "Start barred for 3 min: others take its part",
];

/// Reason why a vehicle lands beside its pad: another one may lie there, or come down.
pub const LANDS_ASIDE: &str = "No room to land: seeking a place aside";

/// When the last of the other vehicles began to land, or to fly home, by [`lines`]: nobody takes
/// over what this vehicle leaves later.
pub fn others_until_s(log: &str, vehicle: u8) -> f64 {
    let mut ended: Vec<(&str, f64)> = Vec::new();
    for line in log.lines().filter(|line| line.contains("landing") || line.contains("the way home"))
    {
        let mut words = line.split_whitespace();
        let (Some(Ok(at_s)), Some(who)) = (words.next().map(str::parse), words.next()) else {
            continue;
        };
        if who != format!("Some({vehicle})") && ended.iter().all(|(first, _)| *first != who) {
            ended.push((who, at_s));
        }
    }
    ended.iter().fold(0.0, |last, (_, at_s)| last.max(*at_s))
}

/// Whether this vehicle itself said why it lands short of its part, by [`lines`].
pub fn says(log: &str, vehicle: u8, reasons: &[&str]) -> bool {
    let own = format!(" Some({vehicle}) ");
    log.lines()
        .filter(|line| line.contains(&own))
        .any(|line| reasons.iter().any(|row| line.contains(row)))
}

/// Flies a coverage mission: its result with what its pictures show, and what was said.
///
/// # Errors
/// Reason why it cannot be planned, flown or judged.
pub fn fly(mission: &mut Mission) -> anyhow::Result<(MissionResult, Vec<Event>)> {
    fly_on(mission, &mut Vec::new())
}

/// The same, judged by the pictures of flights before too; those of this one are added to them.
///
/// # Errors
/// As [`fly`].
pub fn fly_on(
    mission: &mut Mission,
    pictures: &mut Vec<Picture>,
) -> anyhow::Result<(MissionResult, Vec<Event>)> {
    let flight = flight(mission, pictures)?;
    Ok((flight.result, flight.log))
}

/// The same, with all that was recorded.
///
/// # Errors
/// As [`fly`].
pub fn flight(mission: &mut Mission, pictures: &mut Vec<Picture>) -> anyhow::Result<Flight> {
    let plan = mission.plan()?;
    let mut flight = swarm::fly(mission, &plan, "fly", false, &Progress::hidden())?;
    pictures.iter_mut().for_each(|picture| picture.t_s = 0.0);
    pictures.append(&mut flight.pictures);
    let judged = flown::judge_pictures(&mission.scenario, &plan, pictures.clone())?;
    flight.result.complete &= judged.complete;
    flight.result.coverage = Some(judged.result);
    Ok(flight)
}

/// The same from a scenario's text: its result, and what was said that matters.
///
/// # Errors
/// Reason why it is not flown.
pub fn fly_text(text: &str) -> Result<(MissionResult, String), String> {
    let said = |error: anyhow::Error| format!("{error:#}");
    let scenario = scenario::parse(text, "area").map_err(|error| error.to_string())?;
    let mut mission = Mission::prepare(scenario, &Progress::hidden()).map_err(said)?;
    let (result, log) = fly(&mut mission).map_err(said)?;
    Ok((result, lines(&log)))
}

/// What was said that matters.
pub fn lines(log: &[Event]) -> String {
    let mut lines = String::new();
    for event in log.iter().filter(|event| event.text.contains(':') || event.level == Level::Error)
    {
        let _ = writeln!(lines, "{:8.2} {:?} {}", event.t_s, event.vehicle, event.text);
    }
    lines
}

/// What is wrong with a flight.
pub fn faults(result: &MissionResult) -> Option<String> {
    let safety = &result.safety;
    let clean = (safety.wall_contacts, safety.violations, safety.deadlocks) == (0, 0, 0);
    (!(clean && result.complete))
        .then(|| format!("{:?}\n{:?}\n{:?}", result.vehicles, safety, result.coverage))
}
