//! Compiles register layouts.
