//! Test doubles for the companion: a scripted autopilot, and a simulated flash whose words tear at
//! a power loss.

pub mod fake_autopilot;
pub mod fake_flash;
