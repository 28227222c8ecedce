//! What the embedded schemas say of their fields in words: enough to read our messages without our code.

use prost_types::source_code_info::Location;
use prost_types::{FileDescriptorProto, SourceCodeInfo};

/// Message, field (empty for the message itself), and what it is.
const COMMENTS: &[(&str, &str, &str)] = &[
    (
        "Packed",
        "",
        "Records of one type, one after the other: `stride` bytes each, in them the fields.",
    ),
    (
        "Edges",
        "",
        "Zero-crossings of a view in a channel, row by row and from left to right, one a pixel at most. Pixel (0, 0) is the top \
         left one, whole coordinates are the centres of pixels, x goes right and y down. A crossing lies between the centre \
         of its pixel and that of the pixel to the right, in the row, or of the pixel below, in the column. Either the columns \
         5 to 9 and perhaps 10 are there, with one element an edge, or the edges stand in field 11 as they are.",
    ),
    (
        "Edges",
        "counts",
        "How many edges each row has, from row 0 on.",
    ),
    (
        "Edges",
        "gaps",
        "Of each edge g: g >> 1 pixels of its row lie between the pixel of the edge before it and its own, of a row's first \
         edge between the border and its own. g & 1 is 0 where it lies in the row and 1 where it lies in the column.",
    ),
    (
        "Edges",
        "parts",
        "A byte p an edge: it is p / 256 pixels to the right of its pixel's centre where it lies in the row, and p / 256 below \
         it where it lies in the column. x and y are the pixel's column and row plus that.",
    ),
    (
        "Edges",
        "magnitudes",
        "Two bytes m an edge, unsigned, the lower one first: the gradient is m / 256 gray levels per pixel.",
    ),
    (
        "Edges",
        "orientations",
        "Two bytes o an edge, signed, the lower one first: the gradient, from dark to bright, points to o * pi / 32768 \
         radians; 0 is to the right, pi / 2 down. -32768 is pi.",
    ),
    (
        "Edges",
        "profiles",
        "Eight bytes an edge: gray levels beside it, at x - 6, - 4, - 2.5, - 1.25, + 1.25, + 2.5, + 4 and + 6. Left out where \
         they follow from `camera/VIEW/image` of the same scan: take the edge's row, the one below where it lies 128 / 256 or \
         more below, but none beyond the last; make of each column s = (above + 2 * here + below + 2) >> 2, borders repeated; \
         and between columns k and k + 1, f / 256 from k, take (s[k] * (256 - f) + s[k + 1] * f + 128) >> 8.",
    ),
    (
        "Edges",
        "edges",
        "The edges as they are, where they are no whole numbers of these steps.",
    ),
    (
        "Curves",
        "",
        "Curves of a view in a channel, numbered from 0, and their points curve by curve. The curves are either the columns 8 to \
         13, with one element a curve, or messages in field 5. The points are either the columns 14 and 15, or stand in field \
         6, or are indices in field 7. A point is an edge of `edges/VIEW/CHANNEL` of the same scan.",
    ),
    ("Curves", "curves", "The curves one by one."),
    (
        "Curves",
        "points",
        "The points as they are, where they are no edges.",
    ),
    (
        "Curves",
        "edges",
        "Each point's index among the edges; written until there were columns 14 and 15.",
    ),
    ("Curves", "counts", "How many points each curve has."),
    (
        "Curves",
        "parents",
        "0, or one more than the number of the curve that it branches off.",
    ),
    ("Curves", "x", "Mean column of its points."),
    ("Curves", "y", "Mean row of its points."),
    (
        "Curves",
        "magnitude",
        "Mean gradient of its points, in gray levels per pixel.",
    ),
    ("Curves", "length", "Length along the curve, in pixels."),
    (
        "Curves",
        "starts",
        "The pixel of each curve's first point, row * image_width + column, less that of the curve before it. The point is the \
         one edge of that pixel.",
    ),
    (
        "Curves",
        "steps",
        "A byte for every point but a curve's first: from the pixel of the point before it to its own, rows down in the upper \
         four bits and columns to the right in the lower, each from -8 to 7 in two's complement.",
    ),
    (
        "Tables",
        "",
        "R-tables of a view's curves in a channel, and all points of these curves by rows.",
    ),
    ("Tables", "tables", "The tables one by one."),
    (
        "Tables",
        "entries",
        "The entries table by table, where they do not follow from the curves' points.",
    ),
    (
        "Tables",
        "rows",
        "Where each row's points start in the order by rows, and where the last one's end; a point between two rows belongs to \
         the upper.",
    ),
    (
        "Tables",
        "order",
        "Indices of points of `curves/VIEW/CHANNEL`, row by row. Left out where each row's are in order of their columns.",
    ),
    (
        "Tables",
        "points",
        "Of each entry the index of its point: it is filed under the point's orientation, and its vector is the table's place \
         less the point's.",
    ),
    (
        "Tables",
        "weights",
        "What each entry's vote counts; left out where all count 1.",
    ),
    (
        "Tables",
        "tables_follow",
        "Every curve has a table: its place is the curve's, its entries are all the curve's points in order of orientation, of \
         equal ones the lower index first, and its weight is the sum of theirs.",
    ),
    (
        "Tables",
        "rows_follow",
        "Rows and order are those of the points, each row's in order of columns, of equal ones the lower index first.",
    ),
    (
        "Matches",
        "",
        "Matched curves of the reference view in a channel. Their points, match by match, stand in field 6, or are the columns 8 \
         to 10 with one element a point.",
    ),
    ("Matches", "matches", "The matches one by one."),
    ("Matches", "points", "The points as they are."),
    (
        "Matches",
        "rejected",
        "Curves that were not matched, and why: the code of a messages::Reason.",
    ),
    (
        "Matches",
        "gaps",
        "Of each point g: g >> 1 points of `curves/VIEW/CHANNEL`, VIEW being the reference view, lie between the one before it \
         and its own, before the first as many lie from the beginning. It is at that point's x and y. g & 1 is 1 where its \
         disparity was filled in along the curve.",
    ),
    (
        "Matches",
        "disparities",
        "Disparity between neighbouring views, in pixels.",
    ),
    ("Matches", "scores", "Confidence, 0 to 1, higher is surer."),
];

/// The comments on a file's messages, where protobuf keeps them.
pub(super) fn of(file: &FileDescriptorProto) -> SourceCodeInfo {
    // Messages are field 4 of a file, fields field 2 of a message.
    const MESSAGE: i32 = 4;
    const FIELD: i32 = 2;
    let location = |(message, field, text): &(&str, &str, &str)| {
        let at = file
            .message_type
            .iter()
            .position(|m| m.name() == *message)?;
        let mut path = vec![MESSAGE, at as i32];
        if !field.is_empty() {
            let fields = &file.message_type[at].field;
            let at = fields.iter().position(|f| f.name() == *field)?;
            path.extend([FIELD, at as i32]);
        }
        Some(Location {
            path,
            span: vec![0, 0, 0],
            leading_comments: Some(format!(" {text}\n")),
            ..Location::default()
        })
    };
    SourceCodeInfo {
        location: COMMENTS.iter().filter_map(location).collect(),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::payload::Kind;
    use crate::record::Schema;
    use prost::Message as _;
    use prost_types::FileDescriptorSet;

    fn own() -> FileDescriptorProto {
        let set = FileDescriptorSet::decode(&*Schema::of(Kind::Edges).data).unwrap();
        set.file
            .into_iter()
            .find(|f| f.package() == "tricurve")
            .unwrap()
    }

    #[test]
    fn every_comment_is_on_something_that_there_is() {
        let comments = of(&own());
        assert_eq!(comments.location.len(), COMMENTS.len());
        assert_eq!(own().source_code_info, Some(comments));
    }

    #[test]
    fn every_column_says_what_it_is() {
        // The head says it by its names.
        const HEAD: i32 = 4;
        for message in own().message_type {
            if !COMMENTS
                .iter()
                .any(|(of, field, _)| *of == message.name() && field.is_empty())
            {
                continue;
            }
            let columns = message.field.iter().filter(|f| f.number() > HEAD);
            for column in columns {
                let is_it = |(of, field, _): &&(&str, &str, &str)| {
                    (*of, *field) == (message.name(), column.name())
                };
                assert!(
                    COMMENTS.iter().any(|comment| is_it(&comment)),
                    "{}.{}",
                    message.name(),
                    column.name()
                );
            }
        }
    }
}
