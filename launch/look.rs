//! A look at a source's first scans before anything runs: whether they can be stereo, and how far off their rows are.

use capture::look::{Finding, Look, REFUSED_PX, look_but};
use capture::{Layout, Source, SourceError};
use messages::{Image, Owned, Rail};
use serde::Serialize;

use crate::graph::Graph;

/// Scans of a rig, or triples of a rail, that are looked at: the geometry is the same in all.
const SCANS: u64 = 3;
/// Pixels of all that is looked at, at most: the look must not be what a run waits for.
const PIXELS: usize = 40_000_000;

/// One of the images that stand in a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stand {
    /// Baselines to the right of any one place.
    pub(crate) place: f64,
    pub(crate) scan: u64,
    pub(crate) view: usize,
}

/// What was found in a scan.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Found {
    pub(crate) scan: u64,
    #[serde(flatten)]
    pub(crate) finding: Finding,
    /// In a sentence.
    pub(crate) says: String,
}

/// What was found in the scans that were looked at.
#[derive(Debug)]
pub(crate) struct Looked {
    /// By scan, the worst first.
    by_scan: Vec<Vec<Found>>,
    is_rail: bool,
    /// How to say which view stands where.
    naming: &'static str,
    /// Whether a calibration is made good already.
    is_rectified: bool,
}

/// What comes of a look.
#[derive(Debug, Default)]
pub(crate) struct Judged {
    /// Why it should not run.
    pub(crate) refusal: Option<String>,
    /// What is to be said besides.
    pub(crate) warnings: Vec<String>,
}

impl Looked {
    /// Looks at the first, a middle and the last scan of what can be read beforehand; of cameras at nothing.
    pub(crate) fn at(source: &mut Source, is_rectified: bool) -> Self {
        let rows = match source.is_cameras() {
            true => Vec::new(),
            false => rows_of(source, SCANS),
        };
        Self::at_rows(source, &rows, is_rectified)
    }

    /// Looks at these rows of images; what cannot be read is told when its turn comes.
    pub(crate) fn at_rows(source: &mut Source, rows: &[Vec<Stand>], is_rectified: bool) -> Self {
        let mut looked = Self {
            by_scan: Vec::new(),
            is_rail: source.rail().is_some(),
            naming: match (source.layout(), source.topics()) {
                (Some(Layout::Cameras), _) => "name the folders so",
                (_, Some(_)) => "name them so: --topics left=/…,centre=/…,right=/…",
                _ => "name the files so, or list them so in scene.json",
            },
            is_rectified,
        };
        let mut pixels = 0;
        for row in rows.iter().filter(|row| row.len() > 1) {
            let scan = row[0].scan;
            pixels += source.size_of(scan).pixels() * row.len();
            if !looked.by_scan.is_empty() && pixels > PIXELS {
                break;
            }
            looked.by_scan.extend(found(source, row));
        }
        looked
    }

    /// What was found that makes a scan no stereo at all, whatever its rows.
    pub(crate) fn no_stereo(&self) -> impl Iterator<Item = &Found> {
        let all = self.by_scan.iter().flatten();
        all.filter(|found| !found.finding.is_of_rows())
    }

    /// What a run does with it: what is measured in every scan that was looked at is refused.
    pub(crate) fn judged(&self, source: &str) -> Judged {
        let mut judged = Judged::default();
        for (number, found) in self.by_scan.iter().enumerate() {
            // One sentence a scan, of what is worst; what was said of another scan is not said again.
            let Some(worst) = found.first() else {
                continue;
            };
            let is_kind = |other: &Found| {
                std::mem::discriminant(&other.finding) == std::mem::discriminant(&worst.finding)
            };
            let earlier = self.by_scan[..number]
                .iter()
                .filter_map(|found| found.first());
            if earlier.into_iter().any(is_kind) {
                continue;
            }
            let is_everywhere = self.by_scan.iter().all(|found| {
                let worst = found.first();
                worst.is_some_and(|worst| is_kind(worst) && is_refused(&worst.finding))
            });
            let cure = self.cure(&worst.finding, source);
            let text = format!("{}{cure}", worst.says);
            match is_everywhere {
                true => judged.refusal = Some(text),
                false => judged.warnings.push(text),
            }
        }
        judged
    }

    /// What to do about it.
    fn cure(&self, finding: &Finding, source: &str) -> String {
        match finding {
            Finding::Order { .. } => format!("; {}", self.naming),
            Finding::Rows { .. } if self.is_rail => {
                "; level the camera along its way, or turn the images (capture.sway)".to_owned()
            }
            Finding::Rows { .. } if self.is_rectified => {
                "; the calibration does not fit these images: calibrate anew".to_owned()
            }
            Finding::Rows { .. } => format!(
                "; rectify them: capture.calibration, or tricurve check-geometry {source} -o residual.yaml, and then --set capture.calibration=residual.yaml"
            ),
            _ => String::new(),
        }
    }
}

/// Whether a run refuses it: where hardly anything is seen in common it may be right in later scans.
fn is_refused(finding: &Finding) -> bool {
    match finding {
        Finding::Constant { .. } | Finding::Identical { .. } | Finding::Order { .. } => true,
        Finding::Rows { rows, .. } => rows.off_px > REFUSED_PX,
        Finding::Odd { .. } | Finding::Apart { .. } | Finding::Still { .. } => false,
    }
}

/// What is found in a row of images.
fn found(source: &mut Source, row: &[Stand]) -> Result<Vec<Found>, SourceError> {
    let scan = row[0].scan;
    let size = source.size_of(scan);
    let rail = source.rail();
    let drift = rail.map_or(0.0, |rail| rail.drift_px);
    let mut images = Vec::with_capacity(row.len());
    for stand in row {
        let mut image = Owned::<Image>::new(source.size_of(stand.scan));
        image.fill(|room| source.read(stand.scan, stand.view, room))?;
        images.push(image);
    }
    let views: Vec<&[u8]> = images.iter().map(|image| image.view().pixels).collect();
    let sways: Vec<_> = row.iter().map(|stand| source.sway(stand.scan)).collect();
    let off = |view: usize, [x, y]: [f64; 2]| {
        let [right, down] = sways[view].off(size, x, y);
        [right, down + drift * row[view].place]
    };
    let Look { findings, .. } = look_but(&views, size, &off);
    let names = names(source, row);
    let several = source.scenes() > 1 && rail.is_none();
    let told = findings.into_iter().filter(|finding| {
        // Which way a rail goes, and where it stands still, is known.
        rail.is_none() || finding.is_of_rows()
    });
    Ok(told
        .map(|finding| Found {
            scan,
            says: match several {
                true => format!("{}: {}", source.name(scan), finding.says(&names)),
                false => finding.says(&names),
            },
            finding,
        })
        .collect())
}

/// The names of the files in a row.
fn names(source: &Source, row: &[Stand]) -> Vec<String> {
    if source.rail().is_some() {
        return row.iter().map(|stand| source.name(stand.scan)).collect();
    }
    let views = source.views(row[0].scan).into_iter();
    views.map(|view| view.name).collect()
}

/// The rows of images that are looked at, each left to right: of a rig's scans the first, the last and some between; of a
/// rail triples from all along it.
pub(crate) fn rows_of(source: &Source, most: u64) -> Vec<Vec<Stand>> {
    if let Some(rail) = source.rail() {
        return triples(source, rail, most);
    }
    let stand = |scan: u64, view: usize| Stand {
        place: view as f64,
        scan,
        view,
    };
    let row = |scan| {
        (0..source.view_count())
            .map(|view| stand(scan, view))
            .collect()
    };
    let scenes = source.scenes().min(source.scans());
    let count = scenes.min(most);
    let last = (count - 1).max(1);
    (0..count)
        .map(|number| row(number * (scenes - 1) / last))
        .collect()
}

/// Some of the triples that a rail's frames form.
fn triples(source: &Source, rail: Rail, most: u64) -> Vec<Vec<Stand>> {
    let baseline_m = source.calibration().map_or(1.0, |camera| camera.baseline_m);
    let of_frame = |frame: u64| {
        let frames = [frame, frame - rail.stride, frame - rail.reach()];
        let [Some(newest), Some(middle), Some(oldest)] =
            frames.map(|frame| source.position_m(frame))
        else {
            return None;
        };
        let places_m = [newest, middle, oldest];
        matching::rail::triple(&rail, places_m, baseline_m).ok()?;
        let stands = places_m.into_iter().zip(frames);
        let mut stands: Vec<_> = stands
            .map(|(place_m, scan)| Stand {
                place: place_m / baseline_m,
                scan,
                view: 0,
            })
            .collect();
        stands.sort_by(|a, b| a.place.total_cmp(&b.place));
        Some(stands)
    };
    let all: Vec<_> = (rail.reach()..source.scenes())
        .filter_map(of_frame)
        .collect();
    let apart = all.len().div_ceil(most as usize).max(1);
    all.into_iter().step_by(apart).collect()
}

/// Says what is wrong with one scene, where results are only compared and nothing is refused.
pub(crate) fn say(source: &mut Source, scan: u64, graph: &Graph, name: &str) {
    let row: Vec<Stand> = (0..source.view_count())
        .map(|view| Stand {
            place: view as f64,
            scan,
            view,
        })
        .collect();
    let calibration = graph.settings_of("capture").get("calibration");
    let is_rectified = calibration.is_some_and(|calibration| !calibration.is_null());
    let judged = Looked::at_rows(source, &[row], is_rectified).judged(name);
    for said in judged.refusal.iter().chain(&judged.warnings) {
        crate::say!("{name}: warning: {said}");
    }
}
