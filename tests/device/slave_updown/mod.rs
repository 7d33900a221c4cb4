//! Up- and downloads at a slave node (manual 5.00005.03a p. 141-143, 190-193), on heap memory and on the
//! mapped image: what the application finds in its registers and what the master gets to read.

mod area;
mod refusals;
mod transfers;
