//! Upload of a file: from its first piece in the reassembly window to the seal of its slot.

use super::Store;
use super::flash::{ErasePermission, File};
use super::flash_area::{AreaCondition, DATA_OFFSET, FlashArea};
use super::reassembly::{PieceOutcome, WINDOW_LEN};
use super::upload_state::{UploadError, UploadState};
use crate::storage::mission_file::MissionView;
use planner_core::map::field;
use planner_core::roadmap;

impl Store {
    /// State of the last upload; `None` if there was none, or it was abandoned.
    pub fn upload_state(&self) -> Option<UploadState> {
        self.upload.map(|(_, state)| state)
    }

    /// Begins an upload, and abandons one under way. Pieces are accepted once
    /// [`Self::upload_state`] is `Receiving`.
    ///
    /// # Errors
    /// [`UploadError::Armed`] or [`UploadError::AwaitsRestart`].
    pub fn open_upload(&mut self, file: File, erasing: ErasePermission) -> Result<(), UploadError> {
        if self.upload_state() == Some(UploadState::Closing) {
            return Err(UploadError::AwaitsRestart);
        }
        self.abandon_upload();
        if self.layout.stalls_processor && erasing == ErasePermission::Forbidden {
            return Err(UploadError::Armed);
        }
        if file != File::Mission {
            let slot = self.writable_slot().ok_or(UploadError::AwaitsRestart)?;
            if self.slots[slot] != AreaCondition::Clean && erasing == ErasePermission::Forbidden {
                return Err(UploadError::Armed);
            }
            self.erasure_failed = false;
        }
        self.reassembly.reset();
        let state =
            if file == File::Mission { UploadState::Receiving } else { UploadState::Opening };
        self.upload = Some((file, state));
        Ok(())
    }

    /// Accepts a piece of the file at `offset`; `RetryLater` if no upload is open for pieces.
    pub fn take_piece(&mut self, offset: u32, piece: &[u8]) -> PieceOutcome {
        match self.upload {
            Some((File::Mission, UploadState::Receiving)) => {
                self.reassembly.insert(offset, piece, WINDOW_LEN as u32)
            }
            Some((File::Roadmap | File::Field, UploadState::Receiving)) => {
                self.reassembly.insert(offset, piece, self.layout.slot_len - DATA_OFFSET)
            }
            _ => PieceOutcome::RetryLater,
        }
    }

    /// Ends an upload whose pieces were all sent: checks the file and starts to store it.
    /// [`Self::upload_state`] becomes `Closing`, then `Ended`; at once `Ended` for a file that is
    /// incomplete or damaged.
    pub fn finish_upload(&mut self) {
        let Some((file, UploadState::Receiving)) = self.upload else { return };
        let state = match (file, self.reassembly.last_part()) {
            (_, Some(_)) if self.reassembly.file_len() == 0 => {
                UploadState::Ended(Err(UploadError::Damaged))
            }
            (_, None) => UploadState::Ended(Err(UploadError::Incomplete)),
            (File::Mission, Some(rest))
                if MissionView::parse(rest).is_ok_and(|view| view.byte_len() == rest.len()) =>
            {
                UploadState::Closing
            }
            (File::Mission, Some(_)) => UploadState::Ended(Err(UploadError::Damaged)),
            (File::Roadmap | File::Field, Some(_)) => UploadState::Closing,
        };
        self.upload = Some((file, state));
        if let UploadState::Ended(result) = state {
            self.end_upload(result);
        }
    }

    /// Abandons an upload, unless its file is already being stored.
    pub fn abandon_upload(&mut self) {
        if !matches!(self.upload, Some((_, UploadState::Closing))) {
            self.drop_upload_job();
            self.mark_open_slot_dirty();
            self.upload = None;
        }
    }

    /// Ends the upload with this result; after an error its slot is to be erased.
    pub(super) fn end_upload(&mut self, result: Result<(), UploadError>) {
        if let Some((file, _)) = self.upload {
            self.upload = Some((file, UploadState::Ended(result)));
        }
        if result.is_err() {
            self.mark_open_slot_dirty();
        }
    }

    /// Marks a half-written slot for erasure.
    fn mark_open_slot_dirty(&mut self) {
        for slot in &mut self.slots {
            if *slot == AreaCondition::Open {
                *slot = AreaCondition::Dirty;
            }
        }
    }

    /// The slot for the next upload: neither in use nor with the newest file.
    pub(super) fn writable_slot(&self) -> Option<usize> {
        let newest = self.newest_slot();
        (0..2).find(|i| Some(*i) != self.slot_in_use && Some(*i) != newest)
    }

    /// The slot into which an upload is being written.
    pub(super) fn open_slot(&self) -> Option<FlashArea> {
        self.slots.iter().position(|slot| *slot == AreaCondition::Open).map(FlashArea::Slot)
    }

    /// Whether these first bytes are the head of a file with `len` bytes: of a field of heights if
    /// one is being uploaded, else of a roadmap.
    pub(super) fn is_file_head(&self, bytes: &[u8], len: u32) -> bool {
        let declared = match self.upload {
            Some((File::Field, _)) => {
                bytes.first_chunk().and_then(|head| field::declared_len(head).ok())
            }
            _ => bytes.first_chunk().and_then(|head| roadmap::declared_len(head).ok()),
        };
        declared == Some(len as usize)
    }
}

#[cfg(test)]
mod tests;
