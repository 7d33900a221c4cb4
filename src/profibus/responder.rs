//! The data link layer of a station that only answers. It filters the requests to the station, and recognizes
//! repetitions of answered requests.

use super::{Answer, BROADCAST, Frame, FunctionCode, Request, Telegram};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// Result of a request, for the user of the station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// The request is for another station.
    Nothing,
    /// The station answers with this telegram: a status, or its earlier answer if the master repeats a
    /// request.
    Answered(Telegram),
    /// A new request. The user answers it with [`Responder::answer`].
    Asked(Frame),
    /// A request without an answer.
    Delivered(Frame),
}

/// A station that answers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Responder {
    address: u8,
    /// The address of the last requester, the frame count bit of its request, and the answer to the request.
    last: Option<(u8, bool, Telegram)>,
}

snapshot_fields!(Responder { values: last; built: address });

impl Responder {
    /// Returns the station with this address, 0 to 126.
    #[must_use]
    pub const fn new(address: u8) -> Self {
        Responder { address, last: None }
    }

    /// Returns the address of the station.
    #[must_use]
    pub const fn address(&self) -> u8 {
        self.address
    }

    /// Called when a telegram has come.
    pub fn heard(&mut self, telegram: Telegram) -> Reaction {
        let Telegram::Frame(frame) = telegram else { return Reaction::Nothing };
        let FunctionCode::Request { request, fcb, fcv, .. } = FunctionCode::parse(frame.fc) else {
            return Reaction::Nothing;
        };
        match (frame.da, request) {
            (BROADCAST, Request::Sdn) => Reaction::Delivered(frame),
            (da, _) if da != self.address => Reaction::Nothing,
            (_, Request::Sdn) => Reaction::Delivered(frame),
            (_, Request::FdlStatus) => Reaction::Answered(self.short(frame.sa, Answer::Ok)),
            (_, Request::Srd | Request::Sda) => {
                if let Some((_, _, answer)) =
                    self.last.as_ref().filter(|(sa, last, _)| fcv && *sa == frame.sa && *last == fcb)
                {
                    return Reaction::Answered(answer.clone());
                }
                Reaction::Asked(frame)
            }
        }
    }

    /// Returns the answer to `request`, and keeps the answer: a master that has not received it repeats the
    /// request.
    pub fn answer(&mut self, request: &Frame, answer: Telegram) -> Telegram {
        if let FunctionCode::Request { fcb, .. } = FunctionCode::parse(request.fc) {
            self.last = Some((request.sa, fcb, answer.clone()));
        }
        answer
    }

    /// Returns an answer without data.
    #[must_use]
    pub fn short(&self, da: u8, answer: Answer) -> Telegram {
        let fc = FunctionCode::Answer(answer).octet();
        Telegram::Frame(Frame { da, sa: self.address, fc, dsap: None, ssap: None, data: Vec::new() })
    }

    /// Returns an answer with data to `request`, with the service access points of the request.
    #[must_use]
    pub fn data(&self, request: &Frame, answer: Answer, data: Vec<u8>) -> Telegram {
        let fc = FunctionCode::Answer(answer).octet();
        let (da, dsap, ssap) = (request.sa, request.ssap, request.dsap);
        Telegram::Frame(Frame { da, sa: self.address, fc, dsap, ssap, data })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(da: u8, fc: u8) -> Telegram {
        Telegram::Frame(Frame { da, sa: 2, fc, dsap: Some(60), ssap: Some(62), data: Vec::new() })
    }

    fn asks(responder: &mut Responder, fc: u8) -> bool {
        match responder.heard(request(5, fc)) {
            Reaction::Asked(frame) => {
                let answer = responder.data(&frame, Answer::Low, vec![fc]);
                responder.answer(&frame, answer);
                true
            }
            Reaction::Answered(Telegram::Frame(frame)) => {
                assert_eq!((frame.da, frame.dsap, frame.ssap), (2, Some(62), Some(60)));
                false
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_repeated_request_gets_the_same_answer() {
        let mut responder = Responder::new(5);
        // The first request of a master is a new request with either value of the frame count bit.
        assert!(asks(&mut responder, 0x6D));
        assert!(asks(&mut responder, 0x5D));
        assert!(!asks(&mut responder, 0x5D));
        assert!(asks(&mut responder, 0x7D));
        assert!(!asks(&mut responder, 0x7D));
        assert!(asks(&mut responder, 0x6D));
    }

    #[test]
    fn requests_for_other_stations_are_ignored() {
        let mut responder = Responder::new(5);
        assert_eq!(responder.heard(request(6, 0x6D)), Reaction::Nothing);
        assert_eq!(responder.heard(request(5, 0x08)), Reaction::Nothing);
        assert_eq!(responder.heard(Telegram::Token { da: 5, sa: 2 }), Reaction::Nothing);
        assert!(matches!(responder.heard(request(127, 0x46)), Reaction::Delivered(_)));
        let Reaction::Answered(status) = responder.heard(request(5, 0x49)) else { panic!("no status") };
        assert_eq!(status.octets().unwrap(), [0x10, 2, 5, 0, 7, 0x16]);
    }
}
