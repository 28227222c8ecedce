//! Ground truth: what a perfect result would be.

use messages::Size;

/// The true disparities of one view, and which of its points all chosen views see.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Size of the view.
    pub size: Size,
    /// Pixels between neighbouring chosen views, row by row; NaN where unknown.
    pub disparity: Vec<f32>,
    /// Whether all chosen views see the point of this pixel; false where the disparity is unknown.
    pub visible: Vec<bool>,
}

impl Truth {
    /// Truth from disparities alone, seen in chosen view `view` of `views`: a point is hidden where it leaves the
    /// picture or where one of smaller depth lands within half a pixel of it.
    pub(crate) fn from_disparity(
        size: Size,
        disparity: Vec<f32>,
        view: usize,
        views: usize,
    ) -> Self {
        let width = size.width as usize;
        let mut visible: Vec<bool> = disparity.iter().map(|d| !d.is_nan()).collect();
        let mut nearest = vec![f32::NEG_INFINITY; width];
        for (row, visible) in disparity.chunks(width).zip(visible.chunks_mut(width)) {
            for steps in (0..views)
                .filter(|&other| other != view)
                .map(|other| other as f32 - view as f32)
            {
                let land = |x: usize, disparity: f32| {
                    let column = (x as f32 - steps * disparity).round();
                    (0.0..width as f32)
                        .contains(&column)
                        .then_some(column as usize)
                };
                nearest.fill(f32::NEG_INFINITY);
                for (x, &disparity) in row.iter().enumerate() {
                    if let Some(column) = land(x, disparity) {
                        nearest[column] = nearest[column].max(disparity);
                    }
                }
                for (x, (&disparity, visible)) in row.iter().zip(&mut *visible).enumerate() {
                    // Points of one surface may share a column.
                    *visible &=
                        land(x, disparity).is_some_and(|column| disparity > nearest[column] - 1.0);
                }
            }
        }
        Self {
            size,
            disparity,
            visible,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_near_strip_hides_what_lies_behind_it_in_the_other_views() {
        // Ground at disparity 1, and at columns 10 to 13 a strip at disparity 5.
        let size = Size::new(32, 1);
        let strip = 10..14;
        let disparity = (0..32)
            .map(|x| if strip.contains(&x) { 5.0 } else { 1.0 })
            .collect();
        let truth = Truth::from_disparity(size, disparity, 0, 3);
        let hidden: Vec<usize> = (0..32).filter(|&x| !truth.visible[x]).collect();
        // In view 1 the strip lands on columns 5 to 8, where ground from 6 to 9 lands; in view 2 on 0 to 3, where
        // ground from 2 to 5 lands. Ground columns 0 and 1 leave the picture.
        assert_eq!(hidden, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }

    #[test]
    fn unknown_points_are_not_visible() {
        let truth = Truth::from_disparity(Size::new(3, 1), vec![0.0, f32::NAN, 0.0], 1, 3);
        assert_eq!(truth.visible, [true, false, true]);
    }
}
