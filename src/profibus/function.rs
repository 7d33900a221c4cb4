//! The function code of a telegram. It contains the request and its frame count bit, or the kind of answer.

/// The service that a telegram requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Send data without an acknowledgement.
    Sdn,
    /// Send and request data. The answer has data.
    Srd,
    /// Send data. The answer is a receipt.
    Sda,
    /// Request the status of the station.
    FdlStatus,
}

/// The answer of a station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// A receipt, or the status of a station.
    Ok,
    /// Data with low priority.
    Low,
    /// Data. The station also has a diagnosis, which is data of high priority.
    High,
    /// The station does not have the service at all, or does not offer it at present.
    NotActivated,
}

/// The octet FC of a telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FunctionCode {
    /// The telegram is a request.
    Request {
        /// The service of the request.
        request: Request,
        /// Frame count bit. It changes with each new request, so that a slave recognizes repetitions.
        fcb: bool,
        /// True if the frame count bit is valid.
        fcv: bool,
        /// True if the priority is high.
        is_high: bool,
    },
    /// An answer of a slave.
    Answer(Answer),
    /// Any other function code.
    Other(u8),
}

const IS_REQUEST: u8 = 0x40;
const FCB: u8 = 0x20;
const FCV: u8 = 0x10;

/// A bit that is 0 in all requests and answers.
const RESERVED: u8 = 0x80;

/// The low bits of requests without an answer: a time event, and SDN of low and of high priority.
const UNANSWERED: [u8; 3] = [0x00, 0x04, 0x06];

impl FunctionCode {
    /// Returns true if a telegram with this octet is an answer. The answers of a master in a token ring are
    /// [`FunctionCode::Other`], because their bits 4 and 5 give the type of station.
    #[must_use]
    pub const fn is_answer(octet: u8) -> bool {
        octet & (RESERVED | IS_REQUEST) == 0
    }

    /// Returns true if a telegram with this octet is a request that a station must answer. This includes requests that
    /// no slave of commram supports.
    #[must_use]
    pub const fn wants_answer(octet: u8) -> bool {
        let [time_event, low, high] = UNANSWERED;
        let code = octet & 0x0F;
        octet & (RESERVED | IS_REQUEST) == IS_REQUEST && code != time_event && code != low && code != high
    }

    /// Returns the meaning of the octet.
    #[must_use]
    pub const fn parse(octet: u8) -> Self {
        if octet & RESERVED != 0 {
            return FunctionCode::Other(octet);
        }
        if octet & IS_REQUEST == 0 {
            return match octet {
                0x00 => FunctionCode::Answer(Answer::Ok),
                0x03 => FunctionCode::Answer(Answer::NotActivated),
                0x08 => FunctionCode::Answer(Answer::Low),
                0x0A => FunctionCode::Answer(Answer::High),
                _ => FunctionCode::Other(octet),
            };
        }
        let (request, is_high) = match octet & 0x0F {
            0x03 => (Request::Sda, false),
            0x04 => (Request::Sdn, false),
            0x05 => (Request::Sda, true),
            0x06 => (Request::Sdn, true),
            0x09 => (Request::FdlStatus, false),
            0x0C => (Request::Srd, false),
            0x0D => (Request::Srd, true),
            _ => return FunctionCode::Other(octet),
        };
        FunctionCode::Request { request, fcb: octet & FCB != 0, fcv: octet & FCV != 0, is_high }
    }

    /// Returns the octet that encodes the function code.
    #[must_use]
    pub const fn octet(self) -> u8 {
        match self {
            FunctionCode::Request { request, fcb, fcv, is_high } => {
                let code = match (request, is_high) {
                    (Request::Sda, false) => 0x03,
                    (Request::Sdn, false) => 0x04,
                    (Request::Sda, true) => 0x05,
                    (Request::Sdn, true) => 0x06,
                    (Request::FdlStatus, _) => 0x09,
                    (Request::Srd, false) => 0x0C,
                    (Request::Srd, true) => 0x0D,
                };
                IS_REQUEST | code | if fcb { FCB } else { 0 } | if fcv { FCV } else { 0 }
            }
            FunctionCode::Answer(Answer::Ok) => 0x00,
            FunctionCode::Answer(Answer::NotActivated) => 0x03,
            FunctionCode::Answer(Answer::Low) => 0x08,
            FunctionCode::Answer(Answer::High) => 0x0A,
            FunctionCode::Other(octet) => octet,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_the_standard() {
        for (octet, request, fcb, fcv, is_high) in [
            (0x49, Request::FdlStatus, false, false, false),
            (0x6D, Request::Srd, true, false, true),
            (0x5D, Request::Srd, false, true, true),
            (0x7C, Request::Srd, true, true, false),
            (0x46, Request::Sdn, false, false, true),
        ] {
            assert_eq!(FunctionCode::parse(octet), FunctionCode::Request { request, fcb, fcv, is_high });
        }
        assert_eq!(FunctionCode::parse(0x08), FunctionCode::Answer(Answer::Low));
        assert_eq!(FunctionCode::parse(0x12), FunctionCode::Other(0x12));
        assert_eq!(FunctionCode::parse(0xED), FunctionCode::Other(0xED), "the reserved bit is set");
    }

    /// The bits alone decide about requests for a status of the network layer (4E, 4F) and about answers of
    /// masters (20, 30), which no slave of commram uses.
    #[test]
    fn requests_and_answers_are_distinguished_by_their_bits() {
        for octet in [0x49, 0x4E, 0x4F, 0x6D, 0x7C, 0x43, 0x45] {
            assert!(FunctionCode::wants_answer(octet) && !FunctionCode::is_answer(octet), "16#{octet:02X}");
        }
        for octet in [0x00, 0x03, 0x08, 0x0A, 0x10, 0x20, 0x30, 0x02] {
            assert!(FunctionCode::is_answer(octet) && !FunctionCode::wants_answer(octet), "16#{octet:02X}");
        }
        for octet in [0x44, 0x46, 0x40, 0x80, 0xED] {
            assert!(!FunctionCode::is_answer(octet) && !FunctionCode::wants_answer(octet), "16#{octet:02X}");
        }
    }

    #[test]
    fn every_octet_is_unchanged_after_a_round_trip() {
        for octet in 0..=u8::MAX {
            let back = FunctionCode::parse(octet).octet();
            assert!(back == octet, "16#{octet:02X} became 16#{back:02X}");
        }
    }
}
