//! Plots: registers over emulated time, as SVG or PNG.
//!
//! A plot has a [`Row`] for each register. The rows are one below the other, with vertical lines at the SYNC edges. The
//! plot uses only data of the journal: the line of a register begins with the first known value, and keeps each value
//! until the next one.

mod draw;
mod render;
mod row;

pub use render::{Picture, PlotError};
pub use row::{Row, Style, address_of};

/// Contents of a plot.
pub struct Plot {
    /// Start of the plot, in emulated microseconds since power-on.
    pub from_us: u64,
    /// End of the plot, later than `from_us`.
    pub to_us: u64,
    /// Times of the SYNC edges in the plot, ascending.
    pub edges: Vec<u64>,
    /// Rows of the plot, one for each register.
    pub rows: Vec<Row>,
    /// Sections of a scenario, each with its start in emulated microseconds, ascending.
    pub sections: Vec<(u64, String)>,
}

impl Plot {
    /// Creates a plot of these rows. Values and edges outside the plot are dropped.
    pub fn new(from_us: u64, to_us: u64, mut edges: Vec<u64>, mut rows: Vec<Row>) -> Self {
        let to_us = to_us.max(from_us.saturating_add(1));
        rows.iter_mut().for_each(|row| row.cut(from_us, to_us, &edges));
        edges.retain(|edge| (from_us..=to_us).contains(edge));
        Self { from_us, to_us, edges, rows, sections: Vec::new() }
    }

    /// Adds marks for the sections that begin in the plot.
    #[must_use]
    pub fn with_sections(mut self, sections: impl IntoIterator<Item = (u64, String)>) -> Self {
        let (from_us, to_us) = (self.from_us, self.to_us);
        self.sections = sections.into_iter().filter(|(begin, _)| (from_us..=to_us).contains(begin)).collect();
        self
    }
}
