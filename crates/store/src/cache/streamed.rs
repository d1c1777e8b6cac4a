//! A stored output from a file whose bytes are not all in memory.

use std::io::{BufRead as _, BufReader, Read};

use postcard::{Deserializer, Error, Result, de_flavors::Flavor};
use serde::de::DeserializeOwned;

/// Bytes that are read at once.
const AT_ONCE: usize = 1 << 16;

/// The output, if the rest of the file is exactly its stored form; `None` also for a type that borrows its bytes.
pub(super) fn read<T: DeserializeOwned>(file: impl Read) -> Option<T> {
    let bytes = Bytes {
        reader: BufReader::with_capacity(AT_ONCE, file),
        taken: Vec::new(),
    };
    let mut deserializer = Deserializer::from_flavor(bytes);
    let value = T::deserialize(&mut deserializer).ok()?;
    let mut rest = deserializer.finalize().ok()?;
    rest.reader.fill_buf().ok()?.is_empty().then_some(value)
}

/// The bytes of a reader; memory holds those of one string or list of bytes.
struct Bytes<R> {
    reader: BufReader<R>,
    taken: Vec<u8>,
}

impl<'de, R: Read + 'de> Flavor<'de> for Bytes<R> {
    type Remainder = Self;
    type Source = ();

    fn pop(&mut self) -> Result<u8> {
        let bytes = self.reader.fill_buf();
        let first = bytes.ok().and_then(|bytes| bytes.first().copied());
        self.reader.consume(1);
        first.ok_or(Error::DeserializeUnexpectedEnd)
    }

    fn try_take_n(&mut self, _count: usize) -> Result<&'de [u8]> {
        Err(Error::NotYetImplemented)
    }

    fn try_take_n_temp<'a>(&'a mut self, count: usize) -> Result<&'a [u8]>
    where
        'de: 'a,
    {
        self.taken.clear();
        let bytes = Read::by_ref(&mut self.reader).take(count as u64);
        let read = { bytes }.read_to_end(&mut self.taken);
        match read {
            Ok(read) if read == count => Ok(&self.taken),
            _ => Err(Error::DeserializeUnexpectedEnd),
        }
    }

    fn finalize(self) -> Result<Self> {
        Ok(self)
    }
}
