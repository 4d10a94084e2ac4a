//! Reading parts: whatever is damaged or cut short is told from what is whole.

use super::{CHECK, END, Header, LONGEST, MAGIC, RECORD_HEAD, RecordHead, TRAILER, Totals, VERSION, check, long, word};
use crate::{Error, Result};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A complete part file.
#[derive(Debug)]
pub struct PartFile {
    path: PathBuf,
    file: File,
    header: Header,
    totals: Totals,
    key: [u8; 32],
    start: u64,
    index: u64,
}

impl PartFile {
    /// Opens the part `path` and checks its header, index and end; records are checked as they are read.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Picture`] if it is no part file, unfinished, cut short or damaged.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|source| Error::io(path, "open", source))?;
        let bad = |problem: &str| Error::Picture { path: path.to_path_buf(), problem: problem.to_owned() };
        let fail = |source: std::io::Error| match source.kind() {
            ErrorKind::UnexpectedEof => bad("is cut short, expected a whole part file"),
            _ => Error::io(path, "read", source),
        };
        let length = file.metadata().map_err(fail)?.len();
        let mut fixed = [0; 16];
        file.read_exact_at(&mut fixed, 0).map_err(fail)?;
        if fixed[..8] != *MAGIC {
            return Err(bad("is no part file"));
        }
        let version = word(&fixed, 8);
        if version != VERSION {
            return Err(bad(&format!("is a part file of version {version}, expected version {VERSION}")));
        }
        let header_length = word(&fixed, 12);
        if header_length > LONGEST || u64::from(header_length) > length {
            return Err(bad("is cut short or damaged: its header is longer than the file"));
        }
        let mut head = vec![0; 16 + header_length as usize + 32];
        file.read_exact_at(&mut head, 0).map_err(fail)?;
        let (head, stored) = head.split_at(16 + header_length as usize);
        let key = *blake3::hash(head).as_bytes();
        if stored != key {
            return Err(bad("is damaged: the checksum of its header is wrong"));
        }
        let header: Header = ciborium::from_reader(&head[16..])
            .map_err(|error| bad(&format!("has a header of another program's form: {error}")))?;
        let start = head.len() as u64 + 32;
        let (index, totals) = read_end(&file, length, start, &header, &key).map_err(fail)?.ok_or_else(|| {
            bad("is unfinished, cut short or damaged at its end: what it is to hold must be rendered again")
        })?;
        Ok(Self { path: path.to_path_buf(), file, header, totals, key, start, index })
    }

    /// What it says of itself.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What it took.
    #[must_use]
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Bytes of the file that records take.
    #[must_use]
    pub fn record_bytes(&self) -> u64 {
        self.index - self.start
    }

    /// Reads the record of `block` in `pass` into `buffer` and gives its payload.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Picture`] if it is damaged.
    pub fn record<'b>(&self, block: u32, pass: u32, buffer: &'b mut Vec<u8>) -> Result<&'b [u8]> {
        let bad = |problem: String| Error::Picture { path: self.path.clone(), problem };
        let damaged = || bad(format!("is damaged: the checksum of block {block} is wrong"));
        let fail = |source: std::io::Error| match source.kind() {
            ErrorKind::UnexpectedEof => damaged(),
            _ => Error::io(&self.path, "read", source),
        };
        let place = self.header.place(block, pass).ok_or_else(|| bad(format!("has no block {block}")))?;
        let mut offset = [0; 8];
        self.file.read_exact_at(&mut offset, self.index + 8 * place as u64).map_err(fail)?;
        let offset = u64::from_le_bytes(offset);
        let mut head = [0; RECORD_HEAD];
        self.file.read_exact_at(&mut head, offset).map_err(fail)?;
        let about = RecordHead::from_bytes(&head);
        let sane = about.length <= LONGEST && offset >= self.start && offset < self.index;
        if !sane || (about.block, about.pass) != (block, pass) {
            return Err(damaged());
        }
        let length = about.length as usize;
        buffer.resize(RECORD_HEAD + length + CHECK, 0);
        buffer[..RECORD_HEAD].copy_from_slice(&head);
        self.file.read_exact_at(&mut buffer[RECORD_HEAD..], offset + RECORD_HEAD as u64).map_err(fail)?;
        let (record, seal) = buffer.split_at(RECORD_HEAD + length);
        if check(&[&self.key, record]) != *seal {
            return Err(damaged());
        }
        Ok(&record[RECORD_HEAD..])
    }

    /// The error of a record of `block` that is sound and yet not what the header promises.
    #[must_use]
    pub fn misfit(&self, block: u32) -> Error {
        let problem = format!("its block {block} does not hold what its header promises");
        Error::Picture { path: self.path.clone(), problem }
    }

    /// Checks every record.
    ///
    /// # Errors
    /// As [`PartFile::record`].
    pub fn verify(&self) -> Result<()> {
        let mut buffer = Vec::new();
        for block in self.header.blocks.0..self.header.blocks.1 {
            for pass in 0..self.header.passes {
                self.record(block, pass, &mut buffer)?;
            }
        }
        Ok(())
    }
}

/// Where the index stands, and the totals; nothing if the end is not that of a complete file.
fn read_end(
    file: &File,
    length: u64,
    start: u64,
    header: &Header,
    key: &[u8; 32],
) -> std::io::Result<Option<(u64, Totals)>> {
    let Some(at) = length.checked_sub(TRAILER as u64).filter(|&at| at >= start) else { return Ok(None) };
    let mut trailer = [0; TRAILER];
    file.read_exact_at(&mut trailer, at)?;
    let (index, entries, totals) = (long(&trailer, 0), u64::from(word(&trailer, 8)), u64::from(word(&trailer, 12)));
    let whole = trailer[TRAILER - END.len()..] == *END
        && entries == header.records() as u64
        && index >= start
        && index.checked_add(8 * entries + totals) == Some(at);
    if !whole {
        return Ok(None);
    }
    // What stands between is shorter than the file, whose length is known to be real.
    let mut tail = vec![0; usize::try_from(at - index).unwrap_or(0)];
    file.read_exact_at(&mut tail, index)?;
    if check(&[key, &tail]) != trailer[16..16 + CHECK] {
        return Ok(None);
    }
    let totals = &tail[tail.len() - usize::try_from(totals).unwrap_or(0)..];
    Ok(ciborium::from_reader(totals).ok().map(|totals| (index, totals)))
}

/// The sound records of a journal from `start` on, each with its offset and end: all before the first that is not whole.
pub(super) fn scan(
    reader: &mut (impl Read + Seek),
    start: u64,
    key: &[u8; 32],
) -> std::io::Result<Vec<(RecordHead, u64, u64)>> {
    let mut records = Vec::new();
    let mut offset = start;
    reader.seek(SeekFrom::Start(start))?;
    let mut buffer = Vec::new();
    loop {
        let whole = read_record(reader, &mut buffer).map(|head| {
            let (record, seal) = buffer.split_at(buffer.len() - CHECK);
            (head, check(&[key, record]) == *seal)
        });
        match whole {
            Ok((head, true)) => {
                let end = offset + buffer.len() as u64;
                records.push((head, offset, end));
                offset = end;
            }
            Ok((_, false)) => return Ok(records),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(records),
            Err(error) => return Err(error),
        }
    }
}

fn read_record(reader: &mut impl Read, buffer: &mut Vec<u8>) -> std::io::Result<RecordHead> {
    let mut head = [0; RECORD_HEAD];
    reader.read_exact(&mut head)?;
    let about = RecordHead::from_bytes(&head);
    if about.length > LONGEST {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    buffer.resize(RECORD_HEAD + about.length as usize + CHECK, 0);
    buffer[..RECORD_HEAD].copy_from_slice(&head);
    reader.read_exact(&mut buffer[RECORD_HEAD..])?;
    Ok(about)
}
