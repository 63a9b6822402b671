//! The built program from outside: exit codes, messages, files.
//!
//! Tests that need an adapter are listed as ignored without one; `CUTIS_GPU=require` makes that a failure. So are those that need python3
//! with meshio, and with trimesh and pygltflib too (`CUTIS_PYTHON` names another interpreter).

mod drawn;
mod hostile;
mod input;
mod killed;
mod lost;
mod memory;
mod mesh;
mod results;
mod resumed;
mod served;
mod stand_in;
mod work;

use libtest_mimic::{Arguments, Trial};

/// What went wrong, in words.
pub type Outcome = Result<(), String>;

/// A test by name; the second list needs an adapter.
type Test = (&'static str, fn() -> Outcome);

/// Fails with words.
#[macro_export]
macro_rules! ensure {
    ($holds:expr, $($words:tt)*) => {
        let holds: bool = $holds;
        if !holds {
            return Err(format!($($words)*));
        }
    };
}

fn main() {
    let arguments = Arguments::from_args();
    let adapter = !cutis::gpu::adapters().is_empty();
    let required = std::env::var("CUTIS_GPU").is_ok_and(|v| v == "require");
    let trial = |(name, test): &Test| {
        let test = *test;
        Trial::test(*name, move || Ok(test()?))
    };
    // limits of the address space, and what a process takes of it, are Linux's
    let memory = if cfg!(target_os = "linux") { memory::TESTS } else { &[] };
    let hostile = if cfg!(unix) { hostile::TESTS } else { &[] };
    let plain = [
        drawn::TESTS,
        hostile,
        input::TESTS,
        killed::TESTS,
        lost::TESTS,
        memory,
        mesh::TESTS,
        results::TESTS,
        resumed::TESTS,
        served::TESTS,
        stand_in::TESTS,
    ]
    .concat();
    let on_gpu = results::GPU_TESTS;
    let mut trials: Vec<Trial> = plain.iter().map(trial).collect();
    trials.extend(on_gpu.iter().map(|test| match (adapter, required) {
        (false, true) => Trial::test(test.0, || Err("no adapter, and CUTIS_GPU=require".into())),
        (false, false) => trial(test).with_ignored_flag(true).with_kind("no adapter"),
        (true, _) => trial(test),
    }));
    let meshio = mesh::has_meshio();
    trials.extend(mesh::MESHIO_TESTS.iter().map(|test| match meshio {
        true => trial(test),
        false => trial(test).with_ignored_flag(true).with_kind("no python3 with meshio"),
    }));
    let readers = drawn::has_readers();
    trials.extend(drawn::READER_TESTS.iter().map(|test| match readers {
        true => trial(test),
        false => trial(test).with_ignored_flag(true).with_kind("no python3 with meshio, trimesh and pygltflib"),
    }));
    libtest_mimic::run(&arguments, trials).exit();
}
