//! How messages lie in memory: ROS 2's CDR in either byte order, ROS 1's packed form, and protobuf's fields.

/// What is wrong with a message, as the second half of a sentence.
pub(super) type Why = String;

/// Reads a message of ROS, field after field.
#[derive(Clone, Debug)]
pub(super) struct Wire<'a> {
    bytes: &'a [u8],
    at: usize,
    is_big: bool,
    /// Numbers begin at multiples of their size, up to this one.
    alignment: usize,
    /// Whether strings end with a zero that counts.
    has_zeros: bool,
}

/// The kinds of encapsulation that hold plain CDR: byte order and greatest alignment.
const PLAIN: [(u8, bool, usize); 4] = [
    (0x00, true, 8),
    (0x01, false, 8),
    (0x06, true, 4),
    (0x07, false, 4),
];

impl<'a> Wire<'a> {
    /// Of CDR, which begins with four bytes that say how it is written down.
    pub(super) fn cdr(bytes: &'a [u8]) -> Result<Self, Why> {
        let Some((&[_, kind, _, _], body)) = bytes.split_first_chunk() else {
            return Err(short(bytes.len()));
        };
        let Some(&(_, is_big, alignment)) = PLAIN.iter().find(|(known, ..)| *known == kind) else {
            return Err(format!(
                "it is encapsulated as 0x{kind:02x}, and plain CDR is read"
            ));
        };
        Ok(Self {
            bytes: body,
            at: 0,
            is_big,
            alignment,
            has_zeros: true,
        })
    }

    /// Of ROS 1, which packs numbers without gaps.
    pub(super) fn ros1(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            is_big: false,
            alignment: 1,
            has_zeros: false,
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Why> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let taken = rest.get(..count).ok_or_else(|| short(self.bytes.len()))?;
        self.at += count;
        Ok(taken)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], Why> {
        self.at = self.at.next_multiple_of(N.min(self.alignment));
        let mut number = [0; N];
        number.copy_from_slice(self.take(N)?);
        if self.is_big {
            number.reverse();
        }
        Ok(number)
    }

    pub(super) fn u8(&mut self) -> Result<u8, Why> {
        self.number::<1>().map(|[byte]| byte)
    }

    pub(super) fn u32(&mut self) -> Result<u32, Why> {
        self.number().map(u32::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Result<f32, Why> {
        self.number().map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, Why> {
        self.number().map(f64::from_le_bytes)
    }

    pub(super) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Why> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64()?;
        }
        Ok(numbers)
    }

    pub(super) fn string(&mut self) -> Result<String, Why> {
        let length = self.u32()? as usize;
        let mut text = self.take(length)?;
        if self.has_zeros {
            text = text.strip_suffix(&[0]).unwrap_or(text);
        }
        Ok(String::from_utf8_lossy(text).into_owned())
    }

    /// A sequence, of each element as `read` reads it.
    pub(super) fn list<T>(
        &mut self,
        mut read: impl FnMut(&mut Self) -> Result<T, Why>,
    ) -> Result<Vec<T>, Why> {
        // No count reserves memory: a damaged one would take all there is.
        let count = self.u32()?;
        let mut list = Vec::new();
        for _ in 0..count {
            list.push(read(self)?);
        }
        Ok(list)
    }

    /// A sequence of bytes: how many there are, and those that are here.
    pub(super) fn bytes(&mut self) -> Result<(usize, &'a [u8]), Why> {
        let length = self.u32()? as usize;
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let here = &rest[..length.min(rest.len())];
        self.at += here.len();
        Ok((length, here))
    }

    /// A time, in nanoseconds; 0 for one before 1970.
    pub(super) fn time(&mut self) -> Result<u64, Why> {
        let (seconds, nanos) = (self.u32()?, self.u32()?);
        Ok(nanos_of(i64::from(seconds as i32), u64::from(nanos)))
    }

    /// A header: when, and in which frame.
    pub(super) fn header(&mut self) -> Result<(u64, String), Why> {
        if !self.has_zeros {
            // ROS 1 counts messages.
            self.u32()?;
        }
        Ok((self.time()?, self.string()?))
    }
}

pub(super) fn nanos_of(seconds: i64, nanos: u64) -> u64 {
    let seconds = u64::try_from(seconds).unwrap_or_default();
    seconds.saturating_mul(1_000_000_000).saturating_add(nanos)
}

fn short(length: usize) -> Why {
    format!("it ends after {length} bytes")
}

/// One field of a protobuf message.
#[derive(Clone, Copy, Debug)]
pub(super) enum Field<'a> {
    /// A whole number.
    Number(u64),
    /// Eight bytes.
    Double(f64),
    /// Bytes, a text or a message: how many there are, and those that are here.
    Bytes(usize, &'a [u8]),
}

/// Goes through the fields of a protobuf message, up to where it is cut off.
pub(super) fn fields<'a>(
    mut bytes: &'a [u8],
    mut take: impl FnMut(u64, Field<'a>) -> Result<(), Why>,
) -> Result<(), Why> {
    let whole = bytes.len();
    while !bytes.is_empty() {
        let key = varint(&mut bytes).ok_or_else(|| short(whole))?;
        let field = match key & 7 {
            0 => Field::Number(varint(&mut bytes).ok_or_else(|| short(whole))?),
            1 => {
                let (number, rest) = bytes.split_first_chunk().ok_or_else(|| short(whole))?;
                bytes = rest;
                Field::Double(f64::from_le_bytes(*number))
            }
            2 => {
                let length = varint(&mut bytes).ok_or_else(|| short(whole))?;
                let length = usize::try_from(length).map_err(|_| short(whole))?;
                let (here, rest) = bytes.split_at(length.min(bytes.len()));
                bytes = rest;
                Field::Bytes(length, here)
            }
            5 => {
                let (number, rest) = bytes.split_first_chunk().ok_or_else(|| short(whole))?;
                bytes = rest;
                Field::Number(u32::from_le_bytes(*number).into())
            }
            _ => return Err("it is no protobuf message".to_owned()),
        };
        take(key >> 3, field)?;
    }
    Ok(())
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn numbers_lie_at_multiples_of_their_size_after_the_encapsulation() {
        // A byte, a gap of three, a u32; then a gap up to 8 for a double.
        let little = [
            &[0, 1, 0, 0, 7, 9, 9, 9, 1, 2, 0, 0][..],
            &1.5f64.to_le_bytes(),
        ]
        .concat();
        let big = [
            &[0, 0, 0, 0, 7, 9, 9, 9, 0, 0, 2, 1][..],
            &1.5f64.to_be_bytes(),
        ]
        .concat();
        for bytes in [little, big] {
            let mut wire = Wire::cdr(&bytes).unwrap_or_else(|why| panic!("{why}"));
            assert_eq!(wire.u8(), Ok(7));
            assert_eq!(wire.u32(), Ok(0x201));
            assert_eq!(wire.f64(), Ok(1.5));
            assert_eq!(wire.u8(), Err("it ends after 16 bytes".to_owned()));
        }
    }

    #[test]
    fn the_newer_cdr_aligns_doubles_to_four_bytes() {
        let bytes = [&[0, 7, 0, 0, 1, 0, 0, 0][..], &2.5f64.to_le_bytes()].concat();
        let mut wire = Wire::cdr(&bytes).unwrap_or_else(|why| panic!("{why}"));
        assert_eq!((wire.u32(), wire.f64()), (Ok(1), Ok(2.5)));
        let why = Wire::cdr(&[0, 3, 0, 0]).map(|_| ()).unwrap_err();
        assert!(why.contains("0x03"), "{why}");
    }

    #[test]
    fn a_damaged_count_takes_no_memory() {
        let mut wire = Wire::ros1(&[0xff, 0xff, 0xff, 0xff, 1]);
        assert!(wire.list(Wire::f64).is_err());
        assert!(Wire::ros1(&[0xff; 5]).string().is_err());
    }

    #[test]
    fn protobuf_fields_are_told_as_far_as_they_are_here() {
        let mut seen = Vec::new();
        let bytes = [0x08, 0x96, 0x01, 0x12, 0x05, b'a', b'b'];
        let told = fields(&bytes, |number, field| {
            seen.push(match field {
                Field::Number(value) => (number, value as usize, 0),
                Field::Bytes(length, here) => (number, length, here.len()),
                Field::Double(_) => (number, 0, 0),
            });
            Ok(())
        });
        assert_eq!(told, Ok(()));
        assert_eq!(seen, [(1, 150, 0), (2, 5, 2)]);
        assert!(fields(&[0x08, 0x96], |_, _| Ok(())).is_err());
        assert!(fields(&[0x0f], |_, _| Ok(())).is_err());
    }
}
