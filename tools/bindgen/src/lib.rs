//! Empty, because nothing of this package is called.
