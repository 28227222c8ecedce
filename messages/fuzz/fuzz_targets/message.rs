//! Every message decoder: whatever the bytes are, it says what is wrong or gives a message whose indices hold.
//!
//! `cargo +nightly fuzz run --fuzz-dir messages/fuzz message`
#![no_main]

use libfuzzer_sys::fuzz_target;
use messages::record::{Beside, Codec, Recorded, Said};
use messages::{Header, ImageView, Kind, Rail, Rig, Size, Stage, Topic};

fn decode<M: Recorded>(codec: &Codec, topic: &Topic, bytes: &[u8], beside: &[u8]) {
    // An image is there as it should be; what else is referred to is as strange as the message.
    let (rig, mut image) = (codec.rig(), Vec::new());
    let (pixels, header) = (vec![9; rig.size.pixels()], Header::new(1, 1, rig.size));
    let view = ImageView { pixels: &pixels }.into();
    let of = Topic::of(rig, Kind::Image).swap_remove(0);
    codec.clone().encode(&of, &header, view, Beside::default(), &mut image);
    let others = |kind: Kind| match kind {
        Kind::Image => Some(Said::Recorded(&image)),
        _ => (!beside.is_empty()).then_some(Said::Recorded(beside)),
    };
    if let Ok(message) = codec.decode::<M>(topic, 1, 1, bytes, &others) {
        assert!(M::is_sound(message.view()));
    }
}

fuzz_target!(|data: &[u8]| {
    let [kind, split, bytes @ ..] = data else {
        return;
    };
    let size = Size::new(16, 12);
    let kind = Kind::OWN[usize::from(*kind) % Kind::OWN.len()];
    let rig = match kind.stage() {
        Stage::MAP => Rig::of_rail(Rail::default(), &[4.0], size),
        _ => Rig::of_views(3, &[4.0], size),
    };
    let topic = Topic::of(&rig, kind).swap_remove(0);
    let codec = Codec::new(rig, 0);
    let (bytes, beside) = bytes.split_at(usize::from(*split).min(bytes.len()));
    macro_rules! decoded {
        ($kind:ident) => {
            decode::<messages::$kind>(&codec, &topic, bytes, beside)
        };
    }
    messages::of_kind!(kind, decoded, _ => {});
});
