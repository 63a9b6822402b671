//! Files that are read and written, whole, broken and changed at random.

mod formats;
mod fuzz;
mod samples;
