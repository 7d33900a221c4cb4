//! Elements of an XML file with declarations, with their places. Entities of a document type are not replaced, and the depth is
//! bounded, so a hostile file costs no more than its size.

use super::error::{Fault, TextPosition, Wrong};
use super::{Declarations, plcopen, twincat};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, escape};
use std::borrow::Cow;

/// Maximum depth of elements. Exports of projects have a depth of about 20.
const MAX_DEPTH: usize = 128;

/// Reads the declarations of an XML file of a known kind.
pub(crate) fn read(text: &str, into: &mut Declarations) -> Result<(), Fault> {
    let mut xml = Xml::new(text);
    loop {
        let (at, content) = xml.next()?;
        match content {
            Content::Begin(root) if root.is("TcPlcObject") => return twincat::read(&mut xml, into),
            Content::Begin(root) if root.is("project") => return plcopen::read(&mut xml, into),
            Content::Begin(root) => return Err((at, Wrong::OtherXml(root.name))),
            Content::End => return Err((at, Wrong::Xml("it has no element".to_owned()))),
            Content::Text(_) => {}
        }
    }
}

/// A part of an XML file.
pub(crate) enum Content {
    /// The beginning of an element. Every element also has an end, even `<a/>`.
    Begin(Tag),
    /// The end of the current element, or of the file.
    End,
    /// Text, or a part of a text.
    Text(String),
}

/// The begin of an element.
pub(crate) struct Tag {
    /// Name of the element without the prefix of a namespace.
    pub name: String,
    /// Names and values, at most [`MAX_ATTRIBUTES`].
    attributes: Vec<(String, String)>,
}

/// Maximum number of attributes of an element that are read. No element has more than ten relevant attributes.
const MAX_ATTRIBUTES: usize = 32;

impl Tag {
    pub(crate) fn is(&self, name: &str) -> bool {
        self.name == name
    }

    /// Returns the value of an attribute.
    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.as_str())
    }

    fn of(start: &BytesStart<'_>) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        // The check for repeated attributes is off: they have no effect here, and the check takes quadratic time.
        let mut all = start.attributes();
        let attributes = all.with_checks(false).flatten().take(MAX_ATTRIBUTES).map(|attribute| {
            let raw = text(&attribute.value);
            let value = escape::unescape(&raw).ok().map(Cow::into_owned);
            (text(attribute.key.local_name().as_ref()), value.unwrap_or(raw))
        });
        Self { name: text(start.local_name().as_ref()), attributes: attributes.collect() }
    }
}

/// Reads an XML file part by part.
pub(crate) struct Xml<'a> {
    reader: Reader<&'a [u8]>,
    text: &'a str,
    depth: usize,
    /// True if the next part is the end of `<a/>`.
    is_empty: bool,
    /// A byte offset and its place.
    known: (usize, TextPosition),
}

impl<'a> Xml<'a> {
    fn new(text: &'a str) -> Self {
        let known = (0, TextPosition::BEGIN);
        Self { reader: Reader::from_str(text), text, depth: 0, is_empty: false, known }
    }

    /// Returns the next part, and the place where it begins.
    pub(crate) fn next(&mut self) -> Result<(TextPosition, Content), Fault> {
        loop {
            let at = self.place(self.reader.buffer_position());
            if self.is_empty {
                self.is_empty = false;
                self.depth -= 1;
                return Ok((at, Content::End));
            }
            let event = self.reader.read_event();
            let event = event.map_err(|error| {
                let at = self.place(self.reader.error_position());
                (at, Wrong::Xml(error.to_string()))
            })?;
            let content = match event {
                Event::Start(start) => self.begin(&start, at)?,
                Event::Empty(start) => {
                    self.is_empty = true;
                    self.begin(&start, at)?
                }
                Event::End(_) => {
                    self.depth = self.depth.saturating_sub(1);
                    Content::End
                }
                Event::Text(text) => Content::Text(String::from_utf8_lossy(&text).into_owned()),
                Event::CData(text) => Content::Text(String::from_utf8_lossy(&text).into_owned()),
                Event::GeneralRef(name) => {
                    let reference = format!("&{};", String::from_utf8_lossy(&name));
                    let text = escape::unescape(&reference);
                    Content::Text(text.map_or_else(|_| reference.clone(), |text| text.into_owned()))
                }
                Event::Eof if self.depth > 0 => return Err((at, Wrong::Unfinished("element"))),
                Event::Eof => Content::End,
                Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => continue,
            };
            return Ok((at, content));
        }
    }

    /// Skips the rest of the current element, up to and including its end.
    pub(crate) fn skip(&mut self) -> Result<(), Fault> {
        let outside = self.depth.saturating_sub(1);
        loop {
            if let (_, Content::End) = self.next()?
                && self.depth <= outside
            {
                return Ok(());
            }
        }
    }

    /// True if the whole file has been read.
    pub(crate) fn is_at_end(&self) -> bool {
        self.depth == 0
    }

    /// Returns the text of the current element, up to and including its end, and the place where the text begins.
    pub(crate) fn text(&mut self) -> Result<(TextPosition, String), Fault> {
        let mut all = String::new();
        let mut begin = None;
        loop {
            let (at, content) = self.next()?;
            match content {
                Content::Text(text) => {
                    begin = begin.or_else(|| Some(self.behind_mark(at)));
                    all += &text;
                }
                Content::Begin(_) => self.skip()?,
                Content::End => return Ok((begin.unwrap_or(at), all)),
            }
        }
    }

    /// Returns the place after `<![CDATA[`, if this mark is at `at`, where the last part began.
    fn behind_mark(&self, at: TextPosition) -> TextPosition {
        const MARK: &str = "<![CDATA[";
        let is_marked = self.text[self.known.0..].starts_with(MARK);
        TextPosition { column: at.column + if is_marked { MARK.len() } else { 0 }, ..at }
    }

    fn begin(&mut self, start: &BytesStart<'_>, at: TextPosition) -> Result<Content, Fault> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err((at, Wrong::DeepXml(MAX_DEPTH)));
        }
        Ok(Content::Begin(Tag::of(start)))
    }

    /// Returns the place of a byte offset, which is not before the last one.
    fn place(&mut self, offset: u64) -> TextPosition {
        let (from, mut place) = self.known;
        let offset = usize::try_from(offset).unwrap_or(usize::MAX).clamp(from, self.text.len());
        for c in self.text.get(from..offset).unwrap_or_default().chars() {
            place.advance(c);
        }
        self.known = (offset, place);
        place
    }
}
