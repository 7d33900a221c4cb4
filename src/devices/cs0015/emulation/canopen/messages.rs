//! Messages that a CS0015 sends and receives as a CANopen node with factory settings. They are for bus
//! databases.

use super::communication::{Communication, Factory, PDOS, PdoDirection};
use crate::can::Message;
use crate::devices::canopen::messages::{MessageInfo, NodeMessages};
use crate::devices::cs0015::emulation::config::Cs0015Config;
use crate::devices::cs0015::emulation::port::Program;
use crate::devices::cs0015::registers::DEVICE;
use crate::layout::Width;

/// Returns the messages of a device with these settings and with factory values.
pub(crate) fn of(config: &Cs0015Config) -> Vec<Message> {
    if config.program == Program::None {
        return Vec::new();
    }
    let mut communication = Communication::new(Factory { node: config.node_id, kbit_s: config.kbit_s });
    if let Program::BuiltIn { pdos, .. } = &config.program {
        pdos.iter().for_each(|(way, pdo, asked)| communication.ask(*way, *pdo, *asked));
        communication.reset();
    }
    let default = |index| DEVICE.object(index, 0).map_or(0, |object| object.default.at_node(config.node_id));
    let sdo = |sub| communication.sdo_cob_id(sub);
    let of = NodeMessages { node: &config.name };
    let nodes = match &config.program {
        Program::BuiltIn { master: Some(master), .. } => Some(&master.nodes),
        _ => None,
    };
    let mut all: Vec<_> = of.broadcasts(default(0x1005), nodes.is_some()).collect();
    all.extend(nodes.into_iter().flatten().flat_map(|node| of.of_master(*node)));
    all.extend(of.services(default(0x1014), default(0x100E), sdo(1), sdo(2)));
    for (way, area) in [(PdoDirection::Receive, "rx_pdo"), (PdoDirection::Transmit, "tx_pdo")] {
        let first = DEVICE.area(area).map_or(0, |area| area.first);
        for pdo in 0..PDOS {
            let name = format!("{}{}", area.to_uppercase(), pdo + 1);
            let about = match way {
                PdoDirection::Receive => MessageInfo::received(&name, ""),
                PdoDirection::Transmit => MessageInfo::sent(&name, ""),
            };
            let words = ["word_1", "word_2", "word_3", "word_4"].map(|word| (word, 16));
            let made = of.message(communication.pdo_cob_id(way, pdo), about, &words);
            all.push(made.map(|mut made| {
                for (word, signal) in (0..).zip(&mut made.signals) {
                    signal.about = DEVICE.at(Width::Word, first + 8 * pdo as u32 + 2 * word).to_string();
                }
                made
            }));
        }
    }
    all.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::Arbitration;
    use crate::devices::cs0015::emulation::canopen::node::BootUp;

    #[test]
    fn each_pdo_of_both_directions_has_its_name_and_registers() {
        let (name, program) = ("panel".to_owned(), Program::Attached { cycle_us: 1_000 });
        let config =
            Cs0015Config { name, bus: None, node_id: 5, kbit_s: 125, boot_up: BootUp::default(), program };
        let ids: Vec<_> =
            of(&config).into_iter().map(|it| (it.name, Arbitration::new(it.id, false).number())).collect();
        for (name, id) in [("panel_TX_PDO1", 0x185), ("panel_RX_PDO1", 0x205), ("panel_RX_PDO2", 0x305)] {
            assert!(ids.contains(&(name.to_owned(), id)), "{name}: {ids:X?}");
        }
        let messages: Vec<_> = of(&config).into_iter().map(|it| (it.name, it.signals)).collect();
        for area in ["rx_pdo", "tx_pdo"] {
            let named = format!("panel_{}", area.to_uppercase());
            let pdos: Vec<_> = messages.iter().filter(|(name, _)| name.starts_with(&named)).collect();
            assert_eq!(pdos.len(), PDOS);
            for (pdo, (name, signals)) in (0..).zip(pdos) {
                assert_eq!(*name, format!("{named}{}", pdo + 1));
                let first = DEVICE.area(area).unwrap().first + 8 * pdo;
                let about: Vec<_> = signals.iter().map(|signal| signal.about.as_str()).collect();
                assert_eq!(about, [0, 2, 4, 6].map(|byte| DEVICE.at(Width::Word, first + byte).to_string()));
            }
        }
    }
}
