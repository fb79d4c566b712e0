//! Keeps the pictures of earlier flights of a mission in a file beside the flash images of its
//! companions, so that coverage is judged over all flights.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use planner_core::Point;

use crate::coverage::check::Picture;
use crate::files::{self, ResultFiles};
use crate::quote::printable_path;

/// Name of the file with the pictures taken so far.
const FILE_NAME: &str = "pictures.json";

/// One picture in the file: time in its flight, seconds, which readers ignore; east, north and up,
/// metres; heading, radians counterclockwise from east.
type PictureRow = [f32; 5];

/// The file of pictures, and the pictures that earlier flights left in it.
pub struct PictureStore {
    /// Path of the file.
    path: PathBuf,
    /// The pictures of earlier flights.
    earlier_pictures: Vec<Picture>,
}

impl PictureStore {
    /// Reads the pictures of earlier flights from a directory; none if the file does not exist.
    ///
    /// # Errors
    /// The file cannot be read, or holds no list of pictures.
    pub fn open(dir: &Path) -> anyhow::Result<Self> {
        let path = dir.join(FILE_NAME);
        let mut earlier_pictures = Vec::new();
        if path.exists() {
            let bad = || format!("no pictures of earlier flights: {}", printable_path(&path));
            let text = files::read(&path, files::MAX_BINARY_BYTES).with_context(bad)?;
            let rows: Vec<PictureRow> = serde_json::from_slice(&text).with_context(bad)?;
            // Pictures of earlier flights count as taken at time 0, before this flight.
            let picture = |[_, x, y, z, heading]: PictureRow| Picture {
                vehicle: None,
                t_s: 0.0,
                position: Point::new(x, y, z),
                yaw_enu_rad: heading,
            };
            earlier_pictures = rows.into_iter().map(picture).collect();
        }
        Ok(Self { path, earlier_pictures })
    }

    /// Inserts the pictures of earlier flights before those of this flight, which continued them. A
    /// flight may continue even if the earlier pictures already show the whole area: a companion's
    /// journal may be some waypoints behind.
    pub fn prepend_earlier_to(&self, pictures: &mut Vec<Picture>) {
        pictures.splice(..0, self.earlier_pictures.iter().copied());
    }

    /// Writes all pictures to the file for the next flight.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn store_pictures(&self, pictures: &[Picture]) -> anyhow::Result<()> {
        let row = |p: &Picture| -> PictureRow {
            [p.t_s, p.position.x, p.position.y, p.position.z, p.yaw_enu_rad]
        };
        let rows: Vec<PictureRow> = pictures.iter().map(row).collect();
        let mut results = ResultFiles::single_file(&self.path)?;
        results.add_file(&self.path, &serde_json::to_vec(&rows)?)?;
        results.commit()
    }
}

#[cfg(test)]
mod tests;
