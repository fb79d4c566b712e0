//! Counts the instructions of the calls of coverage planning.

use board_bench::calls::coverage_workspace::CoverageWorkspace;
use board_bench::calls::{Meter, coverage, coverage_flights, coverage_missions};
use firmware::workspace::CoveragePlanWorkspace;
use static_cell::ConstStaticCell;

/// Memory of the separate steps. `memory.x` places it by name.
static PARTS: ConstStaticCell<CoverageWorkspace> = ConstStaticCell::new(CoverageWorkspace::new());

/// Counts the instructions of whole plans, then of their steps. Returns two checksums of results:
/// of the steps, and of the flights.
pub fn measure_coverage(
    meter: &mut impl Meter,
    lent: &mut CoveragePlanWorkspace,
    out: &mut coverage_flights::Flights,
) -> [u32; 2] {
    let parts = PARTS.take();
    let flights = coverage_missions::measure_coverage_flights(meter, lent, parts, out);
    [coverage::measure_coverage_calls(meter, parts), flights]
}
