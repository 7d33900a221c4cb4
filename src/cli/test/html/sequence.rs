//! Sequence diagram of the exchange before a failure. Program, firmware and bus have a vertical line each; time runs
//! downwards.

use super::EscapedText;
use crate::script::{ExchangeKind, ExchangeStep};
use crate::time::seconds;

/// Names and horizontal positions of the lines for program, firmware and bus.
const LANES: [(&str, i32); 3] = [("PLC program", 150), ("firmware", 270), ("bus", 390)];
const WIDTH: i32 = 1060;
const TEXTS: i32 = 420;
const TOP: i32 = 34;
const STEP: i32 = 22;
/// Longest text beside an arrow, in characters.
const LONGEST: usize = 86;

/// Draws the diagram for a page.
pub(super) fn picture(exchange: &[ExchangeStep], failed_us: u64) -> String {
    let height = TOP + STEP * (exchange.len() as i32 + 2);
    let heads = LANES.map(|(name, x)| {
        format!(
            "<text x=\"{x}\" y=\"16\" text-anchor=\"middle\">{name}</text>\
             <line class=\"life\" x1=\"{x}\" y1=\"24\" x2=\"{x}\" y2=\"{}\"/>\n",
            height - STEP
        )
    });
    let steps = exchange.iter().zip(0..).map(|(step, number)| arrow(step, TOP + STEP * number));
    let steps: String = steps.collect();
    format!(
        "<svg class=\"sequence\" xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" width=\"{WIDTH}\" height=\"{height}\" \
         viewBox=\"0 0 {WIDTH} {height}\">\n<title>Handshakes before the failure</title>\n{}{steps}\
         <text class=\"wrong\" x=\"8\" y=\"{}\">{}  failure</text>\n</svg>\n",
        heads.concat(),
        height - STEP / 2,
        seconds(failed_us)
    )
}

fn arrow(step: &ExchangeStep, y: i32) -> String {
    let [program, firmware, bus] = LANES.map(|(_, x)| x);
    let (class, from, to) = match step.kind {
        ExchangeKind::Program => ("program", program, firmware),
        ExchangeKind::Firmware => ("firmware", firmware, program),
        ExchangeKind::Bus => ("bus", firmware, bus),
        ExchangeKind::Wrong | ExchangeKind::More => ("wrong", TEXTS, TEXTS),
    };
    let arrow = if from == to {
        String::new()
    } else {
        let back = if to > from { to - 8 } else { to + 8 };
        format!(
            "<line class=\"{class}\" x1=\"{from}\" y1=\"{y}\" x2=\"{to}\" y2=\"{y}\"/>\
             <polygon class=\"{class}\" points=\"{to},{y} {back},{} {back},{}\"/>",
            y - 4,
            y + 4
        )
    };
    format!(
        "<text class=\"time\" x=\"8\" y=\"{0}\">{1}</text>{arrow}<text class=\"{2}\" x=\"{TEXTS}\" y=\"{0}\"><title>{3}</title>{4}</text>\n",
        y + 4,
        seconds(step.line.time_us),
        match step.kind {
            ExchangeKind::Wrong => "wrong",
            ExchangeKind::More => "time",
            ExchangeKind::Program | ExchangeKind::Firmware | ExchangeKind::Bus => "what",
        },
        EscapedText(&step.line.text),
        EscapedText(shortened(&step.line.text))
    )
}

/// Returns a line of the journal without its time, shortened to the available width.
fn shortened(line: &str) -> String {
    let rest = line.split_once(" s  ").map_or(line, |(_, rest)| rest);
    let words: Vec<_> = rest.split_whitespace().collect();
    let text = words.join(" ");
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::JournalLine;

    #[test]
    fn arrows_go_from_sender_to_receiver() {
        let line = |text: &str| JournalLine { time_us: 1500, kind: "x".into(), text: text.to_owned() };
        let step = |kind, text| ExchangeStep { kind, line: line(text) };
        let picture = picture(
            &[
                step(ExchangeKind::Program, "0.001500 s  line        a := 16#05"),
                step(ExchangeKind::Firmware, "0.001500 s  line:node2  a 16#05 -> 16#04"),
                step(ExchangeKind::Bus, "0.001500 s  drives      16#010 CC"),
                step(ExchangeKind::Wrong, "0.001500 s  line        late"),
            ],
            2000,
        );
        assert!(picture.contains("x1=\"150\" y1=\"34\" x2=\"270\""), "{picture}");
        assert!(picture.contains("x1=\"270\" y1=\"56\" x2=\"150\""), "{picture}");
        assert!(picture.contains("x1=\"270\" y1=\"78\" x2=\"390\""), "{picture}");
        assert!(picture.contains(">line:node2 a 16#05 -&gt; 16#04</text>"), "{picture}");
        assert!(picture.contains("0.002000 s  failure"), "{picture}");
        assert_eq!(picture.matches("<polygon").count(), 3);
    }

    #[test]
    fn long_lines_end_in_dots() {
        assert_eq!(shortened("0.1 s  a   b"), "a b");
        assert_eq!(shortened(&"ü".repeat(100)).chars().count(), LONGEST + 1);
    }
}
