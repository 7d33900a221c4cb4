//! Client and server over iceoryx2: in one process, and between processes that die.

mod basic;
mod hostile;
mod processes;
mod rig;
mod versions;
mod waiting;
