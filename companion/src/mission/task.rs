//! What a task asks for beside its path: where the vehicle looks, and what the autopilot is
//! commanded on the way.
//!
//! The path is flown the same whatever the task is. A kind of task has a file here, an arm in each
//! function below, and a variant of [`planner_core::flight::Task`].

mod along;
mod camera;

use planner_core::flight::{Path, Task};

pub(crate) use self::along::{PathProgress, PathRelation};
use self::camera::CameraControl;
use crate::autopilot::telemetry::Ack;
use crate::link::Links;
use crate::time::Instant;

/// State of the tasks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tasks {
    camera: CameraControl,
}

impl Tasks {
    /// Forgets a former plan.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }

    /// Sends the task's commands that are due at this place of the path.
    pub(crate) fn step<const W: usize>(
        &mut self,
        task: &Task,
        path: &Path<W>,
        along: PathProgress,
        now: Instant,
        links: &mut Links,
    ) {
        match task {
            Task::Stay | Task::Goto(_) => {}
            Task::Photograph(photographs) => self.camera.step(photographs, path, along, now, links),
        }
    }

    /// Takes the autopilot's answer to a command.
    pub(crate) fn handle_ack(&mut self, ack: &Ack, links: &mut Links) {
        self.camera.handle_ack(ack, links);
    }
}

/// Heading of the vehicle `along_m` metres along its path, radians from east to the left; any
/// heading where absent.
pub(crate) fn heading<const W: usize>(task: &Task, path: &Path<W>, along_m: f32) -> Option<f32> {
    match task {
        Task::Stay | Task::Goto(_) => None,
        Task::Photograph(photographs) => camera::heading(photographs, path, along_m),
    }
}
