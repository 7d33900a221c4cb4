//! Project on the board: the loaded project, and the project in the flash memory (manual 5.00005.03a p. 37, 40).

use crate::memory::header::Project;
use serde::{Deserialize, Serialize};

/// Content of the flash memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Flash {
    Empty,
    /// A boot project, which the board loads at power-on.
    Boot,
    /// A process has loaded its program, which counts as a boot project. It is deleted when the process ends
    /// (decision D-302).
    OfProcess,
}

/// The loaded project, and the project that is loaded after power-off and reset.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Projects {
    loaded: Project,
    flash: Flash,
    /// True if the next start must be a cold start, because the loaded project is new.
    cold: bool,
    /// True if the first start of the boot project must be a cold start, because the boot project is new.
    boot_cold: bool,
    /// True if a project was lost that was sent, but was not a boot project.
    lost: bool,
}

impl Projects {
    /// Returns the projects at the first power-on.
    pub(crate) fn new(loaded: Project) -> Self {
        let flash = if loaded == Project::Boot { Flash::Boot } else { Flash::Empty };
        Projects { loaded, flash, cold: true, boot_cold: true, lost: false }
    }

    /// Returns the loaded project.
    pub(crate) fn loaded(&self) -> Project {
        self.loaded
    }

    /// True if the next start must be a cold start.
    pub(crate) fn starts_cold(&self) -> bool {
        self.cold
    }

    /// True if a project was lost that was sent, but was not a boot project. Its client may still report
    /// states until another project is loaded.
    pub(crate) fn is_lost(&self) -> bool {
        self.lost
    }

    /// Called if NOVRAM has kept the retain flags of the boot project, so the project is not new.
    pub(crate) fn retain_was_kept(&mut self) {
        self.boot_cold = false;
        self.cold = self.loaded == Project::Sent;
    }

    /// Called when a cold start was ordered.
    pub(crate) fn started_cold(&mut self) {
        self.cold = false;
        if self.loaded == Project::Boot {
            self.boot_cold = false;
        }
    }

    /// Called when a client loads a project or deletes the loaded project. The boot project in the flash
    /// memory does not change (p. 38).
    pub(crate) fn load(&mut self, project: Project) {
        if project == Project::Boot {
            (self.flash, self.boot_cold) = (Flash::Boot, true);
        }
        (self.loaded, self.cold, self.lost) = (project, true, false);
    }

    /// Called when a process has loaded its program, which counts as a boot project.
    pub(crate) fn brought(&mut self) {
        if self.flash == Flash::Empty {
            self.flash = Flash::OfProcess;
        }
        (self.loaded, self.lost) = (Project::Boot, false);
    }

    /// Called when the process has withdrawn its program. Any next project is then a new project.
    pub(crate) fn taken_back(&mut self) {
        if self.flash == Flash::OfProcess {
            self.flash = Flash::Empty;
            self.boot_cold = true;
        }
        (self.loaded, self.cold) = (Project::None, true);
    }

    /// Called when the boot project is erased from the flash memory. The loaded project remains until
    /// power-off or reset.
    pub(crate) fn erased(&mut self) {
        self.flash = Flash::Empty;
        if self.loaded == Project::Boot {
            self.loaded = Project::Sent;
        }
    }

    /// Called when a boot project was copied to the flash memory. The next power-on or reset loads it.
    pub(crate) fn copied(&mut self) {
        (self.flash, self.boot_cold) = (Flash::Boot, true);
    }

    /// Called at power-on or at the end of a reset. Only the boot project is loaded then (p. 37).
    pub(crate) fn restart(&mut self) {
        if self.flash != Flash::Empty {
            (self.loaded, self.cold, self.lost) = (Project::Boot, self.boot_cold, false);
        } else if self.loaded == Project::Sent {
            (self.loaded, self.cold, self.lost) = (Project::None, true, true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Manual p. 37: after reset or power-off the boot project is active again, even if another project was
    /// sent in the meantime.
    #[test]
    fn only_the_boot_project_comes_back() {
        let mut projects = Projects::new(Project::Boot);
        projects.started_cold();
        projects.load(Project::Sent);
        assert_eq!((projects.loaded(), projects.starts_cold()), (Project::Sent, true));
        projects.restart();
        assert_eq!(
            (projects.loaded(), projects.starts_cold()),
            (Project::Boot, false),
            "the project is not new"
        );
        projects.load(Project::None);
        assert_eq!(projects.loaded(), Project::None);
        projects.restart();
        assert_eq!(projects.loaded(), Project::Boot, "p. 38: Reset does not delete the boot project");

        let mut projects = Projects::new(Project::Sent);
        projects.restart();
        assert_eq!((projects.loaded(), projects.is_lost()), (Project::None, true));
        projects.load(Project::Sent);
        assert!(!projects.is_lost());
    }

    #[test]
    fn a_boot_project_can_be_copied_and_erased() {
        let mut projects = Projects::new(Project::None);
        projects.copied();
        assert_eq!(projects.loaded(), Project::None);
        projects.restart();
        assert_eq!((projects.loaded(), projects.starts_cold()), (Project::Boot, true));
        projects.erased();
        assert_eq!(projects.loaded(), Project::Sent, "the loaded project stays");
        projects.restart();
        assert_eq!(projects.loaded(), Project::None);
    }

    #[test]
    fn a_process_takes_its_project_along() {
        let mut projects = Projects::new(Project::None);
        projects.retain_was_kept();
        projects.brought();
        assert_eq!((projects.loaded(), projects.starts_cold()), (Project::Boot, false));
        projects.restart();
        assert_eq!(projects.loaded(), Project::Boot);
        projects.taken_back();
        assert_eq!((projects.loaded(), projects.starts_cold()), (Project::None, true));
        projects.restart();
        assert_eq!(projects.loaded(), Project::None);
    }
}
