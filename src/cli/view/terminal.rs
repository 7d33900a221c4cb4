//! The terminal: taken over, drawn on, and given back whatever happens.

use super::draw;
use super::link::{self, News, Order};
use super::model::Model;
use super::source::Running;
use super::style::Theme;
use crate::cli::error::CliError;
use crate::cli::exit::Exit;
use crate::cli::instance::Instance;
use crate::cli::style;
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, DisableMouseCapture, EnableMouseCapture, Event, KeyEventKind};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::io;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::thread;
use std::time::Duration;

/// How long nothing has to come from the keyboard before it is looked elsewhere.
const KEYS: Duration = Duration::from_millis(30);
/// How long the thread may take to leave the channel.
const FAREWELL: Duration = Duration::from_millis(300);

/// The screen of the terminal, as long as it is ours.
struct Screen;

impl Screen {
    fn take() -> io::Result<Self> {
        enable_raw_mode()?;
        let screen = Screen;
        execute!(io::stdout(), EnterAlternateScreen, EnableMouseCapture)?;
        // What went wrong is to be read on the usual screen.
        let told = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            give_back();
            told(info);
        }));
        Ok(screen)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        give_back();
    }
}

/// Whoever has closed the terminal does not want it back.
fn give_back() {
    use ratatui::crossterm::cursor::Show;
    let _ = execute!(io::stdout(), DisableMouseCapture, LeaveAlternateScreen, Show);
    let _ = disable_raw_mode();
}

/// Shows the instance until the user has seen enough, or a signal ends it.
///
/// # Errors
/// The terminal is gone or cannot be used.
pub(super) fn run(mut model: Model, instance: &str) -> Result<(), CliError> {
    let ended = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // A second one ends the process itself, wherever it hangs.
        let code = Exit::Interrupted.code().into();
        signal_hook::flag::register_conditional_shutdown(signal, code, Arc::clone(&ended))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&ended)))
            .map_err(|reason| CliError::Signals { reason })?;
    }
    let (to_thread, orders) = mpsc::channel();
    let (to_us, news) = mpsc::channel();
    let instance = Instance::running(instance);
    let connect = move || Running::connect(&instance).map_err(|error| error.to_string());
    let thread = thread::spawn(move || link::serve(connect, &orders, &to_us));
    let theme = Theme { has_colours: style::is_on(&io::stdout()) };
    let outcome = show(&mut model, theme, &to_thread, &news, &ended);
    drop(to_thread);
    while !matches!(
        news.recv_timeout(FAREWELL),
        Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected)
    ) {}
    if thread.is_finished()
        && let Err(panicked) = thread.join()
    {
        panic::resume_unwind(panicked);
    }
    match outcome {
        // The terminal has gone while it was drawn on.
        Err(reason) if reason.raw_os_error() == Some(Errno::IO.raw_os_error()) => {
            ended.store(true, Ordering::Relaxed);
        }
        other => other.map_err(|reason| CliError::Output { reason })?,
    }
    if model.is_interrupted || ended.load(Ordering::Relaxed) {
        Err(CliError::Ended { code: Exit::Interrupted.code() })
    } else {
        Ok(())
    }
}

/// Waits for the keyboard so long at most; whether nobody is there any more. At a closed terminal crossterm would read for ever.
fn is_closed(longest: Duration) -> io::Result<bool> {
    let stdin = io::stdin();
    let mut keyboard = [PollFd::new(&stdin, PollFlags::IN)];
    let longest = Timespec::try_from(longest).map_err(io::Error::other)?;
    match poll(&mut keyboard, Some(&longest)) {
        // A signal, such as that of another size.
        Err(Errno::INTR) => Ok(false),
        Err(errno) => Err(errno.into()),
        Ok(_) => Ok(keyboard[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)),
    }
}

fn show(
    model: &mut Model,
    theme: Theme,
    orders: &Sender<Order>,
    news: &Receiver<News>,
    ended: &AtomicBool,
) -> io::Result<()> {
    let _screen = Screen::take()?;
    let mut terminal = Terminal::new(CrosstermBackend::new(io::stdout()))?;
    let (mut wish, mut is_new) = (None, true);
    while !model.quits && !ended.load(Ordering::Relaxed) {
        if core::mem::take(&mut is_new) {
            terminal.draw(|frame| draw::draw(frame, model, theme))?;
        }
        let wanted = model.wish();
        if wish.as_ref() != Some(&wanted) {
            wish = Some(wanted.clone());
            model.orders.insert(0, Order::Show(wanted));
        }
        for order in model.orders.drain(..) {
            // If nobody takes it, there is no news either.
            let _ = orders.send(order);
        }
        if is_closed(KEYS)? {
            ended.store(true, Ordering::Relaxed);
            break;
        }
        while event::poll(Duration::ZERO)? {
            is_new = true;
            match event::read()? {
                Event::Key(key) if key.kind != KeyEventKind::Release => model.press(key),
                Event::Mouse(event) => model.mouse(event),
                _ => {}
            }
            if model.quits {
                break;
            }
        }
        loop {
            match news.try_recv() {
                Ok(told) => {
                    is_new = true;
                    model.take(told);
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(()),
            }
        }
    }
    Ok(())
}
