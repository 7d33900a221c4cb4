//! Pages of the documentation about kinds of devices, modules and buses, relative to `docs`.

/// Page about the modules of a controller.
pub(crate) const OF_MODULES: &str = "devices/bm4-plc/overview.md";

/// Kinds without a page of their own name. Each has its page and a heading of this page; an empty heading is the
/// beginning of the page.
pub(crate) const OF_KINDS: &[(&str, &str, &str)] = &[
    ("cr201x", "devices/cs0015/overview.md", "## I/O modules"),
    ("can-05", OF_MODULES, ""),
    ("can-06", OF_MODULES, ""),
    ("cansync", "reference/plant.md", "## Drives on a bus"),
    ("can", "reference/can.md", ""),
    ("profibus", "devices/can-dp2/overview.md", ""),
    ("serial", "reference/serial.md", ""),
];
