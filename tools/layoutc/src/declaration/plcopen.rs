//! PLCopen XML (tc6, 2.0 and 2.01), as CODESYS, TwinCAT, Beremiz and OpenPLC export it: data types and constants. Programs and
//! function blocks are skipped.

use super::error::{Fault, TextPosition, Wrong};
use super::expression::Expression;
use super::lexer::alignment_of_pack_mode;
use super::xml::{Content, Tag, Xml};
use super::{Declarations, MAX_DEPTH, Member, Record, Type, TypeId, parser};
use std::collections::HashMap;

/// Reads the content of `<project>`.
pub(crate) fn read(xml: &mut Xml<'_>, into: &mut Declarations) -> Result<(), Fault> {
    loop {
        let (at, content) = xml.next()?;
        match content {
            Content::Begin(tag) if tag.is("dataType") => data_type(xml, into, &tag, at)?,
            Content::Begin(tag) if tag.is("pou") => {
                into.skip_part(at, "POU", tag.attribute("name").unwrap_or_default());
                xml.skip()?;
            }
            Content::Begin(tag) if tag.is("globalVars") && tag.attribute("constant") == Some("true") => {
                constants(xml, into)?;
            }
            Content::End if xml.is_at_end() => return Ok(()),
            Content::Begin(_) | Content::End | Content::Text(_) => {}
        }
    }
}

fn name_of(tag: &Tag, element: &'static str, at: TextPosition) -> Result<String, Fault> {
    let name = tag.attribute("name").filter(|name| !name.is_empty());
    name.map(str::to_owned).ok_or((at, Wrong::NoAttribute(element, "name")))
}

/// Returns the next element inside the current element. Returns nothing at the end of the current element.
fn child(xml: &mut Xml<'_>) -> Result<Option<(TextPosition, Tag)>, Fault> {
    loop {
        match xml.next()? {
            (at, Content::Begin(tag)) => return Ok(Some((at, tag))),
            (_, Content::End) => return Ok(None),
            (_, Content::Text(_)) => {}
        }
    }
}

fn data_type(xml: &mut Xml<'_>, into: &mut Declarations, tag: &Tag, at: TextPosition) -> Result<(), Fault> {
    let name = name_of(tag, "dataType", at)?;
    let mut ty = None;
    let mut remarks = Remarks::default();
    while let Some((_, part)) = child(xml)? {
        match part.name.as_str() {
            "baseType" => ty = Some(specification(xml, into, ("baseType", at), 0)?),
            "addData" => remarks.read(xml)?,
            _ => xml.skip()?,
        }
    }
    let ty = ty.ok_or((at, Wrong::NoType("dataType")))?;
    if let Type::Record(record) = &mut into.types[ty.0].ty {
        record.base = remarks.base;
        record.pack = remarks.pack;
    }
    into.declare(&name, at, ty)
}

/// Additional data of CODESYS and TwinCAT about a data type.
#[derive(Default)]
struct Remarks {
    /// Name in `<Inheritance><Extends>NAME</Extends></Inheritance>`.
    base: Option<String>,
    /// Value in `<Attribute Name="pack_mode" Value="1"/>`.
    pack: Option<u32>,
}

impl Remarks {
    /// Reads the content of `<addData>`.
    fn read(&mut self, xml: &mut Xml<'_>) -> Result<(), Fault> {
        let mut depth = 1;
        while depth > 0 {
            match xml.next()?.1 {
                Content::Begin(tag) if tag.is("Extends") => self.base = Some(xml.text()?.1.trim().to_owned()),
                Content::Begin(tag) => {
                    if tag.is("Attribute") && tag.attribute("Name") == Some("pack_mode") {
                        self.pack = tag.attribute("Value").and_then(alignment_of_pack_mode);
                    }
                    depth += 1;
                }
                Content::End => depth -= 1,
                Content::Text(_) => {}
            }
        }
        Ok(())
    }
}

/// Reads the type in an element of the name `outer`, up to and including the end of that element.
fn specification(
    xml: &mut Xml<'_>,
    into: &mut Declarations,
    (outer, begin): (&'static str, TextPosition),
    depth: usize,
) -> Result<TypeId, Fault> {
    if depth > MAX_DEPTH {
        return Err((begin, Wrong::TooDeep(MAX_DEPTH)));
    }
    let (at, tag) = child(xml)?.ok_or((begin, Wrong::NoType(outer)))?;
    let ty = match tag.name.as_str() {
        "array" => array(xml, into, at, depth)?,
        "struct" => Type::Record(Record { members: members(xml, into, depth)?, ..Record::default() }),
        // An enumeration may name the elementary type in which its values are stored. If it does not, it has no known
        // size.
        "enum" => inner(xml, into, depth)?.unwrap_or(Type::Unsized("an enumeration")),
        "subrangeSigned" | "subrangeUnsigned" => {
            inner(xml, into, depth)?.ok_or((at, Wrong::NoType("subrange")))?
        }
        "derived" => {
            xml.skip()?;
            Type::Named(name_of(&tag, "derived", at)?)
        }
        "pointer" | "reference" => skipped(xml, "a pointer")?,
        "string" => skipped(xml, "STRING")?,
        "wstring" => skipped(xml, "WSTRING")?,
        elementary => {
            xml.skip()?;
            Type::Named(elementary.to_owned())
        }
    };
    let id = into.add_type(at, ty);
    // Skips further elements up to the end of `outer`. The known tools write no further elements.
    while child(xml)?.is_some() {
        xml.skip()?;
    }
    Ok(id)
}

fn skipped(xml: &mut Xml<'_>, what: &'static str) -> Result<Type, Fault> {
    xml.skip()?;
    Ok(Type::Unsized(what))
}

/// Returns the base type in the current element, up to its end.
fn inner(xml: &mut Xml<'_>, into: &mut Declarations, depth: usize) -> Result<Option<Type>, Fault> {
    let mut ty = None;
    while let Some((at, part)) = child(xml)? {
        if part.is("baseType") {
            let base = specification(xml, into, ("baseType", at), depth + 1)?;
            if let Type::Named(name) = &into.of(base).ty {
                ty = Some(Type::Named(name.clone()));
            }
        } else {
            xml.skip()?;
        }
    }
    Ok(ty)
}

fn array(
    xml: &mut Xml<'_>,
    into: &mut Declarations,
    begin: TextPosition,
    depth: usize,
) -> Result<Type, Fault> {
    let mut bounds = Vec::new();
    let mut of = None;
    while let Some((at, part)) = child(xml)? {
        match part.name.as_str() {
            "dimension" => {
                xml.skip()?;
                let lower = bound(&part, "lower", at)?;
                bounds.push((at, lower, bound(&part, "upper", at)?));
                if bounds.len() > MAX_DEPTH {
                    return Err((at, Wrong::TooDeep(MAX_DEPTH)));
                }
            }
            "baseType" => of = Some(specification(xml, into, ("baseType", at), depth + 1)?),
            _ => xml.skip()?,
        }
    }
    Ok(Type::Array { bounds, of: of.ok_or((begin, Wrong::NoType("array")))? })
}

fn bound(tag: &Tag, name: &'static str, at: TextPosition) -> Result<Expression, Fault> {
    let text = tag.attribute(name).ok_or((at, Wrong::NoAttribute("dimension", name)))?;
    parser::expression(text, at)
}

fn members(xml: &mut Xml<'_>, into: &mut Declarations, depth: usize) -> Result<Vec<Member>, Fault> {
    let mut names: HashMap<String, TextPosition> = HashMap::new();
    let mut members = Vec::new();
    while let Some((at, part)) = child(xml)? {
        if !part.is("variable") {
            xml.skip()?;
            continue;
        }
        let name = name_of(&part, "variable", at)?;
        if let Some(first) = names.insert(name.to_ascii_lowercase(), at) {
            return Err((at, Wrong::Duplicate(name, first.to_string())));
        }
        let mut ty = None;
        while let Some((place, part)) = child(xml)? {
            if part.is("type") {
                ty = Some(specification(xml, into, ("type", place), depth + 1)?);
            } else {
                xml.skip()?;
            }
        }
        members.push(Member { name, at, ty: ty.ok_or((at, Wrong::NoType("variable")))? });
    }
    Ok(members)
}

/// Reads the content of `<globalVars constant="true">`.
fn constants(xml: &mut Xml<'_>, into: &mut Declarations) -> Result<(), Fault> {
    while let Some((at, variable)) = child(xml)? {
        let name = variable.attribute("name").unwrap_or_default();
        while let Some((_, part)) = child(xml)? {
            if !part.is("initialValue") {
                xml.skip()?;
                continue;
            }
            while let Some((_, value)) = child(xml)? {
                xml.skip()?;
                // Values of other kinds have another form, and cannot be bounds of arrays.
                if let Some(Ok(value)) = value.attribute("value").map(|text| parser::expression(text, at)) {
                    into.declare_constant(name, value);
                }
            }
        }
    }
    Ok(())
}
