//! Journal events of CANsync: its bus and its nodes.

use super::firmware::InitFault;
use super::frames::codec;
use super::frames::{Frame, FrameKind};
use crate::can;
use crate::can::Id;
use crate::event_kinds;
use crate::journal::{
    ArrivedFrame, EventCodec, EventKind, EventText, Fields, Keeping, Packer, Part, Reader, Unpacker, hex,
};

/// All event kinds of this module.
pub static KINDS: &[&EventKind] = &[
    SyncEdge::KIND,
    Transmitted::KIND,
    Missed::KIND,
    CommandIgnored::KIND,
    InitRefused::KIND,
    SlaveStatus::KIND,
    BaudRateMismatch::KIND,
    ForeignFrame::KIND,
    DriveBaudRateMismatch::KIND,
    DriveSet::KIND,
    OwnDriveSet::KIND,
];

event_kinds! {
    /// Falling edge of the SYNC signal on a bus. An interval begins.
    SyncEdge = 1, "sync", Registers, at bus {}

    /// A frame was transmitted. The event's time is the end of the frame, when the receivers have it.
    Transmitted = 2, "frame", Traffic, at bus {
        /// The transmitted frame.
        frame: Frame,
    }

    /// A deadline was missed, so a frame is omitted in this interval.
    Missed = 5, "missed", Missed, at origin {
        /// Kind of the frame that was not sent.
        what: OmittedFrame,
    }

    /// A value in `w_CPU_CONTROL` was ignored.
    CommandIgnored = 6, "ignored", Rare, at origin {
        /// Value of `w_CPU_CONTROL` that the firmware ignored.
        value: u16,
        /// Reason why the firmware ignored the value.
        why: Command,
    }

    /// Initialization data was refused.
    InitRefused = 7, "init_refused", Rare, at origin {
        /// Error in the initialization data.
        fault: InitFault,
    }

    /// `a_STAT_SL[slave]` of the master changed.
    SlaveStatus = 8, "slave_status", Rare, at origin {
        /// Number of the slave.
        slave: u8,
        /// New value: bit 0 responds, bit 1 synchronized.
        status: u8,
    }

    /// A node is set to another baud rate than its bus, or than the source of the SYNC signal that it passes on.
    BaudRateMismatch = 9, "baud_rate_mismatch", Rare, at origin {
        /// The node's baud rate in kbit/s.
        node_kbit_s: u16,
        /// The bus's baud rate in kbit/s.
        bus_kbit_s: u16,
        /// True if the node passes on the SYNC signal of that bus, so that none of its slaves synchronizes. False if
        /// the node only receives nothing.
        passes_on: bool,
    }

    /// A drive is set to another baud rate than its bus, so the drive receives nothing (decision D-540).
    DriveBaudRateMismatch = 13, "drive_baud_rate_mismatch", Rare, at bus {
        /// Number of the slave.
        slave: u8,
        /// The drive's baud rate in kbit/s.
        drive_kbit_s: u16,
        /// The bus's baud rate in kbit/s.
        bus_kbit_s: u16,
    }

    /// A parameter of a drive on a bus was set locally, not through the bus.
    DriveSet = 14, "drive_set", Rare, at bus {
        /// Number of the slave.
        slave: u8,
        /// Number of the parameter.
        number: u16,
        /// The bits of its new value.
        value: u32,
    }

    /// A parameter of a PLC's drive was set locally, not through the PLC.
    OwnDriveSet = 15, "own_drive_set", Rare, at plc {
        /// Number of the parameter.
        number: u16,
        /// The bits of its new value.
        value: u32,
    }

    /// A frame of a guest, outside of all slots. The event's time is the end of the frame (decision D-315).
    ForeignFrame = 12, "foreign_frame", Traffic, at bus {
        /// The guest's number on the bus.
        guest: u8,
        /// The frame of the guest.
        frame: Frame,
    }
}

/// Reason why a command in `w_CPU_CONTROL` had no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// The command does not exist or is reserved.
    Unknown,
    /// The command exists but is not possible in the node's present state.
    NotNow,
    /// The value 16#0000, which remains after the firmware has cleared bit 7. The firmware cannot distinguish this
    /// value from a restart command that a program stores in the RAM at this time (decision D-29).
    LeftBehind,
}

/// An omitted frame of process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OmittedFrame {
    /// Reference value frame 1 or 2 was not released by 16#05 in time.
    ReferenceValue(u8),
    /// Own actual value frame 1 or 2 was requested but was not released by 16#05 in time.
    ActualValue(u8),
}

impl OmittedFrame {
    /// Returns the short name of the frame on the bus: `WRC1`.
    fn frame(self) -> String {
        match self {
            OmittedFrame::ReferenceValue(channel) => format!("WRC{channel}"),
            OmittedFrame::ActualValue(channel) => format!("RDC{channel}"),
        }
    }

    fn register(self) -> String {
        match self {
            OmittedFrame::ReferenceValue(channel) => format!("b_CTRLREG_WRC{channel}"),
            OmittedFrame::ActualValue(channel) => format!("b_CTRLREG_RD_RDC{channel}"),
        }
    }
}

impl Part for OmittedFrame {
    #[inline]
    fn put(self, packer: &mut Packer) {
        let (kind, channel) = match self {
            OmittedFrame::ReferenceValue(channel) => (0, channel),
            OmittedFrame::ActualValue(channel) => (1, channel),
        };
        packer.put(kind);
        channel.put(packer);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        match (unpacker.take(), u8::take(unpacker)?) {
            (0, channel) => Some(OmittedFrame::ReferenceValue(channel)),
            (1, channel) => Some(OmittedFrame::ActualValue(channel)),
            _ => None,
        }
    }
}

impl Part for Command {
    fn put(self, packer: &mut Packer) {
        packer.put(self as u32);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        match unpacker.take() {
            0 => Some(Command::Unknown),
            1 => Some(Command::NotNow),
            2 => Some(Command::LeftBehind),
            _ => None,
        }
    }
}

impl Part for InitFault {
    fn put(self, packer: &mut Packer) {
        packer.put(self as u32);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        InitFault::from_number(u8::take(unpacker)?)
    }
}

impl Part for Frame {
    #[inline]
    fn put(self, packer: &mut Packer) {
        packer.put(u32::from(self.id()) << 8 | self.data().len() as u32);
        u64::from_le_bytes(self.padded()).put(packer);
    }

    fn take(unpacker: &mut Unpacker) -> Option<Self> {
        let (id_and_length, data) = (unpacker.take(), u64::take(unpacker)?.to_le_bytes());
        let length = usize::from(id_and_length as u8);
        Frame::new((id_and_length >> 8) as u16, data.get(..length)?)
    }
}

impl EventText for SyncEdge {
    #[inline]
    fn keeping(&self) -> Keeping {
        Keeping::Counted
    }

    fn text(&self, _: &mut Reader) -> String {
        "SYNC".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}

/// Returns the decoded frame, or its bytes and the decoding error.
fn frame_text(frame: &Frame) -> String {
    match codec::decode(frame) {
        Ok(decoded) => format!("16#{:03X} {decoded}", frame.id()),
        Err(error) => {
            let bytes: String = frame.data().iter().map(|byte| format!(" {byte:02X}")).collect();
            format!("16#{:03X}{bytes}: {error}", frame.id())
        }
    }
}

/// Describes a frame. Returns an empty text if the frame is not a CANsync frame.
pub(crate) fn describe(frame: &can::Frame) -> String {
    let Id::Standard(id) = frame.arbitration().id() else { return String::new() };
    Frame::new(id.as_raw(), frame.payload().data()).map_or_else(String::new, |frame| frame_text(&frame))
}

impl EventText for Transmitted {
    fn text(&self, _: &mut Reader) -> String {
        frame_text(&self.frame)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        let text = codec::decode(&self.frame).map_or_else(|error| error.to_string(), |it| it.to_string());
        Fields::new().with("id", self.frame.id()).with("data", hex(self.frame.data(), "")).with("text", text)
    }

    fn frame(&self) -> Option<ArrivedFrame> {
        Some(ArrivedFrame { frame: self.frame.into(), guest: None })
    }

    fn slot(&self) -> Option<&'static str> {
        self.frame.kind().map(FrameKind::slot)
    }
}

impl EventText for ForeignFrame {
    fn text(&self, _: &mut Reader) -> String {
        format!("{} from guest{}, outside of the slots", frame_text(&self.frame), self.guest)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
            .with("id", self.frame.id())
            .with("data", hex(self.frame.data(), ""))
            .with("guest", self.guest)
    }

    fn frame(&self) -> Option<ArrivedFrame> {
        Some(ArrivedFrame { frame: self.frame.into(), guest: Some(self.guest) })
    }
}

impl EventText for Missed {
    #[inline]
    fn keeping(&self) -> Keeping {
        Keeping::Counted
    }

    fn text(&self, _: &mut Reader) -> String {
        let (frame, register) = (self.what.frame(), self.what.register());
        format!("missed: {frame} is left out in this interval, {register} was not 16#05 in time")
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("frame", self.what.frame())
    }
}

impl EventText for CommandIgnored {
    fn text(&self, reader: &mut Reader) -> String {
        let control = reader.of_port(self.origin, "w_CPU_CONTROL");
        let why = match self.why {
            Command::Unknown => "no such command",
            Command::NotNow => "not possible in this state",
            Command::LeftBehind => "left after bit 7 was cleared",
        };
        format!("{} {} ignored: {why}", control.label(), control.value(self.value.into()))
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        let why = match self.why {
            Command::Unknown => "unknown",
            Command::NotNow => "not_now",
            Command::LeftBehind => "left_behind",
        };
        Fields::new().with("command", self.value).with("why", why)
    }
}

impl EventText for InitRefused {
    fn text(&self, _: &mut Reader) -> String {
        format!("initialization data refused: {}", self.fault)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("reason", self.fault as u8).with("text", self.fault.to_string())
    }
}

impl EventText for SlaveStatus {
    fn text(&self, reader: &mut Reader) -> String {
        let register = reader.of_port(self.origin, &format!("a_STAT_SL[{}]", self.slave));
        format!("{} {}", register.label(), register.explained(self.status.into()))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let register = reader.of_port(self.origin, &format!("a_STAT_SL[{}]", self.slave));
        let text = register.meaning(self.status.into());
        Fields::new().with("slave", self.slave).with("status", self.status).with("text", text)
    }
}

impl EventText for DriveSet {
    fn text(&self, _: &mut Reader) -> String {
        format!("drive {}: P{} set to {} by hand", self.slave, self.number, self.value as i32)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("slave", self.slave).with("number", self.number).with("value", self.value)
    }
}

impl EventText for OwnDriveSet {
    fn text(&self, _: &mut Reader) -> String {
        format!("drive: P{} set to {} by hand", self.number, self.value as i32)
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("number", self.number).with("value", self.value)
    }
}

impl EventText for DriveBaudRateMismatch {
    fn text(&self, _: &mut Reader) -> String {
        let DriveBaudRateMismatch { slave, drive_kbit_s, bus_kbit_s, .. } = self;
        format!(
            "drive {slave} is set to {drive_kbit_s} kbit/s, the bus runs at {bus_kbit_s}: it hears nothing"
        )
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        let DriveBaudRateMismatch { slave, drive_kbit_s, bus_kbit_s, .. } = *self;
        Fields::new().with("slave", slave).with("drive_kbit_s", drive_kbit_s).with("bus_kbit_s", bus_kbit_s)
    }
}

impl EventText for BaudRateMismatch {
    fn text(&self, _: &mut Reader) -> String {
        let BaudRateMismatch { node_kbit_s, bus_kbit_s, .. } = self;
        if self.passes_on {
            format!(
                "is set to {node_kbit_s} kbit/s and passes on the SYNC signal of a bus at {bus_kbit_s}: no slave \
                 synchronizes"
            )
        } else {
            format!("is set to {node_kbit_s} kbit/s, its bus runs at {bus_kbit_s}: it hears nothing")
        }
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("node_kbit_s", self.node_kbit_s).with("bus_kbit_s", self.bus_kbit_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::Payload;
    use embedded_can::ExtendedId;

    #[test]
    fn a_frame_is_described_in_terms_of_its_bus() {
        let payload = || Payload::new(&[0x20, 0x0A, 0x00]).unwrap();
        let frame = can::Frame::standard(0x505, payload());
        let text = describe(&frame);
        assert!(text.starts_with("16#505 "), "{text}");
        assert_eq!(text, frame_text(&Frame::new(0x505, &[0x20, 0x0A, 0x00]).unwrap()));
        let foreign = can::Frame::new(ExtendedId::new(0x505).unwrap(), payload());
        assert_eq!(describe(&foreign), "", "no frame of a CANsync bus");
    }
}
