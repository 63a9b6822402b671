//! What every input must keep to: no panic, a bounded time, a bounded peak of memory; and how the bounds are watched.

use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestRunner};
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// No input here takes a tenth of a second; a machine under load gets a thousand times that.
const LONGEST: Duration = Duration::from_secs(100);
/// How often an input is looked at in that time; a machine that stands still for a while costs one look.
const LOOKS: u32 = 20;

/// Peak of memory to read an input in, bytes: texts here are below 100 kB, and a mesh takes some ten times its text.
pub const TO_READ: u64 = 32 << 20;

/// Peak to step a scene of at most 3 × 3 cells a layer, bytes.
pub const TO_RUN: u64 = 512 << 20;

/// The input at work, and how often it was looked at.
type AtWork = Arc<Mutex<Option<(u32, String)>>>;

/// Looks every now and then whether an input takes too long, and tells it to `late`.
pub struct Watch(AtWork);

impl Watch {
    pub fn new(longest: Duration, late: impl Fn(&str) + Send + 'static) -> Self {
        let at_work = AtWork::default();
        let seen = Arc::downgrade(&at_work);
        std::thread::spawn(move || {
            while let Some(at_work) = seen.upgrade() {
                if let Some((looks, input)) = at_work.lock().expect("no panic under it").as_mut() {
                    *looks += 1;
                    if *looks > LOOKS {
                        late(input);
                    }
                }
                drop(at_work);
                std::thread::sleep(longest / LOOKS);
            }
        });
        Self(at_work)
    }

    fn over<T>(&self, input: &str, run: impl FnOnce() -> T) -> T {
        *self.0.lock().expect("no panic under it") = Some((0, input.to_string()));
        let out = run();
        *self.0.lock().expect("no panic under it") = None;
        out
    }
}

/// Ends the process with the input on the screen: a loop that never ends cannot be caught otherwise.
fn end(input: &str) {
    // not by a macro, whose words the test harness keeps to itself
    writeln!(std::io::stderr(), "an input takes longer than {LONGEST:?}:\n{input}").ok();
    std::process::exit(70);
}

/// A folder of its own for files of the inputs, removed at the end.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("cutis-fuzz-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the folder for temporary files takes one more");
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).ok();
    }
}

/// Runs under the bounds; a panic or a peak above `bytes` comes back in words.
pub fn bounded<T>(bytes: u64, run: impl FnOnce() -> T) -> Result<T, String> {
    let mut out = None;
    // caught inside, so that the count of what is held stays balanced
    let held = allocation_counter::measure(|| out = Some(catch_unwind(AssertUnwindSafe(run))));
    let done = out.expect("measuring runs it").map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        format!("panic: {}", text.or(panic.downcast_ref::<&str>().map(|s| (*s).into())).unwrap_or_default())
    })?;
    match held.bytes_max <= bytes {
        true => Ok(done),
        false => Err(format!("{} bytes at a time, at most {bytes} allowed", held.bytes_max)),
    }
}

/// How many inputs, here one of `share` of what is asked for.
pub fn count(share: u32) -> u32 {
    let asked = std::env::var("CUTIS_FUZZ").ok().map(|n| n.parse().expect("CUTIS_FUZZ is a whole number"));
    (asked.unwrap_or(10_000) / share).max(1)
}

/// Tries inputs of a strategy on a property; panics with the smallest input that it does not hold for, or, with `CUTIS_FUZZ_LIST=1`, with
/// one input of each kind that it does not hold for.
pub fn tried<S: Strategy>(cases: u32, inputs: S, property: impl Fn(&S::Value) -> Result<(), String>)
where
    S::Value: Debug,
{
    let seed = std::env::var("CUTIS_FUZZ_SEED").ok().map(|n| n.parse().expect("CUTIS_FUZZ_SEED is a whole number"));
    let config = Config {
        cases,
        rng_seed: RngSeed::Fixed(seed.unwrap_or(28)),
        max_shrink_iters: 4096,
        failure_persistence: None,
        ..Config::default()
    };
    let watch = Watch::new(LONGEST, end);
    let mut runner = TestRunner::new(config);
    let watched = |input: &S::Value| watch.over(&format!("{input:?}"), || property(input));
    if std::env::var_os("CUTIS_FUZZ_LIST").is_some() {
        let mut kinds: BTreeMap<String, (u32, String, String)> = BTreeMap::new();
        for _ in 0..cases {
            let input = inputs.new_tree(&mut runner).expect("every strategy here gives a value").current();
            if let Err(found) = watched(&input) {
                let kind = found.chars().filter(|c| !c.is_ascii_digit()).take(60).collect();
                kinds.entry(kind).or_insert_with(|| (0, found, format!("{input:?}"))).0 += 1;
            }
        }
        let list: Vec<_> =
            kinds.values().map(|(count, found, input)| format!("{count} × {found}\n    {input}")).collect();
        assert!(list.is_empty(), "{}", list.join("\n"));
        return;
    }
    let outcome = runner.run(&inputs, |input| watched(&input).map_err(TestCaseError::fail));
    if let Err(error) = outcome {
        panic!("{error}");
    }
}

/// A message that says which file, and what to do about it.
pub fn mends(message: &str, file: &str) -> Result<(), String> {
    let verbs = [
        "add",
        "bind",
        "change",
        "choose",
        "close",
        "complete",
        "constrain",
        "convert",
        "did you mean",
        "end",
        "export",
        "give",
        "hold",
        "join",
        "leave",
        "let",
        "look",
        "make",
        "mend",
        "move",
        "name",
        "put",
        "record",
        "remove",
        "rename",
        "rewrite",
        "run",
        "sort",
        "start",
        "swap",
        "take",
        "update",
        "use",
        "widen",
        "write",
        "the unit is part of the key: write",
    ];
    let says_what_to_do = message.split("; ").skip(1).any(|clause| verbs.iter().any(|verb| clause.starts_with(verb)));
    match message.contains(file) && says_what_to_do {
        true => Ok(()),
        false => Err(format!("does not name {file} or how to mend it: {message}")),
    }
}

#[test]
fn a_planted_panic_blow_up_hang_or_bare_message_is_noticed() {
    let fails = |property: fn(&u32) -> Result<(), String>| {
        catch_unwind(|| tried(2000, 0u32..1000, property))
            .expect_err("it is noticed")
            .downcast::<String>()
            .expect("a text")
    };
    let text = fails(|n| bounded(TO_READ, || assert!(*n < 700, "{n} is too much")));
    assert!(text.contains("panic: 700 is too much"), "the smallest such input: {text}");
    let text = fails(|n| bounded(1 << 20, || drop(std::hint::black_box(vec![1u8; (*n as usize) << 11]))));
    assert!(text.contains("input: 513") && text.contains("bytes at a time"), "{text}");
    let late = Arc::new(AtomicBool::new(false));
    let told = late.clone();
    let watch = Watch::new(Duration::from_millis(20), move |input| told.store(input == "slow", Ordering::Release));
    watch.over("quick", || ());
    watch.over("slow", || {
        while !late.load(Ordering::Acquire) {
            std::thread::yield_now()
        }
    });
    assert!(mends("a.toml:3: wrong; write b", "a.toml").is_ok());
    assert!(mends("a.toml:3: wrong", "a.toml").is_err() && mends("wrong; write b", "a.toml").is_err());
}
