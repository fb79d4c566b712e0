//! `host-sim upload`: uploads a roadmap, field or mission file to a companion by MAVLink FTP.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, anyhow, bail, ensure};
use companion::storage::mission_file::{self, MissionView};
use companion::storage::store::File;
use planner_core::map::field::{self, FieldView};
use planner_core::roadmap;

use crate::capacity::{BOARDS, BoardCapacity};
use crate::files;
use crate::link::LinkUrl;
use crate::progress::Progress;
use crate::quote::printable_path;
use crate::say;
use crate::upload::FtpClient;

/// Arguments of `host-sim upload`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A roadmap, field or mission file, as `host-sim plan` writes them
    file: PathBuf,
    /// Link to the vehicle's autopilot, which forwards to the companion, or to the companion
    /// itself: udp:HOST:PORT, udp-listen:HOST:PORT, tcp:HOST:PORT, tcp-listen:HOST:PORT or
    /// serial:PATH:BAUD
    #[arg(long, value_name = "URL")]
    link: LinkUrl,
    /// MAVLink system id of the vehicle; if absent, that of the first companion heard
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    id: Option<u8>,
    /// System id to send from: one that the companion's mission names as a ground station
    #[arg(long, value_name = "N", default_value_t = 255)]
    #[arg(value_parser = clap::value_parser!(u8).range(1..))]
    ground_station: u8,
    /// The vehicle's board: nucleo-h743, qemu or pico2. A file that does not fit it is not sent;
    /// without this option, a file that fits no board
    #[arg(long, value_name = "BOARD", value_parser = BoardCapacity::by_name)]
    board: Option<&'static BoardCapacity>,
}

/// Uploads the file and verifies the CRC-32 of what arrived. The companion uses the file from its
/// next start on.
///
/// # Errors
/// The file is no roadmap, field or mission or does not fit the board, no companion is heard, the
/// companion refuses the file, or the link fails.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let path = printable_path(&args.file);
    let bytes = files::read(&args.file, files::MAX_BINARY_BYTES)
        .with_context(|| format!("cannot read: {path}"))?;
    let board = args.board.unwrap_or(&BOARDS[0]);
    let file =
        checked_file_kind(&bytes, board).with_context(|| format!("not for upload: {path}"))?;
    let mut client =
        FtpClient::new(args.link.open()?, args.id).with_own_system(args.ground_station);
    let system = client.wait_for_companion()?;
    let bar = Progress::on_terminal().begin_counted_stage("upload", bytes.len() as u64);
    client
        .upload(file, &bytes, |done| bar.set_position(done))
        .with_context(|| format!("upload failed: {path}"))?;
    drop(bar);
    say!(
        "{path} is vehicle {system}'s {} from its next start on: {} bytes, CRC-32 right",
        file.name(),
        bytes.len()
    );
    Ok(ExitCode::SUCCESS)
}

/// Kind of a file by its magic number; an error if it is malformed or exceeds the board's capacity.
fn checked_file_kind(bytes: &[u8], board: &BoardCapacity) -> anyhow::Result<File> {
    let (file, excess) = if bytes.starts_with(&roadmap::MAGIC) {
        let view = super::roadmap::parse(bytes).context("no sound roadmap")?;
        (File::Roadmap, board.roadmap_excess(&view))
    } else if bytes.starts_with(&field::MAGIC) {
        FieldView::parse(bytes).map_err(|e| anyhow!("no sound field: {e}"))?;
        // Every board holds the largest field.
        (File::Field, None)
    } else if bytes.starts_with(&mission_file::MAGIC) {
        let view = MissionView::parse(bytes).map_err(|e| anyhow!("no sound mission: {e}"))?;
        let more = bytes.len() - view.byte_len();
        ensure!(more == 0, "no sound mission: {more} bytes follow its end");
        (File::Mission, board.mission_excess(&view))
    } else {
        bail!(
            "it begins neither as a roadmap or field nor as a mission\nhint: `host-sim plan` writes roadmap.bin or field.bin, and \
             mission.bin"
        )
    };
    match excess {
        Some(excess) => bail!(
            "too large: {excess}\nhint: `host-sim plan --board {}` writes files that it holds",
            board.name
        ),
        None => Ok(file),
    }
}
