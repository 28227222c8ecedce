//! The whole chain in one process: views in, points out.

use std::ops::Deref;

use matching::ChannelView;
use messages::settings::Settings as _;
use messages::{Calibration, Curves, Image, MatchesView, Owned, Point, Rig, Size, Tables};

use crate::chain::{OfView, OfViews, emptied};

/// The settings of every stage; those that are left alone are what the program `tricurve` runs with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Zero-crossings of ∇²G, channel by channel.
    pub filter: filter::Settings,
    /// Zero-crossings linked to curves.
    pub track: track::Settings,
    /// Which tables matching reads.
    pub hough: hough::Settings,
    /// Curves matched in three and more views.
    pub matching: matching::Settings,
}

impl Settings {
    /// Every literal constant of the thesis: its three channels, its thresholds, whole curves.
    pub fn thesis() -> Self {
        Self {
            filter: filter::Settings::thesis(),
            track: track::Settings::thesis(),
            hough: hough::Settings::thesis(),
            matching: matching::Settings::thesis(),
        }
    }
}

/// Why views cannot be matched.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// A setting is out of its range.
    #[error("{0}")]
    Setting(String),
    /// Two views leave it open which of several like edges is the partner.
    #[error(
        "expected three or more views at equal steps, the rig has {0}: give it the views between or beside them"
    )]
    Views(usize),
    /// A camera that moves: its frames are matched by the graph.
    #[error(
        "expected views that are taken at one time, the rig is a rail: `tricurve run --rail` matches its frames"
    )]
    Rail,
    /// The rig's channels are not the filter's.
    #[error(
        "expected the filter's channels, {filter:?}, the rig has {rig:?}: make the rig with those of the settings"
    )]
    Channels {
        /// σ² of the rig's channels.
        rig: Vec<f32>,
        /// σ² of the filter's channels.
        filter: Vec<f32>,
    },
    /// There are not as many images as the rig has views.
    #[error("expected {expected} images, one a view from left to right, not {found}")]
    Images {
        /// Views of the rig.
        expected: usize,
        /// Images given.
        found: usize,
    },
    /// An image is of another size.
    #[error(
        "expected {expected} gray levels in image {view}, row by row as in {size}, not {found}"
    )]
    Pixels {
        /// Index of the view.
        view: usize,
        /// The rig's size.
        size: Size,
        /// Its pixels.
        expected: usize,
        /// Gray levels given.
        found: usize,
    },
}

/// The chain filter → track → hough → match, with its memory: after the first scans it allocates nothing.
///
/// It computes what the nodes of a graph compute, to the byte.
///
/// ```
/// use tricurve::{Pipeline, Rig, Settings, Size};
///
/// // A bar before a plain ground, seen by three cameras side by side: 6 pixels to the left from view to view.
/// let bar = |left: usize| -> Vec<u8> {
///     let gray = |at: usize| if (left..left + 30).contains(&(at % 160)) { 180 } else { 60 };
///     (0..160 * 120).map(gray).collect()
/// };
/// let views = [bar(80), bar(74), bar(68)];
///
/// let settings = Settings::default();
/// let rig = Rig::of_views(3, &settings.filter.channels, Size::new(160, 120));
/// let mut pipeline = Pipeline::new(&settings, &rig)?;
/// let found = pipeline.process(&views)?;
/// assert!(found.points().len() > 100);
/// for point in found.points() {
///     assert!((point.disparity - 6.0).abs() < 0.2);
/// }
/// # Ok::<(), tricurve::PipelineError>(())
/// ```
pub struct Pipeline {
    size: Size,
    calibration: Calibration,
    views: usize,
    channels: usize,
    of_view: OfView,
    of_views: OfViews,
    image: Owned<Image>,
    /// By channel, then view.
    curves: Vec<Owned<Curves>>,
    tables: Vec<Owned<Tables>>,
    /// Memory for lists of what is borrowed during a scan.
    inputs: Vec<ChannelView<'static>>,
    by_channel: Vec<&'static [ChannelView<'static>]>,
}

impl Pipeline {
    /// A chain for a rig whose images all have its size.
    ///
    /// # Errors
    /// A setting out of its range, fewer than three views, a rail, or channels that are not the filter's.
    pub fn new(settings: &Settings, rig: &Rig) -> Result<Self, PipelineError> {
        let wrong = |node: &str, error: &dyn std::fmt::Display| {
            PipelineError::Setting(format!("{node}.{error}"))
        };
        let Settings {
            filter,
            track,
            hough,
            matching,
        } = settings;
        filter.check().map_err(|error| wrong("filter", &error))?;
        track.check().map_err(|error| wrong("track", &error))?;
        hough.check().map_err(|error| wrong("hough", &error))?;
        matching.check().map_err(|error| wrong("match", &error))?;
        if rig.rail.is_some() {
            return Err(PipelineError::Rail);
        }
        if rig.views.len() < 3 {
            return Err(PipelineError::Views(rig.views.len()));
        }
        if rig.channels != filter.channels {
            return Err(PipelineError::Channels {
                rig: rig.channels.clone(),
                filter: filter.channels.clone(),
            });
        }
        let hough = hough::Settings {
            tables: Some(hough.tables.unwrap_or(matching.reads_tables())),
            ..hough.clone()
        };
        let (size, views, channels) = (rig.size, rig.views.len(), rig.channels.len());
        Ok(Self {
            size,
            calibration: rig.calibration(size),
            views,
            channels,
            of_view: OfView::new(filter, track, &hough, size),
            of_views: OfViews::new(matching, &rig.channels, size),
            image: Owned::new(size),
            curves: (0..channels * views).map(|_| Owned::new(size)).collect(),
            tables: (0..channels * views).map(|_| Owned::new(size)).collect(),
            inputs: Vec::new(),
            by_channel: Vec::new(),
        })
    }

    /// Matches images that were taken at one time: rectified, from left to right at equal steps, gray levels row by row.
    ///
    /// # Errors
    /// Another number of images than the rig has views, or an image of another size.
    pub fn process(
        &mut self,
        images: &[impl Deref<Target = [u8]>],
    ) -> Result<Found<'_>, PipelineError> {
        if images.len() != self.views {
            return Err(PipelineError::Images {
                expected: self.views,
                found: images.len(),
            });
        }
        let size = self.size;
        let is_other = |image: &&[u8]| image.len() != size.pixels();
        let mut pixels = images.iter().map(|image| &**image);
        if let Some((view, other)) = pixels.by_ref().enumerate().find(|(_, own)| is_other(own)) {
            return Err(PipelineError::Pixels {
                view,
                size,
                expected: size.pixels(),
                found: other.len(),
            });
        }
        for (view, image) in images.iter().enumerate() {
            self.image.fill(|room| {
                room.clear();
                room.pixels.extend_from_slice(image);
            });
            self.of_view.begin(self.image.view());
            for channel in 0..self.channels {
                let at = self.views * channel + view;
                self.of_view.curves(channel, &mut self.curves[at]);
                self.of_view.tables(&self.curves[at], &mut self.tables[at]);
            }
        }
        self.match_views();
        Ok(Found { pipeline: self })
    }

    fn match_views(&mut self) {
        let mut inputs = emptied(std::mem::take(&mut self.inputs));
        let each = self.curves.iter().zip(&self.tables);
        inputs.extend(each.map(|(curves, tables)| ChannelView {
            curves: curves.view(),
            tables: tables.view(),
        }));
        let mut by_channel = emptied(std::mem::take(&mut self.by_channel));
        by_channel.extend(inputs.chunks(self.views));
        self.of_views.process(&by_channel, &self.calibration);
        self.by_channel = emptied(by_channel);
        self.inputs = emptied(inputs);
    }
}

impl std::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pipeline")
            .field("size", &self.size)
            .field("views", &self.views)
            .field("channels", &self.channels)
            .finish_non_exhaustive()
    }
}

/// What was found in a scan.
#[derive(Debug)]
pub struct Found<'a> {
    pipeline: &'a Pipeline,
}

impl<'a> Found<'a> {
    /// The trusted points of all channels, in the reference view's columns and rows and in metres in its optical frame (x
    /// to the right, y down, z forward), as far as the rig is calibrated.
    pub fn points(&self) -> &'a [Point] {
        self.pipeline.of_views.points().points
    }

    /// The disparity picture of the reference view, row by row, in pixels between neighbouring views; NaN where nothing is
    /// known.
    pub fn disparity(&self) -> &'a [f32] {
        self.pipeline.of_views.disparity()
    }

    /// What was matched in a channel, coarse to fine; nothing of a channel that there is not.
    pub fn matches(&self, channel: usize) -> Option<MatchesView<'a>> {
        self.pipeline
            .of_views
            .matches()
            .get(channel)
            .map(Owned::view)
    }
}
