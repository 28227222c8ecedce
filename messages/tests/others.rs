//! Messages of others: defined once, known everywhere.
#![expect(clippy::unwrap_used, reason = "tests")]

use messages::record::{Beside, Codec, Schema};
use messages::{
    AnyView, Header, Kind, Message, Owned, RegisterError, Rig, Size, Stage, Topic, register,
};
use prost_types::FileDescriptorSet;

messages::row! { "bytemuck";
    /// Zero-crossings of about one strength.
    pub struct Class {
        /// The least of their magnitudes, in gray levels per pixel.
        pub least: f32,
        /// How many there are.
        pub count: u32,
    }
}

messages::message! {
    /// How strong the zero-crossings of a view are.
    pub Histogram, HistogramView, HistogramRoom
        = "histogram" by "histogram" from [Kind::Edges] per [view, channel] {
        /// Weakest first.
        classes: Class = |_size| 4,
        /// The strongest rows, strongest first.
        rows: u32 = |size| size.height as usize,
    }
}

messages::message! {
    /// Whether a scan is worth keeping.
    pub Verdict, VerdictView, VerdictRoom
        = "verdict" by "judge" from [Histogram::KIND, Kind::Points] per [] {
        /// One number: 0 to 1.
        worth: f32 = |_size| 1,
    }
}

messages::message! {
    /// Takes a name that there is.
    Taken, TakenView, TakenRoom = "edges" by "others" from [] per [] {
        /// Nothing.
        nothing: u32 = |_size| 1,
    }
}

messages::message! {
    /// Is no word.
    Worse, WorseView, WorseRoom = "a/b" by "others" from [] per [] {
        /// Nothing.
        nothing: u32 = |_size| 1,
    }
}

messages::message! {
    /// Consists of what no recording holds as rows.
    Bytes, BytesView, BytesRoom = "bytes" by "others" from [] per [] {
        /// Bytes.
        bytes: u8 = |_size| 1,
    }
}

messages::message! {
    /// Has a maker that waits for the one that waits for it.
    Chicken, ChickenView, ChickenRoom = "chicken" by "hen" from [Egg::KIND] per [] {
        /// Nothing.
        nothing: u32 = |_size| 1,
    }
}

messages::message! {
    /// What it came of.
    Egg, EggView, EggRoom = "egg" by "coop" from [] per [] {
        /// Nothing.
        nothing: u32 = |_size| 1,
    }
}

messages::message! {
    /// And what that came of.
    Coop, CoopView, CoopRoom = "straw" by "coop" from [Chicken::KIND] per [] {
        /// Nothing.
        nothing: u32 = |_size| 1,
    }
}

fn rig() -> Rig {
    Rig::of_views(3, &[4.0, 2.0], Size::new(40, 30))
}

fn sample() -> Owned<Histogram> {
    let mut histogram = Owned::<Histogram>::new(rig().size);
    histogram.header = Header {
        view: 1,
        channel: 1,
        ..Header::new(7, 1_700_000_000_123_456_789, Size::new(40, 30))
    };
    let class = |least: f32, count| Class { least, count };
    histogram.fill(|room| {
        let classes = [class(0.5, 9), class(f32::NAN, 0), class(-0.0, u32::MAX)];
        room.classes.extend_from_slice(&classes);
        room.rows.extend_from_slice(&[3, 0, 29]);
    });
    histogram
}

/// One test: what is registered is so for the whole process.
#[test]
fn what_others_define_once_has_topics_schema_encoding_and_comparison_like_ours() {
    let refused = |kind, error: fn(String) -> RegisterError, name: &str| {
        assert_eq!(register(&[kind]), Err(error(name.to_owned())));
    };
    refused(Taken::KIND, RegisterError::Taken, "edges");
    refused(Worse::KIND, RegisterError::Name, "a/b");
    refused(Bytes::KIND, RegisterError::Rows, "bytes");
    let circle = register(&[Chicken::KIND, Egg::KIND, Coop::KIND]);
    assert_eq!(circle, Err(RegisterError::Circle("hen".to_owned())));
    let twice = register(&[Verdict::KIND, Verdict::KIND]);
    assert_eq!(twice, Err(RegisterError::Taken("verdict".to_owned())));
    assert_eq!(Stage::named("histogram"), None);

    register(&[Histogram::KIND, Verdict::KIND]).unwrap();
    assert_eq!(register(&[]), Err(RegisterError::Twice));

    // Topics and stages.
    let topics = Topic::of(&rig(), Histogram::KIND);
    assert_eq!(topics.len(), 6);
    assert_eq!(topics[3].name, "histogram/centre/2");
    assert!(Topic::all(&rig()).contains(&topics[0]));
    let (histogram, judge) = (Stage::named("histogram"), Stage::named("judge"));
    let (histogram, judge) = (histogram.unwrap(), judge.unwrap());
    assert_eq!(histogram.takes(), [Kind::Edges]);
    assert!(histogram.follows(Stage::FILTER) && !histogram.follows(Stage::TRACK));
    assert!(judge.follows(histogram) && judge.follows(Stage::TRACK));
    assert!(!Stage::EVALUATE.follows(histogram));
    let text = serde_json::to_string(&Histogram::KIND).unwrap();
    assert_eq!(
        serde_json::from_str::<Kind>(&text).unwrap(),
        Histogram::KIND
    );

    // Encoding and back, with the types and without.
    let sample = sample();
    let mut codec = Codec::new(rig(), 0);
    let mut bytes = Vec::new();
    let (header, view) = (sample.header, AnyView::from(sample.view()));
    codec.encode(&topics[3], &header, view, Beside::default(), &mut bytes);
    let nobody = |_| None;
    let (number, nanos) = (header.sequence, header.capture_nanos);
    let own: Owned<Histogram> = codec
        .decode(&topics[3], number, nanos, &bytes, &nobody)
        .unwrap();
    assert_eq!(view.difference(&own.view().into()), None);
    let (read, other) = codec
        .decode_other(&topics[3], number, nanos, &bytes)
        .unwrap();
    assert_eq!(view.difference(&AnyView::Other(other.view())), None);
    assert_eq!((read, own.header), (own.header, read));
    assert_eq!((read.view, read.channel, read.lens), (1, 1, header.lens));

    // Damaged, it is told, and more than there can be is refused.
    for len in 0..bytes.len() {
        let cut = &bytes[..len];
        if let Ok((_, other)) = codec.decode_other(&topics[3], number, nanos, cut) {
            assert!(other.view().memory().concat().len() < view.memory().concat().len());
        }
    }
    let thrice = bytes.repeat(3);
    assert!(
        codec
            .decode_other(&topics[3], number, nanos, &thrice)
            .is_err()
    );

    // The first difference, in the words of the definition.
    let mut changed = own.clone();
    changed.fill(|room| {
        let class = |least: f32, count| Class { least, count };
        let classes = [class(0.5, 9), class(f32::NAN, 1)];
        room.classes.extend_from_slice(&classes);
    });
    let difference = view.difference(&changed.view().into()).unwrap();
    assert_eq!((difference.section, difference.element), ("classes", 1));
    assert_eq!(
        difference.one.as_deref(),
        Some("Class { least: NaN, count: 0 }")
    );
    assert_eq!(
        difference.other.as_deref(),
        Some("Class { least: NaN, count: 1 }")
    );
    let sections = view.sections(1);
    assert_eq!((sections[0].len, sections[1].name), (3, "rows"));
    assert_eq!(sections[0].first, ["Class { least: 0.5, count: 9 }"]);

    // A schema that says what it all means.
    let schema = Schema::of(Histogram::KIND);
    assert_eq!(schema.name, "tricurve.histogram.Histogram");
    let set = <FileDescriptorSet as prost::Message>::decode(&*schema.data).unwrap();
    let file = set.file.last().unwrap();
    let names: Vec<&str> = file.message_type.iter().map(|m| m.name()).collect();
    assert_eq!(names, ["Class", "Histogram"]);
    let comments = &file.source_code_info.as_ref().unwrap().location;
    let is_said = |text: &str| {
        let mut all = comments.iter().map(|at| at.leading_comments());
        all.any(|comment| comment.contains(text))
    };
    assert!(is_said("in gray levels per pixel") && is_said("The strongest rows"));
}
