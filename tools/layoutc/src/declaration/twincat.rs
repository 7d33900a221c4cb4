//! Objects of TwinCAT, one in a file: `.TcDUT` and `.TcGVL` have declarations as text. A function block, program or interface
//! (`.TcPOU`, `.TcIO`) is skipped.

use super::error::Fault;
use super::xml::{Content, Xml};
use super::{Declarations, parser};

/// Reads the content of `<TcPlcObject>`.
pub(crate) fn read(xml: &mut Xml<'_>, into: &mut Declarations) -> Result<(), Fault> {
    loop {
        let (at, content) = xml.next()?;
        match content {
            Content::Begin(object) if object.is("DUT") || object.is("GVL") => {}
            Content::Begin(part) if part.is("Declaration") => {
                let (begin, text) = xml.text()?;
                parser::parse(&text, begin, into)?;
            }
            Content::Begin(object) => {
                if let Some(name) = object.attribute("Name") {
                    into.skip_part(at, &object.name, name);
                }
                xml.skip()?;
            }
            Content::End if xml.is_at_end() => return Ok(()),
            Content::End | Content::Text(_) => {}
        }
    }
}
