//! True contours, of scenes that know them: what can be seen as an edge, and why it is one.

/// Why a contour is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ContourKind {
    /// A thing ends before another that lies deeper.
    Silhouette,
    /// Two surfaces meet.
    Crease,
    /// A paint ends.
    Mark,
    /// A shadow ends that one thing throws on another: half of the lamp is seen from there. Where a round thing turns away
    /// from the lamp there is none.
    Shadow,
}

impl ContourKind {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::Silhouette, Self::Crease, Self::Mark, Self::Shadow];
}

/// A point of a contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourPoint {
    /// Column.
    pub x: f32,
    /// Row.
    pub y: f32,
    /// Pixels between neighbouring chosen views, of the nearer of the two things that meet there.
    pub disparity: f32,
    /// By how many gray levels what lies on its two sides differs, without noise and blur, 2.5 pixels away or as far as it
    /// reaches: of a soft shadow, by how much it changes within five pixels.
    pub contrast: f32,
    /// Which chosen views show it, a bit each from the lowest on: where it is neither outside nor hidden, and an edge there
    /// too.
    pub seen: u32,
}

/// A contour of a view, from where it begins or comes out from behind another to where it ends or goes behind one; a
/// closed one ends with the point it begins with.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour {
    /// Why it is one.
    pub kind: ContourKind,
    /// In order, at most about a pixel and a half apart.
    pub points: Vec<ContourPoint>,
}

impl Contour {
    /// Its length in pixels.
    pub fn length(&self) -> f32 {
        let pairs = self.points.windows(2);
        pairs
            .map(|two| (two[1].x - two[0].x).hypot(two[1].y - two[0].y))
            .sum()
    }
}
