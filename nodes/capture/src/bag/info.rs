//! What the cameras of a bag are like, by the messages beside their images.

use messages::Size;

use super::message::Info;
use super::topics;
use crate::calibration::ros::CameraInfo;
use crate::camera_info::{self, Known};
use crate::rectify::Rectifier;
use crate::settings::Settings;

/// What a bag says of its cameras, settled.
#[derive(Debug, Default)]
pub(crate) struct Cameras {
    /// Where images are as cameras took them, and can be rectified.
    pub(crate) rectifier: Option<Rectifier>,
    /// What is known of images that need not be rectified.
    pub(crate) known: Known,
    pub(crate) notices: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// A view's images, and what is said of its camera on which topic.
#[derive(Clone, Debug)]
pub(super) struct Described {
    pub(super) images: String,
    pub(super) info: Option<(String, Info)>,
}

impl Cameras {
    /// Of all views, left to right, whose images are of this size.
    pub(super) fn of(views: &[Described], size: Size, settings: &Settings) -> Self {
        let mut cameras = Self::default();
        let infos: Vec<&(String, Info)> = views.iter().filter_map(|v| v.info.as_ref()).collect();
        if infos.is_empty() {
            return cameras;
        }
        let without = views.iter().find(|view| view.info.is_none());
        if let Some(view) = without.filter(|_| infos.len() < views.len()) {
            cameras.warnings.push(format!(
                "the camera_info of the others is not used, for {} has none",
                view.images
            ));
            return cameras;
        }
        if let Some((topic, _)) = infos.iter().find(|(_, info)| !info.is_known()) {
            cameras.warnings.push(format!(
                "{topic} holds zeros, as of a camera that was not calibrated, and no camera_info is used"
            ));
            return cameras;
        }
        if let Some((topic, info)) = infos.iter().find(|(_, info)| info.size != size) {
            cameras.warnings.push(format!(
                "{topic} is of images of {} pixels, and these are {size}: no camera_info is used",
                info.size
            ));
            return cameras;
        }
        let names: Vec<&str> = infos.iter().map(|(topic, _)| topic.as_str()).collect();
        let names = names.join(", ");
        let is_named_so = |view: &&Described| topics::is_rectified(&view.images);
        let rectified = views.iter().filter(is_named_so).count();
        let is_straight = infos.iter().all(|(_, info)| info.is_straight());
        if rectified == views.len() || is_straight {
            let (all, is_said) = (messages(&infos), settings.baseline.is_some());
            match camera_info::of(&all, views.len(), &[size], is_said) {
                Ok(read) => {
                    // What distorts is said of the images as they were taken.
                    cameras.known = Known {
                        is_distorted: false,
                        ..read.known
                    };
                    let base = read.known.baseline_m;
                    let base =
                        base.map_or(String::new(), |b| format!(", steps of {:.2} mm", b * 1e3));
                    cameras.notices.push(format!(
                        "images are rectified, by P of {names}: focal length {:.1} px{base}",
                        read.known.focal_px.unwrap_or_default()
                    ));
                    cameras.warnings.extend(read.warnings);
                }
                Err(why) => cameras
                    .warnings
                    .push(format!("no camera_info is used: {why}")),
            }
            return cameras;
        }
        if rectified > 0 {
            cameras.warnings.push(format!(
                "some images are rectified by their topics' names and others are not, and no camera_info is used: {}",
                views.iter().map(|view| view.images.as_str()).collect::<Vec<_>>().join(", ")
            ));
            return cameras;
        }
        match Rectifier::of_infos(&messages(&infos), settings, &[size]) {
            Ok(rectifier) => {
                cameras.notices.push(format!(
                    "images are as cameras took them, and are rectified by {names}"
                ));
                rectifier.remark(&mut cameras.notices, &mut cameras.warnings);
                cameras.rectifier = Some(rectifier);
            }
            Err(why) => {
                let k = infos[0].1.k;
                cameras.known = Known {
                    focal_px: Some(k[0]).filter(|&focal| focal > 0.0),
                    cx: Some(k[2]).filter(|_| k[0] > 0.0),
                    cy: Some(k[5]).filter(|_| k[0] > 0.0),
                    baseline_m: None,
                    is_distorted: infos
                        .iter()
                        .any(|(_, info)| info.d.iter().any(|&d| d != 0.0)),
                };
                cameras.warnings.push(format!(
                    "images are as cameras took them and cannot be rectified by their camera_info ({why}); set capture.calibration"
                ));
            }
        }
        cameras
    }
}

/// As calibrations are read.
fn messages(infos: &[&(String, Info)]) -> Vec<CameraInfo> {
    let each = infos.iter();
    each.map(|(topic, info)| info.as_message(topic)).collect()
}
