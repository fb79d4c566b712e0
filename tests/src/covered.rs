//! Flies coverage missions, and judges them by where their pictures were truly taken.

use std::fmt::Write as _;

use host_sim::coverage::check::Picture;
use host_sim::flown::pictures;
use host_sim::mission::PreparedMission;
use host_sim::progress::Progress;
use host_sim::report::{Level, LogEvent};
use host_sim::result::MissionResult;
use host_sim::swarm::SwarmFlight;
use host_sim::{scenario, swarm};

/// Log texts that explain why a vehicle without a fault leaves its part undone: for example no
/// majority hears it, or a failed vehicle hovers on its path.
pub const EARLY_LANDING_TEXTS: [&str; 12] = [
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
    "Climb takes too long: landing",
    "Obstacle on the way back: seeking a place",
];

/// Log text of a vehicle that lands beside its pad, since another one may lie or come down there.
pub const LANDS_ASIDE_TEXT: &str = "No room to land: seeking a place aside";

/// When the last of the other vehicles began to land or to fly home, seconds, by [`log_lines`]: no
/// vehicle is left to take over what `vehicle` leaves after that.
pub fn last_other_ended_s(log: &str, vehicle: u8) -> f64 {
    let mut ended: Vec<(&str, f64)> = Vec::new();
    for line in log.lines().filter(|line| line.contains("landing") || line.contains("the way home"))
    {
        let mut words = line.split_whitespace();
        let (Some(Ok(at_s)), Some(lost)) = (words.next().map(str::parse), words.next()) else {
            continue;
        };
        if lost != format!("Some({vehicle})") && ended.iter().all(|(first, _)| *first != lost) {
            ended.push((lost, at_s));
        }
    }
    ended.iter().fold(0.0, |last, (_, at_s)| last.max(*at_s))
}

/// Whether `vehicle` itself logged one of `reasons`, in a log by [`log_lines`].
pub fn has_logged(log: &str, vehicle: u8, reasons: &[&str]) -> bool {
    let own = format!(" Some({vehicle}) ");
    log.lines()
        .filter(|line| line.contains(&own))
        .any(|line| reasons.iter().any(|row| line.contains(row)))
}

/// Flies a coverage mission; returns its result, with what its pictures show, and its event log.
///
/// # Errors
/// Reason why it cannot be planned, flown or judged.
pub fn fly(mission: &mut PreparedMission) -> anyhow::Result<(MissionResult, Vec<LogEvent>)> {
    fly_adding_pictures(mission, &mut Vec::new())
}

/// As [`fly`], judged by `pictures` of earlier flights too (it sets their times to 0), to which it
/// adds this flight's.
///
/// # Errors
/// As [`fly`].
pub fn fly_adding_pictures(
    mission: &mut PreparedMission,
    pictures: &mut Vec<Picture>,
) -> anyhow::Result<(MissionResult, Vec<LogEvent>)> {
    let flight = fly_with_record(mission, pictures)?;
    Ok((flight.result, flight.log))
}

/// As [`fly_adding_pictures`], but returns all that the flight recorded.
///
/// # Errors
/// As [`fly`].
pub fn fly_with_record(
    mission: &mut PreparedMission,
    pictures: &mut Vec<Picture>,
) -> anyhow::Result<SwarmFlight> {
    let plan = mission.plan()?;
    let mut flight = swarm::fly(mission, &plan, "fly", swarm::Pace::Fastest, &Progress::hidden())?;
    if let Some(places) = pictures::track_points_as_pictures(&mission.scenario, &flight.tracks)? {
        flight.pictures = places;
    }
    pictures.iter_mut().for_each(|picture| picture.t_s = 0.0);
    pictures.append(&mut flight.pictures);
    let judged = pictures::judge_pictures(&mission.scenario, &plan, pictures.clone())?;
    flight.result.complete &= judged.complete;
    flight.result.coverage = Some(judged.result);
    Ok(flight)
}

/// As [`fly`], from a scenario's text; returns the result and the log by [`log_lines`].
///
/// # Errors
/// Why the mission is not flown.
pub fn fly_text(text: &str) -> Result<(MissionResult, String), String> {
    let said = |error: anyhow::Error| format!("{error:#}");
    let scenario = scenario::parse(text, "area").map_err(|error| error.to_string())?;
    let mut mission = PreparedMission::prepare(scenario, &Progress::hidden()).map_err(said)?;
    let (result, log) = fly(&mut mission).map_err(said)?;
    Ok((result, log_lines(&log)))
}

/// The log as text, `time vehicle text` a line: events with a reason (`:`) and errors only.
pub fn log_lines(log: &[LogEvent]) -> String {
    let mut lines = String::new();
    for event in log.iter().filter(|event| event.text.contains(':') || event.level == Level::Error)
    {
        let _ = writeln!(lines, "{:8.2} {:?} {}", event.t_s, event.vehicle, event.text);
    }
    lines
}

/// Text of the result if the flight was unsafe or is not complete; `None` if it was clean.
pub fn faults_text(result: &MissionResult) -> Option<String> {
    let safety = &result.safety;
    let clean = (safety.wall_contacts, safety.violations, safety.deadlocks) == (0, 0, 0);
    (!(clean && result.complete))
        .then(|| format!("{:?}\n{:?}\n{:?}", result.vehicles, safety, result.coverage))
}
