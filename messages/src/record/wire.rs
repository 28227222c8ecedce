//! Protobuf's wire format, as much of it as the recording needs.
//!
//! Large messages are mostly one block of memory: written by hand they cost one copy, and a reader borrows them.

use super::DecodeError;

/// A value as it stands on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Varint(u64),
    Fixed64(u64),
    Bytes(&'a [u8]),
    Fixed32(u32),
}

impl<'a> Value<'a> {
    pub(super) fn bytes(self) -> Result<&'a [u8], DecodeError> {
        match self {
            Self::Bytes(bytes) => Ok(bytes),
            _ => Err(DecodeError::Malformed),
        }
    }

    pub(super) fn fixed32(self) -> Result<u32, DecodeError> {
        match self {
            Self::Fixed32(value) => Ok(value),
            _ => Err(DecodeError::Malformed),
        }
    }
}

/// The fields of a message, in the order they stand.
#[derive(Clone, Debug)]
pub(super) struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(super) fn new(message: &'a [u8]) -> Self {
        Self { rest: message }
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = *self.rest.split_off_first()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn field(&mut self) -> Option<(u32, Value<'a>)> {
        let key = self.varint()?;
        let number = u32::try_from(key >> 3).ok().filter(|&number| number > 0)?;
        let value = match key & 7 {
            0 => Value::Varint(self.varint()?),
            1 => Value::Fixed64(u64::from_le_bytes(*self.array()?)),
            2 => {
                let len = usize::try_from(self.varint()?).ok()?;
                Value::Bytes(self.rest.split_off(..len)?)
            }
            5 => Value::Fixed32(u32::from_le_bytes(*self.array()?)),
            _ => return None,
        };
        Some((number, value))
    }

    fn array<const N: usize>(&mut self) -> Option<&'a [u8; N]> {
        self.rest.split_off(..N)?.first_chunk()
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<(u32, Value<'a>), DecodeError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let field = self.field();
        if field.is_none() {
            self.rest = &[];
        }
        Some(field.ok_or(DecodeError::Malformed))
    }
}

/// Packed varints, one after the other.
#[derive(Clone, Debug)]
pub(super) struct Varints<'a> {
    rest: Fields<'a>,
}

impl<'a> Varints<'a> {
    pub(super) fn new(packed: &'a [u8]) -> Self {
        Self {
            rest: Fields::new(packed),
        }
    }

    /// The next one, while there are any.
    #[inline(always)]
    pub(super) fn next(&mut self) -> Result<Option<u64>, DecodeError> {
        match self.rest.rest {
            [] => Ok(None),
            // Most are small.
            [byte, rest @ ..] if *byte < 0x80 => {
                self.rest.rest = rest;
                Ok(Some(u64::from(*byte)))
            }
            _ => match self.rest.varint() {
                None => Err(DecodeError::Malformed),
                value => Ok(value),
            },
        }
    }
}

impl Value<'_> {
    pub(super) fn double(self) -> Result<f64, DecodeError> {
        match self {
            Self::Fixed64(bits) => Ok(f64::from_bits(bits)),
            _ => Err(DecodeError::Malformed),
        }
    }
}

/// Appends fields to a message. Zeros are written too: what is written tells all by itself.
#[derive(Debug)]
pub(super) struct Fill<'a>(pub(super) &'a mut Vec<u8>);

impl Fill<'_> {
    pub(super) fn plain_varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn key(&mut self, field: u32, wire_type: u32) {
        self.plain_varint(u64::from(field << 3 | wire_type));
    }

    pub(super) fn varint(&mut self, field: u32, value: u64) {
        self.key(field, 0);
        self.plain_varint(value);
    }

    pub(super) fn fixed32(&mut self, field: u32, value: u32) {
        self.key(field, 5);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub(super) fn double(&mut self, field: u32, value: f64) {
        self.key(field, 1);
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    /// The head of a field of this many bytes, which the caller appends.
    pub(super) fn open(&mut self, field: u32, len: usize) {
        self.key(field, 2);
        self.plain_varint(len as u64);
    }

    pub(super) fn bytes(&mut self, field: u32, bytes: &[u8]) {
        self.open(field, bytes.len());
        self.0.extend_from_slice(bytes);
    }

    pub(super) fn text(&mut self, field: u32, text: &str) {
        self.bytes(field, text.as_bytes());
    }

    /// Packed varints.
    pub(super) fn varints(&mut self, field: u32, values: &[u32]) {
        let len = values.iter().map(|&value| varint_len(u64::from(value)));
        self.open(field, len.sum());
        for &value in values {
            self.plain_varint(u64::from(value));
        }
    }

    pub(super) fn doubles(&mut self, field: u32, values: &[f64]) {
        self.bytes(field, bytemuck::cast_slice(values));
    }

    /// A message inside the message, moved once to make room for its length: for small ones.
    pub(super) fn message(&mut self, field: u32, fill: impl FnOnce(&mut Fill<'_>)) {
        self.key(field, 2);
        let start = self.0.len();
        fill(self);
        let end = self.0.len();
        self.plain_varint((end - start) as u64);
        let moved = self.0.len() - end;
        self.0[start..].rotate_right(moved);
    }

    /// A `google.protobuf.Timestamp`.
    pub(super) fn timestamp(&mut self, field: u32, nanos: u64) {
        self.message(field, |time| {
            time.varint(1, nanos / 1_000_000_000);
            time.varint(2, nanos % 1_000_000_000);
        });
    }
}

/// How many bytes a number takes as a varint.
pub(super) fn varint_len(value: u64) -> usize {
    (64 - (value | 1).leading_zeros() as usize).div_ceil(7)
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn what_is_written_is_what_is_read() {
        let mut out = Vec::new();
        let mut fill = Fill(&mut out);
        fill.varint(1, u64::MAX);
        fill.fixed32(2, 7);
        fill.message(1000, |inner| {
            inner.double(1, -0.5);
            inner.bytes(2, &[3; 300]);
        });
        let fields: Vec<_> = Fields::new(&out).collect::<Result<_, _>>().unwrap();
        assert_eq!(
            fields[..2],
            [(1, Value::Varint(u64::MAX)), (2, Value::Fixed32(7))]
        );
        assert_eq!(fields[2].0, 1000);
        let inner: Vec<_> = Fields::new(fields[2].1.bytes().unwrap())
            .collect::<Result<_, _>>()
            .unwrap();
        assert_eq!(
            inner,
            [
                (1, Value::Fixed64((-0.5f64).to_bits())),
                (2, Value::Bytes(&[3; 300]))
            ]
        );
    }

    #[test]
    fn a_cut_message_is_malformed_and_ends() {
        let mut out = Vec::new();
        Fill(&mut out).bytes(1, &[1, 2, 3]);
        for cut in 1..out.len() {
            let mut fields = Fields::new(&out[..cut]);
            assert!(fields.next().unwrap().is_err(), "{cut}");
            assert_eq!(fields.next(), None);
        }
    }

    #[test]
    fn packed_varints_are_read_as_they_were_written_and_a_cut_one_is_malformed() {
        let values = [0, 1, 127, 128, 16_383, 16_384, u32::MAX];
        let mut out = Vec::new();
        Fill(&mut out).varints(3, &values);
        let (number, packed) = Fields::new(&out).next().unwrap().unwrap();
        let packed = packed.bytes().unwrap();
        let mut varints = Varints::new(packed);
        let read = values.map(|_| varints.next().unwrap().unwrap());
        assert_eq!((number, read), (3, values.map(u64::from)));
        assert_eq!(varints.next(), Ok(None));
        let mut cut = Varints::new(&packed[..packed.len() - 1]);
        while let Ok(more) = cut.next() {
            assert!(more.is_some());
        }
        assert!(Varints::new(&[0xff; 11]).next().is_err());
    }

    #[test]
    fn varints_are_as_long_as_said() {
        for value in (0..64)
            .map(|bit| 1u64 << bit)
            .chain([0, 127, 128, 300, u64::MAX])
        {
            let mut out = Vec::new();
            Fill(&mut out).plain_varint(value);
            assert_eq!(out.len(), varint_len(value), "{value}");
        }
    }
}
