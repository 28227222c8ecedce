//! The node: `edges ─► histogram ─► histogram`, a view and channel at a time.

use tricurve::NodeType;
use tricurve::messages::bus::{Bus, BusError, Start};
use tricurve::messages::{Edge, Edges, Kind, Message};

tricurve::settings! {
    /// How zero-crossings are counted.
    pub struct Settings {
        /// Gray levels per pixel from the weakest edge of one class to that of the next.
        pub step: f32 = 4.0, in 0.1..=64;
    }
}

tricurve::row! {
    /// Zero-crossings of about one strength.
    pub struct Class {
        /// The least of their magnitudes, in gray levels per pixel.
        pub least: f32,
        /// How many there are.
        pub count: u32,
    }
}

/// Classes of a histogram; the last one has all that are stronger.
const CLASSES: usize = 16;

tricurve::message! {
    /// How strong the zero-crossings of a view in a channel are.
    pub Histogram, HistogramView, HistogramRoom
        = "histogram" by "histogram" from [Kind::Edges] per [view, channel] {
        /// Weakest first.
        classes: Class = |_size| CLASSES,
    }
}

/// The node as graph files know it.
pub fn node() -> NodeType {
    NodeType::new("histogram", "how strong the zero-crossings are", run)
        .message::<Histogram>()
        .version(1)
        .tunable_but(&[])
}

/// Counts the zero-crossings of every view and channel that comes, until told to stop.
fn run(bus: &mut Bus, settings: Settings, _start: &Start) -> Result<(), BusError> {
    let mut edges = bus.inputs(&[Kind::Edges])?;
    let histograms = bus.outputs(&[Histogram::KIND])?;
    let mut step = bus.tuned(&settings, |settings| settings.step)?;
    let mut counted = 0;
    bus.ready()?;
    while let Some(message) = bus.next(&mut edges)? {
        let header = message.header();
        let edges = message.view::<Edges>()?.edges;
        let classes = counted_by(edges, *step.at(&header)?);
        histograms.send::<Histogram>(&header, header.view, header.channel, |room| {
            room.classes.extend_from_slice(&classes);
        })?;
        counted += edges.len() as u64;
    }
    bus.finish(&[("edges", counted)]);
    Ok(())
}

/// The pure part: how many edges are how strong.
fn counted_by(edges: &[Edge], step: f32) -> [Class; CLASSES] {
    let mut classes = [Class::default(); CLASSES];
    for (number, class) in classes.iter_mut().enumerate() {
        class.least = number as f32 * step;
    }
    for edge in edges {
        let class = (edge.magnitude / step) as usize;
        classes[class.min(CLASSES - 1)].count += 1;
    }
    classes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_is_in_one_class_and_the_strongest_are_in_the_last() {
        let of = |magnitude| Edge {
            magnitude,
            ..Edge::default()
        };
        let classes = counted_by(&[of(0.0), of(3.9), of(4.0), of(250.0)], 4.0);
        let counts = classes.map(|class| class.count);
        assert_eq!(counts[..3], [2, 1, 0]);
        assert_eq!((counts[CLASSES - 1], classes[1].least), (1, 4.0));
    }
}
