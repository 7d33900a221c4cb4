//! The terminal: preparation, drawing, and restoration in all cases.

use super::draw;
use super::link::{self, LinkCommand, LinkReport};
use super::model::Model;
use super::source::RunningInstance;
use super::style::Theme;
use crate::cli::error::CliError;
use crate::cli::exit::Exit;
use crate::cli::instance::Instance;
use crate::cli::signals;
use crate::cli::start::in_thread;
use crate::cli::style;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, DisableMouseCapture, EnableMouseCapture, Event, KeyEventKind};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    Clear, ClearType, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use ratatui::layout::{Rect, Size};
use ratatui::{Terminal, TerminalOptions, Viewport};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::io;
use std::mem::ManuallyDrop;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, TryRecvError};
use std::time::Duration;

/// Longest wait for a key; then the loop does its other work.
const KEYS: Duration = Duration::from_millis(30);
/// Time limit for the link thread to disconnect from the channel at the end.
const FAREWELL: Duration = Duration::from_millis(300);
/// Largest number of columns and rows that are drawn. The memory for the view grows with their product.
const LARGEST: u16 = 1000;

/// The alternate screen of the terminal; dropping this value restores the terminal.
struct Screen;

impl Screen {
    fn take() -> io::Result<Self> {
        enable_raw_mode()?;
        let screen = Screen;
        execute!(io::stdout(), EnterAlternateScreen, EnableMouseCapture)?;
        // A panic message must appear on the normal screen.
        let previous_hook = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            give_back();
            previous_hook(info);
        }));
        Ok(screen)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        give_back();
    }
}

/// Restores the terminal. Errors are ignored, because the terminal may already be closed.
fn give_back() {
    use ratatui::crossterm::cursor::Show;
    let _ = execute!(io::stdout(), DisableMouseCapture, LeaveAlternateScreen, Show);
    let _ = disable_raw_mode();
}

/// Shows the instance until the user quits or a signal ends the view.
///
/// # Errors
/// The terminal is closed or cannot be used.
pub(super) fn run(mut model: Model, instance: &str) -> Result<(), CliError> {
    let ended = Arc::new(AtomicBool::new(false));
    for signal in signals::termination() {
        // A second signal ends the process at once, in case the view hangs.
        let code = Exit::Interrupted.code().into();
        signal_hook::flag::register_conditional_shutdown(signal, code, Arc::clone(&ended))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&ended)))
            .map_err(|reason| CliError::Signals { reason })?;
    }
    let (to_thread, orders) = mpsc::channel();
    let (to_us, news) = mpsc::channel();
    let instance = Instance::running(instance);
    let connect = move || RunningInstance::connect(&instance).map_err(|error| error.to_string());
    let thread = in_thread(move || link::serve(connect, &orders, &to_us))?;
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
        // If the terminal is closed, drawing and reading fail. This is the normal end of the view and not an error.
        Err(reason)
            if reason.raw_os_error() == Some(Errno::IO.raw_os_error())
                || is_closed(Duration::ZERO).unwrap_or(true) =>
        {
            ended.store(true, Ordering::Relaxed);
        }
        other => other.map_err(|reason| CliError::Output { reason })?,
    }
    if model.is_interrupted || ended.load(Ordering::Relaxed) {
        Err(CliError::Ended(Exit::Interrupted.code()))
    } else {
        Ok(())
    }
}

/// Waits at most `longest` for a key. Returns true if the terminal is closed: crossterm would then read without an end.
fn is_closed(longest: Duration) -> io::Result<bool> {
    let stdin = io::stdin();
    let mut keyboard = [PollFd::new(&stdin, PollFlags::IN)];
    let longest = Timespec::try_from(longest).map_err(io::Error::other)?;
    match poll(&mut keyboard, Some(&longest)) {
        // A signal interrupted the wait, for example because the terminal has another size.
        Err(Errno::INTR) => Ok(false),
        Err(errno) => Err(errno.into()),
        Ok(_) => Ok(keyboard[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)),
    }
}

/// Returns the part of a terminal of this size in which the view draws.
fn area_to_draw(size: Size) -> Rect {
    Rect::new(0, 0, size.width.min(LARGEST), size.height.min(LARGEST))
}

/// Creates a terminal that draws in this area.
fn terminal_of(area: Rect) -> io::Result<Terminal<CrosstermBackend<io::Stdout>>> {
    let options = TerminalOptions { viewport: Viewport::Fixed(area) };
    Terminal::with_options(CrosstermBackend::new(io::stdout()), options)
}

fn show(
    model: &mut Model,
    theme: Theme,
    orders: &Sender<LinkCommand>,
    news: &Receiver<LinkReport>,
    ended: &AtomicBool,
) -> io::Result<()> {
    let _screen = Screen::take()?;
    let mut area = Rect::default();
    // The destructor of the terminal shows a hidden cursor. If the terminal is closed, this fails, and the destructor
    // panics because it cannot print the error. So the destructor never runs, and `Screen` shows the cursor.
    let mut terminal = ManuallyDrop::new(terminal_of(area)?);
    let (mut query, mut is_new) = (None, true);
    while !model.quits && !ended.load(Ordering::Relaxed) {
        if core::mem::take(&mut is_new) {
            let present = area_to_draw(terminal.size()?);
            if core::mem::replace(&mut area, present) != present {
                // `Terminal::resize` would clear a limited area cell by cell, with two system calls for each cell.
                execute!(io::stdout(), Clear(ClearType::All))?;
                terminal.show_cursor()?;
                *terminal = terminal_of(area)?;
            }
            terminal.draw(|frame| draw::draw(frame, model, theme))?;
        }
        let wanted = model.query();
        if query.as_ref() != Some(&wanted) {
            query = Some(wanted.clone());
            model.orders.insert(0, LinkCommand::Show(wanted));
        }
        for order in model.orders.drain(..) {
            // Sending fails only if the thread has ended. The loop then notices that the reports have ended, too.
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
                Ok(report) => {
                    is_new = true;
                    model.take(report);
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(()),
            }
        }
    }
    Ok(())
}
