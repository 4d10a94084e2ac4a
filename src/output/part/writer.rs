//! Writing a part: a journal that survives its writer, and becomes the part once it is complete.

use super::reader::{self, PartFile};
use super::{END, Header, MAGIC, PartCost, RecordHead, Totals, VERSION, check};
use crate::output::file;
use crate::{Error, Result};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::BufReader;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};

/// What stands at a part's name.
#[derive(Debug)]
pub enum Opened {
    /// The whole part, made before and found sound.
    Finished,
    /// A part to be filled, with what an earlier task left of it.
    Unfinished(Box<PartWriter>),
}

/// A part in the making. The journal is locked as long as this lives.
#[derive(Debug)]
pub struct PartWriter {
    header: Header,
    path: PathBuf,
    journal: PathBuf,
    file: File,
    key: [u8; 32],
    /// Offsets of records; 0 for those that are missing.
    index: Vec<u64>,
    end: u64,
    cost: PartCost,
    begun_anew: bool,
}

impl PartWriter {
    /// Opens the part `path` that `header` describes, going on from the last complete record of an earlier task of the
    /// same part. What that task was writing when it died is cut off; the journal of another part is begun anew.
    ///
    /// # Errors
    /// [`Error::Busy`] if another task is writing it; [`Error::Io`].
    pub fn open(path: &Path, header: &Header) -> Result<Opened> {
        file::make_folder_of(path)?;
        let mut journal = path.as_os_str().to_os_string();
        journal.push(".partial");
        let journal = PathBuf::from(journal);
        if is_finished(path, header) {
            return Ok(Opened::Finished);
        }
        let file = lock(path, &journal)?;
        if is_finished(path, header) {
            // Another task finished it between the first look and the lock.
            let _ = fs::remove_file(&journal);
            return Ok(Opened::Finished);
        }
        let head = encode_header(header, path)?;
        let key = *blake3::hash(&head).as_bytes();
        let mut writer = Self {
            header: header.clone(),
            path: path.to_path_buf(),
            journal,
            file,
            key,
            index: vec![0; header.records()],
            end: head.len() as u64 + key.len() as u64,
            cost: PartCost::default(),
            begun_anew: false,
        };
        writer.recover(&head)?;
        Ok(Opened::Unfinished(Box::new(writer)))
    }

    /// Reads what is there, and cuts off what is not whole.
    fn recover(&mut self, head: &[u8]) -> Result<()> {
        let fail = |source| Error::io(&self.journal, "read", source);
        let length = self.file.metadata().map_err(fail)?.len();
        let mut start = vec![0; head.len() + self.key.len()];
        let known = length >= self.end && self.file.read_exact_at(&mut start, 0).is_ok();
        if known && start[..head.len()] == *head && start[head.len()..] == self.key {
            let mut reader = BufReader::with_capacity(1 << 16, &self.file);
            let records = reader::scan(&mut reader, self.end, &self.key).map_err(fail)?;
            for (head, offset, end) in records {
                let Some(place) = self.header.place(head.block, head.pass) else { break };
                if self.index[place] == 0 {
                    self.cost = self.cost.plus(head.cost);
                }
                self.index[place] = offset;
                self.end = end;
            }
            return self.cut();
        }
        self.begun_anew = length > 0;
        if length > 0 {
            self.file.set_len(0).map_err(|source| Error::io(&self.journal, "empty", source))?;
        }
        start[..head.len()].copy_from_slice(head);
        start[head.len()..].copy_from_slice(&self.key);
        self.write(&start, 0)
    }

    fn cut(&self) -> Result<()> {
        self.file.set_len(self.end).map_err(|source| Error::io(&self.journal, "cut off the damaged end of", source))
    }

    fn write(&self, bytes: &[u8], at: u64) -> Result<()> {
        self.file.write_all_at(bytes, at).map_err(|source| Error::io(&self.journal, "write", source))
    }

    /// What the part is.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The file that it will be.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Records that it holds.
    #[must_use]
    pub fn held(&self) -> usize {
        self.index.iter().filter(|&&offset| offset > 0).count()
    }

    /// Whether a journal of other settings stood in its place and was given up.
    #[must_use]
    pub fn is_begun_anew(&self) -> bool {
        self.begun_anew
    }

    /// Whether it holds the record of `block` in `pass`.
    #[must_use]
    pub fn holds(&self, block: u32, pass: u32) -> bool {
        self.header.place(block, pass).is_some_and(|place| self.index[place] > 0)
    }

    /// Appends a record. Of one that cannot be written whole nothing is kept.
    ///
    /// # Errors
    /// [`Error::Io`]; if the part has no such record.
    pub fn append(&mut self, block: u32, pass: u32, cost: PartCost, payload: &[u8]) -> Result<()> {
        let foreign = || Error::invalid(format!("block {block} of pass {pass}"), "it is not in this part");
        let place = self.header.place(block, pass).ok_or_else(foreign)?;
        let length = u32::try_from(payload.len()).map_err(|_| foreign())?;
        let mut bytes = Vec::with_capacity(payload.len() + super::RECORD_HEAD + super::CHECK);
        bytes.extend_from_slice(&RecordHead { block, pass, length, cost }.to_bytes());
        bytes.extend_from_slice(payload);
        let seal = check(&[&self.key, &bytes]);
        bytes.extend_from_slice(&seal);
        if let Err(error) = self.write(&bytes, self.end) {
            // The next task would cut it off itself; the first error is the one to report.
            let _ = self.cut();
            return Err(error);
        }
        self.index[place] = self.end;
        self.end += bytes.len() as u64;
        self.cost = self.cost.plus(cost);
        Ok(())
    }

    /// Completes the part: index and end mark, flushed to the disk, and only then its name.
    ///
    /// # Errors
    /// If records are missing; [`Error::Io`], after which the journal is as it was.
    pub fn finish(self, totals: Totals) -> Result<PathBuf> {
        let missing = self.index.len() - self.held();
        if missing > 0 {
            return Err(Error::invalid(self.path.display().to_string(), format!("{missing} blocks are missing")));
        }
        let totals = encode(&Totals { cost: self.cost, ..totals }, &self.path)?;
        let mut tail: Vec<u8> = self.index.iter().flat_map(|offset| offset.to_le_bytes()).collect();
        tail.extend_from_slice(&totals);
        let seal = check(&[&self.key, &tail]);
        tail.extend_from_slice(&self.end.to_le_bytes());
        let lengths = [self.index.len(), totals.len()];
        for length in lengths {
            tail.extend_from_slice(&u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
        }
        tail.extend_from_slice(&seal);
        tail.extend_from_slice(END);
        let written = self.write(&tail, self.end).and_then(|()| {
            self.file.sync_all().map_err(|source| Error::io(&self.journal, "write", source))?;
            fs::rename(&self.journal, &self.path).map_err(|source| Error::io(&self.path, "rename into place", source))
        });
        if let Err(error) = written {
            let _ = self.cut();
            return Err(error);
        }
        Ok(self.path)
    }
}

/// Opens and locks the journal. The file may be renamed between the two: then it is no journal any more.
fn lock(path: &Path, journal: &Path) -> Result<File> {
    let identity = |about: fs::Metadata| (about.dev(), about.ino());
    loop {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(journal)
            .map_err(|source| Error::io(journal, "open", source))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(Error::Busy { path: path.to_path_buf() }),
            Err(TryLockError::Error(source)) => return Err(Error::io(journal, "lock", source)),
        }
        let here = file.metadata().map_err(|source| Error::io(journal, "read", source))?;
        if fs::metadata(journal).is_ok_and(|there| identity(there) == identity(here)) {
            return Ok(file);
        }
    }
}

fn is_finished(path: &Path, header: &Header) -> bool {
    path.exists() && PartFile::open(path).is_ok_and(|part| part.header() == header && part.verify().is_ok())
}

fn encode(value: &impl serde::Serialize, path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    ciborium::into_writer(value, &mut bytes).map_err(|error| Error::Picture {
        path: path.to_path_buf(),
        problem: format!("cannot be described: {error}"),
    })?;
    Ok(bytes)
}

fn encode_header(header: &Header, path: &Path) -> Result<Vec<u8>> {
    let cbor = encode(header, path)?;
    let mut head = Vec::with_capacity(cbor.len() + 16);
    head.extend_from_slice(MAGIC);
    head.extend_from_slice(&VERSION.to_le_bytes());
    head.extend_from_slice(&u32::try_from(cbor.len()).unwrap_or(u32::MAX).to_le_bytes());
    head.extend_from_slice(&cbor);
    Ok(head)
}
