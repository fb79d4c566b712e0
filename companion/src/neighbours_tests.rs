use super::*;

const ORIGIN: Geodetic = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 600.0 };

fn table() -> Neighbours<4> {
    let entry = |system_id| RosterEntry { system_id, start: Point::zeros() };
    Neighbours::new(&[entry(3), entry(5), entry(9)], 5)
}

fn place(boot_ms: u32, north_1e7: i32) -> GLOBAL_POSITION_INT_DATA {
    GLOBAL_POSITION_INT_DATA {
        time_boot_ms: boot_ms,
        lat: 400_000_000 + north_1e7,
        lon: -30_000_000,
        alt: 602_500,
        vx: 150,
        vy: -50,
        vz: 20,
        ..Default::default()
    }
}

fn intent(flags: u8, mission_crc: u32, plan_crc: u32) -> Intent {
    let points = Vec::new();
    Intent { system_id: 9, flags, mission_crc, plan_crc, progress_m: 4.0, speed_mps: 1.0, heard: 2, points }
}

#[test]
fn a_position_reaches_the_mission_frame_and_ages() {
    let mut table = table();
    assert!(table.at(Instant::ZERO).is_empty());
    table.handle_position(Instant::from_millis(100), &ORIGIN, 9, &place(50, 1000));
    let heard = table.at(Instant::from_millis(600))[0];
    assert_eq!((heard.id, heard.rank), (9, 2));
    // A ten-thousandth of a degree of latitude is 11.1 m.
    assert!((heard.position - Point::new(0.0, 11.1, 2.5)).norm() < 0.02, "{:?}", heard.position);
    assert!((heard.velocity - Point::new(-0.5, 1.5, -0.2)).norm() < 1e-5);
    assert!((heard.age_s - 0.5).abs() < 1e-6);
}

#[test]
fn below_is_lower_and_near_the_vertical() {
    let mut table = table();
    let above = Point::new(0.0, 1.0, 9.0);
    assert!(!table.any_below(&above, 2.0), "nobody was heard");
    table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(50, 0));
    assert!(table.any_below(&above, 2.0));
    assert!(!table.any_below(&Point::new(0.0, 3.0, 9.0), 2.0) && !table.any_below(&Point::zeros(), 2.0));
}

#[test]
fn late_and_repeated_positions_change_nothing_but_a_restart_does() {
    let mut table = table();
    table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(20_000, 1000));
    for late in [20_000, 19_900, 10_001] {
        table.handle_position(Instant::from_millis(500), &ORIGIN, 9, &place(late, 0));
        assert!(table.at(Instant::from_millis(500))[0].age_s > 0.4, "{late}");
    }
    table.handle_position(Instant::from_millis(500), &ORIGIN, 9, &place(100, 0));
    assert_eq!(table.at(Instant::from_millis(500))[0].age_s, 0.0);
}

#[test]
fn progress_counts_only_on_our_mission_and_plan() {
    let mut table = table();
    table.handle_position(Instant::ZERO, &ORIGIN, 9, &place(0, 0));
    for (flags, mission, plan, own_plan, progress) in [
        (ON_PLAN, 1, 2, Some(2), Some(4.0)),
        (0, 1, 2, Some(2), None),
        (ON_PLAN, 7, 2, Some(2), None),
        (ON_PLAN, 1, 7, Some(2), None),
        (ON_PLAN, 1, 2, None, None),
    ] {
        table.handle_intent(Instant::ZERO, 1, &intent(flags, mission, plan), 1, own_plan);
        assert_eq!(table.at(Instant::ZERO)[0].progress_m, progress);
    }
}

#[test]
fn strangers_rank_last_and_overflow_is_counted() {
    let mut table = table();
    for id in [200, 201, 202] {
        table.handle_position(Instant::ZERO, &ORIGIN, id, &place(0, 0));
    }
    assert_eq!((table.at(Instant::ZERO).len(), table.dropped()), (2, 1));
    assert!(table.at(Instant::ZERO).iter().all(|n| n.rank == u16::MAX));
}

#[test]
fn silence_is_that_of_those_who_fly() {
    let mut table = table();
    let at = Instant::from_millis;
    assert_eq!(table.silence(at(9000), at(2000)), Duration::from_millis(7000), "never heard");
    table.handle_position(at(5000), &ORIGIN, 9, &place(0, 0));
    assert_eq!(table.silence(at(9000), at(2000)), Duration::from_millis(7000), "it does not hear us");
    table.handle_intent(at(5000), 1, &intent(0, 1, 2), 1, None);
    assert_eq!(table.silence(at(9000), at(2000)), Duration::from_millis(4000));
    assert!(table.linked_within(at(5500), Duration::from_millis(1000)));
    assert!(!table.linked_within(at(6500), Duration::from_millis(1000)));
    table.handle_intent(at(5000), 1, &intent(LANDED, 1, 2), 1, None);
    table.handle_intent(at(5000), 1, &Intent { system_id: 3, ..intent(LANDED, 1, 2) }, 1, None);
    assert_eq!(table.silence(at(9000), at(2000)), Duration::default(), "all have landed");
}

#[test]
fn who_is_out_opens_gates_only_after_it_was_looked_at() {
    let at = Instant::from_millis;
    let mut table = table();
    let out = |table: &mut Neighbours<4>, now: Instant| table.at(now)[0].out;
    table.handle_position(at(1000), &ORIGIN, 9, &place(50, 1000));
    table.handle_intent(at(1000), 1, &intent(OUT, 7, 8), 7, None);
    assert!(!out(&mut table, at(1100)), "nobody has looked");
    table.found_clear(at(900));
    assert!(!out(&mut table, at(1200)), "it went out while somebody looked");
    table.found_clear(at(1000));
    assert!(out(&mut table, at(1300)));
    table.forget_plan();
    assert!(!out(&mut table, at(1400)), "another plan, another look");
    table.found_clear(at(1400));
    table.handle_intent(at(1500), 1, &intent(0, 7, 8), 7, None);
    assert!(!out(&mut table, at(1600)), "it is not out any more");
    // Silent from now on: dead later, but nobody counts on that before the next look.
    let dead = at(1500) + DEAD;
    assert!(!out(&mut table, dead) && !table.at(dead)[0].grounded);
    table.found_clear(dead);
    assert!(out(&mut table, dead) && table.at(dead)[0].grounded);
}
