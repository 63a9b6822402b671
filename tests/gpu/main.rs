//! The GPU tests: every kernel, the device layer and whole solves, on every adapter that this machine offers.
//!
//! Without an adapter they are listed as ignored, with the reason; `CUTIS_GPU=require` makes that a failure. `--nocapture` prints how
//! much of its bound each comparison used.

mod body;
mod bounded;
mod carving;
#[path = "../shared/crumbs.rs"]
mod crumbs;
mod device;
mod embedded;
#[path = "../shared/falls.rs"]
mod falls;
#[path = "../shared/forms.rs"]
mod forms;
mod hard;
#[path = "../shared/long.rs"]
mod long;
mod lost;
mod parity;
mod pictures;
#[path = "../shared/ragged.rs"]
mod ragged;
mod robust;
mod scenes;
#[path = "../shared/small.rs"]
mod small;
mod solver;
#[path = "../shared/states.rs"]
mod states;
#[path = "../shared/sweeps.rs"]
mod sweeps;
mod swept;
mod tetrahedra;
mod tetrahedra_cut;
mod twins;

use cutis::gpu::{Adapter, Gpu, adapters};
use cutis::kernels;
use cutis::step::Platform;
use libtest_mimic::{Arguments, Trial};
use std::sync::atomic::{AtomicBool, Ordering};

/// What went wrong, in words.
pub struct Failure(String);

impl From<String> for Failure {
    fn from(message: String) -> Self {
        Self(message)
    }
}
impl From<&str> for Failure {
    fn from(message: &str) -> Self {
        Self(message.into())
    }
}
impl From<cutis::error::Error> for Failure {
    fn from(error: cutis::error::Error) -> Self {
        Self(error.to_string())
    }
}

/// This very device, for a simulation.
fn platform(gpu: &Gpu) -> Platform {
    let a = &gpu.adapter;
    Platform::Gpu(Some(format!("{} {} {}", a.name, a.backend, a.driver)))
}

/// Prints what a test measured, under `--nocapture`.
fn report(gpu: &Gpu, text: &str) {
    if REPORT.load(Ordering::Relaxed) {
        println!("{}: {text}", label(&gpu.adapter));
    }
}

static REPORT: AtomicBool = AtomicBool::new(false);

type Test = Box<dyn Fn(&Gpu) -> Result<(), Failure> + Send>;

/// Every test by name, for any adapter.
fn tests() -> Vec<(String, Test)> {
    let mut all: Vec<(String, Test)> = vec![];
    for source in kernels::ALL {
        let case = move || {
            parity::case_of(source).ok_or_else(|| Failure::from("no parity case; add one to tests/gpu/parity.rs"))
        };
        all.push((source.name.into(), Box::new(move |gpu| parity::agrees(gpu, case()?))));
        all.push((
            format!("{}_broken", source.name),
            Box::new(move |gpu| parity::is_found_out_when_broken(gpu, case()?)),
        ));
    }
    for (name, test) in device::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in lost::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in scenes::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in pictures::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in robust::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in carving::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in swept::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in embedded::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in tetrahedra::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    for (name, test) in tetrahedra_cut::TESTS {
        all.push((name.to_string(), Box::new(test)));
    }
    all.extend(solver::tests());
    all.extend(hard::tests());
    all
}

/// The adapter's name as the first part of a test's name: `llvmpipe`.
fn label(adapter: &Adapter) -> String {
    let name = adapter.name.split('(').next().unwrap_or("").trim();
    name.to_lowercase().replace(' ', "-")
}

fn main() {
    let arguments = Arguments::from_args();
    REPORT.store(arguments.nocapture, Ordering::Relaxed);
    let found = adapters();
    let mut trials = vec![];
    for (index, a) in found.iter().enumerate() {
        if !arguments.list {
            println!("adapter {}: {}, {}, {}", index, a.name, a.backend, a.driver);
        }
        let twice = found[..index].iter().any(|b| label(b) == label(a));
        let label = if twice { format!("{}#{index}", label(a)) } else { label(a) };
        for (name, test) in tests() {
            let wanted = format!("{} {} {}", a.name, a.backend, a.driver);
            trials.push(Trial::test(format!("{label}::{name}"), move || {
                let gpu = Gpu::open(Some(&wanted)).map_err(|e| e.to_string())?;
                test(&gpu).map_err(|e| e.0.into())
            }));
        }
    }
    if found.is_empty() {
        let required = std::env::var("CUTIS_GPU").is_ok_and(|v| v == "require");
        println!("no Vulkan, Metal or DX12 adapter; `cargo run -- adapters` says how to get one");
        for (name, _) in tests() {
            trials.push(
                Trial::test(name, || Err("no adapter was found".into()))
                    .with_kind("no adapter")
                    .with_ignored_flag(true),
            );
        }
        if required {
            trials
                .push(Trial::test("an_adapter_is_there", || Err("CUTIS_GPU=require, but no adapter was found".into())));
        }
    }
    libtest_mimic::run(&arguments, trials).exit();
}
