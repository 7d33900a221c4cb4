//! The USS protocol (universal serial interface; USS specification E20125-D0001-S302-A1): a master exchanges process
//! data and parameters with up to 32 drives on one line.
//!
//! A telegram is `STX LGE ADR`, the net data, and `BCC`. The net data begin with the parameter channel (PKW), followed
//! by the process data (PZD); [`Layout`] has the sizes of both. Only the master starts an exchange. It sends a telegram
//! to each slave in turn, and the slave answers within 20 ms.
//!
//! [`Master`] and [`Slave`] are state machines without input and output. Their users pass the characters of the line to
//! `received`, and send the characters that `poll` returns. Times are emulated times in microseconds.
//!
//! ```
//! use commram::serial::Character;
//! use commram::serial::uss::{
//!     Layout, Master, MasterEvent, Parameter, ParameterType, Parameters, PkwWidth, Request, Slave, Station, Timing,
//! };
//!
//! let (timing, layout) = (Timing::new(38_400), Layout::new(PkwWidth::Four, 2)?);
//! let p1120 = Parameter::new(1120, ParameterType::Unsigned16, 100.0).within(0.0, 6500.0);
//! let mut drive = Slave::new(3, timing, layout, Parameters::new([p1120])?)?;
//! let mut master = Master::new(timing, [Station { address: 3, layout }])?;
//! master.set_setpoints(3, &[0x047F, 0x1000])?;
//! master.request(3, Request::write_word(1120, 250))?;
//!
//! let request = master.poll(0);
//! assert_eq!(request[..5], [0x02, 14, 3, 0x24, 0x60]); // 16#2460: change parameter 1120, a word
//! let mut time = 0;
//! for octet in request {
//!     time += timing.characters(1);
//!     drive.received(time, Character::Byte(octet));
//! }
//! assert_eq!(drive.setpoints(), [0x047F, 0x1000]);
//! time = drive.due().expect("the answer");
//! for octet in drive.poll(time) {
//!     time += timing.characters(1);
//!     master.received(time, Character::Byte(octet));
//! }
//! let Some(MasterEvent::Answered { reply, .. }) = master.next_event() else { panic!("no answer") };
//! assert_eq!(reply.word(), 250);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **What the check sum cannot detect.** `BCC` is the exclusive or of all characters before it. Two changes of the same
//! bits and two exchanged characters leave it correct, and so does a doubled character that has the value of `BCC`: the
//! telegram then ends one character earlier. A lost character is detected, because the telegram is incomplete. A changed
//! `LGE` is detected if the layout has a fixed length. The parity bit of the characters detects most of these faults.

mod layout;
mod master;
#[cfg(test)]
mod noise_tests;
mod parameters;
mod pkw;
mod receiver;
mod slave;
mod telegram;
#[cfg(test)]
mod tests;
mod timing;

pub use layout::{Layout, LayoutError, PkwWidth};
pub use master::{Master, MasterError, MasterEvent, Station, StationFault};
pub use parameters::{Parameter, ParameterAccess, ParameterType, Parameters, ParametersError};
pub use pkw::{Pkw, Refusal, ReplyCode, Request, Task};
pub use slave::{Slave, SlaveEvent};
pub use telegram::{Address, MAX_DATA, STX, Telegram, TelegramError};
pub use timing::Timing;
