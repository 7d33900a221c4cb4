//! The traits of devices and buses, their capabilities, and the types of their functions.

mod address_writes;
mod bus;
mod bus_view;
mod context;
mod device;
mod device_ports;
mod device_view;
mod drive;
mod events;
mod faulty;
mod file_changes;
mod front;
pub(super) mod guest;
mod novram;
mod option_card;
mod port_watch;
mod scene;
mod sync;

pub use address_writes::AddressWrites;
pub use bus::{Bus, Plug, World};
pub use bus_view::{BusView, ParticipantId, RateMismatch, StationState};
pub use context::Context;
pub use device::Device;
pub use device_ports::DevicePorts;
pub use device_view::DeviceView;
pub use drive::{DriveDetails, DriveState, Drives, ParameterRefusal, ParameterState, Shaft};
pub use events::Events;
pub use faulty::Faulty;
pub use file_changes::FileChanges;
pub use front::{Front, FrontAction, Power};
pub use guest::{Attendance, BusGuests, GuestNews, GuestRefusal};
pub use novram::NovramContents;
pub use option_card::{CardPulses, ControllerPulses, OptionCard, OptionSlots};
pub use port_watch::PortWatch;
pub use scene::{Interval, Slot};
pub use sync::{SyncLine, SyncOrigin, SyncSignal};
