//! What a task adds to flying a path: the vehicle's heading, and commands to the autopilot along
//! the path.
//!
//! Every task's path is flown in the same way. A kind of task has a file in `task/`, an arm in each
//! function below, and a variant of [`planner_core::flight::Task`].

mod along;
mod camera;

use planner_core::flight::{Path, Task};

pub(crate) use self::along::{PathProgress, PathRelation};
use self::camera::CameraControl;
use crate::autopilot::telemetry::Ack;
use crate::link::Links;
use crate::time::Instant;
use crate::timers::Timers;

/// State of the commands of the vehicle's task.
#[derive(Clone, Debug, Default)]
pub(crate) struct TaskCommands {
    /// Commands to the camera.
    camera: CameraControl,
}

impl TaskCommands {
    /// Ends the commands of the former plan.
    pub(crate) fn begin_plan(&mut self) {
        self.camera.begin_path();
    }

    /// Queues the task's commands to the autopilot that are due at this place of the path. Returns
    /// whether the vehicle leaves its path at this place, and takes no more pictures.
    pub(crate) fn step<const W: usize>(
        &mut self,
        task: &Task,
        path: &Path<W>,
        along: PathProgress,
    ) -> bool {
        match task {
            Task::Stay | Task::Goto(_) => false,
            Task::Photograph(photographs) => self.camera.step(photographs, path, along),
        }
    }

    /// Sends the first queued command to the autopilot, or repeats it.
    pub(crate) fn send_commands(&mut self, now: Instant, timers: &mut Timers, links: &mut Links) {
        self.camera.send_current_command(now, timers, links);
    }

    /// Handles the autopilot's COMMAND_ACK of a command of the task.
    pub(crate) fn handle_ack(&mut self, ack: &Ack, links: &mut Links) {
        self.camera.handle_ack(ack, links);
    }
}

/// Heading that the task wants `along_m` metres along the path, radians from east,
/// counter-clockwise; `None` if the task wants none.
pub(crate) fn heading<const W: usize>(task: &Task, path: &Path<W>, along_m: f32) -> Option<f32> {
    match task {
        Task::Stay | Task::Goto(_) => None,
        Task::Photograph(photographs) => camera::heading(photographs, path, along_m),
    }
}
