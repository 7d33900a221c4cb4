//! The parameter channel (PKW): requests, answers and error numbers.

#[cfg(feature = "emulator")]
use serde::{Deserialize, Serialize};

/// Number of parameters of a page: higher numbers are on other pages. The index word has the number of the page.
const PAGE: u16 = 2000;

/// What the master requests (AK of a request).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Task {
    /// No request.
    None = 0,
    /// Request a value.
    Read = 1,
    /// Change a word.
    WriteWord = 2,
    /// Change a double word.
    WriteDouble = 3,
    /// Request an element of the description.
    ReadDescription = 4,
    /// Change an element of the description.
    WriteDescription = 5,
    /// Request an element of an array.
    ReadElement = 6,
    /// Change a word of an array.
    WriteElementWord = 7,
    /// Change a double word of an array.
    WriteElementDouble = 8,
    /// Request the number of elements of an array.
    ReadCount = 9,
    /// Reserved.
    Reserved = 10,
    /// Change a double word of an array, and store it permanently.
    StoreElementDouble = 11,
    /// Change a word of an array, and store it permanently.
    StoreElementWord = 12,
    /// Change a double word, and store it permanently.
    StoreDouble = 13,
    /// Change a word, and store it permanently.
    StoreWord = 14,
    /// Request or change a text.
    Text = 15,
}

/// What the slave answers (AK of an answer).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ReplyCode {
    /// No answer.
    None = 0,
    /// A word.
    Word = 1,
    /// A double word.
    Double = 2,
    /// An element of the description.
    Description = 3,
    /// A word of an array.
    ElementWord = 4,
    /// A double word of an array.
    ElementDouble = 5,
    /// The number of elements of an array.
    Count = 6,
    /// The request cannot be executed; the value is a [`Refusal`].
    Refused = 7,
    /// The master has no right to change parameters.
    NoRights = 8,
    /// The slave reports the change of a word.
    ChangedWord = 9,
    /// The slave reports the change of a double word.
    ChangedDouble = 10,
    /// The slave reports the change of a word of an array.
    ChangedElementWord = 11,
    /// The slave reports the change of a double word of an array.
    ChangedElementDouble = 12,
    /// Reserved.
    Reserved13 = 13,
    /// Reserved.
    Reserved14 = 14,
    /// A text.
    Text = 15,
}

/// Error number of the answer [`ReplyCode::Refused`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[repr(u16)]
pub enum Refusal {
    /// There is no parameter with that number.
    #[error("there is no parameter with that number")]
    Number = 0,
    /// The parameter cannot be changed.
    #[error("the parameter cannot be changed")]
    ReadOnly = 1,
    /// The value is outside its limits.
    #[error("the value is outside its limits")]
    Limit = 2,
    /// The array has no such element.
    #[error("the array has no such element")]
    Index = 3,
    /// The parameter is not an array.
    #[error("the parameter is not an array")]
    NoArray = 4,
    /// The request has another type than the parameter.
    #[error("the request has another type than the parameter")]
    Type = 5,
    /// The description cannot be changed.
    #[error("the description cannot be changed")]
    Description = 7,
    /// There is no such element of the description.
    #[error("there is no such element of the description")]
    NoDescription = 9,
    /// The parameter has no text.
    #[error("the parameter has no text")]
    NoText = 15,
    /// The drive cannot execute the request in its present state.
    #[error("the drive cannot execute the request in its present state")]
    State = 17,
    /// The request cannot be executed for another reason.
    #[error("the request cannot be executed for another reason")]
    Other = 18,
}

/// The parameter channel of one telegram.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub struct Pkw {
    /// AK, 0 to 15: a [`Task`] or a [`ReplyCode`].
    pub code: u8,
    /// Number of the parameter, 0 to 31,999.
    pub number: u16,
    /// Element of an array or a description. 255 is all elements, with a channel of variable width.
    pub index: u8,
    /// True if the slave reports a change without a request (SPM).
    pub is_report: bool,
    /// Values. A double word is two words, the upper one first.
    pub values: Vec<u16>,
}

/// A parameter channel that a master sends.
pub type Request = Pkw;

impl Pkw {
    /// A parameter channel without request or answer.
    pub const NONE: Self = Pkw { code: 0, number: 0, index: 0, is_report: false, values: Vec::new() };

    fn request(task: Task, number: u16, index: u8, values: Vec<u16>) -> Self {
        Pkw { code: task as u8, number, index, is_report: false, values }
    }

    /// Returns the request for a value.
    #[must_use]
    pub fn read(number: u16) -> Self {
        Self::request(Task::Read, number, 0, Vec::new())
    }

    /// Returns the request that changes a word.
    #[must_use]
    pub fn write_word(number: u16, value: u16) -> Self {
        Self::request(Task::WriteWord, number, 0, vec![value])
    }

    /// Returns the request that changes a double word.
    #[must_use]
    pub fn write_double(number: u16, value: u32) -> Self {
        Self::request(Task::WriteDouble, number, 0, words(value))
    }

    /// Returns the request for an element of an array.
    #[must_use]
    pub fn read_element(number: u16, index: u8) -> Self {
        Self::request(Task::ReadElement, number, index, Vec::new())
    }

    /// Returns the request that changes a word of an array.
    #[must_use]
    pub fn write_element_word(number: u16, index: u8, value: u16) -> Self {
        Self::request(Task::WriteElementWord, number, index, vec![value])
    }

    /// Returns the request that changes a double word of an array.
    #[must_use]
    pub fn write_element_double(number: u16, index: u8, value: u32) -> Self {
        Self::request(Task::WriteElementDouble, number, index, words(value))
    }

    /// Returns the request for the number of elements of an array.
    #[must_use]
    pub fn read_count(number: u16) -> Self {
        Self::request(Task::ReadCount, number, 0, Vec::new())
    }

    /// Returns the request for an element of the description: 1 for the identifier, 2 for the number of elements, 7 and
    /// 8 for the limits.
    #[must_use]
    pub fn read_description(number: u16, element: u8) -> Self {
        Self::request(Task::ReadDescription, number, element, Vec::new())
    }

    /// Returns the same request, which also stores the value permanently. Requests that change nothing stay as they are.
    #[must_use]
    pub const fn stored(mut self) -> Self {
        self.code = match self.code {
            2 => Task::StoreWord as u8,
            3 => Task::StoreDouble as u8,
            7 => Task::StoreElementWord as u8,
            8 => Task::StoreElementDouble as u8,
            code => code,
        };
        self
    }

    /// True if the request changes a value of a parameter: codes 2, 3, 7, 8 and 11 to 14.
    #[must_use]
    pub const fn is_change(&self) -> bool {
        matches!(self.code, 2 | 3 | 7 | 8 | 11..=14)
    }

    /// Returns the answer that refuses this request.
    #[must_use]
    pub fn refused(&self, refusal: Refusal) -> Self {
        self.answer(ReplyCode::Refused, vec![refusal as u16])
    }

    /// Returns the answer to this request.
    pub(super) fn answer(&self, code: ReplyCode, values: Vec<u16>) -> Self {
        Pkw { code: code as u8, values, is_report: false, ..*self }
    }

    /// Returns the value as a word: the last word.
    #[must_use]
    pub fn word(&self) -> u16 {
        self.values.last().copied().unwrap_or(0)
    }

    /// Returns the value as a double word: the last two words.
    #[must_use]
    pub fn double(&self) -> u32 {
        match self.values.as_slice() {
            [.., upper, lower] => u32::from(*upper) << 16 | u32::from(*lower),
            _ => u32::from(self.word()),
        }
    }

    /// Returns the error number of a refused request.
    #[must_use]
    pub fn refusal(&self) -> Option<u16> {
        (self.code == ReplyCode::Refused as u8).then(|| self.word())
    }

    /// True if this answer belongs to `request`.
    #[must_use]
    pub fn answers(&self, request: &Self) -> bool {
        let fits = match request.code {
            1 => matches!(self.code, 1 | 2),
            2 | 14 => self.code == 1,
            3 | 13 => self.code == 2,
            4 | 5 => self.code == 3,
            6 => matches!(self.code, 4 | 5),
            7 | 12 => self.code == 4,
            8 | 11 => self.code == 5,
            9 => self.code == 6,
            15 => self.code == 15,
            _ => false,
        };
        let is_refused = request.code != 0 && matches!(self.code, 7 | 8);
        (fits || is_refused)
            && self.number == request.number
            && self.index == request.index
            && !self.is_report
    }

    /// Returns PKE, IND and the values.
    pub(super) fn words(&self) -> Vec<u16> {
        let page = (self.number / PAGE).min(15);
        let pke = u16::from(self.code & 15) << 12
            | u16::from(self.is_report) << 11
            | (self.number - page * PAGE) & 0x7FF;
        // The bits of the page, from bit 15 on, have the weights 1, 8, 4 and 2.
        let page = (page & 1) << 15 | (page & 8) << 11 | (page & 4) << 11 | (page & 2) << 11;
        let mut words = vec![pke, page | u16::from(self.index)];
        words.extend(&self.values);
        words
    }

    /// Returns the parameter channel of its words; no word is a channel without request or answer.
    pub(super) fn of_words(words: &[u16]) -> Self {
        let [pke, ind, values @ ..] = words else { return Pkw::NONE };
        let page = ind >> 15 | (ind >> 11) & 8 | (ind >> 11) & 4 | (ind >> 11) & 2;
        Pkw {
            code: (pke >> 12) as u8,
            number: page * PAGE + (pke & 0x7FF),
            index: (ind & 0xFF) as u8,
            is_report: pke & 0x800 != 0,
            values: values.to_vec(),
        }
    }
}

/// Returns the words of a double word, the upper one first.
pub(super) fn words(value: u32) -> Vec<u16> {
    vec![(value >> 16) as u16, (value & 0xFFFF) as u16]
}
