//! Empty: nothing of this package is called.
