//! The files of a project: templates with `@names@` that are replaced.

use super::words::Words;
use super::{Device, Template};
use crate::cli::error::CliError;
use crate::cli::plant;
use crate::script::DEFINITIONS;
use std::path::Path;

/// Files of every project. The reusable parts for CI servers, `action.yml` and `.gitlab/commram.yml`, come from `tools/ci`, because
/// repositories without such a project can use them, too.
const COMMON: &[(&str, &str)] = &[
    ("scenarios/start.rhai", include_str!("templates/minimal/start.rhai")),
    (".gitignore", include_str!("templates/minimal/gitignore")),
    (".vscode/extensions.json", include_str!("templates/minimal/vscode-extensions.json")),
    (".vscode/settings.json", include_str!("templates/minimal/vscode-settings.json")),
    (".github/actions/commram/action.yml", include_str!("../../../tools/ci/action.yml")),
    (".github/workflows/commram.yml", include_str!("templates/minimal/github.yml")),
    (".gitlab/commram.yml", include_str!("../../../tools/ci/gitlab.yml")),
    (".gitlab-ci.yml", include_str!("templates/minimal/gitlab-ci.yml")),
];

/// Additions of a template to the common files.
struct Extra {
    files: &'static [(&'static str, &'static str)],
    /// Files that the commands of the template create, for `.gitignore`.
    ignored: &'static str,
    /// Commands that run the program or test of the template.
    commands: &'static [&'static str],
    ci: Ci,
}

/// Additions of a template to the files for CI servers.
#[derive(Default)]
struct Ci {
    /// Comment that lists further variables of the repository.
    variables: &'static str,
    /// Steps of the workflow for GitHub before the action.
    github_before: &'static str,
    /// Steps of the workflow for GitHub after the action.
    github_after: &'static str,
    /// Another job for GitLab.
    gitlab_job: &'static str,
}

impl Template {
    fn extra(self) -> Extra {
        match self {
            // The files of a device are in `device_files.rs`.
            Template::Minimal | Template::Device => {
                Extra { files: &[], ignored: "", commands: &[], ci: Ci::default() }
            }
            Template::SoftPlcC => Extra {
                files: &[
                    ("soft_plc.c", include_str!("templates/soft-plc-c/soft_plc.c")),
                    ("Makefile", include_str!("templates/soft-plc-c/Makefile")),
                ],
                ignored: "/soft_plc\n/commram.h\n",
                commands: &["make run"],
                ci: Ci {
                    github_after: include_str!("templates/soft-plc-c/github-after.yml"),
                    gitlab_job: include_str!("templates/soft-plc-c/gitlab-job.yml"),
                    ..Ci::default()
                },
            },
            Template::SoftPlcRust => Extra {
                files: &[
                    ("Cargo.toml", include_str!("templates/soft-plc-rust/manifest.toml")),
                    ("src/main.rs", include_str!("templates/soft-plc-rust/main.rs")),
                ],
                ignored: "/target/\n",
                commands: &["cargo build", "commram with plant.toml -- target/debug/soft-plc"],
                ci: Ci {
                    github_after: include_str!("templates/soft-plc-rust/github-after.yml"),
                    gitlab_job: include_str!("templates/soft-plc-rust/gitlab-job.yml"),
                    ..Ci::default()
                },
            },
            Template::Pytest => Extra {
                files: &[
                    ("test_start.py", include_str!("templates/pytest/test_start.py")),
                    ("pytest.ini", include_str!("templates/pytest/pytest.ini")),
                ],
                ignored: "__pycache__/\n.pytest_cache/\n",
                commands: &["pip install pytest \"$COMMRAM_WHEEL\"", "pytest"],
                ci: Ci {
                    variables: "# COMMRAM_WHEEL is the path or the address of the wheel; pip needs its name, \
                                commram-VERSION-cp310-abi3-*.whl.\n",
                    github_before: include_str!("templates/pytest/github-before.yml"),
                    gitlab_job: include_str!("templates/pytest/gitlab-job.yml"),
                    ..Ci::default()
                },
            },
        }
    }
}

impl Ci {
    /// Replaces the names in a text with these additions.
    fn completed(&self, text: String) -> String {
        // With this condition, the action runs the scenarios even if an earlier step of the workflow has failed.
        let condition = if self.github_before.is_empty() { "" } else { "        if: ${{ !cancelled() }}\n" };
        [
            ("@ci_variables@\n", self.variables),
            ("@github_before@\n", self.github_before),
            ("@github_condition@\n", condition),
            ("@github_after@\n", self.github_after),
            ("@gitlab_job@\n", self.gitlab_job),
        ]
        .iter()
        .fold(text, |text, (name, part)| text.replace(name, part))
    }
}

/// A project for a device.
pub(super) struct Project {
    device: Device,
    extra: Extra,
    words: Words,
}

impl Project {
    /// # Errors
    /// The plant of the device is refused.
    pub(super) fn new(device: Device, template: Template) -> Result<Self, CliError> {
        Ok(Project { device, extra: template.extra(), words: Words::new(device)? })
    }

    /// Returns the paths of the files in the project, and their texts.
    pub(super) fn files(&self) -> Vec<(&'static str, String)> {
        let own = [
            ("plant.toml", plant::with_schema(self.device.plant)),
            (plant::SCHEMA, plant::schema()),
            (".rhai/definitions/commram.d.rhai", DEFINITIONS.to_owned()),
        ];
        let rendered =
            COMMON.iter().chain(self.extra.files).map(|(path, text)| (*path, self.rendered(path, text)));
        own.into_iter().chain(rendered).collect()
    }

    fn rendered(&self, path: &str, text: &str) -> String {
        let text = self.words.replaced(text);
        match path {
            ".gitignore" => text + self.extra.ignored,
            ".github/workflows/commram.yml" | ".gitlab-ci.yml" => self.extra.ci.completed(text),
            _ => text,
        }
    }

    /// Returns the next commands for the user, one per line.
    pub(super) fn commands(&self, directory: &Path) -> String {
        let to = format!("cd {}", quoted(&directory.display().to_string()));
        let all = [to.as_str(), "commram plant check plant.toml", "commram test scenarios"];
        all.iter().chain(self.extra.commands).map(|line| format!("  {line}\n")).collect()
    }
}

/// Quotes a word for a shell.
pub(super) fn quoted(word: &str) -> String {
    let plain = |sign: char| sign.is_ascii_alphanumeric() || "/._-".contains(sign);
    if word.chars().all(plain) && !word.starts_with('-') {
        return word.to_owned();
    }
    format!("-- '{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;
    use clap::ValueEnum;

    #[test]
    fn every_device_has_projects_without_unreplaced_names() {
        for known in devices::all() {
            let Some(device) = Device::of(known) else { panic!("{} has no project", known.layout.name) };
            for template in Template::value_variants() {
                let project = Project::new(device, *template).unwrap();
                for (path, text) in project.files() {
                    let name = text.split('@').skip(1).step_by(2).find(|it| {
                        !it.is_empty() && it.chars().all(|sign| sign.is_ascii_lowercase() || sign == '_')
                    });
                    assert_eq!(name, None, "{}: {path}\n{text}", known.layout.name);
                }
            }
        }
    }

    #[test]
    fn directories_are_quoted_for_the_shell() {
        assert_eq!(quoted("a/b-1.x"), "a/b-1.x");
        assert_eq!(quoted("a b's"), "-- 'a b'\\''s'");
        assert_eq!(quoted("-x"), "-- '-x'");
    }
}
