//! Pages octet by octet (p. 50-60).

use super::*;

/// Returns the ranges of segments with these lengths.
fn segments(lengths: &[usize]) -> Vec<Range<usize>> {
    let mut first = 0;
    let mut next = |length: usize| {
        first += length;
        first - length..first
    };
    lengths.iter().map(|length| next(*length)).collect()
}

struct Master {
    pages: Pages,
    outputs: Vec<u8>,
    counter: u8,
}

impl Master {
    fn new(outputs: &[usize], inputs: &[usize]) -> Self {
        let octets = outputs.iter().sum();
        Master {
            pages: Pages::new(segments(outputs), segments(inputs)),
            outputs: vec![0; octets],
            counter: 0,
        }
    }

    /// Sends page `number` with this content; returns its effects and the result.
    fn page(&mut self, number: u16, carried: &[u8]) -> (PageEffect, u8) {
        self.counter += 1;
        self.outputs.fill(0);
        for segment in self.pages.outputs.clone() {
            self.outputs[segment.start..segment.start + 2].copy_from_slice(&number.to_be_bytes());
        }
        self.outputs[COUNTER] = self.counter;
        for (place, octet) in places(&self.pages.outputs.clone()).zip(carried) {
            self.outputs[place] = *octet;
        }
        let taken = self.pages.written(&self.outputs, true);
        assert_eq!(self.pages.shown()[COUNTER], self.counter);
        (taken, self.pages.shown()[RESULT])
    }

    /// Returns a configured master. The gateway sends the frame 203h with 4 bytes and 204h with 6 bytes. It
    /// receives 301h with 6 bytes and 302h with 4 bytes.
    fn configured() -> Self {
        let mut master = Master::new(&[32], &[32]);
        assert_eq!(master.page(0, &[]).1, 0);
        assert_eq!(master.page(51, &[0, 0, 2, 3, 0, 4, 0, 0, 2, 4, 0, 6, END, END, END, END]).1, 0);
        let (taken, result) = master.page(151, &[0, 0, 3, 1, 0, 6, 0, 0, 3, 2, 0, 4, END, END, END, END]);
        assert_eq!((taken.has_configured, result, master.pages.phase()), (true, 0, PagePhase::Data));
        master
    }

    fn sent(&mut self, carried: &[u8]) -> Vec<(u32, usize)> {
        let frames = self.page(251, carried).0.frames;
        frames.iter().map(|frame| (frame.arbitration().number(), frame.data().len())).collect()
    }
}

/// The sizes of p. 51-53. A page of 82 octets carries 70 octets of content, enough for 11 records and a mark.
/// A page of 105 octets carries 91 octets of content, enough for the data of 13 identifiers with 6 bytes
/// each.
#[test]
fn pages_have_the_sizes_of_the_manual() {
    assert_eq!(carries(&segments(&[32, 32, 18])), 70);
    assert_eq!(((70 - MARK) / RECORD, (70 - MARK) % RECORD), (11, 0));
    assert_eq!(carries(&segments(&[32, 32, 32, 9])), 91);
    let pages = divide([6; 127], 91);
    assert_eq!((pages.len(), pages[0].clone(), pages[9].clone()), (10, 0..13, 117..127));
    assert_eq!(divide([8, 8, 1], 18), [0..2, 2..3]);
}

/// Each segment of a page begins with the page number. The content begins at octet 8 of the first segment and
/// at octet 2 of the other segments (p. 55, 59).
#[test]
fn page_1_has_the_sizes() {
    let mut master = Master::new(&[32, 18], &[32, 32, 9]);
    assert_eq!(master.page(0, &[]).1, 0);
    let shown = master.pages.shown();
    assert_eq!(shown[..12], [0, 1, 1, 0, 0, 0, 0, 0, 0, 50, 0, 73]);
    assert_eq!((&shown[32..34], &shown[64..66]), (&[0, 1][..], &[0, 1][..]));
}

/// Table 6.4.4: the octets of a page with definitions of sent identifiers.
#[test]
fn a_page_with_identifiers_has_the_octets_of_the_manual() {
    let mut master = Master::new(&[32], &[32]);
    master.page(0, &[]);
    let records = [0, 0, 3, 1, 0xB8, 6, 0, 0, 3, 3, 0xB8, 8, END, END, END, END];
    assert_eq!(master.page(51, &records).1, 0);
    assert_eq!(master.outputs[..2], [0, 0x33]);
    assert_eq!(master.outputs[8..20], [0, 0, 3, 1, 0xB8, 6, 0, 0, 3, 3, 0xB8, 8]);
    assert_eq!(
        (master.pages.tx.len(), master.pages.tx[1].length, master.pages.phase()),
        (2, 8, PagePhase::Rx)
    );
}

/// Tables 6.4.6 and 6.4.7.
#[test]
fn outputs_are_sent_according_to_force() {
    let mut master = Master::configured();
    let first = [2, 0x12, 0x34, 0x56, 0x78, 1, 0xBA, 0x98, 0x76, 0x54, 0x32, 0x10];
    assert_eq!(master.sent(&first), [(0x203, 4), (0x204, 6)]);
    assert_eq!(master.sent(&first), [(0x204, 6)], "the other one has not changed");
    let mut none = first;
    (none[0], none[5]) = (0, 0);
    assert_eq!(master.sent(&none), []);
    let once: Vec<bool> = [3, 3, 4, 4, 3]
        .into_iter()
        .map(|force| {
            let mut page = none;
            page[0] = force;
            !master.sent(&page).is_empty()
        })
        .collect();
    assert_eq!(once, [true, false, true, false, true]);
    // If the counter has not changed, the outputs contain no new page.
    let again = master.outputs.clone();
    assert_eq!(master.pages.written(&again, true), PageEffect::default());
    assert_eq!(master.pages.written(&[0; 32], true), PageEffect::default(), "cleared outputs are not a page");
}

/// Table 6.4.8: counter and data of each identifier.
#[test]
fn received_frames_are_on_their_page() {
    let mut master = Master::configured();
    let frame = |id, data: &[u8]| Frame::standard(id, Payload::new(data).unwrap());
    for _ in 0..14 {
        master.pages.received(&frame(0x301, &[0x11, 0x22, 0x33, 0x44, 0x55, 0x66]));
    }
    (0..15).for_each(|_| master.pages.received(&frame(0x302, &[0x99, 0x88, 0x77, 0x66, 0x55])));
    master.page(251, &[]);
    let expected = [14, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 15, 0x99, 0x88, 0x77, 0x66];
    assert_eq!(master.pages.shown()[8..20], expected);
    assert_eq!(master.page(252, &[]).1, 0, "an empty page");
    assert_eq!(master.pages.shown()[8..20], [0; 12]);
}

/// Pages in a wrong order and invalid identifiers are reported with the number of the record. Such a page has
/// no effect.
#[test]
fn wrong_pages_are_reported() {
    let mut master = Master::new(&[32], &[32]);
    let result = |master: &mut Master, number, carried: &[u8]| {
        let result = master.page(number, carried).1;
        (result, master.pages.shown()[RESULT + 1])
    };
    for number in [51, 52, 151, 251, 2, 50] {
        assert_eq!(result(&mut master, number, &[END; 4]), (1, 0), "page {number}");
    }
    result(&mut master, 0, &[]);
    assert_eq!(result(&mut master, 52, &[END; 4]), (1, 0));
    assert_eq!(result(&mut master, 51, &[0, 0, 1, 0, 0, 1, 0x40, 0, 0, 0, 0, 1]), (2, 1));
    assert_eq!(result(&mut master, 51, &[0, 0, 1, 0, 0, 9]), (3, 0));
    assert_eq!(result(&mut master, 51, &[0, 0, 1, 0, 0, 0]), (3, 0));
    assert_eq!(
        result(&mut master, 51, &[0, 0, 1, 0, 0, 1, 0, 0, 2, 0, 0, 1, 0, 0, 3, 0, 0, 1, 0, 0, 4, 0, 0, 1]),
        (4, 4)
    );
    assert_eq!(result(&mut master, 51, &[0, 0, 1, 0, 0, 1, MORE, MORE, MORE, MORE]), (0, 0));
    assert_eq!(result(&mut master, 52, &[0x20, 0, 1, 0, 0, 1, END, END, END, END]), (0, 0));
    assert_eq!(master.pages.tx.len(), 2);
    assert_eq!(result(&mut master, 151, &[0, 0, 1, 0, 0, 1]), (2, 0), "it is sent");
    assert_eq!(result(&mut master, 151, &[END; 4]), (0, 0));
    assert_eq!(result(&mut master, 151, &[END; 4]), (1, 0));
    // Page 0 restarts the configuration.
    assert_eq!((result(&mut master, 0, &[]), master.pages.tx.len()), ((0, 0), 0));
}

/// If two entries receive the same identifier, only the later entry gets its data (p. 35).
#[test]
fn a_repeated_identifier_updates_the_later_entry_only() {
    let mut master = Master::new(&[32], &[32]);
    master.page(0, &[]);
    master.page(51, &[END; 4]);
    master.page(151, &[0, 0, 3, 1, 0, 1, 0, 0, 3, 1, 0, 1, END, END, END, END]);
    master.pages.received(&Frame::standard(0x301, Payload::new(&[7]).unwrap()));
    master.page(251, &[]);
    assert_eq!(master.pages.shown()[8..12], [0, 0, 1, 7]);
}

/// A configuration has at most 100 pages of definitions of each direction, and 65285 pages of data (p. 55,
/// 59).
#[test]
fn the_number_of_pages_is_limited() {
    let mut master = Master::new(&[32], &[32]);
    master.page(0, &[]);
    for number in 51..150 {
        assert_eq!(master.page(number, &[MORE; 4]).1, 0);
        master.counter %= 200;
    }
    assert_eq!(master.page(150, &[MORE; 4]).1, 1);
    assert_eq!(master.page(150, &[END; 4]).1, 0);
    assert_eq!(usize::from(u16::MAX - number::DATA) + 1, 65_285);
}

/// The data of a received identifier must fit on a page of inputs in the format of the page. Page 250 is the
/// last page of inputs.
#[test]
fn the_pages_of_received_identifiers_are_limited() {
    let mut master = Master::new(&[32], &[COUNTER + 8]);
    let room = carries(&master.pages.inputs) as u8;
    assert!((2..8).contains(&room), "{room}");
    master.page(0, &[]);
    assert_eq!(master.page(51, &[END; 4]).1, 0);
    assert_eq!(master.page(151, &[0, 0, 3, 1, 0, room, END, END, END, END]).1, 3);
    assert_eq!(master.page(151, &[0, 0, 3, 1, 0, room - 1, MORE, MORE, MORE, MORE]).1, 0);
    for number in 152..250 {
        assert_eq!(master.page(number, &[MORE; 4]).1, 0);
        master.counter %= 200;
    }
    assert_eq!(master.page(250, &[MORE; 4]).1, 1);
    assert_eq!(master.page(250, &[END; 4]).1, 0);
}
