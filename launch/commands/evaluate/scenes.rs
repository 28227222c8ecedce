//! The scenes that are named on the command line, and why some of them cannot be evaluated.

use std::path::{Path, PathBuf};

use capture::Source;
use serde::Serialize;

use crate::Failure;
use crate::graph::Graph;

/// A scene: where it comes from, opened only when it is its turn.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) is_rendered: bool,
    /// Which scan of its source shows it.
    pub(crate) scan: u64,
    spec: String,
}

/// A scene that cannot be evaluated.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Skipped {
    pub(crate) name: String,
    pub(crate) why: String,
}

impl Scene {
    /// Opens its source, and reads the true disparities of a view.
    pub(crate) fn open(&self, graph: &Graph, view: usize) -> Result<(Source, Vec<f32>), Failure> {
        let source = open(graph, &self.spec).map_err(Failure::failed)?;
        let truth = source.truth(self.scan, view).map_err(Failure::failed)?;
        match truth {
            Some(truth) => Ok((source, truth.disparity)),
            None => Err(Failure::failed(format!("{}: its truth is gone", self.name))),
        }
    }

    /// Opens its source.
    pub(crate) fn source(&self, graph: &Graph) -> Result<Source, Failure> {
        open(graph, &self.spec).map_err(Failure::failed)
    }
}

/// The scenes of these sources: of a folder of folders one each. What cannot be read or has no truth for the view is
/// left out, and said.
///
/// # Errors
/// When nothing is left.
pub(crate) fn with_truth(
    graph: &Graph,
    sources: &[String],
    view: usize,
) -> Result<(Vec<Scene>, Vec<Skipped>), Failure> {
    let (mut scenes, mut skipped) = all(graph, sources);
    scenes.retain(|(scene, source)| {
        let views = source.view_count();
        let is_known = |view: usize| source.knows_truth(view);
        if is_known(view) {
            return true;
        }
        let known = (0..views).find(|view| is_known(*view));
        let why = match known.and_then(|view| ["left", "centre", "right"].get(view)) {
            Some(other) => {
                format!("the truth of its reference view is not known; that of its {other} view is")
            }
            None => "no truth is known of these views".to_owned(),
        };
        skipped.push(Skipped {
            name: scene.name.clone(),
            why,
        });
        false
    });
    let scenes: Vec<Scene> = scenes.into_iter().map(|(scene, _)| scene).collect();
    nothing_left(&scenes, &skipped)?;
    Ok((scenes, skipped))
}

/// The scenes of these sources, with or without truth.
///
/// # Errors
/// When nothing is left.
pub(crate) fn with_images(
    graph: &Graph,
    sources: &[String],
) -> Result<(Vec<Scene>, Vec<Skipped>), Failure> {
    let (scenes, skipped) = all(graph, sources);
    let scenes: Vec<Scene> = scenes.into_iter().map(|(scene, _)| scene).collect();
    nothing_left(&scenes, &skipped)?;
    Ok((scenes, skipped))
}

fn nothing_left(scenes: &[Scene], skipped: &[Skipped]) -> Result<(), Failure> {
    match (scenes, skipped) {
        ([], []) => Err(Failure::usage("there are no scenes")),
        ([], [Skipped { name, why }, ..]) => {
            Err(Failure::failed(format!("no scene is left: {name}: {why}")))
        }
        _ => Ok(()),
    }
}

fn all(graph: &Graph, sources: &[String]) -> (Vec<(Scene, Source)>, Vec<Skipped>) {
    let (mut scenes, mut skipped) = (Vec::new(), Vec::new());
    for spec in sources {
        let is_rendered = spec.starts_with("scene:");
        let mut add = |spec: &str, opened: Result<Source, String>| match opened {
            Ok(_) => {}
            Err(why) => skipped.push(Skipped {
                name: name(spec),
                why,
            }),
        };
        let whole = open(graph, spec);
        let inner = if is_rendered {
            Vec::new()
        } else {
            folders(Path::new(spec))
        };
        match whole {
            Ok(source) if is_rendered || source.scenes() == 1 => {
                for scan in 0..source.scenes() {
                    let scene = Scene {
                        name: source.name(scan).to_owned(),
                        is_rendered,
                        scan,
                        spec: spec.clone(),
                    };
                    if let Ok(again) = open(graph, spec) {
                        scenes.push((scene, again));
                    }
                }
            }
            whole if inner.is_empty() => add(spec, whole),
            _ => {
                for folder in inner {
                    let spec = folder.display().to_string();
                    match open(graph, &spec) {
                        Ok(source) => {
                            let scene = Scene {
                                name: source.name(0).to_owned(),
                                is_rendered,
                                scan: 0,
                                spec,
                            };
                            scenes.push((scene, source));
                        }
                        failed => add(&spec, failed),
                    }
                }
            }
        }
    }
    (scenes, skipped)
}

fn open(graph: &Graph, spec: &str) -> Result<Source, String> {
    let mut settings = graph.settings_of("capture").clone();
    settings["source"] = spec.into();
    let settings = serde_json::from_value(settings).map_err(|error| error.to_string())?;
    let source = Source::open(&settings).map_err(|error| error.to_string())?;
    match source.view_count() {
        3 => Ok(source),
        count => Err(format!("three views are matched, not {count}")),
    }
}

/// The folders in a folder, by name.
fn folders(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_shown = |path: &PathBuf| !name(&path.display().to_string()).starts_with('.');
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_shown).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    folders
}

fn name(spec: &str) -> String {
    let last = Path::new(spec).file_name();
    last.map_or(spec.to_owned(), |name| name.to_string_lossy().into_owned())
}
