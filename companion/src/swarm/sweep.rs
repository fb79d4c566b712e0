//! Is any of many things on the path? Asked a few at a time, since a control step is not to take
//! longer with more neighbours.
//!
//! The things are stretches to keep off ([`KeepOutZone`]), given by sources: a neighbour gives up
//! to 16 of them. A step asks about as many as its budget pays for, the next continues from there.
//! One thing that is on the path answers at once, and its source is asked first the next time: what
//! blocks the way mostly continues doing so. That nothing is, is known after all were asked.

use planner_core::detour::KeepOutZone;

/// Progress of the scan.
#[derive(Clone, Copy, Debug, Default)]
pub struct IncrementalScan {
    /// The source that is asked now, of how many.
    source: u16,
    sources: u16,
    /// Sources that were asked.
    sources_checked: u16,
    /// Things of this source that were asked about.
    zones_checked: u16,
}

impl IncrementalScan {
    /// Asks on: `tell` gives the things of a source, each costs `each` of `budget` and a source
    /// one. `Some(true)` once one of them `is_in_the_way`, `Some(false)` when none of all `sources`
    /// is, then from the first; `None` when the budget is spent, which has to begin with at least
    /// `each`. Where the number of sources changes all are asked again.
    pub fn continue_scan(
        &mut self,
        sources: usize,
        budget: &mut u16,
        each: u16,
        tell: impl Fn(usize, &mut dyn FnMut(KeepOutZone)),
        is_in_the_way: impl Fn(&KeepOutZone) -> bool,
    ) -> Option<bool> {
        let sources = sources as u16;
        if self.sources != sources {
            self.sources = sources;
            self.restart();
        }
        while self.sources_checked < sources {
            let (mut told, mut things, mut found) = (0, self.zones_checked, false);
            self.source %= sources;
            tell(usize::from(self.source), &mut |keep_off| {
                if told == things && !found && *budget >= each {
                    *budget -= each;
                    things += 1;
                    found = is_in_the_way(&keep_off);
                }
                told += 1;
            });
            if found {
                self.restart();
                return Some(true);
            }
            if things < told {
                self.zones_checked = things;
                return None;
            }
            *budget = budget.saturating_sub(1);
            (self.source, self.sources_checked, self.zones_checked) =
                (self.source + 1, self.sources_checked + 1, 0);
        }
        self.sources_checked = 0;
        Some(false)
    }

    /// Restarts the scan from the current source.
    pub fn restart(&mut self) {
        (self.sources_checked, self.zones_checked) = (0, 0);
    }
}

#[cfg(test)]
mod tests {
    use planner_core::Point;
    use planner_core::detour::ZoneKind;

    use super::*;

    /// Seven sources of so many things; the first number of a thing is its source's, the second its
    /// own.
    const THINGS: [usize; 7] = [0, 3, 16, 0, 1, 0, 2];

    fn tell(source: usize, tell: &mut dyn FnMut(KeepOutZone)) {
        for i in 0..THINGS[source] {
            let at = Point::new(source as f32, i as f32, 0.0);
            tell(KeepOutZone { from: at, to: at, radius_m: 1.0, kind: ZoneKind::Static });
        }
    }

    /// The answer where the thing `at` is on the path, and the steps it took.
    fn ask(sweep: &mut IncrementalScan, each: u16, at: Option<(f32, f32)>) -> (bool, usize) {
        for steps in 1.. {
            let mut budget = 5;
            let is =
                |k: &KeepOutZone| at.is_some_and(|(source, i)| k.from.x == source && k.from.y == i);
            if let Some(found) = sweep.continue_scan(THINGS.len(), &mut budget, each, tell, is) {
                return (found, steps);
            }
            assert!(steps < 100);
        }
        unreachable!();
    }

    #[test]
    fn everything_is_asked_about_however_small_the_budget() {
        for each in [1, 2, 5] {
            for (source, &things) in THINGS.iter().enumerate() {
                for i in 0..things {
                    let mut sweep = IncrementalScan::default();
                    let at = Some((source as f32, i as f32));
                    assert!(ask(&mut sweep, each, at).0, "{each} {source} {i}");
                    assert!(!ask(&mut sweep, each, None).0);
                }
            }
        }
        assert_eq!(
            IncrementalScan::default().continue_scan(0, &mut 5, 1, tell, |_| true),
            Some(false),
            "nobody is there"
        );
    }

    #[test]
    fn what_was_in_the_way_is_asked_about_first() {
        let mut sweep = IncrementalScan::default();
        let at = Some((4.0, 0.0));
        assert!(ask(&mut sweep, 5, at).1 > 10);
        assert_eq!(ask(&mut sweep, 5, at), (true, 1));
        assert_eq!(ask(&mut sweep, 5, None), (false, 22), "as many as there are things");
    }

    #[test]
    fn where_sources_come_or_go_all_are_asked_again() {
        let mut sweep = IncrementalScan::default();
        assert_eq!(sweep.continue_scan(7, &mut 12, 1, tell, |_| false), None);
        assert_eq!(sweep.continue_scan(2, &mut 12, 1, tell, |_| false), Some(false));
        assert_eq!(sweep.continue_scan(2, &mut 2, 1, tell, |_| false), None);
        // The first zones were checked already.
        let first = |k: &KeepOutZone| k.from.x == 1.0 && k.from.y == 0.0;
        assert_eq!(sweep.continue_scan(7, &mut 99, 1, tell, first), Some(true));
    }
}
