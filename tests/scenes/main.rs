//! Scenes: what their files say, what each makes and does, and what those of the repository show.

mod code;
#[path = "../shared/forms.rs"]
mod forms;
mod hard;
mod keys;
mod known;
mod laws;
#[path = "../shared/long.rs"]
mod long;
mod needs;
#[allow(dead_code, reason = "the bench prints more")]
mod perturbation;
mod perturbed;
mod scene_errors;
mod scenes;
mod study;
