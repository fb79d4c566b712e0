use super::*;

/// The start that follows a run that left `kept`, encoded as words.
fn start(kept: &CrashRecord, cause: ResetCause) -> (CrashRecord, Option<String<MAX_TEXT_LEN>>) {
    let words = kept.to_words();
    let read = CrashRecord::from_words(&words);
    assert_eq!(read.as_ref(), Some(kept), "as it was written");
    CrashRecord::evaluate_on_start(read, cause)
}

#[test]
fn any_flipped_bit_is_noticed_and_so_is_memory_of_one_kind() {
    let (mut kept, _) = CrashRecord::evaluate_on_start(None, ResetCause::Unknown);
    kept.begin_work(FileWork::Plan, 7);
    kept.note_crash("Restarted: panic at machine.rs:123");
    let words = kept.to_words();
    for bit in 0..32 * RECORD_WORDS {
        let mut flipped = words;
        flipped[bit / 32] ^= 1 << (bit % 32);
        assert_eq!(CrashRecord::from_words(&flipped), None, "bit {bit}");
    }
    for word in [0, u32::MAX, 0xAAAA_AAAA, 0xcccc_cccc] {
        assert_eq!(CrashRecord::from_words(&[word; RECORD_WORDS]), None);
    }
}

#[test]
fn each_end_is_said_as_it_was() {
    let (fresh, said) = CrashRecord::evaluate_on_start(None, ResetCause::Unknown);
    assert_eq!(said, None, "nothing was before");
    let says = |kept: &CrashRecord, cause| start(kept, cause).1;
    let rows = [
        (ResetCause::Power, None),
        (ResetCause::BrownOut, Some("Restarted: brown-out")),
        (ResetCause::Key, Some("Restarted: reset key")),
        (ResetCause::Watchdog, Some("Restarted: watchdog")),
        (ResetCause::Request, Some("Restarted: debugger")),
        (ResetCause::Unknown, Some(UNKNOWN_RESTART)),
    ];
    for (cause, said) in rows {
        assert_eq!(says(&fresh, cause).as_deref(), said, "{cause:?}");
    }
    let mut asked = fresh.clone();
    asked.note_requested_restart();
    assert_eq!(
        (says(&asked, ResetCause::Request), says(&asked, ResetCause::Unknown)),
        (None, None)
    );
    let mut crashed = fresh;
    crashed.note_crash("Restarted: panic at a_file_whose_name_is_so_long.rs:12345");
    let cut = "Restarted: panic at a_file_whose_name_is_so_long.r";
    assert_eq!(says(&crashed, ResetCause::Request).as_deref(), Some(cut));
    assert_eq!(says(&crashed, ResetCause::Power), None, "memory of another day");
}

/// How a start ends while it plans.
#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    Panic,
    Reset,
}

/// A start that ends while it plans on these files; false if they are set aside.
fn fails(kept: &mut CrashRecord, files: u32, cause: ResetCause, end: End) -> bool {
    let begun = kept.begin_work(FileWork::Plan, files);
    if end == End::Panic {
        kept.note_crash("Restarted: panic");
    }
    *kept = start(kept, cause).0;
    begun
}

#[test]
fn files_that_bring_three_starts_in_a_row_down_are_set_aside() {
    for (cause, end) in [
        (ResetCause::Request, End::Panic),
        (ResetCause::Unknown, End::Panic),
        (ResetCause::Watchdog, End::Reset),
    ] {
        let mut kept = CrashRecord::evaluate_on_start(None, ResetCause::Power).0;
        assert!((0..3).all(|_| fails(&mut kept, 7, cause, end)));
        assert!(!kept.begin_work(FileWork::Plan, 7), "three times");
        let again = start(&kept, ResetCause::Key).0;
        assert!(!again.clone().begin_work(FileWork::Plan, 7), "still after a reset");
        assert!(again.clone().begin_work(FileWork::Plan, 8), "others may be tried");
        assert!(again.clone().begin_work(FileWork::CheckRoadmap, 7), "and other work");
        assert!(
            start(&again, ResetCause::Power).0.begin_work(FileWork::Plan, 7),
            "not after the power was off"
        );
    }
}

#[test]
fn a_roadmap_that_was_set_aside_stays_so_while_a_mission_fails() {
    let mut kept = CrashRecord::evaluate_on_start(None, ResetCause::Power).0;
    for _ in 0..3 {
        assert!(kept.begin_work(FileWork::CheckRoadmap, 1));
        kept.note_crash("Restarted: fault");
        kept = start(&kept, ResetCause::Request).0;
    }
    for _ in 0..3 {
        assert!(!kept.begin_work(FileWork::CheckRoadmap, 1));
        assert!(kept.begin_work(FileWork::CheckRoadmap, 2));
        kept.finish_work();
        assert!(fails(&mut kept, 7, ResetCause::Request, End::Panic));
    }
    assert!(!kept.begin_work(FileWork::CheckRoadmap, 1) && !kept.begin_work(FileWork::Plan, 7));
}

#[test]
fn only_starts_in_a_row_count_and_only_those_that_the_planner_brought_down() {
    let fail = |kept: &mut CrashRecord| assert!(fails(kept, 7, ResetCause::Request, End::Panic));
    let mut kept = CrashRecord::evaluate_on_start(None, ResetCause::Power).0;
    (0..2).for_each(|_| fail(&mut kept));
    // A start without a plan leaves the count, and so does one ended by key, brown-out or
    // debugger.
    kept = start(&kept, ResetCause::Watchdog).0;
    for cause in [ResetCause::Key, ResetCause::BrownOut, ResetCause::Request] {
        assert!(fails(&mut kept, 7, cause, End::Reset));
    }
    // A plan that completes does not reset the count if another one then crashes the start.
    assert!(kept.begin_work(FileWork::Plan, 7));
    kept.finish_work();
    fail(&mut kept);
    assert!(!kept.clone().begin_work(FileWork::Plan, 7));
    // A start whose plans all complete resets the count.
    let mut kept = CrashRecord::evaluate_on_start(None, ResetCause::Power).0;
    (0..2).for_each(|_| fail(&mut kept));
    assert!(kept.begin_work(FileWork::Plan, 7));
    kept.finish_work();
    kept.note_crash("Restarted: fault, not the planner's");
    kept = start(&kept, ResetCause::Request).0;
    (0..3).for_each(|_| fail(&mut kept));
    assert!(!kept.begin_work(FileWork::Plan, 7));
}
