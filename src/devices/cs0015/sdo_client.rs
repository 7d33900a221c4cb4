//! SDOs of a master: one at a time, each for a place of the job block (p. 69-70).

use crate::devices::canopen::sdo::{Abort, At, Client, Data, Step};
use serde::{Deserialize, Serialize};

/// How long an answer may take, in us (D-442).
const PATIENCE_US: u64 = 1_000_000;

/// What has become of a transfer: what was read, or the code of the abort.
pub(super) type Finished = Result<Vec<u8>, u32>;

/// A transfer under way.
#[derive(Serialize, Deserialize)]
struct Transfer {
    place: usize,
    node: u8,
    client: Client,
    until: u64,
}

/// The master's end of SDOs.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct SdoClient {
    transfer: Option<Transfer>,
    /// Of the place that waits for it.
    finished: Option<(usize, Finished)>,
}

impl SdoClient {
    /// Whether nothing is under way, nor waits to be fetched.
    pub(super) fn is_free(&self) -> bool {
        self.transfer.is_none() && self.finished.is_none()
    }

    /// Whether it works for a place.
    pub(super) fn is_of(&self, place: usize) -> bool {
        self.transfer.as_ref().is_some_and(|it| it.place == place)
    }

    /// Reads an entry of at most `most` bytes of a node; what is to be sent.
    pub(super) fn read(&mut self, place: usize, node: u8, at: At, most: usize, now: u64) -> Data {
        self.begin(place, node, Client::read(at, most), now)
    }

    /// Writes an entry of a node; what is to be sent.
    pub(super) fn write(&mut self, place: usize, node: u8, at: At, data: &[u8], now: u64) -> Data {
        self.begin(place, node, Client::write(at, data), now)
    }

    fn begin(&mut self, place: usize, node: u8, (client, request): (Client, Data), now: u64) -> Data {
        self.transfer = Some(Transfer { place, node, client, until: now + PATIENCE_US });
        request
    }

    /// A server has answered; what is to be sent to it.
    pub(super) fn answered(&mut self, node: u8, answer: Data, now: u64) -> Option<Data> {
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

    fn finish(&mut self, finished: Finished) {
        self.finished = self.transfer.take().map(|it| (it.place, finished));
    }

    /// What has become of the transfer of a place, once.
    pub(super) fn finished(&mut self, place: usize) -> Option<Finished> {
        self.finished.take_if(|(of, _)| *of == place).map(|(_, finished)| finished)
    }

    /// Whoever waited at a place does so no more: what is to be sent to whom.
    pub(super) fn withdraw(&mut self, place: usize) -> Option<(u8, Data)> {
        self.finished(place);
        let transfer = self.transfer.take_if(|it| it.place == place)?;
        Some((transfer.node, transfer.client.give_up()))
    }

    /// When an answer has been missing for too long; `u64::MAX` if none is awaited.
    pub(super) fn next_time(&self) -> u64 {
        self.transfer.as_ref().map_or(u64::MAX, |it| it.until)
    }

    /// Looks at the time: what is to be sent to whom.
    pub(super) fn due(&mut self, now: u64) -> Option<(u8, Data)> {
        let transfer = self.transfer.as_ref().filter(|it| it.until <= now)?;
        let abort = (transfer.node, transfer.client.give_up());
        self.finish(Err(Abort::TimeOut.code()));
        Some(abort)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: At = At { index: 0x1008, sub: 0 };

    /// A long entry: each answer begins the wait anew, one of somebody else does not.
    #[test]
    fn patience_counts_from_the_last_answer() {
        let mut client = SdoClient::default();
        client.write(3, 5, AT, &[7; 20], 1_000);
        assert_eq!(client.next_time(), 1_000 + PATIENCE_US);
        let taken = [0x60, 0x08, 0x10, 0, 0, 0, 0, 0];
        assert!(client.answered(5, taken, 400_000).is_some(), "the first part goes out");
        assert_eq!(client.answered(6, taken, 500_000), None);
        let until = 400_000 + PATIENCE_US;
        assert_eq!((client.next_time(), client.due(until - 1)), (until, None));
        assert_eq!(client.due(until).map(|(node, _)| node), Some(5));
        assert_eq!(client.finished(3), Some(Err(Abort::TimeOut.code())));
        assert!(client.is_free());
    }
}
