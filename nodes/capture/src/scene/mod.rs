//! Rendered scenes: three machine parts, and a fence of all that repeats, seen by a camera on a rail, without a file on
//! disk.
//!
//! Everything that is seen belongs to a surface's point and not to who looks: textures, shadows and sheen agree in all
//! views, and the true disparity of a pixel is that of the point its middle sees.

mod fence;
mod jack;
mod lettering;
mod paint;
mod render;
mod screwdriver;
mod solid;
mod tab;

use std::sync::OnceLock;

use messages::Size;

use crate::camera_info::Known;
use crate::truth::Truth;
use render::{CENTRE, FOCAL, STEP, Scene};

/// How many positions the rail has.
pub(crate) const POSITIONS: usize = 5;

/// Size of every rendered picture.
pub(crate) const SIZE: Size = render::SIZE;

/// The thesis's three objects, and one that is made to be mistaken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Object {
    Tab,
    Jack,
    Screwdriver,
    Fence,
}

impl Object {
    pub(crate) const ALL: [Self; 4] = [Self::Tab, Self::Jack, Self::Screwdriver, Self::Fence];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Tab => "tab",
            Self::Jack => "jack",
            Self::Screwdriver => "screwdriver",
            Self::Fence => "fence",
        }
    }

    fn scene(self) -> Scene {
        match self {
            Self::Tab => tab::scene(),
            Self::Jack => jack::scene(),
            Self::Screwdriver => screwdriver::scene(),
            Self::Fence => fence::scene(),
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
        let positions: Vec<f32> = self
            .positions
            .iter()
            .map(|&position| position as f32)
            .collect();
        self.scene().truth(&positions, view)
    }
}

/// The rendered camera, for views so many steps apart.
pub(crate) fn camera(step: f64) -> Known {
    Known {
        focal_px: Some(FOCAL.into()),
        cx: Some(CENTRE[0].into()),
        cy: Some(CENTRE[1].into()),
        baseline_m: Some(f64::from(STEP) * step / 1000.0),
        is_distorted: false,
    }
}
