//! Draws a screen of the view as an SVG picture.

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};
use std::fmt::Write;

/// Width and height of a character, and the size of the font.
const CELL: (usize, usize, usize) = (8, 17, 13);

fn colour(colour: Color) -> &'static str {
    match colour {
        Color::DarkGray => "#8b949e",
        Color::Green => "#56d364",
        Color::Yellow => "#e3b341",
        Color::Red => "#ff7b72",
        Color::Cyan => "#56d4dd",
        _ => "#e6edf3",
    }
}

/// Returns the screen as SVG; runs of characters with the same style form one element.
pub(super) fn svg(buffer: &Buffer, title: &str) -> String {
    let (cell_width, cell_height, size) = CELL;
    let (columns, rows) = (usize::from(buffer.area.width), usize::from(buffer.area.height));
    let (width, height) = (columns * cell_width + 16, rows * cell_height + 16);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         role=\"img\" aria-label=\"{title}\" font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"{size}\">\n\
         <title>{title}</title>\n<rect width=\"100%\" height=\"100%\" rx=\"6\" fill=\"#0d1117\"/>\n"
    );
    for (row, cells) in buffer.content.chunks(columns).enumerate() {
        let mut column = 0;
        for run in cells.chunk_by(|one, other| looks(one) == looks(other)) {
            draw(&mut svg, run, 8 + column * cell_width, 8 + row * cell_height);
            column += run.len();
        }
    }
    svg + "</svg>\n"
}

fn looks(cell: &Cell) -> (Color, Modifier) {
    (cell.fg, cell.modifier)
}

fn draw(svg: &mut String, run: &[Cell], x: usize, y: usize) {
    let (cell_width, cell_height, size) = CELL;
    let Some(first) = run.first() else { return };
    let text: String = run.iter().map(Cell::symbol).collect();
    let is_reversed = first.modifier.contains(Modifier::REVERSED);
    let length = run.len() * cell_width;
    if is_reversed {
        let fill = colour(first.fg);
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{length}\" height=\"{cell_height}\" fill=\"{fill}\"/>"
        );
    }
    if text.trim().is_empty() {
        return;
    }
    let fill = if is_reversed { "#0d1117" } else { colour(first.fg) };
    let bold = if first.modifier.contains(Modifier::BOLD) { " font-weight=\"bold\"" } else { "" };
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let base = y + size;
    let _ = writeln!(
        svg,
        "<text x=\"{x}\" y=\"{base}\" fill=\"{fill}\"{bold} textLength=\"{length}\" xml:space=\"preserve\">{text}</text>"
    );
}
