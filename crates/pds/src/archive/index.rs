//! The index of an archive: extents in place and time of the records of every file, so that a search reads only
//! candidate records.
//!
//! An index only saves time. An entry is trusted as long as the file system reports the file as unchanged; an index of
//! a different version, or a damaged one, is ignored.

use std::{
    collections::BTreeMap,
    fs,
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use serde::{Deserialize, Serialize};

use super::{
    Query,
    block::{BLOCK_RECORDS, Block},
    parts::Parts,
};
use crate::pedr::{Complaint, RULES};
use areograph_base::body::Datum;
use areograph_store::files::{Identity, Mark, MarkAt};

/// Name of the index in a folder of the archive.
pub const INDEX: &str = "areograph-pedr.index";
/// Start of the index file: type and format version. The BLAKE3 of the remainder follows, then the remainder in
/// postcard.
const HEADER: &[u8] = b"areograph pedr index 1\n";
/// Mark by which an earlier index is recognised.
pub const INDEX_MARK: Mark = Mark {
    what: "an index that areograph wrote",
    at: MarkAt::Start(HEADER),
};
const HASH_SIZE: usize = 32;
/// Largest index that is read, bytes: far more than the mission's archive takes.
const BYTES_MAX: u64 = 1 << 30;
/// Levels of parent folders that are searched for the index of a file.
const FOLDERS_ABOVE: usize = 4;

/// Index entry of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IndexedFile {
    /// Path below the folder of the index.
    pub(super) path: PathBuf,
    /// Its identity in the file system.
    pub(super) identity: Identity,
    /// BLAKE3 of its bytes.
    pub(super) blake3: [u8; 32],
    /// Faults of its records, in order.
    pub(super) complaints: Vec<Complaint>,
    /// Extents of its blocks; `None` for a file with too many faults, which is read as a whole.
    pub(super) blocks: Option<Vec<Block>>,
    /// Parts of these blocks, in a stand-in; none in an index.
    #[serde(skip)]
    pub(super) parts: Vec<Parts>,
}

/// The form of the index in its file.
#[derive(Serialize, Deserialize)]
struct Stored {
    /// Version of the rules by which records were checked.
    rules: u32,
    files: Vec<IndexedFile>,
}

/// The index of the files in and below a folder.
#[derive(Debug, Clone, Default)]
pub struct Index {
    files: BTreeMap<PathBuf, Arc<IndexedFile>>,
}

impl IndexedFile {
    /// Path below the folder of the index.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// BLAKE3 of the file's bytes, hexadecimal.
    #[must_use]
    pub fn blake3(&self) -> String {
        blake3::Hash::from_bytes(self.blake3).to_hex().to_string()
    }

    /// The entry in the form of stand-ins; `None` if it cannot be encoded.
    pub(super) fn encode(&self) -> Option<Vec<u8>> {
        postcard::to_stdvec(&(self, &self.parts)).ok()
    }

    /// The entry in a stand-in; `None` if it is of a different version.
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let (entry, parts): (Self, Vec<Parts>) = postcard::from_bytes(bytes).ok()?;
        Some(Self { parts, ..entry })
    }

    /// The blocks of a file with this number of records.
    fn blocks_of(&self, records: usize) -> Option<&[Block]> {
        let blocks = self.blocks.as_deref();
        blocks.filter(|blocks| blocks.len() == records.div_ceil(BLOCK_RECORDS))
    }

    /// Whether the entry holds the extents of the file's records and their faults.
    pub(super) fn has_blocks(&self, records: usize) -> bool {
        self.blocks_of(records).is_some()
    }

    /// First and last time tag of the file's records, ET seconds, if the entry holds their extents.
    pub(super) fn tags_s(&self, records: usize) -> Option<[f64; 2]> {
        let blocks = self.blocks_of(records)?.iter().map(Block::tags_s);
        blocks.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// Rows of the file, out of its number of rows, that may contain requested shots; `None` if the index cannot
    /// decide.
    pub(super) fn rows(
        &self,
        query: &Query<'_>,
        datum: Datum,
        records: usize,
    ) -> Option<Vec<Range<usize>>> {
        let blocks = self.blocks_of(records)?;
        let mut rows: Vec<Range<usize>> = Vec::new();
        let undivided = Parts::default();
        for (number, block) in blocks.iter().enumerate() {
            if !block.may_matter(query, datum) {
                continue;
            }
            let start = number * BLOCK_RECORDS;
            let of_block = start..records.min(start + BLOCK_RECORDS);
            let parts = self.parts.get(number).unwrap_or(&undivided);
            for near in parts.near(block, of_block, query, datum) {
                match rows.last_mut() {
                    Some(last) if last.end == near.start => last.end = near.end,
                    _ => rows.push(near),
                }
            }
        }
        Some(rows)
    }
}

impl FromIterator<IndexedFile> for Index {
    fn from_iter<I: IntoIterator<Item = IndexedFile>>(files: I) -> Self {
        let files = files.into_iter();
        Self {
            files: files
                .map(|file| (file.path.clone(), Arc::new(file)))
                .collect(),
        }
    }
}

impl Index {
    /// Decodes the index; `None` if the bytes are damaged or of a different version.
    #[must_use]
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (hash, rest) = bytes.strip_prefix(HEADER)?.split_at_checked(HASH_SIZE)?;
        if blake3::hash(rest).as_bytes() != hash {
            return None;
        }
        let stored: Stored = postcard::from_bytes(rest).ok()?;
        (stored.rules == RULES).then(|| stored.files.into_iter().collect())
    }

    /// Reads the index from the file `path`; `None` if it does not exist or cannot be used.
    #[must_use]
    pub fn read(path: &Path) -> Option<Self> {
        let metadata = fs::metadata(path).ok()?;
        let may_be_read = metadata.is_file() && metadata.len() <= BYTES_MAX;
        let bytes = may_be_read.then(|| fs::read(path))?;
        Self::decode(&bytes.ok()?)
    }

    /// Encodes the index; `None` if that fails.
    #[must_use]
    pub fn encode(&self) -> Option<Vec<u8>> {
        let files = self.files.values().map(|file| IndexedFile::clone(file));
        let stored = Stored {
            rules: RULES,
            files: files.collect(),
        };
        let rest = postcard::to_stdvec(&stored).ok()?;
        let hash = blake3::hash(&rest);
        Some([HEADER, hash.as_bytes(), &rest].concat())
    }

    /// Its files, ordered by path.
    pub fn files(&self) -> impl ExactSizeIterator<Item = &IndexedFile> {
        self.files.values().map(AsRef::as_ref)
    }

    /// The entry of the file with this path below its folder, if the file is unchanged.
    #[must_use]
    pub fn find(&self, path: &Path, identity: &Identity) -> Option<Arc<IndexedFile>> {
        let found = self.files.get(path);
        found
            .filter(|file| file.identity.is_same_file(identity))
            .map(Arc::clone)
    }
}

/// The indexes beside files, each in its folder.
#[derive(Debug, Default)]
pub struct Indexes {
    by_folder: BTreeMap<PathBuf, Index>,
    /// The folder of the index for the folder of each file.
    folders: BTreeMap<PathBuf, PathBuf>,
}

impl Indexes {
    /// The indexes in the folders of these files and in folders above them; of several, the nearest to a file is used.
    ///
    /// * `read` – reads the index from the file with that path, if it exists
    #[must_use]
    pub fn beside(paths: &[PathBuf], read: impl Fn(&Path) -> Option<Index>) -> Self {
        let mut indexes = Self::default();
        let mut asked: BTreeMap<PathBuf, bool> = BTreeMap::new();
        for path in paths {
            let Some(parent) = path.parent() else {
                continue;
            };
            if indexes.folders.contains_key(parent) {
                continue;
            }
            for folder in parent.ancestors().take(FOLDERS_ABOVE + 1) {
                let is_there = *asked.entry(folder.to_owned()).or_insert_with(|| {
                    let index = read(&folder.join(INDEX));
                    let is_there = index.is_some();
                    indexes
                        .by_folder
                        .extend(index.map(|index| (folder.to_owned(), index)));
                    is_there
                });
                if is_there {
                    indexes.folders.insert(parent.to_owned(), folder.to_owned());
                    break;
                }
            }
        }
        indexes
    }

    /// The entry of the file with this identity.
    #[must_use]
    pub fn find(&self, path: &Path, identity: &Identity) -> Option<Arc<IndexedFile>> {
        let folder = self.folders.get(path.parent()?)?;
        let below = path.strip_prefix(folder).ok()?;
        self.by_folder.get(folder)?.find(below, identity)
    }
}
