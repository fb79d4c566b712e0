//! A file coming in: from the first piece in the window to the seal.

use super::Store;
use super::area::{Area, Condition, DATA_OFFSET};
use super::flash::{Erasing, File};
use super::upload_state::{UploadError, UploadState};
use super::window::{Taken, WINDOW_LEN};
use crate::storage::mission_file::MissionView;
use planner_core::{field, roadmap};

impl Store {
    /// Progress of the upload, if there is one.
    pub fn upload(&self) -> Option<UploadState> {
        self.upload.map(|(_, state)| state)
    }

    /// Begins an upload; one under way is given up. Pieces are taken once [`Self::upload`] says so.
    ///
    /// # Errors
    /// [`UploadError::Armed`] or [`UploadError::Waiting`].
    pub fn open(&mut self, file: File, erasing: Erasing) -> Result<(), UploadError> {
        if self.upload() == Some(UploadState::Closing) {
            return Err(UploadError::Waiting);
        }
        self.abandon();
        if self.layout.stalls && erasing == Erasing::Forbidden {
            return Err(UploadError::Armed);
        }
        if file != File::Mission {
            let slot = self.target().ok_or(UploadError::Waiting)?;
            if self.slots[slot] != Condition::Clean && erasing == Erasing::Forbidden {
                return Err(UploadError::Armed);
            }
            self.erasure_failed = false;
        }
        self.window.reset();
        let state = if file == File::Mission { UploadState::Taking } else { UploadState::Opening };
        self.upload = Some((file, state));
        Ok(())
    }

    /// Takes a piece of the file.
    pub fn take(&mut self, offset: u32, piece: &[u8]) -> Taken {
        match self.upload {
            Some((File::Mission, UploadState::Taking)) => self.window.take(offset, piece, WINDOW_LEN as u32),
            Some((File::Roadmap | File::Field, UploadState::Taking)) => {
                self.window.take(offset, piece, self.layout.slot_len - DATA_OFFSET)
            }
            _ => Taken::Later,
        }
    }

    /// All was sent: the file is to be checked and kept. [`Self::upload`] says when that has ended.
    pub fn close(&mut self) {
        let Some((file, UploadState::Taking)) = self.upload else { return };
        let state = match (file, self.window.rest()) {
            (_, Some([])) => UploadState::Ended(Err(UploadError::Damaged)),
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
            self.end(result);
        }
    }

    /// Gives an upload up, unless all of it was sent: then it is kept.
    pub fn abandon(&mut self) {
        if !matches!(self.upload, Some((_, UploadState::Closing))) {
            self.drop_job();
            self.clear_slot();
            self.upload = None;
        }
    }

    pub(super) fn end(&mut self, result: Result<(), UploadError>) {
        if let Some((file, _)) = self.upload {
            self.upload = Some((file, UploadState::Ended(result)));
        }
        if result.is_err() {
            self.clear_slot();
        }
    }

    /// A slot that was being written is to be erased before it is written again.
    fn clear_slot(&mut self) {
        for slot in &mut self.slots {
            if *slot == Condition::Open {
                *slot = Condition::Dirty;
            }
        }
    }

    /// The slot that may be written: not in use, and not the newest.
    pub(super) fn target(&self) -> Option<usize> {
        let newest = self.newest();
        (0..2).find(|i| Some(*i) != self.in_use && Some(*i) != newest)
    }

    /// The slot that is being written.
    pub(super) fn open_slot(&self) -> Option<Area> {
        self.slots.iter().position(|slot| *slot == Condition::Open).map(Area::Slot)
    }

    /// Whether the first bytes are those of a roadmap file, or a field, of this length that can be read.
    pub(super) fn declares(field: bool, bytes: &[u8], len: u32) -> bool {
        let declared = match field {
            true => bytes.first_chunk().and_then(|head| field::declared_len(head).ok()),
            false => bytes.first_chunk().and_then(|head| roadmap::declared_len(head).ok()),
        };
        declared == Some(len as usize)
    }
}
