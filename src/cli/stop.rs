//! `commram stop`: end an emulator.

use super::error::CliError;
use super::session::{images_of, is_alive};
use super::{Instance, output};
use commram::layout::omega_drive_line_2::LAYOUT_HASH;
use commram::memory::{ClockMode, Image, ImageSpec};

/// End an emulator and wait until it has cleaned up.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram stop
  commram stop -i test-3
  commram stop --clean -i test-3")]
pub struct Args {
    /// If the emulator was killed, remove what it left
    #[arg(long)]
    clean: bool,
    #[command(flatten)]
    instance: Instance,
}

/// Ends the emulator.
pub fn run(args: &Args) -> Result<(), CliError> {
    let name = &args.instance.name;
    if args.clean && !images_of(name)?.iter().any(is_alive) {
        remove_remains(name)?;
        return output::print(&format!("instance '{name}' was dead, what it left is removed\n"));
    }
    stop(name)?;
    output::print(&format!("instance '{name}' has stopped\n"))
}

/// Takes the images of a dead instance over, as a new emulator would, and lets them go in good order. So
/// nobody else can start meanwhile.
///
/// # Errors
/// There is nothing, an emulator lives, or the system refuses.
pub fn remove_remains(instance: &str) -> Result<(), CliError> {
    let spec = ImageSpec {
        layout_hash: LAYOUT_HASH,
        device: String::new(),
        clock_mode: ClockMode::Stepped,
        speed: 0,
        processor_cycle_us: 0,
    };
    let take_over = |image: commram::memory::ImageInfo| Image::create(instance, &image.plc, &spec);
    let images = images_of(instance)?.into_iter().map(take_over).collect::<Result<Vec<_>, _>>()?;
    sweep_channel(instance)?;
    drop(images);
    Ok(())
}

#[cfg(feature = "channel")]
fn sweep_channel(instance: &str) -> Result<(), CliError> {
    use commram::channel::{HeaderBells, Server};
    let root = commram::memory::names::channel_root(instance)?;
    if root.exists() {
        Server::open(instance, &root, Box::new(HeaderBells::of_emulator(Vec::new())))?.close();
    }
    Ok(())
}

#[cfg(not(feature = "channel"))]
fn sweep_channel(_instance: &str) -> Result<(), CliError> {
    Ok(())
}

#[cfg(feature = "channel")]
fn stop(name: &str) -> Result<(), CliError> {
    use super::session::Session;
    let session = Session::open(name, 0)?;
    let images = remains::Remains::of(name)?;
    session.request(&[commram::channel::Op::Stop])?;
    // The client must be gone before the emulator sweeps its channel.
    drop(session);
    images.wait_gone()
}

#[cfg(not(feature = "channel"))]
fn stop(_name: &str) -> Result<(), CliError> {
    Err(CliError::NoChannel { command: "stop" })
}

#[cfg(feature = "channel")]
mod remains {
    use super::{CliError, Image, images_of, is_alive};
    use commram::memory::{AttachMode, Attached, ImageInfo};
    use std::time::{Duration, Instant};

    /// The images of an emulator that is ending.
    pub struct Remains {
        instance: String,
        pid: u32,
        images: Vec<Attached>,
    }

    impl Remains {
        /// How long an emulator may take to clean up.
        const PATIENCE: Duration = Duration::from_secs(10);

        /// The images of a living instance.
        ///
        /// # Errors
        /// It does not live any more.
        pub fn of(instance: &str) -> Result<Self, CliError> {
            let attach = |image: ImageInfo| Image::attach(instance, &image.plc, AttachMode::ReadOnly, None);
            let alive = images_of(instance)?.into_iter().filter(is_alive);
            let images = alive.map(attach).collect::<Result<Vec<_>, _>>()?;
            let pid = images.first().map_or(0, |image| image.header_snapshot().firmware_pid.load());
            Ok(Self { instance: instance.to_owned(), pid, images })
        }

        /// Waits until the emulator has let go of its images.
        ///
        /// # Errors
        /// [`CliError::StillThere`].
        pub fn wait_gone(&self) -> Result<(), CliError> {
            let start = Instant::now();
            while self.images.iter().any(Attached::is_alive) {
                if start.elapsed() > Self::PATIENCE {
                    let seconds = Self::PATIENCE.as_secs();
                    return Err(CliError::StillThere {
                        instance: self.instance.clone(),
                        pid: self.pid,
                        seconds,
                    });
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            Ok(())
        }
    }
}
