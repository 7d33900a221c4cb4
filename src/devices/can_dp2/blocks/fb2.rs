//! FB2: page mode (p. 50-70). The block works with this gateway only, since the manual does not define octets 2 to 7 of
//! a page (D-467).

use super::{DataBlocks, Peripherals};
use crate::devices::can_dp2::page::{
    COUNTER, END, HEAD, MARK, MORE, RECORD, RESULT, SEGMENT, divide, number, places,
};
use crate::plc::{Shared, function_block};
use core::ops::Range;

/// Values of RET_VALUE (p. 69).
const NOTHING: u16 = 0;
const TX: u16 = 2;
const RX: u16 = 3;
const DATA: u16 = 4;

/// ERROR: a data block has no end mark or is too small, or a record has an invalid length (D-469).
const BAD_DATA_BLOCK: u8 = 16;

/// ERROR: no page at the given addresses (D-469).
const NO_PAGE: u8 = 17;

/// Progress of the transfer of pages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Page {
    /// Page 0, which requests the sizes of pages.
    #[default]
    Start,
    /// Page 1 was received.
    Sized,
    /// The page with this number, from 0, of the definitions of sent identifiers.
    Tx(u16),
    /// Definitions of received identifiers.
    Rx(u16),
    /// The page with data of this number.
    Data(u16),
    /// The transfer has stopped: ERROR has the reason.
    Failed,
}

/// Progress of the transfer.
#[derive(Clone, Debug, Default)]
pub struct Paging {
    page: Page,
    /// Counter of the expected answer.
    waits_for: Option<u8>,
    /// Segments of the output page, and of the input page.
    outputs: Vec<Range<usize>>,
    inputs: Vec<Range<usize>>,
    /// True if FREIGABE was TRUE in the last cycle.
    was_released: bool,
}

function_block! {
    /// Page mode: defines the sent and received identifiers, then exchanges data continuously (p. 61-69).
    pub struct FB2(data_blocks: Shared<DataBlocks>, peripherals: Shared<Peripherals>) {
        in {
            /// With FALSE the block exchanges pages 0 and 1 only. With TRUE it then also exchanges the other
            /// pages, beginning with the first.
            FREIGABE: bool;
            /// First output of the page.
            WRITE_ADDRESS: u16;
            /// Number of the first data block with the definitions of sent identifiers.
            WRITE_CONFIG_DB: u16;
            /// Number of the first data block with sent data.
            WRITE_DB: u16;
            /// First input of the page.
            READ_ADDRESS: u16;
            /// Number of the first data block with the definitions of received identifiers.
            READ_CONFIG_DB: u16;
            /// Number of the first data block for received data.
            READ_DB: u16;
        }
        out {
            /// Pages in transfer: 0 none, 2 definitions of sent identifiers, 3 of received identifiers, 4 data.
            RET_VALUE: u16;
            /// Reason of a stop: 1 to 4 as reported by the gateway; 16: a data block is wrong; 17: no page at
            /// the addresses. commram defines 16 and 17.
            ERROR: u8;
        }
        internal: Paging;
    }
}

/// Returns the segments of a page with the given number of octets.
fn segments(octets: usize) -> Vec<Range<usize>> {
    (0..octets).step_by(SEGMENT).map(|first| first..octets.min(first + SEGMENT)).collect()
}

/// Returns the records of a configuration, which begins in data block `block` (p. 62-65).
fn records(data_blocks: &DataBlocks, mut block: u16) -> Option<Vec<[u8; RECORD]>> {
    let (mut records, mut offset) = (Vec::new(), 0);
    loop {
        match data_blocks.read::<MARK>(block, offset)? {
            [END, END, END, END] => return Some(records),
            [MORE, MORE, MORE, MORE] => (block, offset) = (block.checked_add(1)?, 0),
            _ => {
                records.push(data_blocks.read(block, offset)?);
                offset += RECORD;
            }
        }
    }
}

/// Position of an identifier's data: data block, offset of the length, number of bytes including `force` or `count_in`.
struct DataPosition {
    block: u16,
    offset: usize,
    length: usize,
}

/// Returns the data positions of all identifiers, which begin in data block `block` (p. 66-69).
fn cells(data_blocks: &DataBlocks, mut block: u16) -> Option<Vec<DataPosition>> {
    let (mut cells, mut offset) = (Vec::new(), 0);
    loop {
        match data_blocks.read::<1>(block, offset)?[0] {
            END => return Some(cells),
            MORE => (block, offset) = (block.checked_add(1)?, 0),
            length @ 2..=9 => {
                cells.push(DataPosition { block, offset, length: length.into() });
                offset += usize::from(length) + 1;
            }
            _ => return None,
        }
    }
}

impl FB2 {
    /// Runs one PLC cycle.
    pub fn call(&mut self, data_blocks: &mut DataBlocks, peripherals: &mut Peripherals) {
        let released = self.FREIGABE;
        if core::mem::replace(&mut self.internal.was_released, released) && !released {
            (self.internal, self.ERROR) = (Paging::default(), 0);
        }
        if self.internal.waits_for.is_some() {
            self.look(data_blocks, peripherals);
        }
        if self.internal.waits_for.is_none() {
            self.next(data_blocks, peripherals);
        }
        self.RET_VALUE = match self.internal.page {
            _ if !released => NOTHING,
            Page::Tx(_) => TX,
            Page::Rx(_) => RX,
            Page::Data(_) => DATA,
            Page::Start | Page::Sized | Page::Failed => NOTHING,
        };
    }

    fn fail(&mut self, error: u8) {
        (self.internal.page, self.ERROR) = (Page::Failed, error);
    }

    /// Polls for the answer to the page.
    fn look(&mut self, data_blocks: &mut DataBlocks, peripherals: &Peripherals) {
        let Some(head) = peripherals.read::<HEAD>(self.READ_ADDRESS) else { return self.fail(NO_PAGE) };
        if self.internal.waits_for != Some(head[COUNTER]) {
            return;
        }
        self.internal.waits_for = None;
        match (head[RESULT], self.internal.page) {
            (0, Page::Start) => match peripherals.read::<{ HEAD + 4 }>(self.READ_ADDRESS) {
                Some([high, low, .., out_high, out_low, in_high, in_low])
                    if u16::from_be_bytes([high, low]) == number::SIZES =>
                {
                    let size = |high, low| usize::from(u16::from_be_bytes([high, low]));
                    self.internal.outputs = segments(size(out_high, out_low));
                    self.internal.inputs = segments(size(in_high, in_low));
                    self.internal.page = Page::Sized;
                }
                _ => self.fail(NO_PAGE),
            },
            (0, Page::Data(page)) => {
                if self.fetch(page, data_blocks, peripherals).is_none() {
                    return self.fail(BAD_DATA_BLOCK);
                }
                self.internal.page = Page::Data(page.wrapping_add(1));
            }
            (0, Page::Tx(page)) => self.internal.page = Page::Tx(page + 1),
            (0, Page::Rx(page)) => self.internal.page = Page::Rx(page + 1),
            (0, Page::Sized | Page::Failed) => {}
            (error, _) => self.fail(error),
        }
    }

    /// Stores the inputs of a page in the data blocks.
    fn fetch(&self, page: u16, data_blocks: &mut DataBlocks, peripherals: &Peripherals) -> Option<()> {
        let places: Vec<usize> = places(&self.internal.inputs).collect();
        let cells = cells(data_blocks, self.READ_DB)?;
        let pages = divide(cells.iter().map(|cell| cell.length - 1), places.len());
        let own = pages.get(usize::from(page)).cloned().unwrap_or(0..0);
        let mut octets = places.iter().filter_map(|place| {
            let place = usize::from(self.READ_ADDRESS) + place;
            peripherals.inputs.get(place).copied()
        });
        for cell in &cells[own] {
            let data: Vec<u8> = octets.by_ref().take(cell.length).collect();
            data_blocks.write(cell.block, cell.offset + 1, &data).then_some(())?;
        }
        Some(())
    }

    /// Writes the next page.
    fn next(&mut self, data_blocks: &DataBlocks, peripherals: &mut Peripherals) {
        let room = places(&self.internal.outputs).count();
        let each = room.saturating_sub(MARK) / RECORD;
        let released = self.FREIGABE;
        if released && self.internal.page == Page::Sized {
            self.internal.page = Page::Tx(0);
        }
        // After the last page of one kind, the block continues with the next kind of page.
        for (here, block, next) in [
            (Page::Tx as fn(u16) -> Page, self.WRITE_CONFIG_DB, Page::Rx(0)),
            (Page::Rx, self.READ_CONFIG_DB, Page::Data(0)),
        ] {
            let (Page::Tx(page) | Page::Rx(page)) = self.internal.page else { break };
            if self.internal.page != here(page) {
                continue;
            }
            let Some(records) = records(data_blocks, block).filter(|_| each > 0) else {
                return self.fail(BAD_DATA_BLOCK);
            };
            let pages = records.len().div_ceil(each).max(1);
            if usize::from(page) >= pages {
                self.internal.page = next;
                continue;
            }
            let own = records.iter().skip(usize::from(page) * each).take(each).flatten().copied();
            let mark = if usize::from(page) + 1 == pages { END } else { MORE };
            let first = if here(0) == Page::Tx(0) { number::TX } else { number::RX };
            let carried: Vec<u8> = own.chain([mark; MARK]).collect();
            return self.send(first + page, &carried, peripherals);
        }
        match self.internal.page {
            Page::Start if !released => self.send(number::START, &[], peripherals),
            Page::Data(page) => {
                let (Some(tx), Some(rx)) =
                    (cells(data_blocks, self.WRITE_DB), cells(data_blocks, self.READ_DB))
                else {
                    return self.fail(BAD_DATA_BLOCK);
                };
                let tx_pages = divide(tx.iter().map(|cell| cell.length - 1), room);
                let input_room = places(&self.internal.inputs).count();
                let rx_pages = divide(rx.iter().map(|cell| cell.length - 1), input_room);
                let page = if usize::from(page) < tx_pages.len().max(rx_pages.len()) { page } else { 0 };
                self.internal.page = Page::Data(page);
                let own = tx_pages.get(usize::from(page)).cloned().unwrap_or(0..0);
                let bytes = tx[own].iter().flat_map(|cell| {
                    let block = data_blocks.get(cell.block).unwrap_or_default();
                    block.get(cell.offset + 1..=cell.offset + cell.length).unwrap_or_default()
                });
                let carried: Vec<u8> = bytes.copied().collect();
                self.send(number::DATA + page, &carried, peripherals);
            }
            _ => {}
        }
    }

    /// Sends page `number` with this content in all segments of the page, with the next counter.
    fn send(&mut self, page: u16, carried: &[u8], peripherals: &mut Peripherals) {
        let Some(head) = peripherals.read::<HEAD>(self.READ_ADDRESS) else { return self.fail(NO_PAGE) };
        // 0 is not a counter value, so outputs that were cleared to 0 do not count as a page.
        let counter = if head[COUNTER] == u8::MAX { 1 } else { head[COUNTER] + 1 };
        // The first page is sent before the size of pages is known.
        let segments = match &self.internal.outputs[..] {
            [] => core::slice::from_ref(&(0..HEAD)).to_vec(),
            known => known.to_vec(),
        };
        let mut octets = vec![0; segments.last().map_or(0, |last| last.end)];
        for segment in &segments {
            let own = &mut octets[segment.clone()];
            own.iter_mut().zip(page.to_be_bytes()).for_each(|(to, from)| *to = from);
        }
        places(&segments).zip(carried).for_each(|(place, octet)| octets[place] = *octet);
        octets[COUNTER] = counter;
        if peripherals.write(self.WRITE_ADDRESS, &octets) {
            self.internal.waits_for = Some(counter);
        } else {
            self.fail(NO_PAGE);
        }
    }
}
