//! Test program: calls every public function of planner-core with extreme and invalid arguments on
//! a board. It runs in QEMU; `tests/tests/board.rs` reads its output and compares the checksums
//! with the host's. If a call panics, its name is printed.
#![no_std]
#![no_main]

use core::cell::Cell;

use board_bench::calls::limits::{self, CallListener, Results};
use board_bench::calls::limits_routes::{self, RouteWorkspaces};
use critical_section::Mutex;
use firmware::boards::stack;
use semihosting::println;
use static_cell::ConstStaticCell;

static LENT: ConstStaticCell<RouteWorkspaces> = ConstStaticCell::new(RouteWorkspaces::new());
/// Name of the call that runs.
static CALL: Mutex<Cell<&str>> = Mutex::new(Cell::new("none"));

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    println!("panic in or after {}: {info}", critical_section::with(|cs| CALL.borrow(cs).get()));
    semihosting::process::exit(1)
}

/// Counts calls and keeps the last call's name.
struct CallCounter(usize);

impl CallListener for CallCounter {
    fn before_call(&mut self, name: &'static str) {
        self.0 += 1;
        critical_section::with(|cs| CALL.borrow(cs).set(name));
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut calls = CallCounter(0);
    let mut answers = Results::new(&mut calls);
    limits::call_without_roadmap(&mut answers);
    let places = answers.sum();
    let routes = limits_routes::call_all(&mut answers, LENT.take());
    println!("limits {} {places:08x} {routes:08x?}", calls.0);
    println!("stack {} {}", stack::max_used_bytes(), stack::size_bytes());
    semihosting::process::exit(0)
}
