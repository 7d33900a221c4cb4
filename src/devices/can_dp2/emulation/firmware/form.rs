//! Byte order between a PLC and CAN (p. 36).

/// Swaps bytes of `data` according to the format byte `form`. Bit 7 of `form` belongs to the first byte of
/// the data. A sequence of 1 bits and the 0 bit that ends it mark a group of bytes. The order of the bytes in
/// a group is reversed. A group ends with the data at the latest (D-376). A second call restores the data.
pub(in crate::devices::can_dp2::emulation) fn swap(form: u8, data: &mut [u8]) {
    let mut first = 0;
    while first < data.len() {
        let ones = (first..7).take_while(|at| form & 0x80 >> at != 0).count();
        let end = (first + ones + 1).min(data.len());
        data[first..end].reverse();
        first = end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn swaps_match_the_examples_of_the_manual() {
        let all = [1, 2, 3, 4, 5, 6, 7, 8];
        for (form, length, expected) in [
            (0x8E, 8, vec![2, 1, 3, 4, 8, 7, 6, 5]),
            (0xFE, 8, vec![8, 7, 6, 5, 4, 3, 2, 1]),
            (0x00, 8, all.to_vec()),
            (0xB8, 6, vec![2, 1, 6, 5, 4, 3]),
            (0x80, 2, vec![2, 1]),
            (0xAA, 8, vec![2, 1, 4, 3, 6, 5, 8, 7]),
            (0xEE, 8, vec![4, 3, 2, 1, 8, 7, 6, 5]),
            (0xFE, 6, vec![6, 5, 4, 3, 2, 1]),
        ] {
            let mut data = all[..length].to_vec();
            swap(form, &mut data);
            assert_eq!(data, expected, "form 16#{form:02X}");
        }
    }

    proptest! {
    #![proptest_config(crate::property_tests())]

        #[test]
        fn swapping_twice_restores_the_data_and_bit_0_has_no_effect(form: u8, data in prop::collection::vec(any::<u8>(), 0..=9)) {
            let (mut once, mut other) = (data.clone(), data.clone());
            swap(form, &mut once);
            swap(form ^ 1, &mut other);
            prop_assert_eq!(&once, &other);
            swap(form, &mut once);
            prop_assert_eq!(once, data);
        }
    }
}
