//! Tables of a TIFF file.

/// Types of values.
const ASCII: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const DOUBLE: u16 = 12;

/// A field of a table.
pub(super) struct Field {
    pub(super) tag: u16,
    kind: u16,
    count: usize,
    bytes: Vec<u8>,
}

impl Field {
    fn of(tag: u16, kind: u16, count: usize, bytes: Vec<u8>) -> Self {
        Self {
            tag,
            kind,
            count,
            bytes,
        }
    }

    pub(super) fn shorts(tag: u16, numbers: &[usize]) -> Self {
        let bytes = numbers.iter().flat_map(|number| {
            let [low, high, ..] = long(*number);
            [low, high]
        });
        Self::of(tag, SHORT, numbers.len(), bytes.collect())
    }

    pub(super) fn longs(tag: u16, numbers: &[usize]) -> Self {
        let bytes = numbers.iter().flat_map(|number| long(*number));
        Self::of(tag, LONG, numbers.len(), bytes.collect())
    }

    pub(super) fn doubles(tag: u16, numbers: &[f64]) -> Self {
        let bytes = numbers.iter().flat_map(|number| number.to_le_bytes());
        Self::of(tag, DOUBLE, numbers.len(), bytes.collect())
    }

    pub(super) fn text(tag: u16, text: &str) -> Self {
        let bytes: Vec<u8> = text.bytes().chain([0]).collect();
        Self::of(tag, ASCII, bytes.len(), bytes)
    }
}

/// A table at the byte `at`, followed by values that do not fit into it; then the next one.
pub(super) fn table(fields: &[Field], at: usize, is_last: bool) -> Vec<u8> {
    let head = 2 + 12 * fields.len() + 4;
    let mut bytes = long(fields.len())[..2].to_vec();
    let mut behind: Vec<u8> = Vec::new();
    for field in fields {
        bytes.extend(field.tag.to_le_bytes());
        bytes.extend(field.kind.to_le_bytes());
        bytes.extend(long(field.count));
        if field.bytes.len() <= 4 {
            bytes.extend(&field.bytes);
            bytes.resize(bytes.len() + 4 - field.bytes.len(), 0);
        } else {
            bytes.extend(long(at + head + behind.len()));
            behind.extend(&field.bytes);
            behind.resize(behind.len().next_multiple_of(2), 0);
        }
    }
    let next = if is_last { 0 } else { at + head + behind.len() };
    bytes.extend(long(next));
    bytes.extend(behind);
    bytes
}

/// Four bytes of a number; the largest grid has 100 MB.
pub(super) fn long(number: usize) -> [u8; 4] {
    u32::try_from(number).unwrap_or(u32::MAX).to_le_bytes()
}
