//! The pictures of earlier flights of a mission, beside the flashes of its companions.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use planner_core::Point;

use super::check::Picture;
use crate::files::{self, ResultFiles};
use crate::quote::quoted_path;

/// File that keeps the pictures taken.
const NAME: &str = "pictures.json";

/// Time, place and heading of a picture.
type PictureRow = [f32; 5];

/// Store of the pictures.
pub struct PictureStore {
    path: PathBuf,
    before: Vec<Picture>,
}

impl PictureStore {
    /// Reads those of earlier flights from a directory, if there were any.
    ///
    /// # Errors
    /// The file cannot be read, or is none of these.
    pub fn open(dir: &Path) -> anyhow::Result<Self> {
        let path = dir.join(NAME);
        let mut before = Vec::new();
        if path.exists() {
            let bad = || format!("no pictures of earlier flights: {}", quoted_path(&path));
            let text = files::read(&path, files::BINARY_BYTES).with_context(bad)?;
            let rows: Vec<PictureRow> = serde_json::from_slice(&text).with_context(bad)?;
            // Before this flight began.
            let picture = |[_, x, y, z, heading]: PictureRow| Picture {
                vehicle: None,
                t_s: 0.0,
                position: Point::new(x, y, z),
                heading,
            };
            before = rows.into_iter().map(picture).collect();
        }
        Ok(Self { path, before })
    }

    /// Adds those of earlier flights.
    pub fn add_to(&self, pictures: &mut Vec<Picture>) {
        pictures.splice(..0, self.before.iter().copied());
    }

    /// Keeps all pictures for the next flight; none where the area is whole, which is begun again
    /// then.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn store_pictures(&self, pictures: &[Picture], whole: bool) -> anyhow::Result<()> {
        let pictures = if whole { &[] } else { pictures };
        let row = |p: &Picture| -> PictureRow {
            [p.t_s, p.position.x, p.position.y, p.position.z, p.heading]
        };
        let rows: Vec<PictureRow> = pictures.iter().map(row).collect();
        let mut results = ResultFiles::single_file(&self.path)?;
        results.add_file(&self.path, &serde_json::to_vec(&rows)?)?;
        results.commit()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_back_until_the_area_is_whole() {
        let dir = tempfile::tempdir().unwrap();
        let picture =
            Picture { vehicle: None, t_s: 7.0, position: Point::new(1.0, 2.0, 3.0), heading: 0.5 };
        PictureStore::open(dir.path()).unwrap().store_pictures(&[picture], false).unwrap();
        let mut pictures = vec![Picture { t_s: 1.0, ..picture }];
        let kept = PictureStore::open(dir.path()).unwrap();
        kept.add_to(&mut pictures);
        assert_eq!(pictures, [Picture { t_s: 0.0, ..picture }, Picture { t_s: 1.0, ..picture }]);
        kept.store_pictures(&pictures, true).unwrap();
        assert!(PictureStore::open(dir.path()).unwrap().before.is_empty());
        std::fs::write(dir.path().join(NAME), "[[1, 2]]").unwrap();
        assert!(PictureStore::open(dir.path()).is_err());
    }
}
