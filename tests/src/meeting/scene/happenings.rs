//! Random events of a meeting: commands, pilots, failures.

use planner_core::Point;

use super::types::{MeetingEvent, START_S, TimedEvent, Vehicle};
use crate::meeting::autopilot::Failsafe;
use crate::meeting::dice::Dice;

/// The start of each vehicle, and up to three random events, by time.
pub(super) fn draw_events(vehicles: &[Vehicle], dice: &mut Dice) -> Vec<TimedEvent> {
    let mut out = Vec::new();
    let mut ended = vec![false; vehicles.len()];
    for vehicle in 0..vehicles.len() {
        out.push(TimedEvent { at_s: START_S, vehicle, what: MeetingEvent::Start });
        out.push(TimedEvent { at_s: START_S + 1.5, vehicle, what: MeetingEvent::Start });
    }
    let events = [0, 1, 1, 1, 2, 2, 3][dice.below(7)];
    let mut busy_until = vec![START_S + 2.0; vehicles.len()];
    for _ in 0..events {
        let vehicle = dice.below(vehicles.len());
        if ended[vehicle] {
            continue;
        }
        let at_s = busy_until[vehicle].max(START_S + dice.real(2.0, 40.0));
        let lasts_s = dice.real(1.0, 20.0);
        let until = at_s + lasts_s;
        let mut push = |at_s, what| out.push(TimedEvent { at_s, vehicle, what });
        let how = if dice.chance(0.5) { Failsafe::Land } else { Failsafe::Return };
        match dice.below(10) {
            0 | 1 => {
                push(at_s, MeetingEvent::Pause);
                match dice.below(4) {
                    0 => push(until, MeetingEvent::Return),
                    1 => push(until, MeetingEvent::Land),
                    _ => {
                        push(until, MeetingEvent::Resume);
                        push(until + 3.0, MeetingEvent::Resume);
                    }
                }
                // The command is repeated, since the first one may be refused.
                push(at_s + 40.0, MeetingEvent::Resume);
            }
            2 => push(at_s, MeetingEvent::Return),
            3 => push(at_s, MeetingEvent::Land),
            4 | 5 => {
                let mut velocity = dice.direction() * dice.real(0.0, 1.5);
                velocity.z *= 0.5;
                push(at_s, MeetingEvent::PilotTakes(velocity));
                if dice.chance(0.5) {
                    push(at_s + 0.5 * lasts_s, MeetingEvent::PilotTakes(Point::zeros()));
                    push(until, MeetingEvent::PilotReturns);
                    (1..5).for_each(|i| push(until + 1.5 * i as f32, MeetingEvent::Resume));
                    // A vehicle that cannot continue is commanded to land.
                    push(until + 40.0, MeetingEvent::Land);
                } else {
                    push(until, MeetingEvent::PilotLands);
                    ended[vehicle] = true;
                }
            }
            6 => {
                push(at_s, MeetingEvent::EntersFailsafe(how));
                ended[vehicle] = true;
            }
            7 => {
                push(at_s, MeetingEvent::CompanionDies);
                // An ArduCopter whose companion died hovers for ever, so its pilot lands it.
                push(at_s + 20.0, MeetingEvent::PilotLands);
                ended[vehicle] = true;
            }
            _ => {
                let (sends, hears) = [(true, false), (false, true), (true, true)][dice.below(3)];
                push(at_s, MeetingEvent::RadioCut { sending_fails: sends, receiving_fails: hears });
                if dice.chance(0.7) {
                    push(at_s + dice.real(1.0, 25.0), MeetingEvent::RadioHealed);
                }
            }
        }
        busy_until[vehicle] = until + 8.0;
    }
    out.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    out
}
