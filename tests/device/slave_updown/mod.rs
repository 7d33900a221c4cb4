//! Up- and downloads at a slave node (manual 5.00005.03a p. 141-143, 190-193), on heap memory and on the
//! mapped image: the registers of the application, and the answers that the master reads.

mod area;
mod refusals;
mod transfers;
