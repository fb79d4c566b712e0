//! `host-sim radio`: the simulated radio of a swarm whose companions are boards or other processes.

use std::process::ExitCode;
use std::thread::sleep;
use std::time::{Duration, Instant as Clock};

use anyhow::Context;
use companion::Instant;
use companion::link::frame::{Framer, MAX_FRAME_LEN};
use planner_core::Point;

use crate::link::{ByteLink, LinkUrl};
use crate::progress::check_printed;
use crate::say;
use crate::swarm::radio::{Radio, RadioConfig};

/// Arguments of `host-sim radio`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Link to a companion or ground station, given once for each: udp-listen:HOST:PORT,
    /// tcp-listen:HOST:PORT, udp:HOST:PORT, tcp:HOST:PORT or serial:PATH:BAUD
    #[arg(long, value_name = "URL", required = true)]
    listen: Vec<LinkUrl>,
    /// Share of frames that each receiver loses, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = parse_share)]
    loss: f64,
    /// Delay from sending to receiving, seconds
    #[arg(long, value_name = "S", default_value_t = 0.05, value_parser = parse_seconds)]
    delay: f64,
    /// Seed of the random losses
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Sleep between two polls of the simulated radio.
const RADIO_POLL_SLEEP: Duration = Duration::from_millis(1);

/// Parses a number from 0 to `most`.
fn parse_number(text: &str, most: f64) -> Result<f64, String> {
    let sound = text.parse().ok().filter(|value| (0.0..=most).contains(value));
    sound.ok_or_else(|| format!("expected a number from 0 to {most}"))
}

/// Parses a share from 0 to 1.
fn parse_share(text: &str) -> Result<f64, String> {
    parse_number(text, 1.0)
}

/// Parses a time from 0 to 60 s.
fn parse_seconds(text: &str) -> Result<f64, String> {
    parse_number(text, 60.0)
}

/// Forwards each frame from one link to all others, with loss and delay, until the process is
/// ended. Prints `listening URL` for each link.
///
/// # Errors
/// A link cannot be opened or is permanently lost.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let config =
        RadioConfig { range_m: f32::INFINITY, loss_probability: args.loss, delay_s: args.delay };
    let mut radio = Radio::new(config, args.listen.len(), args.seed);
    let places = vec![Point::zeros(); args.listen.len()];
    let mut links: Vec<(&LinkUrl, Box<dyn ByteLink>, Framer)> = Vec::new();
    for url in &args.listen {
        let link = url.open()?;
        say!("listening {}", url.with_bound_port(&*link));
        links.push((url, link, Framer::new()));
    }
    check_printed()?;
    let began = Clock::now();
    let mut buffer = [0; 2048];
    loop {
        let now_us = began.elapsed().as_micros() as u64;
        for (station, (url, link, framer)) in links.iter_mut().enumerate() {
            let lost = || format!("link lost: {url}");
            loop {
                let length = link.receive(&mut buffer).with_context(lost)?;
                let mut input = &buffer[..length];
                while let Some(frame) = framer.next(Instant::from_micros(now_us), &mut input) {
                    let mut packet = [0; MAX_FRAME_LEN];
                    let length = frame.encode(&mut packet);
                    radio.broadcast(now_us, Some(station), &places, &packet[..length]);
                }
                if length == 0 {
                    break;
                }
            }
            while let Some(packet) = radio.receive(now_us, station) {
                link.send(&packet).with_context(lost)?;
            }
        }
        sleep(RADIO_POLL_SLEEP);
    }
}
