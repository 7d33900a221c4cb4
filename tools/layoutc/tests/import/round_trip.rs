//! Tests that existing and random layouts can be written in TOML, also through JSON, and read back without a change.
//! Tests also write layouts as declarations, change offsets, and restore them by an import.

use super::{fixture, plan, reported_rows, write};
use commram_layoutc::{compile, compile_family};
use proptest::prelude::*;
use std::fmt::Write;
use std::fs;
use std::path::Path;

const LAYOUTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../layouts");

/// A function that reads a layout file and rewrites it.
type Rewriter = fn(&toml::Table) -> toml::Table;

/// Rewrites the file without comments and with the keys in alphabetical order: directly, and through JSON, which has
/// fewer types.
const WAYS: [Rewriter; 2] =
    [toml::Table::clone, |table| serde_json::from_str(&serde_json::to_string(table).unwrap()).unwrap()];

/// Rewrites every file of `from` and of its folders into `to`.
fn rewrite(from: &Path, to: &Path, way: Rewriter) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let to = to.join(path.file_name().unwrap());
        if path.is_dir() {
            rewrite(&path, &to, way);
        } else {
            let table = fs::read_to_string(&path).unwrap().parse().unwrap();
            fs::write(to, toml::to_string(&way(&table)).unwrap()).unwrap();
        }
    }
}

/// Returns the code that is generated from this layout of any kind.
fn code(dir: &Path) -> String {
    if dir.join("device.toml").exists() {
        compile(dir).unwrap().rust
    } else if dir.join("family.toml").exists() {
        compile_family(dir).unwrap()
    } else {
        commram_layoutc::parameters::compile(dir, "parameters.toml").unwrap()
    }
}

#[test]
fn every_layout_is_read_back_unchanged() {
    for way in WAYS {
        let anew = tempfile::tempdir().unwrap();
        rewrite(Path::new(LAYOUTS), anew.path(), way);
        let mut names: Vec<_> = fs::read_dir(LAYOUTS).unwrap().map(|it| it.unwrap().file_name()).collect();
        names.sort();
        assert!(names.len() >= 7, "{names:?}");
        for name in names {
            let [before, after] = [Path::new(LAYOUTS), anew.path()].map(|dir| code(&dir.join(&name)));
            assert!(before == after, "{}", name.display());
        }
    }
}

/// Types with the prefixes of their registers' names. The last type is a sub-structure of the fixture.
const TYPES: [(&str, &str, u32, u32); 10] = [
    ("BYTE", "b_", 1, 1),
    ("WORD", "w_", 2, 2),
    ("DWORD", "d_", 4, 4),
    ("SINT", "si_", 1, 1),
    ("INT", "i_", 2, 2),
    ("DINT", "di_", 4, 4),
    ("USINT", "us_", 1, 1),
    ("UINT", "u_", 2, 2),
    ("UDINT", "ud_", 4, 4),
    ("PAIR", "_", 4, 2),
];

/// A register, and the size of the gap before it.
#[derive(Clone, Debug)]
struct Drawn {
    ty: usize,
    dims: Vec<u32>,
    gap: u32,
    owner: &'static str,
    reset: u8,
}

impl Drawn {
    fn is_sub(&self) -> bool {
        TYPES[self.ty].0 == "PAIR"
    }

    fn bytes(&self) -> u32 {
        TYPES[self.ty].2 * self.dims.iter().product::<u32>()
    }

    fn name(&self, number: usize) -> String {
        let start = if self.dims.is_empty() { TYPES[self.ty].1 } else { "a_" };
        format!("{start}R{number}")
    }
}

fn drawn() -> impl Strategy<Value = Drawn> {
    let dims = proptest::collection::vec(1..4_u32, 0..3);
    (0..TYPES.len(), dims, 0..9_u32, prop::sample::select(&["plc", "firmware", "both"][..]), 0..128_u8)
        .prop_map(|(ty, mut dims, gap, owner, reset)| {
            // An array of sub-structures has only one dimension.
            dims.truncate(if TYPES[ty].0 == "PAIR" { 1 } else { 2 });
            Drawn { ty, dims, gap, owner, reset }
        })
}

/// Returns the offset of each register if the registers follow each other in this order, and the end.
fn places(registers: &[Drawn], order: &[usize]) -> (Vec<(usize, u32)>, u32) {
    let mut end = 0;
    let placed = order.iter().map(|&number| {
        let register = &registers[number];
        let at = (end + register.gap).next_multiple_of(TYPES[register.ty].3);
        end = at + register.bytes();
        (number, at)
    });
    let placed = placed.collect();
    (placed, end.next_multiple_of(4))
}

/// Returns the fixture with a structure of these registers instead of the original.
fn layout(registers: &[Drawn], order: &[usize]) -> tempfile::TempDir {
    let dir = fixture();
    let device = fs::read_to_string(dir.path().join("device.toml")).unwrap();
    let without = [
        "  { name = \"INIT\", live = \"init\" },\n",
        "last = 1063\n",
        "cpu_first = 0x1000\ncpu_last = 0x103F\n",
    ];
    let device = without.iter().fold(device, |device, part| device.replacen(part, "", 1));
    // A structure of random registers may lack the register that shows the phase.
    let device = device.replace("live = \"cyclic\"", "live = \"always\"");
    fs::write(dir.path().join("device.toml"), device.replace("\"INIT\", ", "")).unwrap();
    let ctrl = fs::read_to_string(dir.path().join("CTRL.toml")).unwrap();
    let head = ctrl.split("size = ").next().unwrap();
    let (placed, size) = places(registers, order);
    let mut text = format!("{head}size = {size}\npage = \"4\"\ndoc = \"By lot\"\nregister = [\n");
    let mut end = 0;
    for (number, at) in placed {
        let register = &registers[number];
        if at > end {
            writeln!(text, "  {{ offset = {end}, padding = {} }},", at - end).unwrap();
        }
        write!(
            text,
            "  {{ offset = {at}, name = \"{}\", type = \"{}\"",
            register.name(number),
            TYPES[register.ty].0
        )
        .unwrap();
        if !register.dims.is_empty() {
            write!(text, ", array = {:?}", register.dims).unwrap();
        }
        if !register.is_sub() {
            write!(
                text,
                ", owner = \"{}\", reset = {}, reset_from = \"manual\"",
                register.owner, register.reset
            )
            .unwrap();
        }
        text += ", doc = \"Drawn\" },\n";
        end = at + register.bytes();
    }
    if size > end {
        writeln!(text, "  {{ offset = {end}, padding = {} }},", size - end).unwrap();
    }
    fs::write(dir.path().join("CTRL.toml"), text + "]\n").unwrap();
    dir
}

/// Returns the declarations of the same registers.
fn declarations(registers: &[Drawn], order: &[usize]) -> String {
    let (placed, size) = places(registers, order);
    let mut text =
        "TYPE\nPAIR : STRUCT w_FIRST : WORD; w_SECOND : WORD; END_STRUCT;\nCTRL : STRUCT\n".to_owned();
    let mut end = 0;
    let filler = |text: &mut String, from: u32, to: u32| {
        if to > from {
            // The name of the filler does not contain its offset, unlike in an export of commram. So the declarations
            // count as those of a vendor.
            writeln!(text, "padding_0{from} : ARRAY[1..{}] OF BYTE;", to - from).unwrap();
        }
    };
    for (number, at) in placed {
        let register = &registers[number];
        filler(&mut text, end, at);
        let bounds: Vec<_> = register.dims.iter().map(|count| format!("0..{}", count - 1)).collect();
        let array =
            if bounds.is_empty() { String::new() } else { format!("ARRAY[{}] OF ", bounds.join(", ")) };
        writeln!(text, "{} : {array}{};", register.name(number), TYPES[register.ty].0).unwrap();
        end = at + register.bytes();
    }
    filler(&mut text, end, size);
    text + "END_STRUCT;\nEND_TYPE\n"
}

fn drawn_in_two_orders() -> impl Strategy<Value = (Vec<Drawn>, Vec<usize>)> {
    proptest::collection::vec(drawn(), 1..12).prop_flat_map(|registers| {
        let order: Vec<_> = (0..registers.len()).collect();
        (Just(registers), Just(order).prop_shuffle())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn any_layout_comes_back_as_it_was((registers, order) in drawn_in_two_orders()) {
        let dir = layout(&registers, &order);
        let before = compile(dir.path()).unwrap();
        for way in WAYS {
            let anew = tempfile::tempdir().unwrap();
            rewrite(dir.path(), anew.path(), way);
            let after = compile(anew.path()).unwrap();
            prop_assert_eq!(&after.rust, &before.rust);
            prop_assert_eq!(after.layout_hash, before.layout_hash);
        }
    }

    #[test]
    fn offsets_come_back_from_declarations((registers, order) in drawn_in_two_orders()) {
        let first: Vec<_> = (0..registers.len()).collect();
        let dir = layout(&registers, &first);
        let before = compile(dir.path()).unwrap().layout_hash;
        let (own, other) = (declarations(&registers, &first), declarations(&registers, &order));
        let as_it_is = plan(dir.path(), &own).unwrap();
        prop_assert_eq!(reported_rows(&as_it_is), [""; 0]);
        prop_assert_eq!((as_it_is.hash_before, as_it_is.hash_after), (before, before));
        write(&plan(dir.path(), &other).unwrap());
        prop_assert_eq!(compile(dir.path()).unwrap().layout_hash, compile(layout(&registers, &order).path()).unwrap().layout_hash);
        prop_assert!(plan(dir.path(), &other).unwrap().changes_nothing());
        write(&plan(dir.path(), &own).unwrap());
        prop_assert_eq!(compile(dir.path()).unwrap().layout_hash, before);
    }
}
