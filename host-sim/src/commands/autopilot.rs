//! `host-sim autopilot`: one simulated autopilot in real time, over flat ground at its home's
//! altitude.
//!
//! The simulation makes one step of 4 ms every 4 ms of the clock, and sleeps in between. If it
//! falls more than a second behind, it skips the missed steps: simulated time then stays behind
//! the clock.

use std::process::ExitCode;
use std::str::FromStr;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use planner_core::Point;
use planner_core::geo::frames::Geodetic;
use sim_autopilot::{Autopilot, AutopilotConfig, SimulatedKind};

use crate::link::{ByteLink, LinkUrl};
use crate::progress::check_printed;
use crate::say;

/// Time step of the simulated vehicle: 250 Hz.
const PHYSICS_STEP: Duration = Duration::from_millis(4);
/// Greatest time by which the simulation may be behind the wall clock and still catches up. If it
/// is further behind, it skips the missed steps.
const MAX_PHYSICS_LAG: Duration = Duration::from_secs(1);
/// Longest datagram that is sent, bytes: fits Ethernet's MTU of 1500.
const MAX_DATAGRAM: usize = 1400;

/// Arguments of `host-sim autopilot`.
#[derive(Args, Clone, Debug)]
pub struct AutopilotArgs {
    /// Link to serve: tcp:HOST:PORT, tcp-listen:HOST:PORT, udp:HOST:PORT, udp-listen:HOST:PORT or
    /// serial:PATH:BAUD; may be repeated
    #[arg(long, value_name = "URL", required = true)]
    pub listen: Vec<LinkUrl>,
    /// Autopilot to simulate
    #[arg(long = "personality", value_name = "NAME", default_value = "px4")]
    #[arg(value_parser = autopilot_kind_parser())]
    pub autopilot: SimulatedKind,
    /// MAVLink system id
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u8).range(1..))]
    pub sysid: u8,
    /// Seconds from the start until ArduCopter's estimator has a position; PX4's has one at once
    #[arg(long, value_name = "S", default_value_t = 40.0, value_parser = parse_seconds)]
    pub ready_after: f32,
    /// Where the vehicle stands: latitude and longitude in degrees, metres above sea level
    #[arg(
        long,
        value_name = "LAT,LON,ALT",
        allow_hyphen_values = true,
        default_value = "47.397742,8.545594,488"
    )]
    pub home: GeodeticArgument,
    /// Origin of the autopilot's local frame (EKF origin); the vehicle's home if absent
    #[arg(long, value_name = "LAT,LON,ALT", allow_hyphen_values = true)]
    pub origin: Option<GeodeticArgument>,
}

/// Parses the name of an autopilot.
fn autopilot_kind_parser() -> impl TypedValueParser<Value = SimulatedKind> {
    let names = PossibleValuesParser::new(["px4", "ardupilot"]);
    names.map(|name| if name == "px4" { SimulatedKind::Px4 } else { SimulatedKind::Ardupilot })
}

/// Parses a time from 0 to 3600 s.
fn parse_seconds(text: &str) -> Result<f32, String> {
    let sound = text.parse().ok().filter(|s| (0.0..=3600.0).contains(s));
    sound.ok_or_else(|| "expected a number of seconds from 0 to 3600".to_owned())
}

/// A WGS84 position in the notation of the command line, `LAT,LON,ALT`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeodeticArgument(pub Geodetic);

impl FromStr for GeodeticArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
        let &[lat_deg, lon_deg, alt_m] = parts.as_slice() else {
            return Err("expected three numbers LAT,LON,ALT".to_owned());
        };
        let place = Geodetic { lat_deg, lon_deg, alt_m };
        if text.split(',').count() != 3 || !place.is_valid() {
            return Err(
                "expected latitude within ±90, longitude within ±180, finite altitude".to_owned()
            );
        }
        Ok(Self(place))
    }
}

/// Serves one simulated autopilot until the process is ended. Prints `listening URL` for each link,
/// with the port that the system chose for port 0.
///
/// # Errors
/// A link cannot be opened or is permanently lost, or the autopilot cannot be simulated.
pub fn run(args: &AutopilotArgs) -> anyhow::Result<ExitCode> {
    let home = args.home.0;
    let config = AutopilotConfig {
        system_id: args.sysid,
        autopilot: args.autopilot,
        world_origin: home,
        ekf_origin: args.origin.map_or(home, |origin| origin.0),
        start: Point::zeros(),
        estimator_ready_s: args.ready_after,
        boot_unix_us: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |t| t.as_micros() as u64),
        ports: args.listen.len(),
        forwards_between_ports: true,
        ..AutopilotConfig::default()
    };
    let mut autopilot =
        Autopilot::new(&config).context("cannot simulate the autopilot: --personality")?;
    let mut links = Vec::new();
    for url in &args.listen {
        let link = url.open()?;
        say!("listening {}", url.with_bound_port(&*link));
        links.push((url, link));
    }
    // Fails if the lines could not be printed: a program that waits for them would wait for ever.
    check_printed()?;
    let ground_up_m = -config.vehicle.radius_m;
    let mut next = Instant::now();
    loop {
        for (port, (url, link)) in links.iter_mut().enumerate() {
            exchange_bytes(&mut autopilot, port, &mut **link)
                .with_context(|| format!("link lost: {url}"))?;
        }
        autopilot.step(PHYSICS_STEP.as_secs_f32(), ground_up_m);
        next += PHYSICS_STEP;
        let now = Instant::now();
        if now > next + MAX_PHYSICS_LAG {
            next = now;
        }
        std::thread::sleep(next.saturating_duration_since(now));
    }
}

/// Hands the autopilot all bytes that have arrived on a link, then sends all bytes that it has for
/// that link.
fn exchange_bytes(
    autopilot: &mut Autopilot,
    port: usize,
    link: &mut dyn ByteLink,
) -> std::io::Result<()> {
    let mut buffer = [0; 2048];
    loop {
        let len = link.receive(&mut buffer)?;
        if len == 0 {
            break;
        }
        autopilot.handle_bytes_on(port, &buffer[..len]);
    }
    loop {
        let len = autopilot.poll_transmit_from(port, &mut buffer[..MAX_DATAGRAM]);
        if len == 0 {
            return Ok(());
        }
        link.send(&buffer[..len])?;
    }
}

#[cfg(test)]
mod tests;
