//! Draws a plot to any backend.

use super::render::FONT;
use super::{Plot, Row, Style};
use crate::time::short;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind};
use plotters::element::{PathElement, Rectangle, Text};
use plotters::prelude::DrawingBackend;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoTextStyle, RGBColor};

type Area<DB> = DrawingArea<DB, Shift>;
type DrawResult<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

const WIDTH: i32 = 1000;
/// The column of names.
const NAMES: i32 = 250;
const RIGHT: i32 = 16;
/// Title and legend, and below them the names of sections.
const HEAD: i32 = 44;
const SECTIONS: i32 = 20;
/// Height of a row with a line.
const LINE: i32 = 120;
const OTHER: i32 = 56;
/// Space above and below the drawing within a row.
const GAP: i32 = 14;
/// The scale of time, with its text.
const SCALE: i32 = 40;
/// Height of letters, and their maximum width.
const LETTERS: i32 = 12;
const LETTER: i32 = 8;
/// Minimum distance between edges: closer edges would look like a grey area.
const NEAREST_EDGES: i32 = 4;
/// Minimum distance between marks of the scale.
const NEAREST_MARKS: u64 = 110;
/// Names up to this length fit in one line.
const LONGEST_NAME: usize = (NAMES / LETTER) as usize;

const PAPER: RGBColor = RGBColor(255, 255, 255);
const INK: RGBColor = RGBColor(32, 33, 36);
const FAINT: RGBColor = RGBColor(105, 110, 118);
const GRID: RGBColor = RGBColor(222, 225, 230);
const STEPS: RGBColor = RGBColor(26, 95, 180);
const NUMBERS: RGBColor = RGBColor(38, 122, 62);
const ANSWERED: RGBColor = RGBColor(247, 183, 110);
const UNANSWERED: RGBColor = RGBColor(230, 110, 100);

fn height(row: &Row) -> i32 {
    if row.style == Style::Line { LINE } else { OTHER }
}

/// Returns the start of the first row.
fn top(plot: &Plot) -> i32 {
    if plot.sections.is_empty() { HEAD } else { HEAD + SECTIONS }
}

/// Returns the width and height in pixels.
pub(super) fn size(plot: &Plot) -> (u32, u32) {
    let rows: i32 = plot.rows.iter().map(height).sum();
    (WIDTH as u32, (top(plot) + rows + SCALE) as u32)
}

/// Draws the plot on an area of the picture.
pub(super) fn draw<DB: DrawingBackend>(plot: &Plot, area: &Area<DB>) -> DrawResult<DB> {
    area.fill(&PAPER)?;
    let sheet = Sheet { plot, area };
    let bottom = size(plot).1 as i32 - SCALE;
    sheet.head()?;
    sheet.edges(bottom)?;
    sheet.sections(bottom)?;
    let mut top = top(plot);
    for row in &plot.rows {
        sheet.row(row, top)?;
        top += height(row);
        sheet.path(&[(0, top), (WIDTH - RIGHT, top)], GRID, 1)?;
    }
    sheet.scale(bottom)
}

struct Sheet<'a, DB: DrawingBackend> {
    plot: &'a Plot,
    area: &'a Area<DB>,
}

impl<DB: DrawingBackend> Sheet<'_, DB> {
    /// Returns the horizontal position of a time.
    fn x(&self, time_us: u64) -> i32 {
        let Plot { from_us, to_us, .. } = self.plot;
        let part = time_us.saturating_sub(*from_us) as f64 / (to_us - from_us) as f64;
        NAMES + (part.min(1.0) * f64::from(WIDTH - NAMES - RIGHT)).round() as i32
    }

    fn path(&self, points: &[(i32, i32)], colour: RGBColor, width: u32) -> DrawResult<DB> {
        self.area.draw(&PathElement::new(thinned(points), colour.stroke_width(width)))
    }

    fn text(&self, text: &str, at: (i32, i32), colour: RGBColor, anchor: HPos) -> DrawResult<DB> {
        let style =
            (FONT, LETTERS).into_text_style(self.area).color(&colour).pos(Pos::new(anchor, VPos::Center));
        self.area.draw(&Text::new(text.to_owned(), at, style))
    }

    /// Draws the title and the legend.
    fn head(&self) -> DrawResult<DB> {
        let Plot { from_us, to_us, rows, edges, .. } = self.plot;
        let title = format!("Registers from {} to {} of emulated time", short(*from_us), short(*to_us));
        self.text(&title, (4, 14), INK, HPos::Left)?;
        let has = |style: Style| rows.iter().any(|row| row.style == style);
        let spans = rows.iter().flat_map(|row| row.spans(*to_us));
        let (answered, unanswered): (Vec<_>, Vec<_>) = spans.partition(|(.., is_answered)| *is_answered);
        let entries = [
            ("value", STEPS, has(Style::Steps)),
            ("number", NUMBERS, has(Style::Line)),
            ("request until its answer", ANSWERED, !answered.is_empty()),
            ("request without answer", UNANSWERED, !unanswered.is_empty()),
            ("SYNC", GRID, !edges.is_empty()),
        ];
        let mut x = NAMES;
        for (text, colour, _) in entries.into_iter().filter(|(.., is_used)| *is_used) {
            let (y, right) = (HEAD - 14, x + 2 * LETTER);
            self.area.draw(&Rectangle::new([(x, y - 3), (right, y + 3)], colour.filled()))?;
            self.text(text, (right + 4, y), FAINT, HPos::Left)?;
            x = right + text.len() as i32 * LETTER;
        }
        Ok(())
    }

    /// Draws a mark at the start of each section, with the name of the section where there is room for it.
    fn sections(&self, bottom: i32) -> DrawResult<DB> {
        let ends = self.plot.sections.iter().skip(1).map(|(begin, _)| *begin).chain([self.plot.to_us]);
        for ((begin, name), end) in self.plot.sections.iter().zip(ends) {
            let (x, end) = (self.x(*begin), self.x(end));
            self.path(&[(x, HEAD), (x, bottom)], FAINT, 1)?;
            let room = ((end - x - 4) / LETTER).max(0) as usize;
            let text: String = name.chars().take(room).collect();
            if room > 2 {
                self.text(&text, (x + 3, HEAD + SECTIONS / 2), INK, HPos::Left)?;
            }
        }
        Ok(())
    }

    /// Draws as many SYNC edges as can be distinguished.
    fn edges(&self, bottom: i32) -> DrawResult<DB> {
        let mut last = i32::MIN / 2;
        for edge in &self.plot.edges {
            let x = self.x(*edge);
            if x - last >= NEAREST_EDGES {
                self.path(&[(x, top(self.plot)), (x, bottom)], GRID, 1)?;
                last = x;
            }
        }
        Ok(())
    }

    fn row(&self, row: &Row, top: i32) -> DrawResult<DB> {
        let (high, low) = (top + GAP, top + height(row) - GAP);
        let lines = if row.note.is_some() { 2 } else { 1 };
        let middle = (high + low) / 2 - (lines - 1) * LETTERS * 2 / 3;
        self.text(shortened(&row.name), (4, middle), INK, HPos::Left)?;
        if let Some(note) = &row.note {
            self.text(note, (4, middle + LETTERS * 4 / 3), FAINT, HPos::Left)?;
        }
        match row.style {
            Style::Handshake(_) => self.handshake(row, high, low),
            Style::Steps => self.steps(row, high, low),
            Style::Line => self.numbers(row, high, low),
        }
    }

    /// Draws each value until the next one, and prints it if there is space for it.
    fn steps(&self, row: &Row, high: i32, low: i32) -> DrawResult<DB> {
        let y = scale_of(row, high, low);
        let mut path = Vec::new();
        for (at, (time, value)) in row.points.iter().enumerate() {
            let (begin, end) = (self.x(*time), self.x(self.end_of(row, at)));
            path.extend([(begin, y(*value)), (end, y(*value))]);
        }
        self.path(&path, STEPS, 2)?;
        for at in 0..row.points.len() {
            self.value(row, at, if y(row.points[at].1) == high { low } else { high })?;
        }
        Ok(())
    }

    /// Draws a span for each request, and prints other values of the register beside it.
    fn handshake(&self, row: &Row, high: i32, low: i32) -> DrawResult<DB> {
        if let (Some((first, _)), end) = (row.points.first(), self.plot.to_us) {
            self.path(&[(self.x(*first), low), (self.x(end), low)], FAINT, 1)?;
        }
        let mut last = i32::MIN;
        for (begin, end, is_answered) in row.spans(self.plot.to_us) {
            let (left, right) = (self.x(begin), self.x(end));
            let right = right.max(left + 2);
            if right == last {
                continue;
            }
            last = right;
            let colour = if is_answered { ANSWERED } else { UNANSWERED };
            self.area.draw(&Rectangle::new([(left, high), (right, low)], colour.filled()))?;
            self.path(&[(left, high), (right, high), (right, low), (left, low), (left, high)], INK, 1)?;
            let text = short(end - begin);
            if text.len() as i32 * LETTER <= right - left {
                self.text(&text, ((left + right) / 2, (high + low) / 2), INK, HPos::Center)?;
            }
        }
        for at in 0..row.points.len() {
            self.value(row, at, low + LETTERS * 2 / 3)?;
        }
        Ok(())
    }

    /// Prints the value of point `at` with its meaning, or the value alone, if there is room for it.
    fn value(&self, row: &Row, at: usize, y: i32) -> DrawResult<DB> {
        let (Some((time, _)), Some(text)) = (row.points.get(at), row.texts.get(at)) else { return Ok(()) };
        let (begin, end) = (self.x(*time), self.x(self.end_of(row, at)));
        let forms = [Some(text.as_str()), text.split_once("  ").map(|(value, _)| value)];
        let fits = |text: &&str| text.chars().count() as i32 * LETTER <= end - begin - 4;
        match forms.into_iter().flatten().find(fits) {
            Some(text) => self.text(text, (begin + 3, y), FAINT, HPos::Left),
            None => Ok(()),
        }
    }

    fn numbers(&self, row: &Row, high: i32, low: i32) -> DrawResult<DB> {
        let y = scale_of(row, high, low);
        let values = row.points.iter().map(|(_, value)| *value);
        if let (Some(least), Some(most)) = (values.clone().min(), values.max()) {
            self.text(&most.to_string(), (NAMES - 6, y(most)), FAINT, HPos::Right)?;
            if least != most {
                self.text(&least.to_string(), (NAMES - 6, y(least)), FAINT, HPos::Right)?;
            }
        }
        let mut path: Vec<_> = row.points.iter().map(|(time, value)| (self.x(*time), y(*value))).collect();
        path.extend(path.last().map(|(_, y)| (self.x(self.plot.to_us), *y)));
        self.path(&path, NUMBERS, 2)
    }

    fn end_of(&self, row: &Row, at: usize) -> u64 {
        row.points.get(at + 1).map_or(self.plot.to_us, |(time, _)| *time)
    }

    /// Draws the scale of time.
    fn scale(&self, bottom: i32) -> DrawResult<DB> {
        let Plot { from_us, to_us, .. } = *self.plot;
        self.path(&[(NAMES, bottom), (WIDTH - RIGHT, bottom)], INK, 1)?;
        let most = ((WIDTH - NAMES - RIGHT) as u64 / NEAREST_MARKS).max(1);
        let distance = distance((to_us - from_us).div_ceil(most));
        let mut next = from_us.div_ceil(distance).checked_mul(distance);
        while let Some(time) = next.filter(|time| *time <= to_us) {
            let x = self.x(time);
            self.path(&[(x, bottom), (x, bottom + 5)], INK, 1)?;
            self.text(&short(time), (x, bottom + 16), INK, HPos::Center)?;
            next = time.checked_add(distance);
        }
        self.text("emulated time", (4, bottom + 16), FAINT, HPos::Left)
    }
}

/// Rounds up to 1, 2, 5, 10, 20 ... microseconds.
fn distance(us: u64) -> u64 {
    let steps =
        (0..19).map(|power| 10_u64.pow(power)).flat_map(|power| [1, 2, 5].map(|it| power.saturating_mul(it)));
    steps.into_iter().find(|step| *step >= us).unwrap_or(us).max(1)
}

/// Returns a function that maps values to positions between `high` and `low`.
fn scale_of(row: &Row, high: i32, low: i32) -> impl Fn(i64) -> i32 {
    let values = row.points.iter().map(|(_, value)| *value);
    let (least, most) = (values.clone().min().unwrap_or(0), values.max().unwrap_or(0));
    move |value| {
        if least == most {
            return (high + low) / 2;
        }
        let part = (value - least) as f64 / (most - least) as f64;
        low - (part * f64::from(low - high)).round() as i32
    }
}

/// Returns the visible points of a line. If several points have the same horizontal position, these are the first,
/// lowest, highest and last point.
fn thinned(points: &[(i32, i32)]) -> Vec<(i32, i32)> {
    let mut kept = Vec::new();
    for same in points.chunk_by(|(one, _), (other, _)| one == other) {
        match same {
            [first, .., last] if same.len() > 4 => {
                let lowest = same.iter().min_by_key(|(_, y)| *y);
                let highest = same.iter().max_by_key(|(_, y)| *y);
                kept.extend([Some(first), lowest, highest, Some(last)].into_iter().flatten());
            }
            few => kept.extend(few),
        }
    }
    kept
}

/// Shortens a name to the width of the column. Removes the beginning, because names differ mostly at their ends.
fn shortened(name: &str) -> &str {
    let too_many = name.len().saturating_sub(LONGEST_NAME);
    &name[name.ceil_char_boundary(too_many)..]
}

#[cfg(test)]
mod tests {
    use super::super::Picture;
    use super::*;
    use crate::layout::Handshake;

    fn plot() -> Plot {
        let row = |style, points: &[(u64, i64)]| Row {
            name: "node2.<b>&REG".to_owned(),
            style,
            points: points.to_vec(),
            texts: points.iter().map(|(_, value)| format!("16#{value:02X}")).collect(),
            is_recorded: false,
            note: Some("not recorded".to_owned()),
        };
        let rows = vec![
            row(
                Style::Handshake(Handshake { request: 5, answer: 4 }),
                &[(0, 0), (2000, 5), (4500, 4), (9000, 5)],
            ),
            row(Style::Steps, &[(1000, 0x43), (6000, 0x80)]),
            row(Style::Line, &[(2000, -100), (4000, 100)]),
            row(Style::Line, &[]),
        ];
        Plot::new(0, 10_000, (0..6).map(|n| 2000 * n).collect(), rows)
    }

    #[test]
    fn an_svg_has_names_values_and_how_long_requests_took() {
        let svg = plot().svg().unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        for text in ["node2.&lt;b&gt;&amp;REG", "16#43", "2500 us", "-100", "not recorded"] {
            assert!(svg.contains(text), "{text}\n{svg}");
        }
        assert!(!svg.contains("<b>"));
        let hostile = plot().with_sections([(0, "\u{1}\u{fffe}\u{ffff}".to_owned())]).svg().unwrap();
        assert!(
            hostile.contains("\u{fffd}\u{fffd}\u{fffd}") && hostile.chars().all(crate::xml_text::is_allowed)
        );
    }

    #[test]
    fn a_plot_has_a_title_a_legend_and_the_sections_of_its_time() {
        let text = |svg: &str, wanted: &str| svg.contains(&format!(">\n{wanted}\n</text>"));
        let svg = plot().svg().unwrap();
        assert!(text(&svg, "Registers from 0 us to 10 ms of emulated time"), "{svg}");
        for entry in ["value", "number", "request until its answer", "request without answer", "SYNC"] {
            assert!(text(&svg, entry), "{entry}\n{svg}");
        }
        let bare = Plot::new(0, 10, Vec::new(), Vec::new()).svg().unwrap();
        assert!(!text(&bare, "SYNC") && !text(&bare, "value"), "{bare}");
        let named =
            |times: &[u64]| times.iter().map(|time| (*time, format!("section <{time}>"))).collect::<Vec<_>>();
        let svg = plot().with_sections(named(&[0, 5000, 20_000])).svg().unwrap();
        assert!(text(&svg, "section &lt;5000&gt;") && !svg.contains("20000"), "{svg}");
        assert_eq!(size(&plot().with_sections(named(&[0]))).1, size(&plot()).1 + SECTIONS as u32);
    }

    #[test]
    fn a_value_has_its_meaning_where_there_is_room() {
        let mut plot = plot();
        plot.rows[1].texts = vec!["16#43  set-up".to_owned(), format!("16#80  {}", "long ".repeat(40))];
        let svg = plot.svg().unwrap();
        assert!(svg.contains("\n16#43  set-up\n") && svg.contains("\n16#80\n"), "{svg}");
    }

    #[test]
    fn a_png_has_letters_without_any_font_of_the_machine() {
        let png = plot().render(Picture::Png).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let (width, height) = size(&plot());
        assert_eq!(pixels.len(), (3 * width * height) as usize);
        // The lines of pixels of the first row. In its column of names there must be background and ink.
        let rows = top(&plot())..top(&plot()) + OTHER;
        let column = rows.flat_map(|y| (0..NAMES).map(move |x| 3 * (y * WIDTH + x) as usize));
        let dark = column.filter(|at| pixels[*at] < 100).count();
        assert!((50..2000).contains(&dark), "{dark}");
    }

    #[test]
    fn the_scale_ends_at_the_last_time_there_is() {
        for from_us in [0, u64::MAX - 1, u64::MAX] {
            let svg = Plot::new(from_us, u64::MAX, Vec::new(), Vec::new()).svg().unwrap();
            assert!(svg.matches("<text").count() < 12, "{svg}");
        }
    }

    #[test]
    fn marks_are_at_round_times() {
        assert_eq!([1, 3, 150, 2000, 2001].map(distance), [1, 5, 200, 2000, 5000]);
        let many: Vec<_> = (0..9).map(|n| (7, (n * 5) % 9)).chain([(8, 1)]).collect();
        assert_eq!(thinned(&many), [(7, 0), (7, 0), (7, 8), (7, 4), (8, 1)]);
        assert_eq!(shortened("short"), "short");
        assert_eq!(shortened(&"ü".repeat(100)).chars().count(), LONGEST_NAME / 2);
    }
}
