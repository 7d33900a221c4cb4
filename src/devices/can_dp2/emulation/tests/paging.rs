//! Page mode at the gateway (p. 50-60; D-467); the tests of `pages` check the content of pages.

use super::*;

/// A page of 32 octets in each direction. `WITH_WINDOW` has a window after it, without an identifier, as in
/// figure 6.4.2.
const CFG_PAGES: [u8; 4] = [0x40, 0x9F, 0x80, 0x9F];
const WITH_WINDOW: [u8; 6] = [0x40, 0x9F, 0x80, 0x9F, 0x9F, 0xAF];

/// Returns page `number` with this counter and content.
fn page(number: u16, counter: u8, carried: &[u8]) -> Vec<u8> {
    let mut page = vec![0; 32];
    page[..2].copy_from_slice(&number.to_be_bytes());
    page[2] = counter;
    page[8..8 + carried.len()].copy_from_slice(carried);
    page
}

/// Returns a bench with a configured gateway. The gateway sends the frame 203h with 2 bytes and receives 301h
/// with 2 bytes.
fn configured(flags: u8) -> Bench {
    let mut bench = Bench::exchanging(flags, 0, &CFG_PAGES);
    let inputs = bench.exchange(&page(0, 1, &[]));
    assert_eq!(inputs[..12], [0, 1, 1, 0, 0, 0, 0, 0, 0, 32, 0, 32]);
    assert_eq!(bench.registers.can.page_state.load(), 2);
    bench.exchange(&page(51, 2, &[0, 0, 2, 3, 0x80, 2, 0xEE, 0xEE, 0xEE, 0xEE]));
    assert_eq!(bench.registers.can.page_state.load(), 3);
    let inputs = bench.exchange(&page(151, 3, &[0, 0, 3, 1, 0x80, 2, 0xEE, 0xEE, 0xEE, 0xEE]));
    assert_eq!((inputs[..4].to_vec(), bench.registers.can.page_state.load()), (vec![0, 151, 3, 0], 4));
    bench.run(5 * MS);
    bench
}

#[test]
fn identifiers_are_exchanged_by_pages() {
    let mut bench = configured(0x01);
    bench.exchange(&page(251, 4, &[2, 0x12, 0x34]));
    bench.send(data(0x301, &[0x55, 0x66]));
    bench.send(data(0x302, &[1, 2]));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["203: 34 12"]);
    // The gateway fills the input page when it handles the output page. The frame arrived after that, so only
    // the next input page contains it.
    assert_eq!(bench.exchange(&page(251, 4, &[2, 0x12, 0x34]))[8..11], [0, 0, 0]);
    assert_eq!(bench.exchange(&page(251, 5, &[2, 0x12, 0x34]))[8..11], [1, 0x66, 0x55]);
    bench.run(10 * MS);
    assert_eq!(bench.heard(), Vec::<String>::new());
    // Cleared outputs do not count as a page: the configuration is unchanged when the next page arrives.
    bench.exchange(&[]);
    assert_eq!(bench.registers.can.page_state.load(), 4);
    bench.exchange(&page(251, 6, &[1, 0, 1]));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["203: 01 00"]);
}

/// A CANopen master sends one remote frame for each input of its pages, as for modules (p. 29). It sends
/// outputs only when their pages have arrived.
#[test]
fn a_canopen_master_requests_the_inputs_of_its_pages() {
    let mut bench = configured(0x07);
    assert_eq!(bench.heard(), ["0: 01 00", "301: remote 2"]);
    assert_eq!(configured(0x17).heard(), ["0: 01 00"]);
    assert_eq!(configured(0x01).heard(), Vec::<String>::new());
}

/// In figure 6.4.2 the segments and the window have the format of a single octet.
#[test]
fn a_window_in_the_last_two_segments() {
    let mut bench = Bench::exchanging(0x81, 0, &WITH_WINDOW);
    let kinds: Vec<u8> = bench.registers.cfg.module.iter().take(4).map(|module| module.kind.load()).collect();
    assert_eq!(kinds, [7, 8, 3, 4]);
    let mut outputs = page(0, 1, &[]);
    let mut window = [0; 16];
    (window[1], window[4], window[12], window[13], window[15]) = (0x12, 7, 1, 0xCC, 1);
    outputs.extend(window);
    let inputs = bench.exchange(&outputs);
    assert_eq!((inputs.len(), inputs[1], inputs[32 + 13]), (48, 1, 0xCC));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["12: 07"]);
}

/// The rules of p. 54, with the codes of p. 21.
#[test]
fn invalid_segments_are_refused() {
    let mut bench = Bench::new(5);
    bench.ask(61, &prm(0x81, 0));
    for (cfg, module, code) in [
        // Four configurations: less than 32 inputs; a short segment before the last segment; a segment that
        // is too long; no outputs.
        (&[0x9F, 0x80, 0x9F][..], 0, 3),
        (&[0x40, 0x90, 0x40, 0x9F, 0x80, 0x9F], 0, 3),
        (&[0x40, 0xA0, 0x80, 0x9F], 0, 3),
        (&[0x40, 0x9F, 0xA7], 1, 3),
        (&[0x40, 0x9F], 0, 3),
        (&[], 0, 3),
        // Four segments that are refused: a module that counts words, a module with data in both directions,
        // a module with one identifier, and a window at the front.
        (&[0x40, 0x9F, 0xEF], 1, 2),
        (&[0x40, 0x9F, 0xBF], 1, 1),
        (&[0x40, 0x9F, 0x80, 0x9F, 0x83, 1, 2, 3, 0], 2, 6),
        (&[0x43, 0x8F, 0xFF, 0xEF, 0, 0x40, 0x9F, 0x80, 0x9F], 0, 6),
    ] {
        bench.ask(62, cfg);
        assert_eq!(bench.diag()[8..], [0x3E, module, code], "{cfg:02X?}");
    }
    // 7 segments of 32 octets are 224 octets. An eighth segment would exceed the maximum (p. 10).
    let segments =
        |inputs: usize, outputs: usize| [[0x40, 0x9F].repeat(inputs), [0x80, 0x9F].repeat(outputs)].concat();
    bench.ask(62, &segments(7, 2));
    assert_eq!(bench.diag()[0], 0);
    bench.ask(62, &segments(8, 1));
    assert_eq!(bench.diag()[8..], [0x3E, 7, 3]);
}
