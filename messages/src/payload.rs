//! The table of our own messages, each defined once, and what all kinds of message have in common.

use crate::elements::{
    Curve, Edge, Entry, MapPoint, Match, MatchPoint, Point, Rejected, Score, Share, Table,
};
use crate::header::Size;
use crate::message::{Definition, Difference, Message, SECTIONS, Section};
use crate::other::{Other, OtherView};

/// Our own messages in the order a scan makes them: their types, the kinds they are, and one type for all of them.
macro_rules! messages {
    (($d:tt) $($(#[doc = $about:literal])+ $name:ident, $view:ident, $room:ident
       = $topic:literal by $stage:literal from [$($from:ident),*] per [$($per:ident),*] { $($sections:tt)+ })+) => {
        $(crate::message! { @types Kind::$name;
            $(#[doc = $about])+ pub $name, $view, $room
            = $topic by $stage from [$(Kind::$from),*] per [$($per),*] { $($sections)+ }
        })+

        /// What a topic's messages are.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind {
            $($(#[doc = $about])+ $name,)+
            /// A message of others.
            Other(Other),
        }

        impl Kind {
            /// Our own, in the order a scan makes them.
            pub const OWN: &'static [Self] = &[$(Self::$name),+];

            /// How it is defined.
            pub const fn definition(self) -> &'static Definition {
                match self {
                    $(Self::$name => $name::DEFINITION,)+
                    Self::Other(other) => other.definition(),
                }
            }
        }

        /// A message of any kind, as its readers see it.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum AnyView<'a> {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($view<'a>),)+
            /// A message of others.
            Other(OtherView<'a>),
        }

        impl AnyView<'_> {
            /// Which kind it is.
            pub const fn kind(&self) -> Kind {
                match self {
                    $(Self::$name(_) => Kind::$name,)+
                    Self::Other(view) => view.kind(),
                }
            }

            /// Where two messages differ first, byte for byte; messages of different kinds differ before everything.
            pub fn difference(&self, other: &AnyView<'_>) -> Option<Difference> {
                match (self, other) {
                    $((Self::$name(one), AnyView::$name(other)) => one.difference(other),)+
                    (Self::Other(one), AnyView::Other(other)) if one.kind() == other.kind() => one.difference(other),
                    _ => Some(Difference {
                        section: "kind",
                        element: 0,
                        one: Some(self.kind().name().to_owned()),
                        other: Some(other.kind().name().to_owned()),
                    }),
                }
            }

            /// Its sections, with the first `most` rows of each.
            pub fn sections(&self, most: usize) -> Vec<Section> {
                match self {
                    $(Self::$name(view) => view.sections(most),)+
                    Self::Other(view) => view.sections(most),
                }
            }

            /// The memory of its sections, in order.
            pub fn memory(&self) -> Vec<&[u8]> {
                match self {
                    $(Self::$name(view) => view.memory(),)+
                    Self::Other(view) => view.memory(),
                }
            }
        }

        impl<'a> AnyView<'a> {
            /// Sees a payload of this kind, as [`Message::view`] does.
            pub fn of(kind: Kind, words: &'a [u64], size: Size, lens: [u32; SECTIONS]) -> Option<Self> {
                match kind {
                    $(Kind::$name => $name::view(words, size, lens).map(Self::$name),)+
                    Kind::Other(other) => OtherView::of(other.definition(), words, size, lens).map(Self::Other),
                }
            }
        }

        $(impl<'a> From<$view<'a>> for AnyView<'a> {
            fn from(view: $view<'a>) -> Self {
                Self::$name(view)
            }
        })+

        /// Does what `$own!(Type)` does for the type of a kind of our own, and for one of others what the arm after it says.
        #[doc(hidden)]
        #[macro_export]
        macro_rules! of_kind {
            ($d kind:expr, $d own:ident, $d other:pat => $d then:expr) => {
                match $d kind {
                    $($d crate::Kind::$name => $d own!($name),)+
                    $d crate::Kind::Other($d other) => $d then,
                }
            };
        }
    };
}

messages! { ($)
    /// A view: 8 bit gray, row by row without gaps; as taken, or rectified where a calibration says how.
    Image, ImageView, ImageRoom = "image" by "capture" from [] per [view] {
        /// `height` rows of `width` pixels.
        pixels: u8 = |size| size.pixels(),
    }

    /// A view as its camera took it, beside the rectified one: 8 bit gray, row by row without gaps.
    Raw, RawView, RawRoom = "image_raw" by "capture" from [] per [view] {
        /// `height` rows of `width` pixels.
        pixels: u8 = |size| size.pixels(),
    }

    /// The true disparities of the reference view, pixels between neighbouring views; NaN where unknown.
    Truth, TruthView, TruthRoom = "truth" by "capture" from [] per [] {
        /// `height` rows of `width` values.
        disparity: f32 = |size| size.pixels(),
    }

    /// The zero-crossings of a view in a channel, in raster order.
    Edges, EdgesView, EdgesRoom = "edges" by "filter" from [Image] per [view, channel] {
        /// At most one a pixel.
        edges: Edge = |size| size.pixels(),
    }

    /// The curves of a view in a channel.
    Curves, CurvesView, CurvesRoom = "curves" by "track" from [Edges] per [view, channel] {
        /// By label.
        curves: Curve = |size| size.pixels() / 2,
        /// Curve by curve, each in order along the curve.
        points: Edge = |size| size.pixels() + size.pixels() / 2,
    }

    /// The R-tables of a view in a channel, and where its curve points lie.
    Tables, TablesView, TablesRoom = "tables" by "hough" from [Curves] per [view, channel] {
        /// One a curve, by label.
        tables: Table = |size| size.pixels() / 2,
        /// Table by table.
        entries: Entry = |size| size.pixels() + size.pixels() / 2,
        /// `height` + 1 offsets into `order`: where each row's points start and end. A point between two rows
        /// belongs to the upper.
        rows: u32 = |size| size.height as usize + 1,
        /// Indices of the curve points, row by row, left to right.
        order: u32 = |size| size.pixels() + size.pixels() / 2,
    }

    /// The matched curves of a channel, and why the others were not.
    Matches, MatchesView, MatchesRoom = "matches" by "match" from [Curves, Tables] per [channel] {
        /// In the order of the reference view's curves.
        matches: Match = |size| size.pixels() / 2,
        /// Match by match, along the reference view's curve.
        points: MatchPoint = |size| size.pixels() + size.pixels() / 2,
        /// All other curves of the reference view, in order; of a recording made before there were reasons, none.
        rejected: Rejected = |size| size.pixels() / 2,
    }

    /// The disparity picture in the reference view, pixels between neighbouring views; NaN where unknown.
    Disparity, DisparityView, DisparityRoom = "disparity" by "match" from [Curves, Tables] per [] {
        /// `height` rows of `width` values.
        disparity: f32 = |size| size.pixels(),
    }

    /// The scan's result: all trusted points of all channels.
    Points, PointsView, PointsRoom = "points" by "match" from [Curves, Tables] per [] {
        /// Row by row, left to right.
        points: Point = |size| size.pixels() + size.pixels() / 2,
    }

    /// What a frame settles of the map: every point of the map comes once.
    Map, MapView, MapRoom = "map" by "map" from [Points] per [] {
        /// In raster order of where they were seen last.
        points: MapPoint = |size| 3 * size.pixels(),
    }

    /// Points of the map that are still followed, as they are now.
    Growing, GrowingView, GrowingRoom = "map/growing" by "map" from [Points] per [] {
        /// In raster order of where they were seen last, frame by frame, the newest first.
        points: MapPoint = |size| 3 * size.pixels(),
    }

    /// How a scan's points compare with the truth.
    Evaluation, EvaluationView, EvaluationRoom = "evaluation" by "evaluate" from [Image, Truth, Matches, Points] per [] {
        /// First the scan's result, then each channel's matches, coarse to fine.
        scores: Score = |_size| 64,
        /// The result's error over its coverage, the surest points first.
        curve: Share = |_size| 64,
    }
}

impl AnyView<'_> {
    /// Whether its indices stay inside it; false for a damaged message.
    pub fn is_sound(&self) -> bool {
        match self {
            Self::Curves(curves) => curves.is_sound(),
            Self::Tables(tables) => tables.is_sound(usize::MAX),
            Self::Matches(matches) => matches.is_sound(),
            Self::Image(_)
            | Self::Raw(_)
            | Self::Truth(_)
            | Self::Edges(_)
            | Self::Disparity(_)
            | Self::Points(_)
            | Self::Map(_)
            | Self::Growing(_)
            | Self::Evaluation(_)
            | Self::Other(_) => true,
        }
    }
}

impl CurvesView<'_> {
    /// Whether every curve's points exist; false for a damaged message.
    pub fn is_sound(&self) -> bool {
        let fits = |c: &Curve| c.first as usize + c.count as usize <= self.points.len();
        self.curves.iter().all(fits)
    }
}

impl TablesView<'_> {
    /// Whether every index stays inside the message and its curves; false for a damaged message.
    pub fn is_sound(&self, points: usize) -> bool {
        let inside = |t: &Table| t.first as usize + t.count as usize <= self.entries.len();
        self.tables.iter().all(inside)
            && self.entries.iter().all(|e| (e.point as usize) < points)
            && self.order.iter().all(|&p| (p as usize) < points)
            && self.rows.is_sorted()
            && self
                .rows
                .last()
                .is_none_or(|&end| end as usize <= self.order.len())
    }
}

impl MatchesView<'_> {
    /// Whether every match's points exist; false for a damaged message.
    pub fn is_sound(&self) -> bool {
        let fits = |m: &Match| m.first as usize + m.count as usize <= self.points.len();
        self.matches.iter().all(fits)
    }
}
