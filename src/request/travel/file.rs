//! Snapshots as files, which are read and sent in parts.

use super::alone;
use crate::plant::SnapshotFile;
use crate::request::{Code, Host, Refused};
use std::collections::VecDeque;

/// Returns a part of a snapshot as a file, at most `most` bytes from byte `from` on; no bytes after
/// its end.
pub(in crate::request) fn read(
    host: &mut dyn Host,
    number: u32,
    from: u32,
    most: usize,
) -> Result<Vec<u8>, Refused> {
    let (plant, travel) = host.plant_and_travel();
    if travel.leaving.0 != number || from == 0 {
        let snapshot = travel.saved.get(number)?.snapshot.clone();
        travel.leaving = (number, plant.file_of(snapshot).to_bytes());
    }
    let rest = travel.leaving.1.get(from as usize..).unwrap_or_default();
    let part = rest.get(..most).unwrap_or(rest).to_vec();
    if part.len() < most {
        travel.leaving = (0, Vec::new());
    }
    Ok(part)
}

/// Maximum size in bytes of all files that clients are sending. If it is exceeded, the file that has waited longest is
/// dropped.
const MOST_BYTES: usize = 4 * SnapshotFile::LONGEST as usize;
/// Maximum number of files that clients are sending.
const MOST_FILES: usize = 64;

/// The files that clients are sending, one for each client; the file with the latest part is the last.
#[derive(Debug, Default)]
pub(super) struct IncomingFiles(VecDeque<(u128, Vec<u8>)>);

impl IncomingFiles {
    /// Appends a part from byte `at` on; byte 0 begins a new file. After an error the file is dropped.
    ///
    /// # Errors
    /// The part does not follow the end of the file, or the file becomes too long. The error is the end of the file.
    fn append(&mut self, client: u128, at: usize, bytes: &[u8]) -> Result<(), usize> {
        let mut file = self.take(client);
        if at == 0 {
            file.clear();
        }
        let end = file.len();
        if at != end || end + bytes.len() > SnapshotFile::LONGEST as usize {
            return Err(end);
        }
        file.extend_from_slice(bytes);
        self.0.push_back((client, file));
        while self.0.len() > MOST_FILES
            || self.0.iter().map(|(_, file)| file.len()).sum::<usize>() > MOST_BYTES
        {
            self.0.pop_front();
        }
        Ok(())
    }

    /// Removes and returns the file of a client. The file is empty if the client has sent none.
    fn take(&mut self, client: u128) -> Vec<u8> {
        let index = self.0.iter().position(|(sender, _)| *sender == client);
        index.and_then(|index| self.0.remove(index)).map(|(_, file)| file).unwrap_or_default()
    }
}

/// The functions for clients of a channel, which may leave.
#[cfg(feature = "channel")]
impl IncomingFiles {
    /// True if no client is sending a file.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Drops the files of clients for which `is_present` is false.
    pub(super) fn release(&mut self, is_present: impl Fn(u128) -> bool) {
        self.0.retain(|(client, _)| is_present(*client));
    }
}

/// Receives a part of a client's file, from byte `at` on.
pub(in crate::request) fn take_in(
    host: &mut dyn Host,
    client: u128,
    at: u32,
    bytes: &[u8],
) -> Result<(), Refused> {
    let (_, travel) = host.plant_and_travel();
    travel.coming.append(client, at as usize, bytes).map_err(|end| {
        let text = format_args!("byte {at} of a snapshot does not come next, byte {end} does");
        Refused::new(Code::SNAPSHOT, text)
    })
}

/// Restores the snapshot in the file that the client has sent.
pub(in crate::request) fn restore(host: &mut dyn Host, client: u128, detached: bool) -> Result<(), Refused> {
    alone(host, detached)?;
    let (_, travel) = host.plant_and_travel();
    let file = SnapshotFile::of_bytes(&travel.coming.take(client));
    let file = file.map_err(|error| Refused::new(Code::SNAPSHOT, error))?;
    host.take_over_files();
    let restored = host.plant_mut().restore_file(&file);
    restored.map_err(|error| Refused::new(Code::SNAPSHOT, error))?;
    host.plant_and_travel().1.is_elsewhere();
    host.has_travelled();
    Ok(())
}
