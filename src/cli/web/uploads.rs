//! Snapshot files that browsers and programs send in parts.
//!
//! The server is one client of the emulator, and the emulator accepts one file from each client at a time. The server
//! therefore stores the file of each session, and sends it as a whole when the session restores it.

use crate::plant::SnapshotFile;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum number of files in uploads. A further file replaces the one that has waited longest.
const MOST_FILES: usize = 16;
/// Maximum number of bytes of all files in uploads.
const MOST_BYTES: usize = 4 * SnapshotFile::LONGEST as usize;

/// The files of an instance, each with its session. The file that was extended last is the last one.
#[derive(Default)]
pub(super) struct Uploads(Mutex<VecDeque<(String, Vec<u8>)>>);

impl Uploads {
    /// Appends a part of a file at byte `at`; byte 0 begins a new file. If the function fails, the file is dropped.
    ///
    /// # Errors
    /// The part does not begin at the end of the file, which is returned, or the file becomes too long.
    pub(super) fn append(&self, session: &str, at: u32, bytes: &[u8]) -> Result<(), usize> {
        let mut file = self.take(session);
        if at == 0 {
            file.clear();
        }
        let end = file.len();
        if at as usize != end || end + bytes.len() > SnapshotFile::LONGEST as usize {
            return Err(end);
        }
        file.extend_from_slice(bytes);
        let mut files = self.files();
        files.push_back((session.to_owned(), file));
        while files.len() > MOST_FILES || files.iter().map(|(_, file)| file.len()).sum::<usize>() > MOST_BYTES
        {
            files.pop_front();
        }
        Ok(())
    }

    /// Removes and returns the file of a session. The file is empty if the session has sent none.
    pub(super) fn take(&self, session: &str) -> Vec<u8> {
        let mut files = self.files();
        let index = files.iter().position(|(sender, _)| sender == session);
        index.and_then(|index| files.remove(index)).map(|(_, file)| file).unwrap_or_default()
    }

    fn files(&self) -> MutexGuard<'_, VecDeque<(String, Vec<u8>)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_do_not_mix_their_files() {
        let uploads = Uploads::default();
        for (session, at, part) in [("a", 0, "12"), ("b", 0, "x"), ("a", 2, "34"), ("b", 1, "y")] {
            assert_eq!(uploads.append(session, at, part.as_bytes()), Ok(()));
        }
        assert_eq!(uploads.append("c", 1, b"z"), Err(0));
        assert_eq!((uploads.take("a"), uploads.take("b")), (b"1234".to_vec(), b"xy".to_vec()));
        assert_eq!(uploads.take("a"), b"");
        (0..20).for_each(|number| uploads.append(&number.to_string(), 0, b"1").unwrap());
        assert_eq!((uploads.take("3"), uploads.take("4")), (b"".to_vec(), b"1".to_vec()));
    }
}
