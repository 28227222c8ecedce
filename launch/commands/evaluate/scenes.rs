//! The scenes that are named on the command line, and why some of them cannot be evaluated.

use std::path::{Path, PathBuf};

use capture::{Layout, Source, SourceError};
use serde::Serialize;

use crate::graph::Graph;
use crate::{Failure, Outcome, look};

/// A scene: where it comes from, opened only when it is its turn.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) is_rendered: bool,
    /// Which scan of its source shows it.
    pub(crate) scan: u64,
    /// How many views are chosen.
    pub(crate) views: usize,
    spec: String,
    /// The chosen views whose true disparities are known.
    known: Vec<usize>,
}

/// A scene that cannot be evaluated.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Skipped {
    pub(crate) name: String,
    pub(crate) why: String,
    /// Whether it was asked for in a way that cannot be.
    #[serde(skip)]
    pub(crate) is_wrong_use: bool,
    /// Whether there is something that could not be read.
    #[serde(skip)]
    pub(crate) is_lost: bool,
}

impl Scene {
    /// Opens its source, and reads the true disparities of a view.
    pub(crate) fn open(&self, graph: &Graph, view: usize) -> Result<(Source, Vec<f32>), Failure> {
        let source = open(graph, &self.spec)?;
        let truth = source.truth(self.scan, view).map_err(Failure::failed)?;
        match truth {
            Some(truth) => Ok((source, truth.disparity)),
            None => Err(Failure::failed(format!("{}: its truth is gone", self.name))),
        }
    }

    /// Index of the first view whose truth is known.
    pub(crate) fn first_known(&self) -> Option<usize> {
        self.known.first().copied()
    }

    /// Why it cannot be compared with the truth.
    fn lacks_truth(&self) -> String {
        let names = ["left", "centre", "right"];
        let name = |&view: &usize| match names.get(view).filter(|_| self.views == 3) {
            Some(name) => (format!("the {name} view"), (*name).to_owned()),
            None => (format!("view {view}"), view.to_string()),
        };
        match self.known.first().map(name) {
            Some((other, name)) => format!(
                "the truth of the reference view is not known, that of {other} is: --reference {name}"
            ),
            None => "no truth is known of these views".to_owned(),
        }
    }

    /// Says what a look at its views finds, which cannot be told from its figures.
    pub(crate) fn say_look(&self, graph: &Graph, source: &mut Source) {
        if !self.is_rendered {
            look::say(source, self.scan, graph, &self.name);
        }
    }

    /// Opens its source.
    pub(crate) fn source(&self, graph: &Graph) -> Result<Source, Failure> {
        open(graph, &self.spec)
    }
}

/// The scenes of these sources: of a folder of folders one each. What cannot be read or has no truth for the view it is
/// asked for is left out, and said.
///
/// # Errors
/// When nothing is left.
pub(crate) fn with_truth(
    graph: &Graph,
    sources: &[String],
    view: impl Fn(&Scene) -> Result<usize, Failure>,
) -> Result<(Vec<Scene>, Vec<Skipped>), Failure> {
    let (mut scenes, mut skipped) = all(graph, sources);
    scenes.retain(|scene| {
        let (is_wrong_use, why) = match view(scene) {
            Ok(view) if scene.known.contains(&view) => return true,
            Ok(_) => (false, scene.lacks_truth()),
            Err(failure) => (failure.outcome == Outcome::Usage, failure.text),
        };
        skipped.push(Skipped {
            name: scene.name.clone(),
            why,
            is_wrong_use,
            is_lost: false,
        });
        false
    });
    nothing_left(scenes.len(), &skipped)?;
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
    nothing_left(scenes.len(), &skipped)?;
    Ok((scenes, skipped))
}

/// Says why, when there are none.
pub(super) fn nothing_left(scenes: usize, skipped: &[Skipped]) -> Result<(), Failure> {
    match (scenes, skipped.first()) {
        (0, None) => Err(Failure::usage("there are no scenes")),
        (0, Some(_)) => {
            let why = |skipped: &Skipped| format!("{}: {}", skipped.name, skipped.why);
            let whys = skipped
                .iter()
                .take(3)
                .map(why)
                .collect::<Vec<_>>()
                .join("; ");
            let text = format!("no scene is left: {whys}");
            Err(match skipped.iter().all(|skipped| skipped.is_wrong_use) {
                true => Failure::usage(text),
                false => Failure::failed(text),
            })
        }
        _ => Ok(()),
    }
}

fn all(graph: &Graph, sources: &[String]) -> (Vec<Scene>, Vec<Skipped>) {
    let (mut scenes, mut skipped) = (Vec::new(), Vec::new());
    let mut take_in = |spec: &str, source: Result<Source, Failure>| match source {
        Ok(source) => {
            let known = (0..source.view_count()).filter(|view| source.knows_truth(*view));
            let known: Vec<usize> = known.collect();
            scenes.extend((0..source.scenes()).map(|scan| Scene {
                name: source.name(scan).to_owned(),
                is_rendered: is_rendered(spec),
                scan,
                views: source.view_count(),
                spec: spec.to_owned(),
                known: known.clone(),
            }));
        }
        Err(error) => skipped.push(Skipped {
            name: name(spec),
            is_wrong_use: error.outcome == Outcome::Usage,
            is_lost: error.outcome != Outcome::Usage,
            why: error.text,
        }),
    };
    for spec in sources {
        let whole = read(graph, spec);
        match parts(spec, &whole).as_slice() {
            [] => take_in(spec, whole.and_then(checked)),
            parts => parts
                .iter()
                .for_each(|part| take_in(part, open(graph, part))),
        }
    }
    (scenes, skipped)
}

fn is_rendered(spec: &str) -> bool {
    spec.starts_with("scene:")
}

/// What a source is opened as by parts: of a folder of scenes each by itself, so that one that is wrong does not spoil the
/// others. None, where it is one source.
fn parts(spec: &str, whole: &Result<Result<Source, SourceError>, Failure>) -> Vec<String> {
    // Only where each folder is a scene of its own; what is wrong with one of them must not spoil the others.
    let is_one = match whole {
        _ if is_rendered(spec) => true,
        Ok(Ok(source)) => source.scenes() == 1 || source.layout() != Some(Layout::Times),
        Ok(Err(error)) => error.is_of_layout(),
        Err(_) => true,
    };
    let folders = match is_one {
        true => Vec::new(),
        false => folders(Path::new(spec)),
    };
    let spec = |folder: &PathBuf| folder.display().to_string();
    folders.iter().map(spec).collect()
}

fn settings_of(graph: &Graph, spec: &str) -> Result<capture::Settings, Failure> {
    let mut settings = graph.settings_of("capture").clone();
    settings["source"] = spec.into();
    serde_json::from_value(settings).map_err(Failure::usage)
}

fn open(graph: &Graph, spec: &str) -> Result<Source, Failure> {
    read(graph, spec).and_then(checked)
}

/// Opens a source that can be read more than once.
fn read(graph: &Graph, spec: &str) -> Result<Result<Source, SourceError>, Failure> {
    if spec.starts_with("camera:") {
        return Err(Failure::usage(SourceError::SentOnce));
    }
    Ok(Source::open(&settings_of(graph, spec)?))
}

/// A source of scenes that can be compared.
fn checked(source: Result<Source, SourceError>) -> Result<Source, Failure> {
    let source = source.map_err(|error| match error.is_wrong_use() {
        true => Failure::usage(error),
        false => Failure::failed(error),
    })?;
    match source.view_count() {
        0..3 => Err(Failure::usage(
            "scenes of three views or more are compared here, and a rail's frames are not: `run` the rail with each setting, which evaluates it (topic evaluation) where the truth is known",
        )),
        _ => Ok(source),
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
