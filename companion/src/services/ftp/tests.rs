//! The FTP server with a client over a bad link that loses, repeats and reorders requests and
//! answers.

extern crate std;

mod world;

use std::vec;
use std::vec::Vec;

use planner_core::coverage::Flat;
use planner_core::map::field::{self, FieldShape, FieldView};
use rand_core::Rng;

use self::world::{Packet, World};
use super::burst::PACKETS_PER_BURST;
use super::packet::{ACK, EFBIG, EIO, NAK, op};
use super::*;
use crate::testing::fake_flash::{LAYOUT, bytes_at, roadmap};

/// CRC-32 as clients compute it: from 0, not inverted.
fn client_crc(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc: u32, byte| {
        (0..8).fold(
            crc ^ u32::from(*byte),
            |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 },
        )
    })
}

#[test]
fn a_roadmap_goes_up_and_comes_back_over_any_link() {
    for seed in 0..40 {
        let (loss, repeats) = if seed == 0 { (0, 0) } else { (60, 60) };
        let mut world = World::new(seed, loss, repeats);
        let file = roadmap(100 + 10 * seed as usize);
        assert_eq!(world.ask(0, op::RESET, 0, &[]).opcode, ACK);
        let piece = [80, 239, 17, 200][seed as usize % 4];
        assert_eq!(world.upload("/roadmap.bin\0", &file, piece).opcode, ACK, "seed {seed}");
        assert_eq!(world.texts, ["Roadmap stored: used from the next start"]);
        assert_eq!(world.download("roadmap.bin", 239), file, "seed {seed}");
        let sum = world.ask(9, op::CRC32, 0, b"/roadmap.bin");
        assert_eq!(sum.data, client_crc(&file).to_le_bytes());
        assert_eq!(sum.session, 9, "of no session: echoed");
        world.restart();
        assert!(
            world
                .store
                .map_range()
                .is_some_and(|extent| extent.end - extent.start == file.len() as u32)
        );
    }
}

#[test]
fn a_burst_comes_in_packets_that_count_on() {
    let mut world = World::new(50, 0, 0);
    let file = roadmap(300);
    world.upload("roadmap.bin", &file, 239);
    let opened = world.ask(0, op::OPEN_READ, 0, b"roadmap.bin");
    let (mut back, mut rounds) = (Vec::new(), 0);
    while back.len() < file.len() {
        (0..20).for_each(|_| world.step());
        world.heard.clear();
        let request = world.packet(opened.session, op::BURST_READ, 80, back.len() as u32, &[]);
        let first = world.sequence;
        world.send(&request);
        (0..20).for_each(|_| world.step());
        let packets = core::mem::take(&mut world.heard);
        assert!(packets.len() <= usize::from(PACKETS_PER_BURST) && packets.last().unwrap().last);
        for (i, packet) in packets.iter().enumerate() {
            assert_eq!(packet.sequence, first + i as u16);
            assert_eq!((packet.offset as usize, packet.opcode), (back.len(), ACK));
            assert_eq!(packet.last, i + 1 == packets.len());
            back.extend_from_slice(&packet.data);
        }
        world.sequence += packets.len() as u16;
        rounds += 1;
    }
    assert_eq!(back, file);
    assert_eq!(rounds, file.len().div_ceil(80 * usize::from(PACKETS_PER_BURST)));
    let end = world.packet(opened.session, op::BURST_READ, 80, file.len() as u32, &[]);
    assert_eq!(world.ask_again(&end).data, [6], "the end");
}

#[test]
fn a_burst_that_ends_with_a_whole_packet_says_where_the_end_is() {
    let mut world = World::new(52, 0, 0);
    let file = roadmap(300);
    world.upload("roadmap.bin", &file, 239);
    let opened = world.ask(0, op::OPEN_READ, 0, b"roadmap.bin");
    let (size, packets) = (200, 3);
    let from = file.len() - packets * size;
    let request = world.packet(opened.session, op::BURST_READ, size as u8, from as u32, &[]);
    let first = world.sequence;
    world.heard.clear();
    world.send(&request);
    (0..20).for_each(|_| world.step());
    let heard: Vec<_> =
        world.heard.iter().map(|p| (p.sequence, p.offset as usize, p.opcode)).collect();
    let mut want: Vec<_> = (0..packets).map(|i| (first + i as u16, from + i * size, ACK)).collect();
    want.push((first + packets as u16, file.len(), NAK));
    assert_eq!(heard, want);
}

#[test]
fn what_is_asked_wrongly_is_refused_as_the_protocol_says() {
    let mut world = World::new(51, 0, 0);
    let no = |answer: Packet, code: u8| assert_eq!((answer.opcode, answer.data), (NAK, vec![code]));
    assert_eq!(world.ask(3, op::NONE, 0, &[]).opcode, ACK);
    no(world.ask(0, op::LIST, 0, b"/"), 6);
    no(world.ask(0, op::OPEN_READ, 0, b"roadmap.bin"), 10);
    no(world.ask(0, op::CRC32, 0, b"roadmap.bin"), 10);
    no(world.ask(0, op::REMOVE, 0, b"roadmap.bin"), 10);
    no(world.ask(0, op::RENAME, 0, b"roadmap.bin\0mission.bin"), 10);
    no(world.ask(0, op::CREATE, 0, b"firmware.bin"), 9);
    no(world.ask(0, op::LIST, 0, b"/fs"), 10);
    no(world.ask(0, op::MAKE_DIRECTORY, 0, b"/fs"), 9);
    no(world.ask(0, op::REMOVE_DIRECTORY, 0, b"/"), 9);
    no(world.ask(0, 77, 0, &[]), 7);
    no(world.ask(1, op::READ, 0, &[]), 4);
    no(world.ask(1, op::WRITE, 0, &[1]), 4);
    no(world.ask(1, op::TERMINATE, 0, &[]), 4);
    assert_eq!(
        world.upload("mission.bin", &crate::testing::fake_flash::mission(9), 100).opcode,
        ACK
    );
    let listed = world.ask(0, op::LIST, 0, b"/").data;
    assert_eq!(listed, b"Fmission.bin\t396\0");
    no(world.ask(0, op::LIST, 1, b"/"), 6);
    no(world.ask(0, op::TRUNCATE, 0, b"mission.bin"), 9);
    // Another client cannot take over a session that is in use.
    let opened = world.ask(0, op::CREATE, 0, b"roadmap.bin");
    assert_eq!(world.ask(opened.session, op::WRITE, 1 << 20, &[1; 50]).data, [2, EFBIG]);
    world.client = (254, 1);
    no(world.ask(0, op::OPEN_READ, 0, b"mission.bin"), 5);
    no(world.ask(opened.session, op::WRITE, 0, &[1]), 4);
    assert_eq!(world.ask(0, op::RESET, 0, &[]).opcode, ACK, "resets its own only");
    world.client = (255, 190);
    assert_eq!(world.ask(opened.session, op::WRITE, 0, &[1]).opcode, ACK);
    world.now = world.now + Duration::from_secs(11);
    world.client = (254, 1);
    assert_eq!(world.ask(0, op::OPEN_READ, 0, b"mission.bin").opcode, ACK);
    assert_eq!(world.ask(0, op::REMOVE, 0, b"mission.bin").opcode, ACK);
    world.restart();
    no(world.ask(0, op::OPEN_READ, 0, b"mission.bin"), 10);
}

#[test]
fn a_damaged_upload_keeps_the_old_file_and_says_so() {
    let mut world = World::new(52, 30, 30);
    let (old, mut new) = (roadmap(60), roadmap(90));
    world.upload("roadmap.bin", &old, 200);
    world.restart();
    new[100] ^= 1;
    let answer = world.upload("roadmap.bin", &new, 200);
    assert_eq!((answer.opcode, answer.data), (NAK, vec![2, EIO]));
    assert_eq!(world.texts.last(), Some(&"Upload is no such file or damaged: old file kept"));
    assert_eq!(world.download("roadmap.bin", 239), old);
}

/// A field of heights of `rows` rows.
fn field_file(rows: u16) -> Vec<u8> {
    let shape = FieldShape { south_west: Flat::new(-20.0, 10.0), cell_m: 5.0, columns: 31, rows };
    let heights: Vec<i16> = (0..31 * rows as i16).map(|node| 3 * node - 400).collect();
    let mut bytes = vec![0; shape.encoded_len()];
    field::write(&shape, &heights, &mut bytes).unwrap();
    bytes
}

#[test]
fn a_field_goes_into_its_slots_in_turn_and_a_damaged_one_keeps_the_old() {
    for (loss, repeats) in [(0, 0), (60, 60)] {
        let mut world = World::new(54, loss, repeats);
        let mut slots = Vec::new();
        for rows in [20, 33, 12] {
            let file = field_file(rows);
            assert_eq!(world.upload("/field.bin\0", &file, 200).opcode, ACK, "{rows}");
            assert_eq!(world.texts.last(), Some(&"Field stored: used from the next start"));
            assert_eq!(world.download("field.bin", 239), file);
            let sum = world.ask(9, op::CRC32, 0, b"field.bin");
            assert_eq!(sum.data, client_crc(&file).to_le_bytes());
            world.restart();
            let extent = world.store.map_range().expect("it is in a slot");
            slots.push(extent.start / LAYOUT.slot_len);
            assert_eq!(bytes_at(&world.flash, Some(extent)), Some(&file[..]));
            // Files with any byte damaged, and a file of another kind, are refused.
            let refused = [10, file.len() / 2, file.len() - 1].map(|at| {
                let mut damaged = field_file(rows + 1);
                damaged[at] ^= 0x10;
                damaged
            });
            for damaged in refused.iter().chain([&roadmap(60)]) {
                let answer = world.upload("field.bin", damaged, 200);
                assert_eq!((answer.opcode, answer.data), (NAK, vec![2, EIO]));
                let kept = "Upload is no such file or damaged: old file kept";
                assert_eq!(world.texts.last(), Some(&kept));
                world.restart();
                assert_eq!(world.download("field.bin", 239), file);
            }
        }
        assert!(slots[0] != slots[1] && slots[1] != slots[2], "A, then B: {slots:?}");
        let view = world.download("field.bin", 239);
        let view = FieldView::parse(&view).expect("a field");
        assert_eq!(view.height_at(&Flat::new(-20.0, 10.0)), -40.0);
    }
}

#[test]
fn nothing_is_erased_while_armed() {
    let mut world = World::new(53, 0, 0);
    let file = roadmap(60);
    world.erasing = ErasePermission::Forbidden;
    // Two areas were erased ahead; a third roadmap would need one.
    assert_eq!(world.upload("roadmap.bin", &file, 239).opcode, ACK);
    let mut store = Store::mount(LAYOUT, &mut world.flash);
    core::mem::swap(&mut world.store, &mut store);
    world.ftp = Ftp::default();
    assert_eq!(world.upload("roadmap.bin", &roadmap(50), 239).opcode, ACK);
    world.store = Store::mount(LAYOUT, &mut world.flash);
    world.ftp = Ftp::default();
    let refused = world.ask(0, op::CREATE, 0, b"roadmap.bin");
    assert_eq!((refused.opcode, refused.data), (NAK, vec![9]));
    assert_eq!(world.texts.last(), Some(&"Upload refused: armed"));
    world.heard.clear();
    // A request that comes before the arming state is known waits, and is refused once the vehicle
    // is known to be armed.
    world.erasing = ErasePermission::NotYet;
    let opens = world.packet(0, op::CREATE, 11, 0, b"roadmap.bin");
    world.send(&opens);
    (0..3).for_each(|_| world.step());
    assert!(world.heard.is_empty());
    world.erasing = ErasePermission::Forbidden;
    for _ in 0..3 {
        let refused = world.ask_again(&opens);
        assert_eq!((refused.opcode, refused.data), (NAK, vec![9]), "each time that it is asked");
        assert_eq!(world.texts.last(), Some(&"Upload refused: armed"));
        world.now = world.now + Duration::from_secs(2);
    }
    world.erasing = ErasePermission::Allowed;
    assert_eq!(world.upload("roadmap.bin", &file, 239).opcode, ACK);
}

/// Sequence numbers of a request that is repeated.
#[derive(Clone, Copy, PartialEq)]
enum Numbers {
    /// The same number each time, as a copy of the packet has.
    Same,
    /// A new number each time, as MAVSDK sends.
    New,
}

/// Sends a request three times, 4 s apart. Returns the opcodes of the answers.
fn ask_three_times(world: &mut World, numbers: Numbers, opcode: u8, data: &[u8]) -> [u8; 3] {
    let mut request = world.packet(0, opcode, data.len() as u8, 0, data);
    [(); 3].map(|()| {
        let answer = world.ask_again(&request).opcode;
        world.now = world.now + Duration::from_secs(4);
        if numbers == Numbers::New {
            request = world.packet(0, opcode, data.len() as u8, 0, data);
        }
        answer
    })
}

#[test]
fn a_client_whose_answers_are_lost_gets_the_same_late_and_under_other_numbers() {
    use Numbers::*;
    for (numbers, damaged) in [(Same, false), (Same, true), (New, false), (New, true)] {
        let mut world = World::new(70, 0, 0);
        let mut file = roadmap(80);
        file[100] ^= u8::from(damaged);
        assert_eq!(ask_three_times(&mut world, numbers, op::CREATE, b"roadmap.bin"), [ACK; 3]);
        let erased = world.flash.programmed;
        world.ask(0, op::CREATE, 0, b"roadmap.bin");
        assert_eq!(world.flash.programmed, erased, "opened once");
        for (i, piece) in file.chunks(MAX_DATA).enumerate() {
            assert_eq!(world.ask(0, op::WRITE, (i * MAX_DATA) as u32, piece).opcode, ACK);
        }
        let reported = if damaged { NAK } else { ACK };
        assert_eq!(ask_three_times(&mut world, numbers, op::TERMINATE, &[]), [reported; 3]);
        assert_eq!(world.texts.len(), 1, "{:?}", world.texts);
        world.now = world.now + Duration::from_secs(10);
        assert_eq!(world.ask(0, op::TERMINATE, 0, &[]).opcode, NAK, "there is no session");
    }
}

#[test]
fn an_upload_after_a_download_of_the_same_numbers_is_stored() {
    let mut world = World::new(73, 0, 0);
    let (old, new) = (roadmap(40), roadmap(80));
    assert_eq!(world.upload("roadmap.bin", &old, 239).opcode, ACK);
    world.restart();
    world.sequence = 100;
    assert_eq!(world.download("roadmap.bin", 239), old);
    // The TerminateSession of this upload has the sequence number of the download's.
    world.sequence -= 2 + new.chunks(239).len() as u16;
    world.heard.clear();
    assert_eq!(world.upload("roadmap.bin", &new, 239).opcode, ACK);
    assert!(world.download("roadmap.bin", 239) == new, "said to be stored, and is not");
}

#[test]
fn a_later_request_of_the_same_number_does_not_get_the_answer_to_an_earlier_one() {
    for pause in [4, 60] {
        let mut world = World::new(71, 0, 0);
        let (good, mut damaged) = (roadmap(80), roadmap(80));
        damaged[100] ^= 1;
        assert_eq!(world.upload("roadmap.bin", &damaged, 239).opcode, NAK);
        world.now = world.now + Duration::from_secs(pause);
        // A restarted client counts sequence numbers from zero again, and receives no late answers.
        world.sequence = 0;
        world.heard.clear();
        assert_eq!(world.upload("roadmap.bin", &good, 239).opcode, ACK, "{pause} s later");
        world.sequence -= 1;
        let close = world.packet(0, op::TERMINATE, 0, 0, &[]);
        for _ in 0..3 {
            assert_eq!(world.ask_again(&close).opcode, ACK, "{pause} s later");
            world.now = world.now + Duration::from_secs(2);
        }
    }
}

#[test]
fn any_packets_in_any_order_are_survived() {
    for seed in 0..60 {
        let mut world = World::new(100 + seed, 20, 80);
        let file = roadmap(80);
        if seed % 2 == 0 {
            world.upload("roadmap.bin", &file, 239);
            world.restart();
        }
        for _ in 0..400 {
            let mut data = [0; 60];
            data.iter_mut().for_each(|byte| *byte = world.rng.next_u32() as u8);
            let name: &[u8] = [&b"roadmap.bin"[..], b"/mission.bin", &data, b""]
                [world.rng.next_u32() as usize % 4];
            let session = (world.rng.next_u32() % 3) as u8;
            let opcode = (world.rng.next_u32() % 18) as u8;
            let offset = world.rng.next_u32() >> (world.rng.next_u32() % 32);
            let size =
                if world.chance(200) { name.len() as u8 } else { world.rng.next_u32() as u8 };
            // All requests but a removal must leave the file as it is.
            if opcode != op::REMOVE {
                let packet = world.packet(session, opcode, size, offset, name);
                world.send(&packet);
            }
            if world.chance(100) {
                world.step();
            }
        }
        (0..50).for_each(|_| world.step());
        world.restart();
        world.now = world.now + Duration::from_secs(20);
        (world.loss, world.repeats) = (0, 0);
        world.heard.clear();
        if seed % 2 == 0 {
            assert_eq!(world.download("roadmap.bin", 100), file, "seed {seed}");
        }
        assert_eq!(world.upload("roadmap.bin", &roadmap(120), 239).opcode, ACK, "seed {seed}");
    }
}
