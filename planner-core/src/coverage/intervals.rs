//! Sets of real numbers, stored as sorted intervals that do not touch.

use heapless::Vec;

use super::CoverageError;

/// Lower and upper end of an interval.
pub(super) type Interval = [f32; 2];

/// A set of real numbers, of at most `N` intervals.
#[derive(Default)]
pub(super) struct Intervals<const N: usize> {
    /// The intervals in ascending order, none of which touches another.
    spans: Vec<Interval, N>,
}

impl<const N: usize> Intervals<N> {
    pub(super) const fn new() -> Self {
        Self { spans: Vec::new() }
    }

    /// Removes all intervals.
    pub(super) fn clear(&mut self) {
        self.spans.clear();
    }

    /// The intervals, in ascending order.
    pub(super) fn spans(&self) -> &[Interval] {
        &self.spans
    }

    /// Adds an interval to the set.
    pub(super) fn add(&mut self, [from, to]: Interval) -> Result<(), CoverageError> {
        // Intervals that the new one touches are consecutive; they are merged with it.
        let first = self.spans.partition_point(|span| span[1] < from);
        let after = self.spans.partition_point(|span| span[0] <= to);
        if first < after {
            let low = libm::fminf(from, self.spans[first][0]);
            let high = libm::fmaxf(to, self.spans[after - 1][1]);
            self.spans[first] = [low, high];
            let len = self.spans.len();
            self.spans.copy_within(after..len, first + 1);
            self.spans.truncate(len - (after - first - 1));
            return Ok(());
        }
        self.spans.insert(first, [from, to]).map_err(|_| CoverageError::LanesFull)
    }

    /// Drops intervals that are shorter than `least`.
    pub(super) fn drop_shorter(&mut self, least: f32) {
        self.spans.retain(|[from, to]| to - from >= least);
    }

    /// Removes each interval of another set, as [`Self::remove`] does.
    pub(super) fn remove_all(&mut self, other: &Self) -> Result<(), CoverageError> {
        other.spans().iter().try_for_each(|span| self.remove(*span))
    }

    /// Removes an interval from the set. An interval of the set that reaches beyond an end of the
    /// removed one keeps that end point.
    pub(super) fn remove(&mut self, [from, to]: Interval) -> Result<(), CoverageError> {
        let mut i = self.spans.partition_point(|span| span[1] <= from);
        while i < self.spans.len() && self.spans[i][0] < to {
            let [low, high] = self.spans[i];
            match (low < from, high > to) {
                (true, true) => {
                    self.spans[i][1] = from;
                    return self
                        .spans
                        .insert(i + 1, [to, high])
                        .map_err(|_| CoverageError::LanesFull);
                }
                (true, false) => {
                    self.spans[i][1] = from;
                    i += 1;
                }
                (false, true) => {
                    self.spans[i][0] = to;
                    return Ok(());
                }
                (false, false) => {
                    self.spans.remove(i);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
