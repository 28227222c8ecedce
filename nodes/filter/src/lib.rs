//! Laplacian of Gaussian by FFT, zero-crossings, gradients.
//!
//! ```text
//!         ┌─► spectrum ─► × −|ω|²·exp(−σ²|ω|²/2) ─► ∇²G ─► zero-crossings ─┐
//! image ──┼─► smoothed ─────────────────────────────► Sobel's operator ────┼─► edges of a channel
//!         └─► averaged down the column ──────────────► gray levels beside ─┘
//! ```
//!
//! One view goes in at a time, one channel comes out at a time, so that the first channel is under way while the
//! next is made. The view is read once and transformed once for all its channels.
//!
//! ```
//! use filter::{Filter, Settings};
//! use messages::{Edges, ImageView, Owned, Size};
//!
//! let size = Size::new(64, 48);
//! let pixels: Vec<u8> = (0..size.pixels()).map(|i| if i % 64 < 30 { 50 } else { 200 }).collect();
//! let mut filter = Filter::new(&Settings::default(), size);
//! let mut edges = Owned::<Edges>::new(size);
//!
//! filter.begin(ImageView { pixels: &pixels }, size);
//! for channel in 0..filter.channels() {
//!     edges.fill(|room| filter.edges(channel, room));
//!     assert!(edges.view().edges.iter().all(|edge| (edge.x - 29.5).abs() < 0.01));
//! }
//! ```

mod crossings;
mod gray;
#[cfg(feature = "node")]
pub mod node;
mod picture;
pub mod settings;
mod smooth;
mod spectrum;

use messages::{EdgesRoom, ImageView, Size};

pub use crossings::NEARLY_HORIZONTAL;
pub use settings::{Interpolation, Scaling, Settings};

use crossings::{Crossings, View};
use gray::Gray;
use picture::Picture;
use smooth::Gaussian;
use spectrum::Spectrum;

/// The version of the algorithm: one more whenever the same input and settings give other edges.
pub const VERSION: u32 = 2;

/// Turns views into zero-crossings, one view at a time, channel by channel.
pub struct Filter {
    scaling: Scaling,
    floor: f32,
    /// How far at most the curvature of ∇²G may move a zero-crossing, in pixels.
    correction: f32,
    /// What precedes Sobel's operator: one Gaussian for all channels, or one for each.
    smoothings: Vec<Gaussian>,
    channels: usize,
    size: Size,
    gray: Gray,
    spectrum: Spectrum,
    filtered: Picture,
    smoothed: Picture,
    /// Which smoothing `smoothed` shows of the current view, and what magnitudes there are multiplied by.
    shown: Option<(usize, f32)>,
    crossings: Crossings,
}

impl Filter {
    /// A filter with room for images up to `max`; the first image of a further size costs a plan for it.
    pub fn new(settings: &Settings, max: Size) -> Self {
        let at_scale = |&variance: &f32| (variance - SOBEL_VARIANCE).max(0.0).sqrt();
        let sigmas = match settings.smoothing {
            Some(sigma) => vec![sigma],
            None => settings.channels.iter().map(at_scale).collect(),
        };
        let mut pictures = [Picture::default(), Picture::default()];
        pictures.iter_mut().for_each(|picture| picture.resize(max));
        let [filtered, smoothed] = pictures;
        let mut crossings = Crossings::default();
        crossings.resize(max.width as usize);
        Self {
            scaling: settings.scaling,
            floor: settings.floor,
            correction: settings.interpolation.correction(),
            smoothings: sigmas
                .into_iter()
                .map(|sigma| Gaussian::new(sigma, max))
                .collect(),
            channels: settings.channels.len(),
            spectrum: Spectrum::new(&settings.channels, max),
            size: Size::default(),
            gray: Gray::new(max),
            filtered,
            smoothed,
            shown: None,
            crossings,
        }
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Takes the next view and makes all that its channels share.
    ///
    /// # Panics
    /// When the image is not of the size it is said to be.
    pub fn begin(&mut self, image: ImageView<'_>, size: Size) {
        assert_eq!(
            image.pixels.len(),
            size.pixels(),
            "pixels of an image of {size}"
        );
        self.size = size;
        self.gray.read(image.pixels, size);
        self.spectrum
            .analyse(&self.gray.pixels()[..size.pixels()], size);
        self.shown = None;
        self.crossings.resize(size.width as usize);
    }

    /// Appends the edges of a channel of the current view, in raster order and at most one a pixel.
    ///
    /// # Panics
    /// When there is no such channel, or no view has begun.
    pub fn edges(&mut self, channel: usize, room: &mut EdgesRoom<'_>) {
        if self.shown.is_none() {
            self.gray.steady();
        }
        self.filter(channel);
        let scale = self.smooth(channel);
        let view = View {
            filtered: &self.filtered,
            smoothed: &self.smoothed,
            gray: &self.gray,
            correction: self.correction,
            scale,
            floor: self.floor,
        };
        for y in 0..self.size.height as usize {
            self.crossings.row(&view, y, &mut room.edges);
        }
    }

    /// Makes ∇²G of the current view in a channel and shows it row by row, in gray levels per square pixel.
    ///
    /// # Panics
    /// When there is no such channel, or no view has begun.
    pub fn filtered(&mut self, channel: usize) -> impl Iterator<Item = &[f32]> {
        self.filter(channel);
        (0..self.size.height as usize).map(|y| self.filtered.pixels(y))
    }

    fn filter(&mut self, channel: usize) {
        self.spectrum.apply(channel, &mut self.filtered);
        self.filtered.mirror();
    }

    /// Makes the picture that Sobel's operator is applied to, unless it is there already, and says what magnitudes
    /// there are multiplied by.
    fn smooth(&mut self, channel: usize) -> f32 {
        let smoothing = channel.min(self.smoothings.len() - 1);
        if let Some((shown, scale)) = self.shown
            && shown == smoothing
        {
            return scale;
        }
        self.smoothings[smoothing].apply(self.gray.pixels(), self.size, &mut self.smoothed);
        let scale = match self.scaling {
            Scaling::Absolute => 1.0,
            Scaling::Picture => {
                let largest = self
                    .crossings
                    .largest_gradient(&self.smoothed, self.size.height as usize);
                if largest > 0.0 { 255.0 / largest } else { 1.0 }
            }
        };
        self.shown = Some((smoothing, scale));
        scale
    }
}

/// The variance by which Sobel's operator itself smooths: that of its weights ¼ ½ ¼, in square pixels.
const SOBEL_VARIANCE: f32 = 0.5;
