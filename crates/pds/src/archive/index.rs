//! The index of an archive: of every file where and when its records are, so that a search reads only what may matter.
//!
//! An index saves time and nothing else. What it says of a file counts as long as the file system says that the file is
//! what it was; an index of another version, or one that is damaged, is as good as none.

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
};
use crate::pedr::{Complaint, RULES};
use areograph_base::body::Datum;
use areograph_store::files::Identity;

/// Name of the index in a folder of the archive.
pub const INDEX: &str = "areograph-pedr.index";
/// How the file begins: what it is, and the form of its entries. BLAKE3 of the rest follows, then the rest in postcard.
const HEADER: &[u8] = b"areograph pedr index 1\n";
const HASH_SIZE: usize = 32;
/// Largest index that is read, bytes: far more than the mission's archive takes.
const BYTES_MAX: u64 = 1 << 30;
/// Folders above that of a file in which its index may lie.
const FOLDERS_ABOVE: usize = 4;

/// What an index says of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IndexedFile {
    /// Path below the folder of the index.
    pub(super) path: PathBuf,
    /// What the file system said of it.
    pub(super) identity: Identity,
    /// BLAKE3 of its bytes.
    pub(super) blake3: [u8; 32],
    /// What is wrong with its records, in their order.
    pub(super) complaints: Vec<Complaint>,
    /// Where they are; none of a file that is read as a whole, because too much is wrong with it.
    pub(super) blocks: Option<Vec<Block>>,
}

/// The form of the index in its file.
#[derive(Serialize, Deserialize)]
struct Stored {
    /// Rules by which records were judged.
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

    /// The blocks of a file of so many records.
    fn blocks_of(&self, records: usize) -> Option<&[Block]> {
        let blocks = self.blocks.as_deref();
        blocks.filter(|blocks| blocks.len() == records.div_ceil(BLOCK_RECORDS))
    }

    /// Whether it tells where the records of the file are, and what is wrong with them.
    pub(super) fn has_blocks(&self, records: usize) -> bool {
        self.blocks_of(records).is_some()
    }

    /// Rows of the file, of which it has so many, that may have shots that are asked for; none when the index cannot tell.
    pub(super) fn rows(
        &self,
        query: &Query<'_>,
        datum: Datum,
        records: usize,
    ) -> Option<Vec<Range<usize>>> {
        let blocks = self.blocks_of(records)?;
        let mut rows: Vec<Range<usize>> = Vec::new();
        for (start, block) in (0..records).step_by(BLOCK_RECORDS).zip(blocks) {
            if block.may_matter(query, datum) {
                let end = records.min(start + BLOCK_RECORDS);
                match rows.last_mut() {
                    Some(last) if last.end == start => last.end = end,
                    _ => rows.push(start..end),
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
    /// The index in these bytes; none when they are damaged, or of another version.
    #[must_use]
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (hash, rest) = bytes.strip_prefix(HEADER)?.split_at_checked(HASH_SIZE)?;
        if blake3::hash(rest).as_bytes() != hash {
            return None;
        }
        let stored: Stored = postcard::from_bytes(rest).ok()?;
        (stored.rules == RULES).then(|| stored.files.into_iter().collect())
    }

    /// The index in the file `path`; none when there is no such file, or none that can be used.
    #[must_use]
    pub fn read(path: &Path) -> Option<Self> {
        let metadata = fs::metadata(path).ok()?;
        let may_be_read = metadata.is_file() && metadata.len() <= BYTES_MAX;
        let bytes = may_be_read.then(|| fs::read(path))?;
        Self::decode(&bytes.ok()?)
    }

    /// The bytes of the index; none when they cannot be made.
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

    /// What it says of the file with this path below its folder, if the file still is what it was.
    #[must_use]
    pub fn find(&self, path: &Path, identity: &Identity) -> Option<Arc<IndexedFile>> {
        let found = self.files.get(path);
        found
            .filter(|file| file.identity == *identity)
            .map(Arc::clone)
    }
}

/// The indexes beside files, each in its folder.
#[derive(Debug, Default)]
pub struct Indexes {
    by_folder: BTreeMap<PathBuf, Index>,
    /// For the folder of each file the folder of its index.
    folders: BTreeMap<PathBuf, PathBuf>,
}

impl Indexes {
    /// Those of the folders of these files, and of some folders above; of several the nearest to a file counts.
    ///
    /// * `read` – the index in the file with that path, if there is one
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

    /// What is known of a file with this identity.
    #[must_use]
    pub fn find(&self, path: &Path, identity: &Identity) -> Option<Arc<IndexedFile>> {
        let folder = self.folders.get(path.parent()?)?;
        let below = path.strip_prefix(folder).ok()?;
        self.by_folder.get(folder)?.find(below, identity)
    }
}
