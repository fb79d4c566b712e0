//! What was flown, judged and shown after the flight: pictures of a coverage mission, those kept
//! from flight to flight, and the report page.

pub mod layers;
pub mod page;
pub mod picture_store;
pub mod pictures;
