//! Inputs that once were read wrongly.
