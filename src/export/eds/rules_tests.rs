//! The rules of CiA 306 for an electronic data sheet, one by one, on the files of all sample devices.

use super::*;
use crate::devices::samples::tables::{MODULE, PANEL};
use std::collections::{BTreeMap, HashSet};

type Section = BTreeMap<String, String>;

/// The sections by name.
struct Sheet(BTreeMap<String, Section>);

impl Sheet {
    /// Reads a file. Fails if a section or a key occurs twice, or if a line is outside of a section.
    fn read(text: &str) -> Self {
        let mut sections: BTreeMap<String, Section> = BTreeMap::new();
        let mut current = None;
        for line in text.lines().filter(|line| !line.is_empty()) {
            assert!(line.is_ascii() && line.len() <= 255, "{line}");
            if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                assert!(sections.insert(name.to_owned(), Section::new()).is_none(), "[{name}] twice");
                current = Some(name.to_owned());
                continue;
            }
            let (key, value) = line.split_once('=').unwrap_or_else(|| panic!("{line}"));
            assert!(!value.contains(['=', ';']), "{line}: some readers end the value there");
            let section = current.as_ref().and_then(|name| sections.get_mut(name)).expect("a section");
            assert!(section.insert(key.to_owned(), value.to_owned()).is_none(), "{line}: twice");
        }
        Self(sections)
    }

    fn section(&self, name: &str) -> &Section {
        self.0.get(name).unwrap_or_else(|| panic!("no section [{name}]"))
    }

    /// Returns the indices of a list of objects, numbered from 1 on.
    fn list(&self, name: &str) -> Vec<u16> {
        let section = self.section(name);
        let count: usize = section["SupportedObjects"].parse().unwrap();
        assert_eq!(section.len(), count + 1, "[{name}]");
        (1..=count).map(|number| u16::try_from(numeral(&section[&number.to_string()])).unwrap()).collect()
    }

    /// Returns the sub-indices of an object that have a section.
    fn subs(&self, index: u16) -> Vec<u8> {
        let prefix = format!("{index:04X}sub");
        let mut subs: Vec<u8> = self
            .0
            .keys()
            .filter_map(|name| name.strip_prefix(&prefix))
            .map(|sub| u8::from_str_radix(sub, 16).unwrap())
            .collect();
        subs.sort_unstable();
        subs
    }
}

fn numeral(text: &str) -> u64 {
    text.strip_prefix("0x")
        .map_or_else(|| text.parse().unwrap(), |digits| u64::from_str_radix(digits, 16).unwrap())
}

fn sheets() -> Vec<Sheet> {
    let sheet = |device| Sheet::read(&generate(&Scope::new(device, None).unwrap()));
    vec![sheet(&PANEL), sheet(&MODULE)]
}

fn keys(section: &Section) -> HashSet<&str> {
    section.keys().map(String::as_str).collect()
}

#[test]
fn the_file_and_the_device_have_all_their_keys() {
    for sheet in sheets() {
        let file = sheet.section("FileInfo");
        let named = [
            "FileName",
            "FileVersion",
            "FileRevision",
            "EDSVersion",
            "Description",
            "CreationTime",
            "CreationDate",
            "CreatedBy",
            "ModificationTime",
            "ModificationDate",
            "ModifiedBy",
        ];
        assert_eq!(keys(file), HashSet::from(named));
        assert_eq!((&*file["EDSVersion"], &*file["CreationTime"]), ("4.0", "12:00AM"), "hh:mm(AM|PM)");
        assert_eq!(file["CreationDate"], "10-01-1999", "mm-dd-yyyy");
        let device = sheet.section("DeviceInfo");
        let mut named = HashSet::from([
            "VendorName",
            "VendorNumber",
            "ProductName",
            "ProductNumber",
            "RevisionNumber",
            "OrderCode",
            "SimpleBootUpMaster",
            "SimpleBootUpSlave",
            "Granularity",
            "DynamicChannelsSupported",
            "GroupMessaging",
            "NrOfRXPDO",
            "NrOfTXPDO",
            "LSS_Supported",
        ]);
        let rates = RATES.map(|rate| format!("BaudRate_{rate}"));
        named.extend(rates.iter().map(String::as_str));
        assert_eq!(keys(device), named);
        let is_pdo = |first: u16| {
            sheet
                .0
                .keys()
                .filter_map(|it| u16::from_str_radix(it, 16).ok())
                .filter(|index| (first..first + 0x200).contains(index))
                .count()
                .to_string()
        };
        assert_eq!((&device["NrOfRXPDO"], &device["NrOfTXPDO"]), (&is_pdo(0x1400), &is_pdo(0x1800)));
        assert_eq!(sheet.section("DummyUsage").len(), 7);
        let comments = sheet.section("Comments");
        assert_eq!(comments["Lines"], (comments.len() - 1).to_string());
    }
}

#[test]
fn every_object_is_in_the_list_of_its_range_and_has_a_section() {
    for sheet in sheets() {
        assert_eq!(sheet.list("MandatoryObjects"), MANDATORY);
        let manufacturers = sheet.list("ManufacturerObjects");
        assert!(manufacturers.iter().all(|index| (0x2000..0x6000).contains(index)));
        let optional = sheet.list("OptionalObjects");
        assert!(optional.iter().all(|it| (0x1000..0x2000).contains(it) || *it >= 0x6000));
        let listed: HashSet<u16> = MANDATORY.into_iter().chain(manufacturers).chain(optional).collect();
        let described: HashSet<u16> =
            sheet.0.keys().filter_map(|name| u16::from_str_radix(name.get(..4)?, 16).ok()).collect();
        assert_eq!(listed, described);
    }
}

#[test]
fn an_object_has_the_keys_of_its_type() {
    for sheet in sheets() {
        for (name, section) in &sheet.0 {
            let Some(index) = name.get(..4).and_then(|it| u16::from_str_radix(it, 16).ok()) else { continue };
            let mut found = keys(section);
            let is_value = section["ObjectType"] == "0x7";
            found.remove("DefaultValue");
            match &*section["ObjectType"] {
                "0x7" => assert_eq!(
                    found,
                    HashSet::from(["ParameterName", "ObjectType", "DataType", "AccessType", "PDOMapping"]),
                    "{name}"
                ),
                "0x9" => {
                    assert_eq!(found, HashSet::from(["ParameterName", "ObjectType", "SubNumber"]), "{name}");
                    assert!(!section.contains_key("DefaultValue"), "{name}");
                    assert_eq!(section["SubNumber"], sheet.subs(index).len().to_string(), "{name}");
                }
                other => panic!("{name}: {other}"),
            }
            if !is_value {
                continue;
            }
            let access = &*section["AccessType"];
            assert!(["ro", "wo", "rw", "rwr", "rww", "const"].contains(&access), "{name}: {access}");
            let most = match &*section["DataType"] {
                "0x0005" => 0xFF,
                "0x0006" => 0xFFFF,
                "0x0007" => 0xFFFF_FFFF,
                other => {
                    assert!(["0x0009", "0x000F"].contains(&other), "{name}");
                    continue;
                }
            };
            let Some(default) = section.get("DefaultValue") else { continue };
            let default = default.strip_prefix("$NODEID").map_or(&**default, |rest| {
                rest.strip_prefix('+').expect("some readers need a number after $NODEID")
            });
            assert!(numeral(default) <= most, "{name}: {default}");
        }
    }
}

#[test]
fn sub_index_0_is_the_highest_sub_index_in_eight_bits() {
    for sheet in sheets() {
        for (name, _) in
            sheet.0.iter().filter(|(_, section)| section.get("ObjectType").is_some_and(|it| it == "0x9"))
        {
            let subs = sheet.subs(u16::from_str_radix(name, 16).unwrap());
            let zero = sheet.section(&format!("{name}sub0"));
            assert_eq!((&*zero["DataType"], &*zero["PDOMapping"]), ("0x0005", "0"), "{name}");
            assert_eq!(numeral(&zero["DefaultValue"]), u64::from(*subs.last().unwrap()), "{name}");
        }
    }
}

#[test]
fn parameter_names_are_distinct_and_records_have_their_own() {
    for sheet in sheets() {
        let mut objects = HashSet::new();
        for (name, section) in sheet.0.iter().filter(|(name, _)| name.len() == 4) {
            let own = &section["ParameterName"];
            assert!(!own.is_empty() && own.len() <= 241, "{name}");
            assert!(objects.insert(own), "{name}: {own}");
            let subs = sheet.subs(u16::from_str_radix(name, 16).unwrap());
            let names: HashSet<_> = subs
                .iter()
                .map(|sub| &sheet.section(&format!("{name}sub{sub:X}"))["ParameterName"])
                .collect();
            assert_eq!(names.len(), subs.len(), "{name}: {names:?}");
            assert!(!names.contains(own), "{name}: {own}");
        }
    }
}

#[test]
fn pdos_map_entries_that_allow_it_and_have_the_length() {
    for sheet in sheets() {
        let mut mapped = HashSet::new();
        for index in (0x1600..0x1800).chain(0x1A00..0x1C00) {
            for sub in sheet.subs(index).into_iter().skip(1) {
                let entry = numeral(&sheet.section(&format!("{index:04X}sub{sub:X}"))["DefaultValue"]);
                let (object, sub, bits) = (entry >> 16, entry >> 8 & 0xFF, entry & 0xFF);
                let name = format!("{object:04X}sub{sub:X}");
                let section = sheet.section(&name);
                let data = numeral(&section["DataType"]);
                assert_eq!(bits, [8, 16, 32][usize::try_from(data).unwrap() - 5], "{name}");
                let allowed = if index < 0x1800 { ["rww", "wo", "rw"] } else { ["rwr", "ro", "rw"] };
                assert!(allowed.contains(&&*section["AccessType"]), "{name}");
                mapped.insert(name);
            }
        }
        let of_pdos: HashSet<String> = sheet
            .0
            .iter()
            .filter(|(_, it)| it.get("PDOMapping").is_some_and(|it| it == "1"))
            .map(|(name, _)| name.clone())
            .collect();
        assert!(!mapped.is_empty());
        assert_eq!(mapped, of_pdos);
    }
}
