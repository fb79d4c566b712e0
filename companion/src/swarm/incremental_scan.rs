//! An incremental scan: whether one of many keep-out zones meets a condition. Each control step
//! tests a few zones, so that it takes no longer with more neighbours.
//!
//! The zones ([`KeepOutZone`]) come from sources, such as neighbours, of which each gives a few.
//! A step tests as many as its budget pays for; the next step continues from there. One zone that
//! meets the condition ends the scan with yes, and the next scan begins with that zone's source: an
//! obstacle on the path mostly stays there. The scan ends with no after all zones were tested.

use planner_core::detour::KeepOutZone;

/// Progress of a scan over the keep-out zones of several sources.
#[derive(Clone, Copy, Debug, Default)]
pub struct IncrementalScan {
    /// Index of the source whose zones are tested now.
    source: u16,
    /// Number of sources at the last call.
    source_count: u16,
    /// Number of sources of which all zones were tested.
    sources_checked: u16,
    /// Number of zones of the present source that were tested.
    zones_checked: u16,
}

impl IncrementalScan {
    /// Continues the scan. `visit` calls back with each zone of the source of an index; a zone
    /// costs `zone_cost` of `budget`, a source 1. Returns `Some(true)` at the first zone for which
    /// `meets_condition` holds, `Some(false)` when it holds for no zone of all `sources`; after
    /// either the next call begins a new scan. Returns `None` when less than `zone_cost` of the
    /// budget is left for the next zone. The scan restarts when the number of sources changes.
    pub fn continue_scan(
        &mut self,
        sources: usize,
        budget: &mut u16,
        zone_cost: u16,
        visit: impl Fn(usize, &mut dyn FnMut(KeepOutZone)),
        meets_condition: impl Fn(&KeepOutZone) -> bool,
    ) -> Option<bool> {
        let sources = sources as u16;
        if self.source_count != sources {
            self.source_count = sources;
            self.restart();
        }
        while self.sources_checked < sources {
            let (mut visited, mut tested, mut found) = (0, self.zones_checked, false);
            self.source %= sources;
            visit(usize::from(self.source), &mut |zone| {
                if visited == tested && !found && *budget >= zone_cost {
                    *budget -= zone_cost;
                    tested += 1;
                    found = meets_condition(&zone);
                }
                visited += 1;
            });
            if found {
                self.restart();
                return Some(true);
            }
            if tested < visited {
                self.zones_checked = tested;
                return None;
            }
            *budget = budget.saturating_sub(1);
            (self.source, self.sources_checked, self.zones_checked) =
                (self.source + 1, self.sources_checked + 1, 0);
        }
        self.sources_checked = 0;
        Some(false)
    }

    /// Begins the scan again, at the present source.
    pub fn restart(&mut self) {
        (self.sources_checked, self.zones_checked) = (0, 0);
    }
}

#[cfg(test)]
mod tests;
