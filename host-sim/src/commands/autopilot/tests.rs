use super::*;
use clap::Parser;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    args: AutopilotArgs,
}

fn parse(line: &str) -> Result<AutopilotArgs, String> {
    Cli::try_parse_from(line.split(' ')).map(|cli| cli.args).map_err(|error| error.to_string())
}

#[test]
fn places_and_links_are_read() {
    let args = parse(
        "x --listen udp-listen:127.0.0.1:0 --home -33.9,18.4,12.5 --origin 40,-3.7,700 --sysid 7",
    )
    .unwrap();
    assert_eq!(args.home.0, Geodetic { lat_deg: -33.9, lon_deg: 18.4, alt_m: 12.5 });
    assert_eq!(args.origin.unwrap().0.lon_deg, -3.7);
    assert_eq!(args.sysid, 7);
}

#[test]
fn what_is_no_place_or_no_link_is_refused() {
    for line in [
        "x --listen udp-listen:127.0.0.1:0 --home 91,0,0",
        "x --listen udp-listen:127.0.0.1:0 --home 1,2",
        "x --listen udp-listen:127.0.0.1:0 --home 1,2,3,x",
        "x --listen udp:nowhere",
        "x --listen udp:127.0.0.1:1 --sysid 0",
        "x",
    ] {
        assert!(parse(line).is_err(), "{line}");
    }
}
