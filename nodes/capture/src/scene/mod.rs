//! Rendered scenes, without a file on disk: three machine parts, and a fence of all that repeats, seen by a camera on a
//! rail; and the three as the thesis photographed them.
//!
//! Everything that is seen belongs to a surface's point and not to who looks: textures, shadows and sheen agree in all
//! views, and the true disparity of a pixel is that of the point its middle sees.

mod contour;
mod fence;
mod jack;
mod lettering;
mod paint;
mod render;
mod screwdriver;
mod solid;
mod tab;
mod thesis;

use std::sync::OnceLock;

use messages::{Contour, Size};

use crate::camera_info::Known;
use crate::truth::Truth;
use render::{CENTRE, Scene};

/// Size of every rendered picture.
pub(crate) const SIZE: Size = render::SIZE;

/// What a rendered scene shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Object {
    Tab,
    Jack,
    Screwdriver,
    Fence,
    /// One of the three as the thesis photographed it.
    Thesis {
        object: thesis::Object,
        is_misaligned: bool,
    },
}

impl Object {
    /// Those of `scene:all`.
    const ALL: [Self; 4] = [Self::Tab, Self::Jack, Self::Screwdriver, Self::Fence];

    /// Those of `scene:thesis`.
    const THESIS: [Self; 3] = Self::photographs(false);

    /// Those of `scene:thesis-misaligned`.
    const MISALIGNED: [Self; 3] = Self::photographs(true);

    const fn photographs(is_misaligned: bool) -> [Self; 3] {
        [
            Self::Thesis {
                object: thesis::Object::Tab,
                is_misaligned,
            },
            Self::Thesis {
                object: thesis::Object::Jack,
                is_misaligned,
            },
            Self::Thesis {
                object: thesis::Object::Screwdriver,
                is_misaligned,
            },
        ]
    }

    pub(crate) const fn name(self) -> &'static str {
        use thesis::Object::{Jack, Screwdriver, Tab};
        match self {
            Self::Tab => "tab",
            Self::Jack => "jack",
            Self::Screwdriver => "screwdriver",
            Self::Fence => "fence",
            Self::Thesis {
                object,
                is_misaligned,
            } => match (object, is_misaligned) {
                (Tab, false) => "thesis-tab",
                (Jack, false) => "thesis-jack",
                (Screwdriver, false) => "thesis-screwdriver",
                (Tab, true) => "thesis-tab-misaligned",
                (Jack, true) => "thesis-jack-misaligned",
                (Screwdriver, true) => "thesis-screwdriver-misaligned",
            },
        }
    }

    /// What is meant by the name of a rendered source; nothing where there is none of this name.
    pub(crate) fn named(name: &str) -> Vec<Self> {
        match name {
            "all" => Self::ALL.to_vec(),
            "thesis" => Self::THESIS.to_vec(),
            "thesis-misaligned" => Self::MISALIGNED.to_vec(),
            _ => Self::each()
                .filter(|object| object.name() == name)
                .collect(),
        }
    }

    fn each() -> impl Iterator<Item = Self> {
        (Self::ALL.into_iter())
            .chain(Self::THESIS)
            .chain(Self::MISALIGNED)
    }

    /// The names of all rendered sources.
    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        let several = ["all", "thesis", "thesis-misaligned"];
        Self::each().map(Self::name).chain(several)
    }

    /// How many positions the camera has.
    pub(crate) const fn positions(self) -> usize {
        match self {
            Self::Thesis { .. } => thesis::POSITIONS,
            _ => 5,
        }
    }

    /// The camera, for views so many steps apart.
    pub(crate) fn camera(self, step: f64) -> Known {
        let (focal, step_mm) = match self {
            Self::Thesis { .. } => (thesis::FOCAL, thesis::STEP),
            _ => (render::FOCAL, render::STEP),
        };
        Known {
            focal_px: Some(focal.into()),
            cx: Some(CENTRE[0].into()),
            cy: Some(CENTRE[1].into()),
            baseline_m: Some(f64::from(step_mm) * step / 1000.0),
            is_distorted: false,
        }
    }

    fn scene(self) -> Scene {
        match self {
            Self::Tab => tab::scene(),
            Self::Jack => jack::scene(),
            Self::Screwdriver => screwdriver::scene(),
            Self::Fence => fence::scene(),
            Self::Thesis {
                object,
                is_misaligned,
            } => thesis::scene(object, is_misaligned),
        }
    }
}

/// A scene and its pictures, made when they are first looked at.
#[derive(Debug)]
pub(crate) struct Rendered {
    pub(crate) object: Object,
    /// The chosen positions.
    pub(crate) positions: Vec<u32>,
    scene: OnceLock<Scene>,
    pictures: Vec<OnceLock<Vec<u16>>>,
}

impl Rendered {
    pub(crate) fn new(object: Object, positions: &[u32]) -> Self {
        Self {
            object,
            positions: positions.to_vec(),
            scene: OnceLock::new(),
            pictures: positions.iter().map(|_| OnceLock::new()).collect(),
        }
    }

    fn scene(&self) -> &Scene {
        self.scene.get_or_init(|| self.object.scene())
    }

    /// The noise-free picture of a chosen view, in 256ths of a gray level.
    pub(crate) fn picture(&self, view: usize) -> &[u16] {
        self.pictures[view].get_or_init(|| self.scene().picture(self.positions[view] as f32))
    }

    pub(crate) fn truth(&self, view: usize) -> Truth {
        self.scene().truth(&self.places(), view)
    }

    /// The true contours of a chosen view, of scenes that show nothing else: textures have none.
    pub(crate) fn contours(&self, view: usize) -> Option<Vec<Contour>> {
        let is_plain = matches!(self.object, Object::Thesis { .. });
        is_plain.then(|| contour::contours(self.scene(), &self.places(), view))
    }

    fn places(&self) -> Vec<f32> {
        let places = self.positions.iter().map(|&position| position as f32);
        places.collect()
    }
}
