//! The same tests run on both backings.

use super::*;
use crate::memory::testing::SEGMENT_SIZE;
use crate::memory::{Cell8, Cell16, Cell32};
use memmap2::MmapOptions;

/// Returns a memory segment on the heap, and a memory segment in an unnamed file. Under Miri, which cannot map files,
/// returns only the segment on the heap.
fn both() -> Vec<Segment> {
    let mut both = vec![Segment::heap(SEGMENT_SIZE)];
    if !cfg!(miri) {
        let file = tempfile::tempfile().unwrap();
        file.set_len(SEGMENT_SIZE as u64).unwrap();
        both.push(Segment::mapped(MmapRaw::map_raw(&file).unwrap(), SEGMENT_SIZE, true).unwrap());
    }
    both
}

fn read_only() -> Segment {
    let file = tempfile::tempfile().unwrap();
    file.set_len(SEGMENT_SIZE as u64).unwrap();
    Segment::mapped(MmapOptions::new().map_raw_read_only(&file).unwrap(), SEGMENT_SIZE, false).unwrap()
}

fn message<T: fmt::Debug>(result: Result<T, MemoryError>) -> String {
    result.unwrap_err().to_string()
}

const LAST: u32 = SEGMENT_SIZE as u32 - 1;

#[test]
fn starts_zeroed_and_holds_the_last_byte() {
    for segment in both() {
        assert_eq!(segment.load(LAST, Width::Byte).unwrap(), 0);
        segment.store(LAST, Width::Byte, 0xA5).unwrap();
        assert_eq!(segment.load(LAST, Width::Byte).unwrap(), 0xA5);
        assert_eq!(segment.load(LAST - 3, Width::Dword).unwrap(), 0xA500_0000);
    }
}

#[test]
fn registers_are_little_endian() {
    for segment in both() {
        segment.store(200_000, Width::Dword, 0x1122_3344).unwrap();
        segment.store(200_004, Width::Word, 0x5566).unwrap();
        let mut bytes = [0; 6];
        segment.read_range(200_000, &mut bytes).unwrap();
        assert_eq!(bytes, [0x44, 0x33, 0x22, 0x11, 0x66, 0x55]);
    }
}

#[test]
fn refusals_name_the_address_and_what_would_be_right() {
    for segment in both() {
        assert_eq!(
            message(segment.load(200_001, Width::Word)),
            "WORD at byte 200001 of the image: a WORD needs an even address"
        );
        assert_eq!(
            message(segment.store(200_002, Width::Dword, 0)),
            "DWORD at byte 200002 of the image: a DWORD needs an address divisible by 4"
        );
        assert_eq!(
            message(segment.load(3_262_144, Width::Dword)),
            "DWORD at byte 3262144 of the image is after the last one, byte 3262143"
        );
        assert_eq!(
            message(segment.load(u32::MAX, Width::Byte)),
            "byte 4294967295 of the image is after the last one, byte 3262143"
        );
        assert_eq!(
            message(segment.load(4_095, Width::Byte)),
            "byte 4095 of the image is in the header page; registers begin at byte 4096"
        );
        assert_eq!(
            message(segment.store(200_000, Width::Byte, 0x100)),
            "byte 200000 of the image: 16#100 does not fit, a BYTE holds at most 16#FF"
        );
        assert_eq!(
            message(segment.compare_exchange(200_000, Width::Word, 0x1_0000, 0)),
            "WORD at byte 200000 of the image: 16#10000 does not fit, a WORD holds at most 16#FFFF"
        );
        assert_eq!(
            message(segment.store_within(200_000, Width::Word, 200_002, Width::Byte, 0)),
            "byte 200002 of the image is not a part of the register there: WORD at byte 200000 of the image"
        );
        assert_eq!(
            message(segment.load_within(200_000, Width::Byte, 200_000, Width::Word)),
            "WORD at byte 200000 of the image is not a part of the register there: byte 200000 of the image"
        );
        assert_eq!(
            message(segment.store_within(200_000, Width::Dword, 200_001, Width::Word, 0)),
            "WORD at byte 200001 of the image: a WORD needs an even address"
        );
        assert_eq!(
            message(segment.read_range(LAST, &mut [0; 2])),
            "byte 3262143 of the image: 2 bytes from there end after the last one, byte 3262143"
        );
    }
}

#[test]
fn view_refusals() {
    for segment in both() {
        assert_eq!(
            message(segment.view::<Cell16>(200_001)),
            "byte 200001 of the image: a view of commram::memory::cell::Cell16 needs an address divisible by 2"
        );
        assert_eq!(
            message(segment.view::<[Cell8; 2]>(LAST)),
            "byte 3262143 of the image: 2 bytes from there end after the last one, byte 3262143"
        );
        assert!(matches!(segment.view::<Cell32>(u32::MAX - 3), Err(MemoryError::BlockOutOfRange { .. })));
        // The words of the front panel are accessible at their own width, and no other bytes are.
        segment.store(3_520, Width::Dword, 7).unwrap();
        let front = segment.load(3_520, Width::Dword).unwrap();
        assert_eq!((front, segment.header_snapshot().front[0].load()), (7, 7));
        for (offset, width) in
            [(3_520, Width::Byte), (3_522, Width::Word), (3_516, Width::Dword), (3_776, Width::Dword)]
        {
            assert!(matches!(segment.load(offset, width), Err(MemoryError::InHeader { .. })), "{offset}");
        }
        segment.store(3_520, Width::Dword, 0).unwrap();
        assert!(matches!(segment.view::<Cell32>(4_092), Err(MemoryError::InHeader { .. })));
    }
}

#[test]
fn a_view_outlives_its_segment_and_sees_raw_stores() {
    for segment in both() {
        let view = segment.view::<[Cell16; 4]>(200_000).unwrap();
        let third = view.project(|block| &block[2]);
        segment.store(200_004, Width::Word, 0x0043).unwrap();
        drop((segment, view));
        assert_eq!(third.load(), 0x0043);
        third.store(0x0044);
        assert_eq!(third.segment().load(200_004, Width::Word).unwrap(), 0x0044);
    }
}

#[test]
fn views_and_segments_cross_threads() {
    fn crosses<T: Send + Sync>() {}
    crosses::<Segment>();
    crosses::<View<Header>>();
}

#[test]
fn compare_exchange_leaves_a_foreign_value_alone() {
    for segment in both() {
        for width in [Width::Byte, Width::Word, Width::Dword] {
            segment.store(200_000, width, 5).unwrap();
            assert_eq!(segment.compare_exchange(200_000, width, 5, 4).unwrap(), Ok(5));
            assert_eq!(segment.compare_exchange(200_000, width, 5, 3).unwrap(), Err(4));
            assert_eq!(segment.load(200_000, width).unwrap(), 4);
        }
    }
}

#[test]
fn partial_stores_keep_the_rest_of_the_register() {
    for segment in both() {
        segment.store(200_000, Width::Dword, 0x1122_3344).unwrap();
        segment.store_within(200_000, Width::Dword, 200_002, Width::Byte, 0xAA).unwrap();
        segment.store_within(200_000, Width::Dword, 200_000, Width::Word, 0xBBCC).unwrap();
        assert_eq!(segment.load(200_000, Width::Dword).unwrap(), 0x11AA_BBCC);
        assert_eq!(segment.load_within(200_000, Width::Dword, 200_002, Width::Word).unwrap(), 0x11AA);
        assert_eq!(segment.load_within(200_000, Width::Dword, 200_000, Width::Dword).unwrap(), 0x11AA_BBCC);
    }
}

#[test]
fn partial_stores_of_two_writers_both_survive() {
    // One round under Miri takes as long as thousands of rounds without Miri.
    const LAST: u32 = if cfg!(miri) { 50 } else { 5_000 };
    for segment in both() {
        std::thread::scope(|scope| {
            for part in 0..2 {
                let segment = &segment;
                scope.spawn(move || {
                    for value in 0..=LAST {
                        segment
                            .store_within(200_000, Width::Dword, 200_000 + 2 * part, Width::Word, value)
                            .unwrap();
                    }
                });
            }
        });
        assert_eq!(segment.load(200_000, Width::Dword).unwrap(), LAST << 16 | LAST);
    }
}

#[test]
fn ranges_at_any_alignment() {
    for segment in both() {
        for i in 0..16 {
            segment.store(200_000 + i, Width::Byte, i).unwrap();
        }
        for start in 0..8 {
            for length in 0..8 {
                let mut bytes = vec![0xFF; length];
                segment.read_range(200_000 + start as u32, &mut bytes).unwrap();
                let expected: Vec<u8> = (start as u8..).take(length).collect();
                assert_eq!(bytes, expected, "start {start}");
            }
        }
    }
}

/// A word, a doubleword and a byte side by side, each written at its own width, while others read all of them in words
/// of 64 and 32 bits: no register may be torn, and a write of a register must not change its neighbours.
#[test]
#[cfg_attr(miri, ignore = "Miri has no model for concurrent accesses of several widths")]
fn registers_are_whole_when_read_in_any_width() {
    const TURNS: u32 = 20_000;
    // For each register: its offset, its width, and two alternating values.
    let registers = [
        (200_000, Width::Dword, [0x1111_1111, 0xEEEE_EEEE_u32]),
        (200_004, Width::Word, [0x2222, 0xDDDD]),
        (200_006, Width::Byte, [0x33, 0xCC]),
        (200_007, Width::Byte, [0x44, 0xBB]),
    ];
    let is_whole = |bytes: [u8; 8]| {
        registers.iter().all(|(offset, width, values)| {
            let start = *offset as usize - 200_000;
            values
                .iter()
                .any(|value| bytes[start..].starts_with(&value.to_le_bytes()[..width.bytes() as usize]))
        })
    };
    for segment in both() {
        for (offset, width, [value, _]) in registers {
            segment.store(offset, width, value).unwrap();
        }
        let wide = segment.view::<Cell64>(200_000).unwrap();
        std::thread::scope(|scope| {
            let segment = &segment;
            let writers = registers.map(|(offset, width, values)| {
                scope.spawn(move || {
                    for turn in 0..TURNS {
                        segment.store(offset, width, values[turn as usize % 2]).unwrap();
                    }
                })
            });
            while !writers.iter().all(|writer| writer.is_finished()) {
                let mut bytes = [0; 8];
                segment.read_range(200_000, &mut bytes).unwrap();
                assert!(is_whole(bytes), "{bytes:X?}");
                let bytes = wide.load().to_le_bytes();
                assert!(is_whole(bytes), "{bytes:X?}");
            }
        });
    }
}

#[test]
fn a_snapshot_is_private() {
    for segment in both() {
        segment.store(200_002, Width::Word, 0x0043).unwrap();
        let copy = segment.snapshot::<[Cell16; 2]>(200_000).unwrap();
        segment.store(200_002, Width::Word, 0).unwrap();
        assert_eq!((copy[0].load(), copy[1].load()), (0, 0x0043));
        copy[0].store(1);
        assert_eq!(segment.load(200_000, Width::Word).unwrap(), 0);
    }
}

#[cfg(feature = "emulator")]
#[test]
fn every_word_is_in_a_block_inside_the_segment() {
    const WORD: usize = size_of::<u64>();
    for size in (HEADER_SIZE..HEADER_SIZE + 400).step_by(WORD) {
        let segment = Segment::heap(size);
        for offset in HEADER_SIZE as u32..size as u32 {
            let (first, words) = segment.block(offset).unwrap();
            let index = (offset - first) as usize / WORD;
            segment.store(offset, Width::Byte, 0x81).unwrap();
            assert_eq!(words[index].load() >> (8 * (offset % 8)) & 0xFF, 0x81, "{size} {offset}");
        }
        assert!(segment.block(size as u32).is_err(), "{size}");
        assert!(segment.block(u32::MAX).is_err(), "{size}");
    }
}

#[test]
#[cfg_attr(miri, ignore = "Miri cannot map files")]
fn a_read_only_segment_refuses_instead_of_crashing() {
    let segment = read_only();
    let refusal =
        "byte 200000 of the image: it is attached read-only; attach it for reading and writing instead";
    assert_eq!(message(segment.store(200_000, Width::Byte, 1)), refusal);
    assert_eq!(message(segment.compare_exchange(200_000, Width::Byte, 0, 1)), refusal);
    assert_eq!(message(segment.store_within(200_000, Width::Word, 200_000, Width::Byte, 1)), refusal);
    assert_eq!(message(segment.view::<Cell16>(200_000)), refusal);
    assert!(matches!(segment.header(), Err(MemoryError::ReadOnly { offset: 0 })));
    assert_eq!(segment.load(200_000, Width::Dword).unwrap(), 0);
    assert_eq!(segment.snapshot::<Cell16>(200_000).unwrap().load(), 0);
    assert_eq!(segment.header_snapshot().magic.load(), 0);
}

#[test]
#[cfg_attr(miri, ignore = "Miri cannot map files")]
fn a_map_that_is_too_short_gives_no_segment() {
    let file = tempfile::tempfile().unwrap();
    file.set_len(SEGMENT_SIZE as u64 - 1).unwrap();
    assert!(Segment::mapped(MmapRaw::map_raw(&file).unwrap(), SEGMENT_SIZE, true).is_none());
}

#[test]
fn the_header_is_at_the_beginning() {
    for segment in both() {
        segment.header().unwrap().virtual_time_us.store(62_500);
        assert_eq!(segment.header_snapshot().virtual_time_us.load(), 62_500);
    }
}

/// Fields of the header page, each written at its own width, while others copy the whole page.
#[test]
#[cfg_attr(miri, ignore = "Miri has no model for concurrent accesses of several widths")]
fn the_header_page_is_whole_in_a_copy() {
    const TURNS: u64 = 20_000;
    const TIMES: [u64; 2] = [0x1111_1111_1111_1111, 0xEEEE_EEEE_EEEE_EEEE];
    const GENERATIONS: [u32; 2] = [0x2222_2222, 0xDDDD_DDDD];
    for segment in both() {
        let header = segment.header().unwrap();
        header.virtual_time_us.store(TIMES[0]);
        header.generation.store(GENERATIONS[0]);
        std::thread::scope(|scope| {
            let header = &header;
            let time = scope
                .spawn(|| (0..TURNS).for_each(|turn| header.virtual_time_us.store(TIMES[turn as usize % 2])));
            let other = scope.spawn(|| {
                (0..TURNS).for_each(|turn| header.generation.store(GENERATIONS[turn as usize % 2]))
            });
            while !(time.is_finished() && other.is_finished()) {
                let copy = segment.header_snapshot();
                assert!(TIMES.contains(&copy.virtual_time_us.load()), "{:X}", copy.virtual_time_us.load());
                assert!(GENERATIONS.contains(&copy.generation.load()), "{:X}", copy.generation.load());
            }
        });
    }
}

/// Segments differ by device: a b maXX PLC needs more than 7 MB, other devices only a page of registers.
#[test]
fn a_segment_is_as_long_as_its_device_needs() {
    for (asked, size) in [(7_034_560, 7_034_560), (4_100, 4_100), (5_001, 5_004), (0, HEADER_SIZE)] {
        let segment = Segment::heap(asked);
        assert_eq!(segment.size(), size);
        let end = size as u32;
        assert_eq!(segment.load(end - 1, Width::Byte).is_ok(), size > HEADER_SIZE);
        assert!(
            matches!(segment.load(end, Width::Byte), Err(MemoryError::OutOfRange { end, .. }) if end == size)
        );
    }
}

#[test]
fn words_of_the_header_end_with_its_page() {
    for segment in both() {
        segment.header_words::<{ HEADER_SIZE / 8 }>().unwrap();
        let beyond = message(segment.header_words::<{ HEADER_SIZE / 8 + 1 }>().map(|_| ()));
        assert!(beyond.contains(&(HEADER_SIZE + 8).to_string()), "{beyond}");
    }
}

#[test]
fn a_copy_ends_with_the_segment() {
    type Four = [Cell32; 4];
    for segment in both() {
        segment.store(LAST, Width::Byte, 0xA5).unwrap();
        let end = (SEGMENT_SIZE - size_of::<Four>()) as u32;
        assert_eq!(segment.snapshot::<Four>(end).unwrap()[3].load(), 0xA500_0000);
        for beyond in [end + 4, LAST + 1, 2 * LAST, u32::MAX - 3] {
            assert!(segment.snapshot::<Four>(beyond).is_err(), "{beyond}");
        }
        let error = message(segment.snapshot::<Four>((HEADER_SIZE - size_of::<Four>()) as u32));
        assert!(error.contains("header page"), "{error}");
    }
}
