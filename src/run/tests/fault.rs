//! The operations on a disk, and what can befall them.

/// An operation of [`Storage`](crate::table::storage::Storage) or of its files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Operation {
    CreateFolder,
    Create,
    Write,
    Sync,
    Rename,
    SyncFolder,
    Remove,
    List,
    Read,
    LookUp,
}

impl Operation {
    pub const ALL: [Self; 10] = [
        Self::CreateFolder,
        Self::Create,
        Self::Write,
        Self::Sync,
        Self::Rename,
        Self::SyncFolder,
        Self::Remove,
        Self::List,
        Self::Read,
        Self::LookUp,
    ];

    pub const fn name(self) -> &'static str {
        match self {
            Self::CreateFolder => "create a folder",
            Self::Create => "create a file",
            Self::Write => "write",
            Self::Sync => "sync a file",
            Self::Rename => "rename",
            Self::SyncFolder => "sync a folder",
            Self::Remove => "remove",
            Self::List => "list",
            Self::Read => "read",
            Self::LookUp => "look up",
        }
    }

    /// Whether a full disk can refuse it.
    pub const fn needs_space(self) -> bool {
        !matches!(self, Self::Remove | Self::List | Self::Read | Self::LookUp)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// EIO, once; nothing is done.
    Refused,
    /// EIO, once; it is done all the same, as network file systems do.
    DoneButRefused,
    /// ENOSPC from now on; of a write, the first half fits.
    Full,
    /// A write takes the first half only, which is no error.
    ShortWrite,
    /// The process is killed; of a write, the first half is done.
    Killed,
    /// The power goes, and with it all that was not synced.
    PowerCut,
    /// The power goes; names are kept, and half of the bytes that were not synced.
    PowerCutTorn,
}

impl Fault {
    pub const ALL: [Self; 7] = [
        Self::Refused,
        Self::DoneButRefused,
        Self::Full,
        Self::ShortWrite,
        Self::Killed,
        Self::PowerCut,
        Self::PowerCutTorn,
    ];

    /// Whether it can befall an operation. What only looks leaves the disk as it was, so that a kill there is one at
    /// the next operation that changes something.
    pub fn befalls(self, operation: Operation) -> bool {
        use Operation::{List, LookUp, Read};
        match self {
            Self::Refused => true,
            Self::ShortWrite => operation == Operation::Write,
            Self::Full => operation.needs_space(),
            // It opens, and then no byte of it can be read.
            Self::DoneButRefused if operation == Read => true,
            _ => !matches!(operation, List | Read | LookUp),
        }
    }
}
