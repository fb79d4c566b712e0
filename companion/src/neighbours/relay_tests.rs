//! News reach whoever is out of range, and are never newer than what they tell of.

extern crate std;
use std::vec::Vec as List;

use proptest::prelude::*;

use super::*;
use crate::config::RosterEntry;
use crate::intent::{Intent, WAITING};
use mavlink::dialects::ardupilotmega::GLOBAL_POSITION_INT_DATA;
use planner_core::frames::{self, Geodetic};

const ORIGIN: Geodetic = Geodetic { lat_deg: 40.0, lon_deg: -3.0, alt_m: 600.0 };
const MISSION: u32 = 7;
const PLAN: u32 = 9;
/// A step of the swarm below.
const STEP_MS: u64 = 200;

fn item(rank: u8) -> Item {
    Item {
        rank,
        column: rank == 1,
        flags: ON_PLAN | WAITING,
        age_ds: 300 + u16::from(rank),
        progress_m: -1.25,
        place_dm: [-32_000, 4, 455],
        floor_dm: -3,
    }
}

fn padded(news: &News) -> [u8; 255] {
    let (mut out, mut padded) = ([0; LENGTH], [0; 255]);
    let len = news.encode(5, &mut out);
    padded[..len].copy_from_slice(&out[..len]);
    padded
}

#[test]
fn come_back_as_sent_and_refuse_the_unsound() {
    for count in 0..=MOST as u8 {
        let news = News { mission_crc: 1, plan_crc: 2, items: (0..count).map(item).collect() };
        assert_eq!(News::decode(&padded(&news), 5), Some(news.clone()));
        assert_eq!(News::decode(&padded(&news), 6), None, "another sender");
        for (at, value) in [(0, 0), (5, 9), (7, count + 1)] {
            let mut bad = padded(&news);
            bad[at] = value;
            assert_eq!(News::decode(&bad, 5), None, "byte {at}");
        }
    }
    let nan = Item { progress_m: f32::NAN, ..item(0) };
    let news = News { mission_crc: 1, plan_crc: 2, items: [nan].into_iter().collect() };
    assert_eq!(News::decode(&padded(&news), 5), None);
}

/// A swarm whose vehicles hear one another over `links` only; the progress of each is the time in seconds.
struct Swarm {
    tables: List<Neighbours<8>>,
    next: List<u16>,
    links: List<List<bool>>,
    /// What is under way: when it is heard, by whom, from whom.
    under_way: List<(u64, usize, usize, News)>,
    told: usize,
}

impl Swarm {
    fn new(links: List<List<bool>>) -> Self {
        let roster: List<RosterEntry> = (1..=links.len() as u8)
            .map(|system_id| RosterEntry { system_id, start: Point::zeros() })
            .collect();
        Self {
            tables: (1..=links.len() as u8).map(|id| Neighbours::new(&roster, id, 2.0)).collect(),
            next: std::vec![0; links.len()],
            links,
            under_way: List::new(),
            told: 0,
        }
    }

    fn step(&mut self, now_ms: u64, delay_ms: u64) {
        let (now, n) = (Instant::from_millis(now_ms), self.tables.len());
        let heard: List<u32> = self.tables.iter().map(|table| table.heard_bits(now)).collect();
        let away = frames::enu_to_geodetic(&ORIGIN, &Point::new(now_ms as f32 * 1e-3, 0.0, 3.0));
        for (i, &heard) in heard.iter().enumerate() {
            let id = i as u8 + 1;
            let intent = Intent {
                system_id: id,
                flags: ON_PLAN,
                mission_crc: MISSION,
                plan_crc: PLAN,
                progress_m: now_ms as f32 * 1e-3,
                heard,
                ..Intent::default()
            };
            let place = GLOBAL_POSITION_INT_DATA {
                time_boot_ms: now_ms as u32,
                lat: (away.lat_deg * 1e7) as i32,
                lon: (away.lon_deg * 1e7) as i32,
                alt: (away.alt_m * 1e3) as i32,
                ..Default::default()
            };
            for j in (0..n).filter(|&j| j != i && self.links[i][j]) {
                self.tables[j].handle_intent(now, j as u16, &intent, MISSION, Some(PLAN));
                self.tables[j].handle_position(now, &ORIGIN, id, &place);
            }
            if now_ms % 1000 == STEP_MS * (i as u64 % 5) {
                let news = self.tables[i].news(now, &mut self.next[i], MISSION, PLAN);
                // At first nobody has heard anybody.
                self.told += usize::from(now_ms >= 2000 && !news.is_empty());
                let to = (0..n).filter(|&j| j != i && self.links[i][j]);
                self.under_way.extend(to.map(|j| (now_ms + delay_ms, j, i, news.clone())));
            }
        }
        let due: List<_> = self.under_way.extract_if(.., |(at_ms, ..)| *at_ms <= now_ms).collect();
        for (_, to, from, news) in due {
            let news = News::decode(&padded_from(&news, from as u8 + 1), from as u8 + 1).unwrap();
            self.tables[to].handle_news(now, from as u8 + 1, &news, Some(PLAN));
        }
    }

    /// Hops from `from` to every other; as many as there are vehicles where none lead there.
    fn hops(&self, from: usize) -> List<usize> {
        let n = self.links.len();
        let mut hops = std::vec![n; n];
        hops[from] = 0;
        for _ in 0..n {
            for i in 0..n {
                for j in (0..n).filter(|&j| self.links[i][j]) {
                    hops[j] = hops[j].min(hops[i] + 1);
                }
            }
        }
        hops
    }
}

fn padded_from(news: &News, sender: u8) -> [u8; 255] {
    let mut bytes = padded(news);
    bytes[TUNNEL_HEAD + 1] = sender;
    bytes
}

proptest! {
    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 255), kind in any::<bool>()) {
        let mut padded: [u8; 255] = bytes.try_into().unwrap();
        if kind {
            padded[..2].copy_from_slice(&PAYLOAD_TYPE.to_le_bytes());
            padded[TUNNEL_HEAD] = VERSION;
        }
        if let Some(news) = News::decode(&padded, padded[TUNNEL_HEAD + 1]) {
            let mut swarm = Swarm::new(std::vec![std::vec![true; 3]; 3]);
            swarm.step(0, 0);
            swarm.tables[0].handle_news(Instant::from_millis(5000), 2, &news, Some(news.plan_crc));
            let told = swarm.tables[0].at(Instant::from_millis(5000));
            prop_assert!(told.iter().all(|n| n.age_s >= 1.0 && n.position.norm().is_finite()));
        }
    }

    #[test]
    fn reach_all_that_are_joined_and_are_never_too_young(
        n in 2_usize..=8,
        joined in proptest::collection::vec(0.0_f32..1.0, 64),
        share in 0.1_f32..1.0,
        delay_ms in 0_u64..900,
    ) {
        let link = |i: usize, j: usize| i != j && joined[i.min(j) * 8 + i.max(j)] < share;
        let links: List<List<bool>> = (0..n).map(|i| (0..n).map(|j| link(i, j)).collect()).collect();
        let all = (0..n).all(|i| (0..n).all(|j| i == j || links[i][j]));
        let mut swarm = Swarm::new(links);
        let last_ms = 60_000;
        for now_ms in (0..=last_ms).step_by(STEP_MS as usize) {
            swarm.step(now_ms, delay_ms);
            for table in &swarm.tables {
                for c in &table.contacts {
                    let (Some(at), Some(progress_m)) = (c.position_at, c.state.progress_m) else { continue };
                    // Both are the time at which they were true.
                    prop_assert!(at.micros() as f32 * 1e-6 <= progress_m + 1e-3);
                    prop_assert!(progress_m <= now_ms as f32 * 1e-3);
                    let place_s = c.state.position.x;
                    prop_assert!(at.micros() as f32 * 1e-6 <= place_s + 0.1, "{at:?} {place_s}");
                }
            }
        }
        prop_assert!(swarm.told == 0 || !all, "nobody is missed");
        for from in 0..n {
            for (to, hops) in swarm.hops(from).into_iter().enumerate() {
                let table = &swarm.tables[to];
                let known = table.contacts.iter().find(|c| usize::from(c.rank) == from);
                let known_m = known.and_then(|c| c.state.progress_m);
                prop_assert!(known_m.is_some() == (hops < n && hops > 0), "{from} {to} {hops}");
                // A hop takes a second of waiting for its turn, and what the radio takes, after the first.
                let late_s = (hops.saturating_sub(1)) as f32 * (1.3 + delay_ms as f32 * 1e-3) + 1.0;
                let told_m = known_m.unwrap_or(last_ms as f32 * 1e-3);
                prop_assert!(told_m >= last_ms as f32 * 1e-3 - late_s, "{told_m} after {hops} hops");
            }
        }
    }
}

#[test]
fn who_is_heard_speaks_for_itself() {
    let mut swarm = Swarm::new(std::vec![std::vec![true; 3]; 3]);
    swarm.step(0, 0);
    swarm.step(STEP_MS, 0);
    let away = Item { age_ds: 0, progress_m: 500.0, place_dm: [9000, 0, 0], ..item(1) };
    let news = News { mission_crc: MISSION, plan_crc: PLAN, items: [away].into_iter().collect() };
    let place = |swarm: &mut Swarm, ms: u64| swarm.tables[0].at(Instant::from_millis(ms))[0].position.x;
    swarm.tables[0].handle_news(Instant::from_millis(900), 3, &news, Some(PLAN));
    assert!(place(&mut swarm, 900) < 1.0);
    swarm.tables[0].handle_news(Instant::from_millis(2500), 3, &news, Some(PLAN));
    assert_eq!(place(&mut swarm, 2500), 900.0);
    let progress_m = swarm.tables[0].at(Instant::from_millis(2500))[0].progress_m;
    assert!(progress_m.is_some_and(|m| m < 20.0), "no faster than it can fly: {progress_m:?}");
    let stranger = News { items: [Item { rank: 7, ..away }].into_iter().collect(), ..news };
    swarm.tables[0].handle_news(Instant::from_millis(2600), 3, &stranger, Some(PLAN));
    assert_eq!(swarm.tables[0].len(), 2, "nobody is added");
}
