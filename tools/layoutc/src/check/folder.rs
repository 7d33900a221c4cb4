//! A device in a folder of an unknown author: refuses keys that only the code of a device can implement.

use crate::error::{Error, Reason};
use crate::raw;
use crate::source::{SourcePlace, Sources, at};

/// Refuses ports, object dictionaries, device description files and bus timing.
pub(super) fn check(sources: &Sources, file: usize, raw: &raw::Device) -> Result<(), Error> {
    let refused = |place: SourcePlace, key| Err(sources.error(place, Reason::NotInFolder(key)));
    if let Some(port) = raw.port.first() {
        return refused(at(file, port.name.span()), "port");
    }
    if let Some(objects) = &raw.objects {
        return refused(at(file, objects.span()), "objects");
    }
    if let Some(gsd) = &raw.gsd {
        return refused(at(file, gsd.span()), "gsd");
    }
    if let Some(rate) = raw.baud_rate.first() {
        return refused(at(file, rate.deadline_WRC.span()), "baud_rate");
    }
    Ok(())
}
