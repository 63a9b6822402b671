//! A running scene that is watched and changed, in a browser and in a window.

mod serve;
mod view;
