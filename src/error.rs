//! What can go wrong, and where in the input.
//!
//! Every variant is something a caller can act on and renders as one clear sentence: which file, which object
//! (name and index), what is wrong, what was expected.

use std::path::{Path, PathBuf};

/// The result of everything fallible in this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What went wrong.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read, written, renamed or listed.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried, as an infinitive: "read", "write", "rename".
        action: &'static str,
        /// The operating system's answer.
        source: std::io::Error,
    },
    /// A scene file, or a file it refers to, breaks its format's rules or a bound that protects the reader.
    #[error("{}: {object}: {problem}", path.display())]
    Scene {
        /// The file that the user named.
        path: PathBuf,
        /// The object with its index and name: `mesh 3 "Body", primitive 0`.
        object: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// The file needs an extension that this program does not support.
    #[error("{}: needs the extension {extension}, which is not supported", path.display())]
    UnsupportedExtension {
        /// The file that the user named.
        path: PathBuf,
        /// The extension's registered name.
        extension: String,
    },
    /// Something the user asked for does not exist in the scene: a camera, a node, an animation.
    #[error("{}: there is no {kind} {wanted}; {available}", path.display())]
    NoSuchObject {
        /// The scene file.
        path: PathBuf,
        /// "camera", "node", "animation".
        kind: &'static str,
        /// What was asked for, quoted if it is a name.
        wanted: String,
        /// What there is: `it has "Main" and "Top"`.
        available: String,
    },
    /// A value given by the user is not usable.
    #[error("{what}: {problem}")]
    Invalid {
        /// The flag or value: `--frames 9-3`.
        what: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// A picture could not be encoded or decoded.
    #[error("{}: {problem}", path.display())]
    Picture {
        /// The picture file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// An external program is missing or failed.
    #[error("{program}: {problem}")]
    Program {
        /// The program's name.
        program: String,
        /// What happened and what to do.
        problem: String,
    },
    /// Parts of frames do not make up what is to be merged.
    #[error("{problem}")]
    Merge {
        /// Which files, what is wrong or missing.
        problem: String,
    },
    /// Another task is writing the same file.
    #[error("{}: another task is writing this part; it is left alone", path.display())]
    Busy {
        /// The file.
        path: PathBuf,
    },
    /// The system asked for an end (SIGTERM).
    #[error("told to stop; what is finished is kept, and the same command goes on from there")]
    Terminated,
    /// The user interrupted the work.
    #[error("interrupted; the {frames_kept} frames already finished are kept")]
    Interrupted {
        /// How many frames of this run are complete on disk.
        frames_kept: usize,
    },
}

impl Error {
    /// An [`Error::Io`] for `path`.
    pub fn io(path: impl AsRef<Path>, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), action, source }
    }

    /// An [`Error::Invalid`].
    pub fn invalid(what: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), problem: problem.into() }
    }

    /// Whether trying again later may succeed with nothing changed: a full disk, an interrupted call, another writer.
    #[must_use]
    pub fn worth_retrying(&self) -> bool {
        use std::io::ErrorKind as K;
        matches!(self, Self::Busy { .. } | Self::Terminated)
            || matches!(self, Self::Io { source, .. } if matches!(source.kind(),
            K::StorageFull | K::QuotaExceeded | K::Interrupted | K::TimedOut | K::WouldBlock | K::ResourceBusy
            | K::OutOfMemory | K::StaleNetworkFileHandle | K::NetworkDown | K::HostUnreachable))
    }
}
