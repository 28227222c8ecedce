//! The layouts in which the Middlebury stereo sets are handed out, <https://vision.middlebury.edu/stereo/data>.
//!
//! | set | views | truth |
//! | --- | --- | --- |
//! | 2001 | `im0.ppm` … `im8.ppm` | `disp2.pgm`, `disp6.pgm`: 8 × the disparity between `im2` and `im6` |
//! | 2001 Tsukuba | `scene1.row3.col1.ppm` … `col5` | `truedisp.row3.col3.pgm`: 16 × the disparity of one step |
//! | 2003 | `im0` … `im8` | `disp2`, `disp6`: 4, 2 or 1 × the disparity between `im2` and `im6`, by size |
//! | 2005, 2006 | `view0.png` … `view6.png`, or in `Illum1/Exp1` | `disp1.png`, `disp5.png`: 1, 2 or 3 × the disparity between `view1` and `view5`, by size |
//! | 2014 | `im0.png`, `im1.png` beside `calib.txt` | `disp0.pfm`: the disparity of one step |

use std::fs;
use std::path::{Path, PathBuf};

use messages::Size;

use crate::error::SourceError;
use crate::image_file;
use crate::truth::{Encoding, TruthFile};

/// The views of a scene, left to right, and what is known of their disparities.
pub(crate) struct Layout {
    pub(crate) files: Vec<PathBuf>,
    /// Where they stand, in steps: their numbers, of which some may be left out.
    pub(crate) positions: Vec<f64>,
    /// By the view's place among the files.
    pub(crate) truths: Vec<(usize, TruthFile)>,
}

/// Steps between the two views that the truth of the sets of 2001 to 2006 is for.
const APART: f32 = 4.0;

/// Lighting and exposure, where a set comes in several.
const TAKEN: &str = "Illum1/Exp1";

/// The scene in a folder of images, when it is laid out like one of the sets: its views without truth say nothing.
pub(crate) fn layout(folder: &Path) -> Result<Option<Layout>, SourceError> {
    let mut names = names(folder);
    let mut inside = folder.to_owned();
    if !names.iter().any(|name| number(name, "view").is_some()) && folder.join(TAKEN).is_dir() {
        inside = folder.join(TAKEN);
        names.extend(self::names(&inside));
    }
    let views = |prefix: &str| -> Vec<(u32, PathBuf)> {
        let view = |name: &String| Some((number(name, prefix)?, inside.join(name)));
        let mut views: Vec<_> = names.iter().filter_map(view).collect();
        views.retain(|(_, path)| image_file::is_image(path));
        views.sort();
        // Of a view in several formats the first by name is taken.
        views.dedup_by_key(|(number, _)| *number);
        views
    };
    // What is called a view is a picture; what is called a disparity need not be one.
    let truths = |prefix: &str| -> Vec<(u32, PathBuf)> {
        let truth = |name: &String| Some((number(name, prefix)?, folder.join(name)));
        names.iter().filter_map(truth).collect()
    };
    let is_pfm = |path: &Path| path.extension().is_some_and(|e| e == "pfm");
    let (views, truths, per_value): (_, _, fn(Size) -> f32) = match () {
        () if !truths("truedisp.row3.col").is_empty() => (
            views("scene1.row3.col"),
            truths("truedisp.row3.col"),
            |_| 1.0 / 16.0,
        ),
        () if !truths("disp").is_empty() && !views("view").is_empty() => {
            (views("view"), truths("disp"), |size| {
                1.0 / APART / in_2005(size)
            })
        }
        () if !truths("disp").is_empty() && !views("im").is_empty() => {
            (views("im"), truths("disp"), |size| {
                1.0 / APART / in_2001_or_2003(size)
            })
        }
        () => return Ok(None),
    };
    let Some((_, first)) = views.first() else {
        return Ok(None);
    };
    let size = image_file::head(first)?.size;
    let known = |(number, path): (u32, PathBuf)| {
        let view = views.iter().position(|(view, _)| *view == number)?;
        let encoding = match is_pfm(&path) {
            true => Encoding::Pfm,
            false => Encoding::Gray {
                per_value: per_value(size),
            },
        };
        Some((view, TruthFile { path, encoding }))
    };
    Ok(Some(Layout {
        truths: truths.into_iter().filter_map(known).collect(),
        positions: views.iter().map(|(number, _)| f64::from(*number)).collect(),
        files: views.into_iter().map(|(_, path)| path).collect(),
    }))
}

/// What the disparities of the sets of 2005 and 2006 are multiplied with: at full, half or a third of the size.
fn in_2005(size: Size) -> f32 {
    match size.width {
        1000.. => 1.0,
        550..1000 => 2.0,
        _ => 3.0,
    }
}

/// Cones and Teddy of 2003 are 450 pixels wide, or two or four times as wide; those of 2001 are narrower.
fn in_2001_or_2003(size: Size) -> f32 {
    match size.width {
        1800.. => 1.0,
        900..1800 => 2.0,
        450..900 => 4.0,
        _ => 8.0,
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}

/// The number in a name like `view3.png`: prefix, digits, one extension.
fn number(name: &str, prefix: &str) -> Option<u32> {
    let (number, extension) = name.strip_prefix(prefix)?.split_once('.')?;
    let is_plain = !extension.contains('.') && number.bytes().all(|b| b.is_ascii_digit());
    number.parse().ok().filter(|_| is_plain)
}
