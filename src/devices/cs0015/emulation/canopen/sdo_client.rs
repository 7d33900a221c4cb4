//! SDO transfers of a master. At most one is in progress. Each transfer belongs to a place of the job block
//! (p. 69-70).

use crate::devices::canopen::sdo::{Abort, Client, Data, EntryAddress, Step};
use serde::{Deserialize, Serialize};

/// Time limit for an answer, in us (D-442).
const PATIENCE_US: u64 = 1_000_000;

/// Result of a transfer: the data read, or the abort code.
pub(crate) type SdoResult = Result<Vec<u8>, u32>;

/// A transfer in progress.
#[derive(Serialize, Deserialize)]
struct Transfer {
    place: usize,
    node: u8,
    client: Client,
    until: u64,
}

/// SDO client of the master.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct SdoClient {
    transfer: Option<Transfer>,
    /// Result of the last transfer, with the place of the job block that waits for it.
    finished: Option<(usize, SdoResult)>,
}

impl SdoClient {
    /// True if no transfer is in progress and no result waits.
    pub(crate) fn is_free(&self) -> bool {
        self.transfer.is_none() && self.finished.is_none()
    }

    /// True if the transfer in progress belongs to this place of the job block.
    pub(crate) fn is_of(&self, place: usize) -> bool {
        self.transfer.as_ref().is_some_and(|it| it.place == place)
    }

    /// Starts to read an entry of at most `most` bytes from a node; returns the frame to send.
    pub(crate) fn read(&mut self, place: usize, node: u8, at: EntryAddress, most: usize, now: u64) -> Data {
        self.begin(place, node, Client::read(at, most), now)
    }

    /// Starts to write an entry of a node; returns the frame to send.
    pub(crate) fn write(&mut self, place: usize, node: u8, at: EntryAddress, data: &[u8], now: u64) -> Data {
        self.begin(place, node, Client::write(at, data), now)
    }

    fn begin(&mut self, place: usize, node: u8, (client, request): (Client, Data), now: u64) -> Data {
        self.transfer = Some(Transfer { place, node, client, until: now + PATIENCE_US });
        request
    }

    /// Handles an answer of a server; returns the next frame for it.
    pub(crate) fn answered(&mut self, node: u8, answer: Data, now: u64) -> Option<Data> {
        let transfer = self.transfer.as_mut().filter(|it| it.node == node)?;
        let (finished, request) = match transfer.client.answered(answer) {
            Step::Ignored => return None,
            Step::Send(request) => {
                transfer.until = now + PATIENCE_US;
                return Some(request);
            }
            Step::Done(data) => (Ok(data), None),
            Step::Aborted(code) => (Err(code), None),
            Step::Failed(abort, request) => (Err(abort.code()), Some(request)),
        };
        self.finish(finished);
        request
    }

    fn finish(&mut self, finished: SdoResult) {
        self.finished = self.transfer.take().map(|it| (it.place, finished));
    }

    /// Takes the result of the transfer that belongs to this place.
    pub(crate) fn finished(&mut self, place: usize) -> Option<SdoResult> {
        self.finished.take_if(|(of, _)| *of == place).map(|(_, finished)| finished)
    }

    /// Withdraws the transfer that belongs to this place; returns the node and the frame to send.
    pub(crate) fn withdraw(&mut self, place: usize) -> Option<(u8, Data)> {
        self.finished(place);
        let transfer = self.transfer.take_if(|it| it.place == place)?;
        Some((transfer.node, transfer.client.give_up()))
    }

    /// Returns the time by which the answer must come; `u64::MAX` if no answer is expected.
    pub(crate) fn next_time(&self) -> u64 {
        self.transfer.as_ref().map_or(u64::MAX, |it| it.until)
    }

    /// Ends the transfer if its time limit has passed; returns the node and the frame to send.
    pub(crate) fn due(&mut self, now: u64) -> Option<(u8, Data)> {
        let transfer = self.transfer.as_ref().filter(|it| it.until <= now)?;
        let abort = (transfer.node, transfer.client.give_up());
        self.finish(Err(Abort::TimeOut.code()));
        Some(abort)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: EntryAddress = EntryAddress { index: 0x1008, sub: 0 };

    /// Reading a long entry takes several answers. Each answer restarts the time limit, except an answer of
    /// another node.
    #[test]
    fn the_time_limit_counts_from_the_last_answer() {
        let mut client = SdoClient::default();
        client.write(3, 5, AT, &[7; 20], 1_000);
        assert_eq!(client.next_time(), 1_000 + PATIENCE_US);
        let taken = [0x60, 0x08, 0x10, 0, 0, 0, 0, 0];
        assert!(client.answered(5, taken, 400_000).is_some(), "the first part is sent");
        assert_eq!(client.answered(6, taken, 500_000), None);
        let until = 400_000 + PATIENCE_US;
        assert_eq!((client.next_time(), client.due(until - 1)), (until, None));
        assert_eq!(client.due(until).map(|(node, _)| node), Some(5));
        assert_eq!(client.finished(3), Some(Err(Abort::TimeOut.code())));
        assert!(client.is_free());
    }
}
