//! Rules about the repository: its texts, and its shaders as text.

mod kernels;
mod tidy;
