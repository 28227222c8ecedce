//! Gray levels of images that have more than 8 bit, or other formats than most: what is black and what is white.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use capture::{Mode, Settings, Source, SourceError};
use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb};
use messages::{Image, Owned};
use tempfile::TempDir;

const SIZE: (u32, u32) = (48, 40);

/// A share of white, other at every place of every view; from black to white in each.
fn share(view: u32, x: u32, y: u32) -> f64 {
    f64::from((x * 5 + y * 3 + view * 17) % 120) / 119.0
}

fn gray(view: u32) -> GrayImage {
    GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        Luma([(share(view, x, y) * 255.0).round() as u8])
    })
}

type Deep = ImageBuffer<Luma<u16>, Vec<u16>>;

/// A view whose white is such a value.
fn deep(view: u32, white: u16) -> Deep {
    ImageBuffer::from_fn(SIZE.0, SIZE.1, |x, y| {
        Luma([(share(view, x, y) * f64::from(white)).round() as u16])
    })
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn file(&self, name: &str) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    /// Three views, each written by this.
    fn of(write: impl Fn(u32, &Path)) -> Self {
        let folder = Self::new();
        for view in 0..3 {
            write(view, &folder.file(&format!("view{view}")));
        }
        folder
    }

    fn settings(&self) -> Settings {
        Settings {
            source: self.0.path().to_str().unwrap().to_owned(),
            ..Settings::default()
        }
    }

    fn open(&self) -> Result<Source, SourceError> {
        Source::open(&self.settings())
    }
}

fn read(source: &mut Source, scan: u64, view: usize) -> Vec<u8> {
    let mut image = Owned::<Image>::new(source.size());
    image.fill(|room| source.read(scan, view, room)).unwrap();
    image.view().pixels.to_vec()
}

/// By how much the views of a scan differ from what they show, at most.
fn most_off(source: &mut Source, scan: u64) -> u8 {
    let off = (0..3).map(|view| {
        let pixels = read(source, scan, view);
        let shown = gray(view as u32);
        let pairs = pixels.iter().zip(shown.as_raw());
        pairs.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    });
    off.max().unwrap()
}

#[test]
fn ten_twelve_and_fourteen_bit_are_scaled_by_what_is_used() {
    for bits in [8u32, 10, 12, 14] {
        let white = (1u32 << bits) - 1;
        for format in ["png", "tiff"] {
            let folder = Folder::of(|view, path| {
                let path = path.with_extension(format);
                deep(view, white as u16).save(path).unwrap();
            });
            let mut source = folder.open().unwrap();
            let said = format!(
                "16-bit images hold at most {white}: they are taken for {bits} bit and scaled to 8, all alike; set capture.bits (16 where they are only dark)"
            );
            assert_eq!(source.notices(), [said], "{format}");
            assert_eq!(source.bits(), Some(bits as u8));
            assert!(most_off(&mut source, 0) <= 1, "{bits} bit {format}");
        }
    }
}

#[test]
fn a_dark_view_is_scaled_as_the_bright_ones_are_and_capture_started_anew_takes_the_same() {
    let folder = Folder::of(|view, path| {
        let white = [900, 4_000, 60][view as usize];
        deep(view, white).save(path.with_extension("png")).unwrap();
    });
    let mut source = folder.open().unwrap();
    assert_eq!(source.bits(), Some(12));
    let brightest = [0, 1, 2].map(|view| read(&mut source, 0, view).into_iter().max().unwrap());
    assert_eq!(brightest, [56, 249, 4]);
    let mut told = Source::open(&Settings {
        bits: Some(12),
        ..folder.settings()
    })
    .unwrap();
    for view in 0..3 {
        assert_eq!(read(&mut told, 0, view), read(&mut source, 0, view));
    }
}

#[test]
fn what_fills_sixteen_bits_from_the_top_is_not_made_brighter() {
    let shifted = |view: u32| {
        let mut image = deep(view, 1_000);
        image.iter_mut().for_each(|value| *value <<= 4);
        image
    };
    let folder = Folder::of(|view, path| shifted(view).save(path.with_extension("png")).unwrap());
    let mut source = folder.open().unwrap();
    assert_eq!(source.bits(), Some(16));
    let said = &source.notices()[0];
    assert!(said.contains("hold at most 16000 of 65535"), "{said}");
    assert_eq!(read(&mut source, 0, 0).into_iter().max(), Some(62));
}

#[test]
fn nearly_black_images_are_left_as_they_are_and_that_is_said() {
    let folder = Folder::of(|view, path| {
        deep(view, 40).save(path.with_extension("png")).unwrap();
    });
    let source = folder.open().unwrap();
    assert_eq!(source.bits(), Some(16));
    let said = &source.notices()[0];
    assert!(
        said.contains("they are black, or use fewer bits; set capture.bits"),
        "{said}"
    );
}

#[test]
fn a_brighter_scan_than_the_first_counts_and_one_that_is_not_looked_at_is_cut_off_and_told() {
    let scans = 200;
    let white = |scan: u32, bright: u32| if scan == bright { 3_900 } else { 1_000 };
    // Evenly over all scans some are looked at, the last one always.
    for (bright, bits) in [(scans - 1, 12), (1, 10)] {
        let folder = Folder::new();
        for scan in 0..scans {
            for view in 0..3 {
                let path = folder.file(&format!("{scan}/view{view}.png"));
                deep(view, white(scan, bright)).save(path).unwrap();
            }
        }
        let mut source = folder.open().unwrap();
        assert_eq!(source.bits(), Some(bits), "scan {bright}");
        assert_eq!(source.take_doubt(), None);
        let pixels = read(&mut source, u64::from(bright), 0);
        assert_eq!(
            pixels.iter().max(),
            Some(&(if bits == 10 { 255 } else { 243 }))
        );
        let told = source.take_doubt();
        assert_eq!(told.is_some(), bits == 10, "{told:?}");
        if let Some(told) = told {
            assert!(
                told.contains("1/view0.png (scan 1) holds up to 3900, more than 10 bit"),
                "{told}"
            );
            assert!(told.ends_with("set capture.bits=12"), "{told}");
            // Once a run.
            read(&mut source, 1, 1);
            assert_eq!(source.take_doubt(), None);
        }
    }
}

#[test]
fn bits_that_are_set_count_and_are_of_no_use_for_eight_bit() {
    let folder = Folder::of(|view, path| {
        deep(view, 1_023).save(path.with_extension("png")).unwrap();
    });
    let set = |bits, folder: &Folder| {
        Source::open(&Settings {
            bits: Some(bits),
            ..folder.settings()
        })
    };
    let mut source = set(12, &folder).unwrap();
    assert_eq!(
        source.notices(),
        ["16-bit images are taken for 12 bit, as capture.bits says, and scaled to 8"]
    );
    assert_eq!(read(&mut source, 0, 0).into_iter().max(), Some(64));
    let source = set(9, &folder).unwrap();
    let warned = source
        .warnings()
        .iter()
        .filter(|said| said.contains("more than 9 bit"));
    assert_eq!(warned.count(), 1, "{:?}", source.warnings());
    let plain = Folder::of(|view, path| gray(view).save(path.with_extension("png")).unwrap());
    let said = set(12, &plain).unwrap().notices()[0].clone();
    assert!(said.starts_with("capture.bits says nothing here"), "{said}");
    for bits in [7, 17] {
        assert!(set(bits, &folder).is_err());
    }
}

#[test]
fn a_png_may_say_how_many_bits_are_significant() {
    // 12 bit of which the first images use 9: only the file knows.
    let write = |path: &Path, image: &Deep, significant: u8| {
        let mut info = png::Info::with_size(SIZE.0, SIZE.1);
        info.color_type = png::ColorType::Grayscale;
        info.bit_depth = png::BitDepth::Sixteen;
        let encoder = png::Encoder::with_info(File::create(path).unwrap(), info).unwrap();
        let bytes: Vec<u8> = image.iter().flat_map(|value| value.to_be_bytes()).collect();
        let mut writer = encoder.write_header().unwrap();
        writer
            .write_chunk(png::chunk::sBIT, &[significant])
            .unwrap();
        writer.write_image_data(&bytes).unwrap();
    };
    let folder = Folder::of(|view, path| {
        write(&path.with_extension("png"), &deep(view, 500), 12);
    });
    let mut source = folder.open().unwrap();
    assert_eq!(source.bits(), Some(12));
    assert_eq!(read(&mut source, 0, 0).into_iter().max(), Some(31));
    // As PNG wants it: the upper bits.
    let folder = Folder::of(|view, path| {
        let mut image = deep(view, 200);
        image.iter_mut().for_each(|value| *value <<= 4);
        write(&path.with_extension("png"), &image, 12);
    });
    assert_eq!(folder.open().unwrap().bits(), Some(16));
}

#[test]
fn a_pgm_says_itself_what_white_is() {
    for white in [1_023u16, 4_095, 300] {
        let folder = Folder::of(|view, path| {
            let mut bytes =
                format!("P5\n# taken in the dark\n{} {}\n{white}\n", SIZE.0, SIZE.1).into_bytes();
            bytes.extend(
                deep(view, white / 4)
                    .iter()
                    .flat_map(|value| value.to_be_bytes()),
            );
            fs::write(path.with_extension("pgm"), bytes).unwrap();
        });
        let mut source = folder.open().unwrap();
        assert_eq!(
            (source.notices(), source.bits()),
            (&["16-bit images are scaled to 8 bit".to_owned()][..], None)
        );
        let brightest = read(&mut source, 0, 0).into_iter().max().unwrap();
        assert!(brightest.abs_diff(64) <= 1, "{white}: {brightest}");
    }
}

#[test]
fn colour_of_twelve_bit_is_scaled_too() {
    let folder = Folder::of(|view, path| {
        let image = deep(view, 4_095);
        let colour = ImageBuffer::<Rgb<u16>, _>::from_fn(SIZE.0, SIZE.1, |x, y| {
            Rgb([image.get_pixel(x, y)[0]; 3])
        });
        let path = path.with_extension("tiff");
        DynamicImage::ImageRgb16(colour).save(path).unwrap();
    });
    let mut source = folder.open().unwrap();
    assert_eq!(source.bits(), Some(12));
    assert!(most_off(&mut source, 0) <= 1);
}

/// Writes a TIFF of one number a pixel.
fn write_numbers<C>(path: &Path, values: &[C::Inner])
where
    C: tiff::encoder::colortype::ColorType,
    [C::Inner]: tiff::encoder::TiffValue,
{
    let file = File::create(path).unwrap();
    let mut encoder = tiff::encoder::TiffEncoder::new(file).unwrap();
    encoder.write_image::<C>(SIZE.0, SIZE.1, values).unwrap();
}

fn numbers(view: u32, white: f32) -> Vec<f32> {
    let shares = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| share(view, x, y)));
    shares.map(|share| share as f32 * white).collect()
}

#[test]
fn numbers_from_0_to_1_to_255_or_to_what_bits_hold_are_read() {
    use tiff::encoder::colortype::{Gray32, Gray32Float, Gray64Float};
    for white in [1.0f32, 255.0, 1_023.0, 4_095.0, 16_383.0, 65_535.0] {
        let single = Folder::of(|view, path| {
            let mut values = numbers(view, white);
            // What was not seen, and a little beyond what can be.
            values[7] = f32::NAN;
            values[8] = -0.01 * white;
            write_numbers::<Gray32Float>(&path.with_extension("tiff"), &values);
        });
        let mut source = single.open().unwrap();
        let said = format!(
            "images whose pixels are numbers are scaled to 8 bit: 0 is black and {white} is white, in all alike"
        );
        assert_eq!(source.notices(), [said]);
        let pixels = read(&mut source, 0, 1);
        assert_eq!(
            pixels[7..9],
            [pixels[6], 0],
            "no number, and less than black"
        );
        let shown = gray(1);
        let pairs = pixels.iter().zip(shown.as_raw()).enumerate();
        let mut off = pairs.filter(|(at, _)| !(7..9).contains(at));
        assert!(off.all(|(_, (a, b))| a.abs_diff(*b) <= 1), "{white}");
        let double = Folder::of(|view, path| {
            let values: Vec<f64> = numbers(view, white).into_iter().map(f64::from).collect();
            write_numbers::<Gray64Float>(&path.with_extension("tif"), &values);
        });
        assert!(most_off(&mut double.open().unwrap(), 0) <= 1, "{white}");
        if white > 1.0 {
            let whole = Folder::of(|view, path| {
                let values: Vec<u32> = numbers(view, white)
                    .into_iter()
                    .map(|v| v.round() as u32)
                    .collect();
                write_numbers::<Gray32>(&path.with_extension("tiff"), &values);
            });
            assert!(most_off(&mut whole.open().unwrap(), 0) <= 1, "{white}");
        }
    }
}

#[test]
fn twelve_bit_of_which_white_is_zero_are_scaled_too() {
    use tiff::encoder::colortype::Gray16;
    use tiff::tags::Tag;
    let folder = Folder::of(|view, path| {
        let file = File::create(path.with_extension("tiff")).unwrap();
        let mut encoder = tiff::encoder::TiffEncoder::new(file).unwrap();
        let mut image = encoder.new_image::<Gray16>(SIZE.0, SIZE.1).unwrap();
        let white = image.encoder();
        white
            .write_tag(Tag::PhotometricInterpretation, 0u16)
            .unwrap();
        let negative: Vec<u16> = deep(view, 4_095)
            .iter()
            .map(|value| 4_095 - value)
            .collect();
        image.write_data(&negative).unwrap();
    });
    let mut source = folder.open().unwrap();
    assert_eq!(source.bits(), Some(12));
    assert!(most_off(&mut source, 0) <= 1);
}

#[test]
fn numbers_that_cannot_be_gray_levels_are_refused() {
    use tiff::encoder::colortype::Gray32Float;
    let pixels = (SIZE.0 * SIZE.1) as usize;
    let normalized: Vec<f32> = numbers(0, 4.0).iter().map(|value| value - 2.0).collect();
    for (values, said) in [
        (vec![f32::NAN; pixels], "no numbers (NaN)"),
        (normalized, "nearly all from -2 to"),
        (numbers(0, 1e7), "to 1"),
        (vec![0.0; pixels], "from 0 to 0"),
    ] {
        let folder = Folder::of(|_, path| {
            write_numbers::<Gray32Float>(&path.with_extension("tiff"), &values);
        });
        let refusal = folder.open().unwrap_err().to_string();
        assert!(
            refusal.contains(said) && refusal.contains("view0.tiff has pixels that are"),
            "{refusal}"
        );
    }
}

#[test]
fn bmp_and_webp_are_read() {
    for format in ["bmp", "webp", "WEBP"] {
        let folder = Folder::of(|view, path| {
            gray(view).save(path.with_extension(format)).unwrap();
        });
        let mut source = folder.open().unwrap();
        assert_eq!(most_off(&mut source, 0), 0, "{format}");
        // Cut off, they are refused.
        let path = fs::read_dir(folder.0.path())
            .unwrap()
            .next()
            .unwrap()
            .unwrap()
            .path();
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() * 2 / 3]).unwrap();
        let refusal = folder.open().unwrap_err().to_string();
        assert!(
            refusal.contains("cannot be read as an image"),
            "{format}: {refusal}"
        );
    }
}

fn jpeg(view: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 95)
        .encode_image(&gray(view))
        .unwrap();
    bytes
}

#[test]
fn a_jpeg_without_its_end_mark_is_read_where_all_rows_are_there() {
    let whole = Folder::of(|view, path| fs::write(path.with_extension("jpg"), jpeg(view)).unwrap());
    let mut whole = whole.open().unwrap();
    // Without the mark, with half of it, and with zeros that a buffer was filled up with.
    for (left, filled) in [(2, 0), (1, 0), (2, 100)] {
        let folder = Folder::of(|view, path| {
            let mut bytes = jpeg(view);
            bytes.truncate(bytes.len() - left);
            bytes.resize(bytes.len() + filled, 0);
            fs::write(path.with_extension("jpg"), bytes).unwrap();
        });
        let mut source = folder.open().unwrap();
        for view in 0..3 {
            assert_eq!(read(&mut source, 0, view), read(&mut whole, 0, view));
        }
    }
    for lost in [12, 100, 400] {
        let folder = Folder::of(|view, path| {
            let bytes = jpeg(view);
            fs::write(path.with_extension("jpg"), &bytes[..bytes.len() - lost]).unwrap();
        });
        let refusal = folder.open().unwrap_err().to_string();
        assert!(
            refusal.contains("it ends before its last row"),
            "{lost}: {refusal}"
        );
    }
}

#[test]
fn frames_of_a_rail_are_scaled_alike() {
    let folder = Folder::new();
    for frame in 0..8 {
        let path = folder.file(&format!("{frame}.png"));
        deep(frame, if frame == 0 { 700 } else { 4_095 })
            .save(path)
            .unwrap();
    }
    let settings = Settings {
        mode: Mode::Rail,
        stride: Some(1),
        ..folder.settings()
    };
    let mut source = Source::open(&settings).unwrap();
    assert_eq!(source.bits(), Some(12));
    assert_eq!(read(&mut source, 0, 0).into_iter().max(), Some(44));
    assert_eq!(read(&mut source, 1, 0).into_iter().max(), Some(255));
}
