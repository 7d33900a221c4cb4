//! Snapshots as files, which are read and sent in parts.

use super::{alone, go_to, unknown};
use crate::plant::SnapshotFile;
use crate::request::{Code, Host, Refused};

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
        let saved = travel.saved.get(&number).ok_or_else(|| unknown(number))?;
        travel.leaving = (number, plant.file_of(saved.snapshot.clone()).to_bytes());
    }
    let rest = travel.leaving.1.get(from as usize..).unwrap_or_default();
    let part = rest.get(..most).unwrap_or(rest).to_vec();
    if part.len() < most {
        travel.leaving = (0, Vec::new());
    }
    Ok(part)
}

/// Takes a part of a file, from its byte `at` on.
pub(in crate::request) fn take_in(host: &mut dyn Host, at: u32, bytes: &[u8]) -> Result<(), Refused> {
    let (_, travel) = host.plant_and_travel();
    if at == 0 {
        travel.coming = Vec::new();
    }
    let come = travel.coming.len();
    if at as usize != come || come + bytes.len() > SnapshotFile::LONGEST as usize {
        let text = format_args!("byte {at} of a snapshot does not come next, byte {come} does");
        return Err(Refused::new(Code::SNAPSHOT, text));
    }
    travel.coming.extend_from_slice(bytes);
    Ok(())
}

/// Restores the snapshot in the file that was sent.
pub(in crate::request) fn restore(host: &mut dyn Host, detached: bool) -> Result<(), Refused> {
    alone(host, detached)?;
    let (_, travel) = host.plant_and_travel();
    let file = SnapshotFile::of_bytes(&core::mem::take(&mut travel.coming));
    let file = file.map_err(|error| Refused::new(Code::SNAPSHOT, error))?;
    go_to(host, &file.snapshot, false)?;
    host.plant_and_travel().1.is_elsewhere();
    host.has_travelled();
    Ok(())
}
