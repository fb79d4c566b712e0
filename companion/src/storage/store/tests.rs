//! The store over a simulated flash.

extern crate std;
use std::vec::Vec;

use planner_core::coverage::Flat;
use planner_core::map::field::{self, FieldShape};
use planner_core::roadmap::RoadmapView;
use rand_core::Rng;

use super::reassembly::PieceOutcome;
use super::*;
use crate::testing::fake_flash::*;

/// Uploads a file in pieces of `piece` bytes.
pub(super) fn upload(
    store: &mut Store,
    flash: &mut Flash,
    file: File,
    bytes: &[u8],
    piece: usize,
) -> Result<Result<(), UploadError>, PowerLoss> {
    if let Err(why) = store.open_upload(file, ErasePermission::Allowed) {
        return Ok(Err(why));
    }
    run(store, flash, ErasePermission::Allowed)?;
    for (i, part) in bytes.chunks(piece).enumerate() {
        assert_eq!(store.take_piece((i * piece) as u32, part), PieceOutcome::Stored);
        run(store, flash, ErasePermission::Allowed)?;
    }
    store.finish_upload();
    run(store, flash, ErasePermission::Allowed)?;
    match store.upload_state() {
        Some(UploadState::Ended(result)) => Ok(result),
        other => panic!("{other:?}"),
    }
}

#[test]
fn files_come_back_after_a_restart() {
    let mut flash = Flash::new(1);
    let mut store = started(&mut flash);
    assert_eq!(
        (store.map_range(), store.mission_range(), store.file_size(File::Roadmap)),
        (None, None, None)
    );
    for (round, nodes) in [300, 10, 600].into_iter().enumerate() {
        let (road, flown) = (roadmap(nodes), mission(nodes as u8 % 50 + 1));
        for (file, bytes) in [(File::Roadmap, &road), (File::Mission, &flown)] {
            assert_eq!(upload(&mut store, &mut flash, file, bytes, 239).unwrap(), Ok(()));
            assert_eq!(store.file_size(file), Some(bytes.len() as u32));
        }
        assert_eq!(store.map_range().is_some(), round > 0, "used from the next start on");
        if round > 0 {
            assert_eq!(
                store.open_upload(File::Roadmap, ErasePermission::Allowed),
                Err(UploadError::AwaitsRestart),
                "one waits already"
            );
        }
        store = started(&mut flash);
        assert_eq!(bytes_at(&flash, store.map_range()), Some(road.as_slice()));
        assert_eq!(bytes_at(&flash, store.mission_range()), Some(flown.as_slice()));
        assert!(RoadmapView::parse(bytes_at(&flash, store.map_range()).unwrap()).is_ok());
    }
    store.remove_file(File::Roadmap);
    store.remove_file(File::Mission);
    run(&mut store, &mut flash, ErasePermission::Forbidden).unwrap();
    assert_eq!((store.file_size(File::Roadmap), store.file_size(File::Mission)), (None, None));
    store = started(&mut flash);
    assert_eq!((store.map_range(), store.mission_range()), (None, None));
    assert_eq!(upload(&mut store, &mut flash, File::Roadmap, &roadmap(20), 80).unwrap(), Ok(()));
    store = started(&mut flash);
    assert_eq!(bytes_at(&flash, store.map_range()), Some(roadmap(20).as_slice()));
}

#[test]
fn a_field_takes_the_place_of_the_roadmap_and_gives_it_back() {
    let mut flash = Flash::new(3);
    let mut store = started(&mut flash);
    let shape = FieldShape { south_west: Flat::zeros(), cell_m: 5.0, columns: 30, rows: 20 };
    let mut heights = std::vec![0; shape.encoded_len()];
    field::write(&shape, &[70; 600], &mut heights).unwrap();
    let road = roadmap(30);
    for (own, other, bytes) in [
        (File::Roadmap, File::Field, &road),
        (File::Field, File::Roadmap, &heights),
        (File::Roadmap, File::Field, &road),
    ] {
        assert_eq!(
            upload(&mut store, &mut flash, other, bytes, 239).unwrap(),
            Err(UploadError::Damaged)
        );
        store = started(&mut flash);
        assert_eq!(upload(&mut store, &mut flash, own, bytes, 239).unwrap(), Ok(()));
        store = started(&mut flash);
        assert_eq!(
            (store.file_size(own), store.file_size(other)),
            (Some(bytes.len() as u32), None)
        );
        assert_eq!(bytes_at(&flash, store.map_range()), Some(bytes.as_slice()));
    }
    store.remove_file(File::Field);
    assert!(store.file_size(File::Roadmap).is_some(), "the field was not there");
}

#[test]
fn what_is_damaged_or_not_whole_leaves_the_old() {
    let mut flash = Flash::new(2);
    let mut store = started(&mut flash);
    let (road, flown) = (roadmap(200), mission(3));
    upload(&mut store, &mut flash, File::Roadmap, &road, 239).unwrap().unwrap();
    upload(&mut store, &mut flash, File::Mission, &flown, 239).unwrap().unwrap();
    for (file, whole) in [(File::Roadmap, roadmap(210)), (File::Mission, mission(4))] {
        for (bytes, why) in [
            (&whole[..whole.len() - 1], UploadError::Damaged),
            (&whole[1..], UploadError::Damaged),
            (&[][..], UploadError::Damaged),
            (&[&whole[..], &[0xFF; 40]].concat(), UploadError::Damaged),
            (&[&whole[..60], &[0x11], &whole[61..]].concat(), UploadError::Damaged),
        ] {
            store = started(&mut flash);
            assert_eq!(upload(&mut store, &mut flash, file, bytes, 100).unwrap(), Err(why));
        }
        store = started(&mut flash);
        store.open_upload(file, ErasePermission::Allowed).unwrap();
        run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        assert_eq!(store.take_piece(0, &whole[..100]), PieceOutcome::Stored);
        assert_eq!(store.take_piece(101, &whole[101..150]), PieceOutcome::Stored);
        store.finish_upload();
        assert_eq!(store.upload_state(), Some(UploadState::Ended(Err(UploadError::Incomplete))));
    }
    store = started(&mut flash);
    assert_eq!(bytes_at(&flash, store.map_range()), Some(road.as_slice()));
    assert_eq!(bytes_at(&flash, store.mission_range()), Some(flown.as_slice()));
    assert_eq!(store.open_upload(File::Mission, ErasePermission::Allowed), Ok(()));
    assert_eq!(store.take_piece(4000, &[0; 97]), PieceOutcome::TooLarge);
    assert_eq!(store.open_upload(File::Roadmap, ErasePermission::Allowed), Ok(()));
    run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
    assert_eq!(store.take_piece(24 << 10, &[0; 1]), PieceOutcome::TooLarge);
}

/// Executes the requests of the store while armed: only reads are allowed.
fn run_armed(store: &mut Store, flash: &mut Flash) {
    let mut read = [0; MAX_READ_LEN];
    while let Some(request) = store.poll_request(ErasePermission::Forbidden) {
        assert!(matches!(request, FlashRequest::Read { .. }), "{request:?} while armed");
        let outcome = execute(flash, request, ErasePermission::Forbidden, &mut read)
            .expect("the power is on");
        store.handle_flash_outcome(outcome.map(|len| &read[..len]));
    }
}

#[test]
fn a_flash_that_stalls_only_reads_while_armed() {
    let mut flash = Flash::new(1);
    let layout = FlashLayout { stalls_processor: true, ..LAYOUT };
    let mut store = Store::mount(layout, &mut flash);
    run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
    let (road, flown) = (roadmap(300), mission(9));
    assert_eq!(upload(&mut store, &mut flash, File::Mission, &flown, 239).unwrap(), Ok(()));
    for file in File::ALL {
        assert_eq!(store.open_upload(file, ErasePermission::Forbidden), Err(UploadError::Armed));
    }
    // A parameter is stored once the vehicle is disarmed.
    store.set_parameter(0, 3.5).unwrap();
    run_armed(&mut store, &mut flash);
    assert!(store.has_unsaved_parameters());
    assert!(store.request_read(File::Mission, 0, 10), "what is there can be read");
    run_armed(&mut store, &mut flash);
    run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
    assert!(!store.has_unsaved_parameters());
    // Armed at any moment of an upload: nothing is programmed until the vehicle is disarmed again.
    let pieces: Vec<_> = road.chunks(239).collect();
    for armed_at in 0..=pieces.len() {
        let mut flash = Flash::new(2);
        let mut store = Store::mount(layout, &mut flash);
        run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        store.open_upload(File::Roadmap, ErasePermission::Allowed).unwrap();
        run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        for (i, piece) in pieces.iter().enumerate() {
            if i == armed_at {
                run_armed(&mut store, &mut flash);
            }
            assert_eq!(store.take_piece((i * 239) as u32, piece), PieceOutcome::Stored);
            if i == armed_at {
                run_armed(&mut store, &mut flash);
            }
            run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        }
        store.finish_upload();
        run_armed(&mut store, &mut flash);
        assert_ne!(
            store.upload_state(),
            Some(UploadState::Ended(Ok(()))),
            "it cannot be sealed yet"
        );
        run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        assert_eq!(store.upload_state(), Some(UploadState::Ended(Ok(()))));
    }
}

#[test]
fn nothing_is_erased_while_armed() {
    let mut flash = Flash::new(3);
    let mut store = Store::mount(LAYOUT, &mut flash);
    assert_eq!(
        store.open_upload(File::Roadmap, ErasePermission::Forbidden),
        Err(UploadError::Armed)
    );
    store.set_parameter(0, 2.5).unwrap();
    run(&mut store, &mut flash, ErasePermission::Forbidden).unwrap();
    assert!(store.has_unsaved_parameters(), "there is no clean half to keep it in yet");
    run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
    assert!(!store.has_unsaved_parameters());
    // With areas erased ahead of time, parameters and a roadmap are stored while armed.
    store.set_parameter(0, 3.5).unwrap();
    run(&mut store, &mut flash, ErasePermission::Forbidden).unwrap();
    let road = roadmap(50);
    store.open_upload(File::Roadmap, ErasePermission::Forbidden).unwrap();
    run(&mut store, &mut flash, ErasePermission::Forbidden).unwrap();
    for (i, part) in road.chunks(200).enumerate() {
        assert_eq!(store.take_piece(200 * i as u32, part), PieceOutcome::Stored);
        run(&mut store, &mut flash, ErasePermission::Forbidden).unwrap();
    }
    store.finish_upload();
    run(&mut store, &mut flash, ErasePermission::Forbidden).unwrap();
    assert_eq!(store.upload_state(), Some(UploadState::Ended(Ok(()))));
    let store = Store::mount(LAYOUT, &mut flash);
    assert_eq!(store.parameters().get(0), Some(("FLK_ACCEL", 3.5)));
    assert_eq!(bytes_at(&flash, store.map_range()), Some(road.as_slice()));
}

#[test]
fn parameters_outlive_many_changes_and_the_mission_with_them() {
    let mut flash = Flash::new(4);
    let mut store = started(&mut flash);
    let flown = mission(40);
    upload(&mut store, &mut flash, File::Mission, &flown, 239).unwrap().unwrap();
    for i in 0..300u32 {
        let value = 0.5 + (i % 40) as f32 * 0.1;
        store.set_parameter(0, value).unwrap();
        run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        if i % 13 == 0 {
            store = started(&mut flash);
        }
        assert_eq!(store.parameters().get(0), Some(("FLK_ACCEL", value)));
        assert_eq!(bytes_at(&flash, store.mission_range()), Some(flown.as_slice()));
    }
}

#[test]
fn a_read_goes_first_between_two_sectors() {
    let mut flash = Flash::new(8);
    let mut store = started(&mut flash);
    let road = roadmap(40);
    upload(&mut store, &mut flash, File::Roadmap, &road, 239).unwrap().unwrap();
    // One slot is to be erased, as after a restart with a new roadmap.
    flash.bytes[LAYOUT.slot_len as usize..2 * LAYOUT.slot_len as usize].fill(0);
    let mut store = Store::mount(LAYOUT, &mut flash);
    let (mut erased, mut read, mut given) = (Vec::new(), [0; MAX_READ_LEN], 0);
    for turn in 0..100 {
        if turn % 2 == 1 {
            store.request_read(File::Roadmap, 0, 100);
        }
        let Some(request) = store.poll_request(ErasePermission::Allowed) else { break };
        if let FlashRequest::Erase { at } = request {
            erased.push(at);
        }
        let outcome = execute(&mut flash, request, ErasePermission::Allowed, &mut read)
            .expect("the power is on");
        if let Some(answer) = store.handle_flash_outcome(outcome.map(|len| &read[..len])) {
            assert_eq!(answer, ReadOutcome::Bytes(&road[..100]));
            given += 1;
        }
    }
    assert_eq!(given, 2, "one between each two sectors");
    let sectors: Vec<u32> = (0..3).map(|i| LAYOUT.slot_len + i * LAYOUT.sector_len).collect();
    assert_eq!(erased, sectors, "each once");
    run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
    assert_eq!(
        store.open_upload(File::Roadmap, ErasePermission::Forbidden),
        Ok(()),
        "and it is ready"
    );
}

/// Cuts the power at a random word of `change`; afterwards a fresh start must find the old files or
/// the new ones, whole.
fn cut_anywhere(
    seed: u64,
    change: impl Fn(&mut Store, &mut Flash) -> Result<(), PowerLoss>,
    cuts: u32,
) {
    let (old_road, old_mission) = (roadmap(200), mission(30));
    let (new_road, new_mission) = (roadmap(500), mission(50));
    let mut found = [0; 2];
    for cut in 0..cuts {
        let mut flash = Flash::new(seed + u64::from(cut));
        let mut store = started(&mut flash);
        upload(&mut store, &mut flash, File::Roadmap, &old_road, 239).unwrap().unwrap();
        upload(&mut store, &mut flash, File::Mission, &old_mission, 239).unwrap().unwrap();
        store.set_parameter(0, 1.0).unwrap();
        store = started(&mut flash);
        assert!(store.parameters().get(0).unwrap().1 == 1.5, "never asked to keep it");
        store.set_parameter(0, 1.0).unwrap();
        run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        // Counts the words that the change programs, by a first run without a cut.
        let (bytes, torn, rng) = (flash.bytes.clone(), flash.torn.clone(), flash.rng.clone());
        let begun = flash.programmed;
        change(&mut Store::mount(LAYOUT, &mut flash), &mut flash).expect("the power is on");
        let words = flash.programmed - begun;
        (flash.bytes, flash.torn, flash.rng) = (bytes, torn, rng);
        flash.power = Some(flash.rng.next_u32() % words);
        change(&mut Store::mount(LAYOUT, &mut flash), &mut flash).expect_err("the power goes");
        flash.power = None;
        // In every third case the power is cut again while the store cleans up.
        if cut % 3 == 0 {
            flash.power = Some(flash.rng.next_u32() % 40);
            let mut store = Store::mount(LAYOUT, &mut flash);
            let _ = run(&mut store, &mut flash, ErasePermission::Allowed);
            flash.power = None;
        }
        let mut store = started(&mut flash);
        let [road, flown] = [store.map_range(), store.mission_range()].map(|r| bytes_at(&flash, r));
        let is_new = road == Some(new_road.as_slice());
        assert!(is_new || road == Some(old_road.as_slice()), "cut {cut}: neither roadmap is whole");
        assert!(
            flown == Some(&new_mission) || flown == Some(&old_mission),
            "cut {cut}: neither mission"
        );
        let value = store.parameters().get(0).unwrap().1;
        assert!(value == 1.0 || value == 2.0, "cut {cut}: {value}");
        found[usize::from(is_new)] += 1;
        // Uploads still work.
        assert_eq!(
            upload(&mut store, &mut flash, File::Roadmap, &new_road, 239).unwrap(),
            Ok(()),
            "cut {cut}"
        );
        assert_eq!(
            upload(&mut store, &mut flash, File::Mission, &new_mission, 80).unwrap(),
            Ok(()),
            "cut {cut}"
        );
        store = started(&mut flash);
        assert_eq!(bytes_at(&flash, store.map_range()), Some(new_road.as_slice()), "cut {cut}");
        assert_eq!(bytes_at(&flash, store.mission_range()), Some(&new_mission[..]), "cut {cut}");
    }
    std::println!("{cuts} cuts: {} found the old roadmap, {} the new", found[0], found[1]);
}

#[test]
fn a_cut_anywhere_leaves_the_old_roadmap_or_the_new_one_whole() {
    let change = |store: &mut Store, flash: &mut Flash| {
        let road = roadmap(500);
        run(store, flash, ErasePermission::Allowed)?;
        upload(store, flash, File::Roadmap, &road, 239)?.expect("it is sound");
        *store = Store::mount(LAYOUT, flash);
        run(store, flash, ErasePermission::Allowed)
    };
    cut_anywhere(1000, change, 300);
}

#[test]
fn a_cut_anywhere_leaves_the_old_mission_or_the_new_one_whole() {
    let change = |store: &mut Store, flash: &mut Flash| {
        let flown = mission(50);
        run(store, flash, ErasePermission::Allowed)?;
        for _ in 0..5 {
            upload(store, flash, File::Mission, &flown, 239)?.expect("it is sound");
            store.set_parameter(0, 2.0).unwrap();
            run(store, flash, ErasePermission::Allowed)?;
        }
        Ok(())
    };
    cut_anywhere(5000, change, 300);
}

#[test]
fn a_flash_that_fails_ends_the_upload_and_is_not_asked_for_ever() {
    for failing in 0..3 {
        let mut flash = Flash::new(6);
        let mut store = started(&mut flash);
        store.set_parameter(0, 2.0).unwrap();
        let opened = store.open_upload(File::Roadmap, ErasePermission::Allowed);
        assert_eq!(opened, Ok(()));
        let mut asked = 0;
        let road = roadmap(50);
        loop {
            while let Some(request) = store.poll_request(ErasePermission::Allowed) {
                asked += 1;
                assert!(asked < 10_000, "it asks for ever");
                let bad = match request {
                    FlashRequest::Erase { .. } => failing == 0,
                    FlashRequest::Program { .. } => failing == 1,
                    FlashRequest::Read { .. } => failing == 2,
                };
                let nothing = [0; MAX_READ_LEN];
                let len = if let FlashRequest::Read { len, .. } = request { len } else { 0 };
                store.handle_flash_outcome(if bad { Err(FlashFault) } else { Ok(&nothing[..len]) });
            }
            match store.upload_state() {
                Some(UploadState::Receiving)
                    if store.take_piece(0, &road[..200]) == PieceOutcome::Stored =>
                {
                    store.finish_upload();
                }
                Some(UploadState::Ended(result)) => break assert!(result.is_err()),
                _ => break,
            }
        }
    }
}

#[test]
fn an_upload_waits_until_it_is_known_whether_the_vehicle_is_armed() {
    for (file, bytes) in [(File::Roadmap, roadmap(60)), (File::Mission, mission(3))] {
        // A flash as delivered: nothing was erased ahead of time.
        let mut flash = Flash::new(77);
        let mut store = Store::mount(LAYOUT, &mut flash);
        store.open_upload(file, ErasePermission::NotYet).expect("it may be allowed yet");
        run(&mut store, &mut flash, ErasePermission::NotYet).unwrap();
        if file == File::Roadmap {
            assert_eq!(store.upload_state(), Some(UploadState::Opening));
            run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        }
        for (i, part) in bytes.chunks(200).enumerate() {
            assert_eq!(store.take_piece(i as u32 * 200, part), PieceOutcome::Stored);
            run(&mut store, &mut flash, ErasePermission::NotYet).unwrap();
        }
        store.finish_upload();
        run(&mut store, &mut flash, ErasePermission::NotYet).unwrap();
        if file == File::Mission {
            assert_eq!(store.upload_state(), Some(UploadState::Closing));
            run(&mut store, &mut flash, ErasePermission::Allowed).unwrap();
        }
        assert_eq!(store.upload_state(), Some(UploadState::Ended(Ok(()))), "{file:?}");
    }
}

#[test]
fn a_record_whose_head_did_not_come_out_is_written_again() {
    let mut flash = Flash::new(78);
    let mut store = started(&mut flash);
    let flown = mission(3);
    store.open_upload(File::Mission, ErasePermission::Allowed).unwrap();
    flown.chunks(200).enumerate().for_each(|(i, part)| _ = store.take_piece(i as u32 * 200, part));
    store.finish_upload();
    let mut read = [0; MAX_READ_LEN];
    let mut heads = 0;
    while let Some(request) = store.poll_request(ErasePermission::Allowed) {
        let head = match request {
            FlashRequest::Program { at, bytes } if bytes[..4] == flown_head(&flown)[..4] => {
                Some(at as usize)
            }
            _ => None,
        };
        let outcome = execute(&mut flash, request, ErasePermission::Allowed, &mut read).unwrap();
        if let Some(at) = head {
            heads += 1;
            if heads == 1 {
                flash.bytes[at + 20] ^= 1;
            }
        }
        store.handle_flash_outcome(outcome.map(|len| &read[..len]));
    }
    assert!(heads > 1, "{heads}");
    assert_eq!(store.upload_state(), Some(UploadState::Ended(Ok(()))));
    let store = started(&mut flash);
    assert_eq!(bytes_at(&flash, store.mission_range()), Some(flown.as_slice()));
}

fn flown_head(flown: &[u8]) -> [u8; WORD_LEN] {
    journal::record_head(records::RecordKind::Mission, flown.len() as u32, 0)
}

#[test]
fn a_roadmap_that_cannot_be_used_is_refused_or_given_up_for_the_one_before() {
    let mut flash = Flash::new(79);
    let mut store = started(&mut flash);
    let old = roadmap(60);
    upload(&mut store, &mut flash, File::Roadmap, &old, 239).unwrap().unwrap();
    store = started(&mut flash);
    // Another version of the format, with a valid CRC.
    let mut other = roadmap(80);
    other[8] += 1;
    let covered = other.len() - 4;
    let crc = crc32(&other[..covered]);
    other[covered..].copy_from_slice(&crc.to_le_bytes());
    let refused = upload(&mut store, &mut flash, File::Roadmap, &other, 239).unwrap();
    assert_eq!(refused, Err(UploadError::Damaged));
    let new = roadmap(90);
    upload(&mut store, &mut flash, File::Roadmap, &new, 239).unwrap().unwrap();
    let mut store = Store::mount(LAYOUT, &mut flash);
    assert_eq!(bytes_at(&flash, store.map_range()), Some(new.as_slice()));
    assert!(store.fall_back_to_older_roadmap());
    assert_eq!(bytes_at(&flash, store.map_range()), Some(old.as_slice()));
    assert!(!store.fall_back_to_older_roadmap() && store.map_range().is_none());
}
