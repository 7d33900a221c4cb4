//! Messages that a node sends and receives, for bus databases.

use crate::can::{BitOrder, Message, Presence, Signal};
use embedded_can::{Id, StandardId};

/// Bit 31 of a COB-ID. If it is set, the message is not used, or is sent only on request.
const INVALID: u32 = 1 << 31;
const ID: u32 = 0x7FF;

/// Description of a message.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MessageInfo<'a> {
    name: &'a str,
    is_sender: bool,
    text: &'a str,
}

impl<'a> MessageInfo<'a> {
    /// Describes a message that the node sends.
    #[must_use]
    pub(crate) const fn sent(name: &'a str, text: &'a str) -> Self {
        MessageInfo { name, is_sender: true, text }
    }

    /// Describes a message that the node receives.
    #[must_use]
    pub(crate) const fn received(name: &'a str, text: &'a str) -> Self {
        MessageInfo { name, is_sender: false, text }
    }
}

/// The messages of a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NodeMessages<'a> {
    /// Name of the device, the prefix of the message names.
    pub node: &'a str,
}

impl NodeMessages<'_> {
    /// Returns a message with consecutive signals of the given numbers of bits; `None` if the COB-ID is marked as
    /// unused.
    #[must_use]
    pub(crate) fn message(
        self,
        cob_id: u32,
        about: MessageInfo<'_>,
        signals: &[(&str, u8)],
    ) -> Option<Message> {
        let id = Some(cob_id).filter(|cob_id| cob_id & INVALID == 0);
        let id: Id = StandardId::new((id? & ID) as u16)?.into();
        let mut first_bit = 0;
        let one = |(name, bits): &(&str, u8)| {
            let signal = Signal {
                name: (*name).to_owned(),
                first_bit,
                bits: *bits,
                order: BitOrder::LowFirst,
                presence: Presence::Always,
                about: String::new(),
            };
            first_bit += bits;
            signal
        };
        let signals: Vec<_> = signals.iter().map(one).collect();
        let me = || vec![self.node.to_owned()];
        let (senders, receivers) = if about.is_sender { (me(), Vec::new()) } else { (Vec::new(), me()) };
        let (name, text) = (format!("{}_{}", self.node, about.name), about.text.to_owned());
        Some(Message { name, id, length: first_bit.div_ceil(8), senders, receivers, signals, about: text })
    }

    /// Returns the messages of network management and SYNC. `is_sender` selects the form for their sender or
    /// for a receiver.
    pub(crate) fn broadcasts(self, sync: u32, is_sender: bool) -> impl Iterator<Item = Option<Message>> {
        let of = if is_sender { MessageInfo::sent } else { MessageInfo::received };
        let nmt = [("command", 8), ("node", 8)];
        let all = [
            ("NMT", self.message(0, of("", "Network management: command, and node or 0 for all"), &nmt)),
            ("SYNC", self.message(sync & ID, of("", "SYNC object (1005h)"), &[])),
        ];
        // The message has one sender and many receivers, so its name has no prefix.
        all.into_iter().map(|(name, message)| message.map(|it| Message { name: name.to_owned(), ..it }))
    }

    /// Returns the messages between a master and one of its nodes, with the identifiers of the predefined
    /// connection set. The names of the master's messages end in the number of the node.
    pub(crate) fn of_master(self, node: u8) -> impl Iterator<Item = Option<Message>> {
        let id = |first: u32| first + u32::from(node);
        let named = move |message: Option<Message>| {
            message.map(|mut it| {
                it.name = format!("{}_{node}", it.name);
                core::mem::swap(&mut it.senders, &mut it.receivers);
                it
            })
        };
        self.services(id(0x080), id(0x700), id(0x600), id(0x580)).map(named)
    }

    /// Returns the messages for emergencies, guarding, and SDO requests and answers, with these COB-IDs.
    pub(crate) fn services(
        self,
        emergency: u32,
        guarding: u32,
        request: u32,
        answer: u32,
    ) -> impl Iterator<Item = Option<Message>> {
        let sdo = [("command", 8), ("index", 16), ("sub_index", 8), ("data", 32)];
        let error = [("error_code", 16), ("error_register", 8), ("own", 40)];
        let state = [("state", 7), ("toggle", 1)];
        [
            self.message(emergency & ID, MessageInfo::sent("EMCY", "Emergency (1014h)"), &error),
            self.message(guarding, MessageInfo::sent("STATE", "Node guarding, boot-up (100Eh)"), &state),
            self.message(
                request,
                MessageInfo::received("SDO_REQUEST", "Request to the object dictionary"),
                &sdo,
            ),
            self.message(answer, MessageInfo::sent("SDO_ANSWER", "Answer of the object dictionary"), &sdo),
        ]
        .into_iter()
    }
}
