//! Makes the flash image of an emulated board.

use anyhow::ensure;
use companion::services::ftp::MAX_DATA;
use companion::storage::store::reassembly::PieceOutcome;
use companion::storage::store::{ErasePermission, File, MAX_READ_LEN, Store, UploadState};

use planner_core::map::field;

use crate::flash::{HOST_FLASH_LAYOUT, HostFlash};

/// Address of flash bank 2 on the emulated board.
pub const FLASH_BANK2_ADDRESS: u32 = 0x6000_0000;
/// Address of the word marks, one byte for each flash word: [`ERASED`], [`PROGRAMMED`], or [`TORN`]
/// from the beginning of the word's programming or erasure to its end.
pub const WORD_MARKS_ADDRESS: u32 = 0x6020_0000;
/// Mark of a flash word that is erased.
pub const ERASED: u8 = 0;
/// Mark of a flash word that is programmed.
pub const PROGRAMMED: u8 = 1;
/// Mark of a flash word whose programming or erasure has begun and not ended.
pub const TORN: u8 = 2;
/// Address of a word in memory by which the board's firmware knows that the bank holds an image.
pub const BANK_IMAGE_MARK_ADDRESS: u32 = 0x6030_0000;
/// Value of that word if the bank holds an image.
pub const BANK_IMAGE_MARK: u32 = 0x464c_4153;

/// Image of a flash bank after the store accepted an upload of these files into an empty bank;
/// `roadmap` may also be a field file. Each file has two slots, of which the other is erased.
///
/// # Errors
/// The store refuses a file.
pub fn flash_bank_image(roadmap: &[u8], mission: &[u8]) -> anyhow::Result<Vec<u8>> {
    let mut flash = HostFlash::open(None)?;
    let mut store = Store::mount(HOST_FLASH_LAYOUT, &mut flash);
    let mut settle = |store: &mut Store| {
        let mut read = [0; MAX_READ_LEN];
        while let Some(request) = store.poll_request(ErasePermission::Allowed) {
            let outcome = flash.execute_request(request, &mut read);
            store.handle_flash_outcome(outcome);
        }
    };
    settle(&mut store);
    let map = if roadmap.starts_with(&field::MAGIC) { File::Field } else { File::Roadmap };
    let files = [(map, roadmap), (File::Mission, mission)];
    // An empty file is left out: a coverage mission has no roadmap, and over level ground no field.
    for (file, bytes) in files.into_iter().filter(|(_, bytes)| !bytes.is_empty()) {
        let opened = store.open_upload(file, ErasePermission::Allowed);
        ensure!(opened.is_ok(), "a board's store takes no {}: {opened:?}", file.name());
        settle(&mut store);
        for (i, piece) in bytes.chunks(MAX_DATA).enumerate() {
            let taken = store.take_piece((i * MAX_DATA) as u32, piece);
            ensure!(
                taken == PieceOutcome::Stored,
                "a board's store refuses {}: {taken:?}",
                file.name()
            );
            settle(&mut store);
        }
        store.finish_upload();
        settle(&mut store);
        let ended = store.upload_state();
        ensure!(
            ended == Some(UploadState::Ended(Ok(()))),
            "a board refuses {}: {ended:?}",
            file.name()
        );
    }
    Ok(flash.into_bytes())
}
