//! Replies on the wire: encoding into blocks, and checked decoding.

use super::content::{Content, MAX_TEXT};
use super::{Block, MAX_REPLY_BLOCKS, MAX_REPLY_BYTES};
use crate::request::replies::replies;
use crate::request::{Code, Refused, Reply};
use zerocopy::IntoBytes;

/// Maximum number of blocks of an error. These blocks are reserved, so that there is always space for an error about
/// too long replies.
const ERROR_BLOCKS: usize = 1 + blocks_for(size_of::<u32>() + MAX_TEXT);

/// Returns the number of blocks for `len` bytes of data.
const fn blocks_for(len: usize) -> usize {
    len.div_ceil(size_of::<Block>())
}

/// The encoded replies of a request. The buffer is cleared and reused, so later replies with registers and times need
/// no allocation.
#[derive(Debug, Default)]
pub(crate) struct ReplyBuffer {
    blocks: Vec<Block>,
    /// Data of the reply that is being encoded.
    data: Vec<u8>,
}

impl ReplyBuffer {
    /// Returns the blocks so far.
    pub(crate) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Removes the blocks and keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
    }

    /// Appends a reply.
    ///
    /// # Errors
    /// The buffer has no space for the reply, and nothing was appended.
    pub(crate) fn push(&mut self, reply: &Reply) -> Result<(), Refused> {
        self.data.clear();
        let Some(head) = encode(reply, &mut self.data) else { return Ok(()) };
        let count = self.blocks.len() + 1 + blocks_for(self.data.len());
        // Space for an error is reserved: it is the last reply of a request.
        if count > MAX_REPLY_BLOCKS - ERROR_BLOCKS && !matches!(reply, Reply::Error(_)) {
            let text = format_args!(
                "the replies of one request may have {MAX_REPLY_BYTES} bytes in all; spread it over several requests"
            );
            return Err(Refused::new(Code::REPLY_TOO_LONG, text));
        }
        self.add(head);
        Ok(())
    }

    /// Appends an error, for which there is always space.
    pub(crate) fn error(&mut self, refused: &Refused) {
        let _fits = self.push(&Reply::Error(refused.clone()));
    }

    /// Appends the head and its data.
    fn add(&mut self, head: Block) {
        self.blocks.push(Block { data_len: self.data.len() as u32, ..head });
        let start = self.blocks.len();
        self.blocks.resize(start + blocks_for(self.data.len()), Block::default());
        if let Some(room) = self.blocks[start..].as_mut_bytes().get_mut(..self.data.len()) {
            room.copy_from_slice(&self.data);
        }
    }
}

/// Declares the conversions between replies and their wire format.
macro_rules! codec {
    ($(
        $(#[$doc:meta])*
        $reply:ident = $number:literal, $name:ident
        $(($one:ident: $type:ty))?
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $field_type:ty
        ),+ $(,)?})?
    ),+ $(,)?) => {
        /// Encodes the reply: returns its head, and appends its data. Returns `None` for an operation that was not
        /// executed.
        fn encode(reply: &Reply, data: &mut Vec<u8>) -> Option<Block> {
            let mut head = Block::default();
            match reply {
                $(Reply::$reply $(($one))? $({ $($field),+ })? => {
                    head.kind = $number;
                    $($one.put(&mut head, data);)?
                    $($($field.put(&mut head, data);)+)?
                })+
                Reply::NotExecuted => return None,
            }
            Some(head)
        }

        /// Decodes a reply; `None` if no server of this version can have sent it.
        fn decode_one(head: &Block, mut data: &[u8]) -> Option<Reply> {
            let data = &mut data;
            let reply = match head.kind {
                $($number => {
                    $(let $one = Content::take(head, data)?;)?
                    $($(let $field = Content::take(head, data)?;)+)?
                    Reply::$reply $(($one))? $({ $($field),+ })?
                })+
                _ => return None,
            };
            data.is_empty().then_some(reply)
        }
    };
}

replies!(codec);

/// A reply that a server of this version cannot have sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("reply {index} at block {block} is malformed; do client and emulator have the same version?")]
pub struct DecodeError {
    /// Index of the malformed reply among the replies of a request, from 0.
    pub index: usize,
    /// Index of the reply's head block.
    pub block: usize,
}

/// Appends the replies in `blocks` to `replies`.
///
/// # Errors
/// The first malformed reply; replies before it have been appended.
pub(crate) fn decode(blocks: &[Block], replies: &mut Vec<Reply>) -> Result<(), DecodeError> {
    let first = replies.len();
    let mut rest = blocks;
    while let Some((head, tail)) = rest.split_first() {
        let bad = DecodeError { index: replies.len() - first, block: blocks.len() - rest.len() };
        let len = head.data_len as usize;
        let (data, tail) = tail.split_at_checked(blocks_for(len)).ok_or(bad)?;
        let data = data.as_bytes().get(..len).ok_or(bad)?;
        replies.push(decode_one(head, data).ok_or(bad)?);
        rest = tail;
    }
    Ok(())
}
