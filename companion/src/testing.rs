//! What the tests fly against: a scripted autopilot, and a flash whose words tear.

pub mod fake_autopilot;
pub mod fake_flash;
