//! `scene.json`: which files of a folder are views, where they stand, and what is known of their disparities.

use std::path::{Component, Path};

use serde::Deserialize;

use crate::error::SourceError;

/// The file's name.
pub(crate) const FILE: &str = "scene.json";

/// What a `scene.json` says; keys it has beyond these are for people.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Description {
    /// Left to right.
    pub(crate) views: Vec<View>,
    #[serde(default)]
    pub(crate) ground_truth: Vec<GroundTruth>,
    #[serde(default)]
    pub(crate) triples: Vec<Triple>,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct View {
    pub(crate) file: String,
    /// Where it stands along the rail; by default its place in the list.
    pub(crate) position_steps: Option<f64>,
}

/// A picture of 256 times the disparity per one step, in 16 bit, 0 where unknown.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct GroundTruth {
    pub(crate) file: String,
    pub(crate) view: u32,
}

#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Triple {
    pub(crate) views: Vec<u32>,
}

impl Description {
    /// Whether the folder has a `scene.json`.
    pub(crate) fn is_in(folder: &Path) -> bool {
        folder.join(FILE).exists()
    }

    /// Reads the folder's `scene.json`, when it has one.
    pub(crate) fn read(folder: &Path) -> Result<Option<Self>, SourceError> {
        let path = folder.join(FILE);
        let wrong = |why: String| SourceError::Description {
            path: path.clone(),
            why,
        };
        let text = match crate::folder::read_plain(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) if error.kind() == std::io::ErrorKind::InvalidData => {
                return Err(wrong("it is not UTF-8 text".to_owned()));
            }
            text => text.map_err(SourceError::io(&path))?,
        };
        let own: Self = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        let files = own.views.iter().map(|view| &view.file);
        for file in files.chain(own.ground_truth.iter().map(|truth| &truth.file)) {
            if !is_inside(file) {
                return Err(wrong(format!(
                    "it names {file:?}, and files must lie in its own folder"
                )));
            }
        }
        let positions = own.positions();
        if let Some(view) =
            (1..positions.len()).find(|&view| positions[view] <= positions[view - 1])
        {
            let (before, here) = (positions[view - 1], positions[view]);
            return Err(wrong(format!(
                "view {view} stands at {here} and the view before it at {before}, but views go from left to right"
            )));
        }
        let named = own.triples.iter().flat_map(|triple| &triple.views);
        if let Some(view) = named
            .copied()
            .find(|&view| view as usize >= own.views.len())
        {
            let count = own.views.len();
            return Err(wrong(format!(
                "a triple names view {view}, and there are only {count} views"
            )));
        }
        Ok(Some(own))
    }

    /// Where the views stand along the rail, in steps.
    pub(crate) fn positions(&self) -> Vec<f64> {
        let place = |(i, view): (usize, &View)| view.position_steps.unwrap_or(i as f64);
        self.views.iter().enumerate().map(place).collect()
    }
}

/// Whether a path stays inside the folder it starts from.
fn is_inside(file: &str) -> bool {
    !file.is_empty()
        && Path::new(file)
            .components()
            .all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}
