//! The front panels of the PLCs, drawn like the real devices: display, LEDs, switches.

use super::{lines, marked, titled};
use crate::cli::view::model::{ClickTarget, ListId, Model};
use crate::cli::view::poll::DeviceFront;
use crate::cli::view::prompt::BoardSwitch;
use crate::cli::view::style::{Theme, padded};
use crate::devices;
use crate::devices::{Led, ModuleFront, Switch};
use crate::identity::DeviceIndex;
use crate::layout::{Owner, shown_text};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

/// Width of the column with the names.
const NAMES: usize = 12;
/// Number of switches of the DIP switch.
const DIP: u32 = 5;

/// A line of the pane. If it has a switch, the second part is the name of the switch in `commram board set` and its
/// possible positions.
type FrontLine = (Line<'static>, Option<(String, Vec<String>)>);

pub(super) fn draw(frame: &mut Frame, model: &mut Model, theme: Theme, area: Rect) {
    let title = " fronts of the PLCs; t turns the switch in the chosen line ".to_owned();
    let inner = titled(frame, title, theme.head(), area);
    let (mut all, mut knobs) = (Vec::new(), Vec::new());
    let names = model.names();
    for ((plc, name), face) in DeviceIndex::enumerate(&names.plcs).zip(&model.faces) {
        let device = names.device(plc);
        let head = Line::from(vec![
            Span::styled(format!(" {name}"), theme.head()),
            Span::styled(format!("  {}", device.title), theme.dim()),
        ]);
        let front = front_lines(face, devices::board_of(device), theme);
        let modules = face.modules.iter().map(|(port, module)| module_line(port, module, theme));
        let own = [(head, None)].into_iter().chain(front).chain(modules).chain([(Line::default(), None)]);
        for (line, knob) in own {
            all.push(line);
            knobs.push(knob.map(|(name, choices)| BoardSwitch { plc, name, choices }));
        }
    }
    let seen = model.board.fit(usize::from(inner.height), all.len());
    let (top, chosen) = (seen.start, model.board.chosen);
    let seen = all.into_iter().enumerate().skip(top).take(seen.len());
    let drawn = seen.map(|(number, line)| marked(line, number == chosen, true, theme)).collect();
    lines(frame, drawn, inner);
    model.knobs = knobs;
    model.hot.push((inner, ClickTarget::List(ListId::Board)));
}

fn front_lines(face: &DeviceFront, has: &'static [&'static str], theme: Theme) -> Vec<FrontLine> {
    let words = face.board.words(has);
    let is_on = words.power == "on";
    let mut all = Vec::new();
    let mut add = |name: &str, spans: Vec<Span<'static>>, knob: Option<(&str, &[&str])>| {
        let knob = knob
            .map(|(name, choices)| (name.to_owned(), choices.iter().map(|it| (*it).to_owned()).collect()));
        all.push((named(name, spans), knob));
    };
    match (shown_text(&face.front), &words.display) {
        (Some(text), _) => add("display", vec![Span::styled(format!("[{text}]"), theme.good())], None),
        (None, Some(shown)) => {
            for (number, part) in segments(shown).into_iter().enumerate() {
                let name = if number == 0 { "display" } else { "" };
                add(name, vec![Span::styled(part, theme.bad())], None);
            }
        }
        (None, None) => {}
    }
    if let Some(leds) = &words.leds {
        let digits = leds.trim_start_matches("2#").chars().filter(char::is_ascii_digit);
        let spans = digits.map(|digit| lamp(digit == '1', theme)).collect();
        add("LEDs", spans, Some(("leds", &["0 to 15"])));
    }
    let power = if is_on { theme.good() } else { theme.bad() };
    add("power", vec![Span::styled(words.power, power)], Some(("power", &["on", "off"])));
    if let Some(switch) = &words.switch {
        let position = |name: &str| {
            let is_selected = name.eq_ignore_ascii_case(switch);
            let sign = if is_selected { "\u{25c9} " } else { "\u{25cb} " };
            Span::styled(format!("{sign}{name}  "), if is_selected { theme.head() } else { theme.dim() })
        };
        let spans = ["RUN", "STOP", "RESET"].map(position).to_vec();
        add("switch", spans, Some(("switch", &["run", "stop", "reset"])));
    }
    if let Some(dip) = words.dip {
        add("DIP switch", dip_spans(dip, words.dip_latched, theme), Some(("dip", &["0 to 31"])));
    }
    let starts: (&str, &[&str]) = ("start", &["cold", "warm", "hot", "stop"]);
    let projects: (&str, &[&str]) = ("project", &["none", "boot", "sent"]);
    let program = [
        ("program", words.program, None),
        ("last start", words.start, Some(starts)),
        ("project", words.project, Some(projects)),
    ];
    for (name, text, knob) in program {
        if let Some(text) = text {
            add(name, vec![Span::raw(text)], knob);
        }
    }
    for (word, value) in face.front.iter().filter(|(word, _)| !word.is_text) {
        let line = named(word.name, vec![Span::raw(word.called(*value))]);
        let choices = || word.choices().split(", ").map(str::to_owned).collect();
        let knob = (word.owner == Owner::Plc).then(|| (word.name.to_owned(), choices()));
        all.push((line, knob));
    }
    all
}

/// Returns the five DIP switches, and the number that their positions form.
fn dip_spans(dip: u32, latched: Option<u32>, theme: Theme) -> Vec<Span<'static>> {
    let one = |bit: u32| {
        let on = dip >> bit & 1 != 0;
        Span::styled(if on { "\u{2580} " } else { "\u{2584} " }, if on { theme.head() } else { theme.dim() })
    };
    let mut spans: Vec<_> = (0..DIP).map(one).collect();
    let counts = latched.unwrap_or(dip);
    let note =
        if counts == dip { String::new() } else { format!(", {counts} is active until the next start") };
    spans.push(Span::raw(format!(" number {dip}{note}")));
    spans
}

fn named(name: &str, spans: Vec<Span<'static>>) -> Line<'static> {
    let mut all = vec![Span::raw(format!("   {} ", padded(name, NAMES)))];
    all.extend(spans);
    Line::from(all)
}

fn lamp(is_lit: bool, theme: Theme) -> Span<'static> {
    if is_lit { Span::styled("\u{25cf} ", theme.good()) } else { Span::styled("\u{25cb} ", theme.dim()) }
}

/// Returns a module in one line: its type, LEDs and switches.
fn module_line(port: &str, module: &ModuleFront, theme: Theme) -> FrontLine {
    let mut spans = vec![Span::styled(padded(module.kind, 14), theme.name())];
    for (name, led) in &module.leds {
        let (sign, style): (String, Style) = match led {
            Led::Off => ("\u{25cb}".to_owned(), theme.dim()),
            Led::On => ("\u{25cf}".to_owned(), theme.good()),
            Led::Flashes(count) => (format!("\u{25d0}{count}"), theme.warning()),
            Led::InTurn => ("\u{25d1}".to_owned(), theme.warning()),
        };
        spans.push(Span::styled(format!("{sign} "), style));
        spans.push(Span::raw(format!("{name}  ")));
    }
    for (name, switch) in &module.switches {
        let position = match switch {
            Switch::Number(number) => number.to_string(),
            Switch::Is(true) => "on".to_owned(),
            Switch::Is(false) => "off".to_owned(),
        };
        spans.push(Span::styled(format!("{name} {position}  "), theme.dim()));
    }
    let has_dip = module.switches.iter().any(|(name, _)| *name == "dip");
    (named(port, spans), has_dip.then(|| (format!("{port}.dip"), vec!["0 to 31".to_owned()])))
}

/// Segments a to g of a seven-segment display, the lowest bit first, for each supported character.
const SEGMENTS: [(char, u8); 28] = [
    ('0', 0x3F),
    ('1', 0x06),
    ('2', 0x5B),
    ('3', 0x4F),
    ('4', 0x66),
    ('5', 0x6D),
    ('6', 0x7D),
    ('7', 0x07),
    ('8', 0x7F),
    ('9', 0x6F),
    ('A', 0x77),
    ('b', 0x7C),
    ('C', 0x39),
    ('c', 0x58),
    ('d', 0x5E),
    ('E', 0x79),
    ('F', 0x71),
    ('H', 0x76),
    ('h', 0x74),
    ('L', 0x38),
    ('n', 0x54),
    ('o', 0x5C),
    ('P', 0x73),
    ('r', 0x50),
    ('t', 0x78),
    ('U', 0x3E),
    ('u', 0x1C),
    ('-', 0x40),
];

/// Returns the display in three lines; characters without segments are printed as text.
fn segments(shown: &str) -> [String; 3] {
    let mut lines = [String::new(), String::new(), String::new()];
    for character in shown.chars() {
        let known = SEGMENTS.iter().find(|(known, _)| *known == character).map(|(_, bits)| *bits);
        let [top, middle, bottom] = match (character, known) {
            ('.', _) => ["", "", "."].map(str::to_owned),
            (_, Some(bits)) => {
                let lit = |bit: u32, sign: char| if bits >> bit & 1 != 0 { sign } else { ' ' };
                [
                    [' ', lit(0, '_'), ' '],
                    [lit(5, '|'), lit(6, '_'), lit(1, '|')],
                    [lit(4, '|'), lit(3, '_'), lit(2, '|')],
                ]
                .map(|line| line.iter().collect())
            }
            (other, None) => [String::from("   "), format!(" {other} "), String::from("   ")],
        };
        lines[0].push_str(&top);
        lines[1].push_str(&middle);
        lines[2].push_str(&bottom);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_display_is_drawn_in_segments() {
        assert_eq!(segments("2."), [" _ ", " _|", "|_ ."]);
        assert_eq!(segments("x"), ["   ", " x ", "   "]);
    }
}
