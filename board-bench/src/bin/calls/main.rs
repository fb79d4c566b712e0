//! Bench program: counts the instructions of every public call of planner-core and companion on a
//! board. It runs in QEMU with `-icount shift=0`; `cargo xtask bench --only worst-case` reads its
//! output. A roadmap lies in bank 2, a map in memory behind it. Each call's line has its
//! instructions, the bytes it is lent and its name.
#![no_std]
#![no_main]

mod companion_calls;
mod coverage_calls;
mod planner_calls;

use core::hint::black_box;

use board_bench::calls::{Meter, flight};
use board_bench::cases;
use firmware::boards::chosen::clock;
use firmware::boards::stack;
use firmware::capacity::BoardCompanion;
use heapless::Vec;
use rand_core::SeedableRng;
use rand_pcg::Pcg32;
use semihosting::println;

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    println!("panic {info}");
    semihosting::process::exit(1)
}

/// Number of flights in which the safety filter's instructions are counted.
const FILTER_FLIGHTS: u64 = 100;
/// Most different names of calls.
const MAX_ROWS: usize = 160;

/// Counts instructions of calls, without those of reading the clock. A row holds a call's name, the
/// bytes it is lent and its largest count.
struct InstructionMeter {
    rows: Vec<(&'static str, usize, u64), MAX_ROWS>,
}

impl Meter for InstructionMeter {
    fn call<T>(&mut self, name: &'static str, bytes: usize, work: impl FnOnce() -> T) -> T {
        let idle = clock::instructions();
        let before = clock::instructions();
        let result = black_box(work());
        let count = (clock::instructions() - before).saturating_sub(before - idle);
        match self.rows.iter_mut().find(|row| row.0 == name) {
            Some(row) => row.2 = row.2.max(count),
            None => self.rows.push((name, bytes, count)).expect("there is room for all rows"),
        }
        result
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    clock::start();
    let mut meter = InstructionMeter { rows: Vec::new() };
    let [calls, flights] = planner_calls::measure_planner_calls(&mut meter);
    println!("coverage {calls:08x} {flights:08x}");
    companion_calls::measure_companion_calls(&mut meter);
    measure_flights(&mut meter);
    measure_area_flights(&mut meter);
    measure_safety_filter(&mut meter);
    for (name, bytes, count) in &meter.rows {
        println!("call {count} {bytes} {name}");
    }
    println!("stack {} {}", stack::max_used_bytes(), stack::size_bytes());
    semihosting::process::exit(0)
}

/// Counts the instructions of control steps in flight: of at least [`cases::STEP_CASES`] among
/// neighbours on the plan, and of as many where most left it or fell silent.
#[inline(never)]
fn measure_flights(meter: &mut InstructionMeter) {
    let mut steps = [0; 2];
    for seed in 0.. {
        let plan = flight::random_plan(&mut Pcg32::seed_from_u64(seed));
        let config = flight::config();
        let mut companion = meter
            .call("Companion::new", size_of::<BoardCompanion>(), || BoardCompanion::new(config))
            .expect("the settings are good");
        let kind = usize::from(flight::has_many_off_plan(seed));
        steps[kind] += flight::measure_flight(seed, &plan, &mut companion, meter);
        if steps.iter().all(|&steps| steps >= cases::STEP_CASES) {
            println!("steps {steps:?}");
            return;
        }
    }
}

/// Counts the instructions of control steps of coverage missions in flight.
#[inline(never)]
fn measure_area_flights(meter: &mut InstructionMeter) {
    let mut steps = 0;
    for seed in 0.. {
        let plan = flight::random_area_plan(&mut Pcg32::seed_from_u64(seed));
        let mut companion =
            BoardCompanion::new(flight::area_config()).expect("the settings are good");
        steps += flight::measure_flight(seed, &plan, &mut companion, meter);
        if steps >= cases::STEP_CASES {
            return;
        }
    }
}

/// Counts the instructions of the safety filter alone.
#[inline(never)]
fn measure_safety_filter(meter: &mut InstructionMeter) {
    for seed in 0..FILTER_FLIGHTS {
        let plan = flight::random_plan(&mut Pcg32::seed_from_u64(seed));
        let mut companion = BoardCompanion::new(flight::config()).expect("the settings are good");
        flight::measure_safety_filter(seed, &plan, &mut companion, meter);
    }
}
