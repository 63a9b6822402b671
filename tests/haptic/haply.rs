//! The client of the Inverse Service against the stand-in, over a real socket.
//!
//! Nothing here passes or fails by a bare time: counts are compared with counts, and waits end when what is waited for is there.

mod stand_in;

use cutis::error::{Error, Result};
use cutis::haptic::device::{Device, Limits, Reading, Wrench};
use cutis::haptic::haply::command::{Command, Version};
use cutis::haptic::haply::mock::{Faults, Mock, Options};
use cutis::haptic::haply::wire::{ArmKind, ArmState, Entry, Frame, GripKind, Vector};
use cutis::haptic::haply::{Client, Refused, Settings, open};
use cutis::scene::Pose;
use glam::{DQuat, DVec3};
use std::io::Write;
use std::net::TcpListener;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use tungstenite::Message;

/// A tick of the loop.
const TICK: Duration = Duration::from_millis(1);

/// How long anything may take that is waited for; far beyond what it takes.
const PATIENCE: Duration = Duration::from_secs(20);

/// Where the stand-in's hand rests, m.
const REST: DVec3 = DVec3::new(0.0, -0.12, 0.15);

/// N/m, of the stand-in's hand.
const STIFFNESS: f64 = 200.0;

/// Step of the stand-in's encoders, m.
const QUANTUM: f64 = 1e-5;

fn mock(faults: Faults) -> Mock {
    Mock::start(Options { port: 0, faults, ..Options::default() }).expect("a free port")
}

fn settings(mock: &Mock) -> Settings {
    Settings { url: mock.url(), ..Settings::default() }
}

fn client(mock: &Mock) -> Client {
    open(&settings(mock)).unwrap_or_else(|e| panic!("{e}"))
}

fn push(force: DVec3) -> Wrench {
    Wrench { force, torque: DVec3::ZERO }
}

/// A loop of 1 kHz that pushes with a force, until `done` says so after a tick; the readings.
fn ticks(client: &mut Client, force: DVec3, mut done: impl FnMut(&Client, usize) -> bool) -> Vec<Reading> {
    let (start, mut readings) = (Instant::now(), Vec::new());
    let mut next = start;
    loop {
        let time = start.elapsed().as_secs_f64();
        readings.push(client.read(time));
        client.write(time, push(force));
        if done(client, readings.len()) {
            return readings;
        }
        assert!(start.elapsed() < PATIENCE, "waited in vain after {} ticks: {:?}", readings.len(), client.trouble());
        next = (next + TICK).max(Instant::now() - 5 * TICK);
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
}

/// Waits without ticking.
fn wait(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < PATIENCE, "waited in vain until {what}");
        std::thread::sleep(TICK);
    }
}

fn sound(readings: &[Reading]) {
    for reading in readings {
        assert!(reading.is_valid() && reading.age.is_finite(), "{reading:?}");
    }
}

#[test]
fn a_loop_of_1_khz_gets_a_state_per_tick() {
    let mock = mock(Faults::default());
    let mut client = client(&mock);
    assert_eq!(client.name(), "Haply inverse3 MOCK with verse_grip GRIP");
    let (mut seen, mut since, mut lags) = (0, 0, Vec::new());
    let readings = ticks(&mut client, DVec3::ZERO, |client, tick| {
        since = if client.frames() > seen { 0 } else { since + 1 };
        seen = client.frames();
        lags.push(since);
        tick == 1500
    });
    sound(&readings);
    lags.sort_unstable();
    let (frames, trouble) = (client.frames(), client.trouble());
    println!("1500 ticks, {frames} states; ticks since the newest state: median {}, worst {}", lags[750], lags[1499]);
    // one per tick, and those before the loop began and after its last word
    assert!(frames > 50 && frames < 1700, "{frames} states in 1500 ticks, {trouble:?}");
    let clean = [trouble.malformed, trouble.non_finite, trouble.unasked, trouble.disconnects, trouble.absent];
    assert_eq!(clean, [0; 5], "{trouble:?}");
    wait("the last frame is answered", || mock.record().frames + 1 == client.frames());
    let record = mock.record();
    assert_eq!(record.profile.as_deref(), Some("org.cutis.haptic"));
    assert_eq!((record.wording, record.required_version.as_deref()), (Some("vector"), Some(">=3.5")));
}

/// The hand's displacement when it rests under a force, and what the stand-in felt.
fn pushed(faults: Faults) -> (DVec3, DVec3) {
    let (mock, force) = (mock(faults), DVec3::new(0.5, -0.25, 1.0));
    let mut client = client(&mock);
    let mut found = (DVec3::ZERO, DVec3::ZERO);
    // a pause of this thread lets the force go for a while
    for turn in 1..=5 {
        let readings = ticks(&mut client, force, |client, _| client.frames() > 600 * turn);
        sound(&readings);
        found = (readings[readings.len() - 1].position - REST, mock.record().forces[0]);
        if arrived(found) {
            break;
        }
    }
    found
}

/// The force arrived and moved the hand by its spring.
fn arrived((moved, felt): (DVec3, DVec3)) -> bool {
    let force = DVec3::new(0.5, -0.25, 1.0);
    felt == force && (moved - force / STIFFNESS).abs().max_element() < QUANTUM
}

#[test]
fn forces_arrive() {
    let felt = pushed(Faults::default());
    assert!(arrived(felt), "{felt:?}");
}

#[test]
fn a_service_that_passes_forces_over_would_be_caught() {
    let felt = pushed(Faults { deaf: true, ..Faults::default() });
    assert!(!arrived(felt), "{felt:?}");
}

#[test]
fn a_loop_that_stops_leaves_no_force() {
    let mock = mock(Faults::default());
    let mut client = client(&mock);
    ticks(&mut client, DVec3::Z, |_, _| mock.record().forces[0] == DVec3::Z);
    wait("the dead man lets go", || mock.record().forces[0] == DVec3::ZERO);
    // by a frame of zero force, not because the service missed one
    assert_eq!((mock.record().idled, client.trouble().disconnects), (0, 0));
    // and it goes on when the loop does
    ticks(&mut client, DVec3::X, |_, _| mock.record().forces[0] == DVec3::X);
}

#[test]
fn a_client_that_closes_leaves_no_force() {
    let mock = mock(Faults::default());
    let mut client = client(&mock);
    ticks(&mut client, DVec3::Z, |_, _| mock.record().forces[0] == DVec3::Z);
    client.close().expect("it lets go");
    wait("the connection ends", || mock.record().ended == 1);
    assert_eq!(mock.record().last_forces, [[DVec3::ZERO]]);
    // a closed device takes what comes, and says nothing new
    let frames = client.frames();
    client.write(0.0, push(DVec3::X));
    assert!(client.read(0.0).is_valid() && client.frames() == frames);
}

/// A service that falls silent at the first force, and tells the forces that it hears: of the first connection alone.
fn falls_silent() -> (String, Receiver<DVec3>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let url = format!("ws://{}", listener.local_addr().expect("it has one"));
    let (tell, told) = channel();
    std::thread::spawn(move || {
        let (stream, _) = listener.accept().expect("a client");
        let mut socket = tungstenite::accept(stream).expect("its handshake");
        let zero = Vector::from(DVec3::ZERO);
        let state = ArmState {
            cursor_position: Some(zero),
            cursor_velocity: zero,
            current_cursor_force: None,
            transform: Default::default(),
        };
        let arm = Entry { device_id: "A".into(), config: None, state: Some(state), status: Default::default() };
        let text = serde_json::to_string(&Frame { inverse3: vec![arm], ..Frame::default() }).expect("a text");
        socket.send(text.as_str().into()).expect("the client listens");
        let mut speaks = true;
        while let Ok(Message::Text(heard)) = socket.read() {
            let command: Command = serde_json::from_str(&heard).expect("a command");
            let set = command.inverse3[0].commands.set_cursor_force.and_then(|set| set.vector);
            let force = DVec3::from(set.expect("a force"));
            speaks &= force == DVec3::ZERO;
            if speaks {
                socket.send(text.as_str().into()).expect("the client listens");
            }
            if tell.send(force).is_err() {
                return;
            }
        }
    });
    (url, told)
}

#[test]
fn a_loop_that_stops_before_a_silent_service_leaves_no_force() {
    let (url, told) = falls_silent();
    let settings = Settings { url, version: Some(Version::VECTOR), ..Settings::default() };
    let mut client = open(&settings).expect("a device");
    let mut forces = Vec::new();
    ticks(&mut client, DVec3::Z, |_, _| {
        forces.extend(told.try_iter());
        forces.contains(&DVec3::Z)
    });
    // the answer to that force never comes, and the zero is sent without it, before the silence counts as the connection's end
    let ended = forces.last() == Some(&DVec3::ZERO);
    assert!(ended || told.recv_timeout(PATIENCE) == Ok(DVec3::ZERO));
    assert_eq!(told.recv_timeout(PATIENCE), Err(RecvTimeoutError::Disconnected));
    wait("the connection counts as lost", || client.trouble().disconnects == 1);
}

#[test]
fn forces_are_cut_to_the_limit_and_what_is_no_force_is_none() {
    let mock = mock(Faults::default());
    let limits = Limits { force: 0.5, torque: 1.0 };
    let mut client = open(&Settings { limits, ..settings(&mock) }).expect("a device");
    assert_eq!(client.limits(), Limits { force: 0.5, torque: 0.0 });
    ticks(&mut client, DVec3::new(3.0, 0.0, 4.0), |_, _| mock.record().peak > 0.0);
    ticks(&mut client, DVec3::new(f64::NAN, 0.0, 0.0), |_, n| n > 20 && mock.record().forces[0] == DVec3::ZERO);
    let (record, trouble) = (mock.record(), client.trouble());
    assert!((record.peak - 0.5).abs() < 1e-12, "{record:?}");
    assert!(trouble.clamped > 0 && trouble.refused > 0, "{trouble:?}");
}

#[test]
fn a_lost_connection_is_taken_up_again_without_a_jolt() {
    let mock = mock(Faults { drop_after: 50, ..Faults::default() });
    let mut client = client(&mock);
    let readings = ticks(&mut client, DVec3::Z, |client, _| client.trouble().reconnects >= 3);
    sound(&readings);
    let trouble = client.trouble();
    assert!(trouble.disconnects >= 3, "{trouble:?}");
    // between two connections what is known grows old
    assert!(readings.iter().any(|r| r.age > 0.015), "no reading is older than the wait");
    let record = mock.record();
    assert!(record.first_forces.len() >= 3 && record.peak == 1.0, "{record:?}");
    assert!(record.first_forces.iter().all(|forces| forces[0] == DVec3::ZERO), "{:?}", record.first_forces);
}

#[test]
fn a_service_that_goes_and_comes_back_is_found_again() {
    let mut first = mock(Faults::default());
    let url = first.url();
    let port = url.rsplit(':').next().and_then(|p| p.parse().ok()).expect("a port");
    let mut client = client(&first);
    ticks(&mut client, DVec3::Z, |_, _| first.record().forces[0] == DVec3::Z);
    drop(first);
    ticks(&mut client, DVec3::Z, |client, _| client.trouble().disconnects == 1);
    let grown = ticks(&mut client, DVec3::Z, |_, n| n == 100);
    assert!(grown[99].age > grown[0].age && grown[99].position == grown[0].position);
    first = Mock::start(Options { port, ..Options::default() }).expect("the port is free again");
    ticks(&mut client, DVec3::Z, |_, _| first.record().forces[0] == DVec3::Z);
    assert_eq!(client.trouble().reconnects, 1);
}

#[test]
fn bad_frames_are_counted_and_never_poses() {
    type Read = fn(&Client) -> u64;
    let cases: [(Faults, Read); 3] = [
        (Faults { malformed_every: 3, ..Faults::default() }, |c| c.trouble().malformed),
        (Faults { null_every: 3, ..Faults::default() }, |c| c.trouble().non_finite),
        (Faults { empty_every: 3, ..Faults::default() }, |c| c.trouble().absent),
    ];
    for (faults, bad) in cases {
        let mock = mock(faults);
        let mut client = client(&mock);
        let readings = ticks(&mut client, DVec3::ZERO, |client, _| bad(client) >= 100);
        sound(&readings);
        // of three frames two are good, and the inventory
        let (good, bad) = (client.frames(), bad(&client));
        assert!(good.abs_diff(2 * bad) <= 3, "{faults:?}: {good} good, {bad} bad");
        assert!(readings.iter().all(|r| (r.position - REST).length() < QUANTUM), "{faults:?}");
        assert_eq!(client.trouble().disconnects, 0, "{faults:?}");
        // the lock step is not lost by them
        assert_eq!(client.trouble().unasked, 0, "{faults:?}");
    }
}

#[test]
fn an_arm_that_is_not_calibrated_has_no_pose_and_no_force() {
    let mock = mock(Faults { uncalibrated: true, ..Faults::default() });
    let mut client = client(&mock);
    let readings = ticks(&mut client, DVec3::Z, |client, _| client.trouble().uncalibrated > 50);
    assert!(readings.iter().all(|r| r.age == f64::INFINITY), "{:?}", readings[0]);
    assert_eq!((client.frames(), mock.record().peak), (0, 0.0));
}

#[test]
fn a_slow_service_gets_the_newest_force_and_nothing_piles_up() {
    let mock = mock(Faults { delay: Duration::from_millis(20), ..Faults::default() });
    let mut client = client(&mock);
    let mut told = 0;
    let readings = ticks(&mut client, DVec3::X, |client, tick| {
        told = tick;
        client.frames() > 20
    });
    sound(&readings);
    let frames = mock.record().frames;
    assert!(frames <= 22, "{frames} frames were sent for 20 answers");
    assert!(told as u64 > 2 * frames, "{told} ticks, {frames} frames");
    assert!(client.trouble().late >= 10, "{:?}", client.trouble());
    // the force of now arrives in the next frame or the one after, not behind those of the past
    let before = mock.record().frames;
    ticks(&mut client, DVec3::Y, |_, _| mock.record().forces[0] == DVec3::Y);
    let needed = mock.record().frames - before;
    assert!(needed <= 3, "{needed} frames until the newest force");
}

/// A hand that moves along x for 10 s.
fn moving() -> Vec<Pose> {
    let turned = DQuat::from_rotation_z(1.0).to_array();
    let pose = |time, x, rotation| Pose { time, position: [x, 0.0, 0.0], rotation };
    vec![pose(0.0, 0.0, [0.0, 0.0, 0.0, 1.0]), pose(10.0, 1.0, turned)]
}

#[test]
fn after_a_burst_the_newest_state_is_the_one() {
    let faults = Faults { burst: 20, ..Faults::default() };
    let mock = Mock::start(Options { port: 0, path: moving(), faults, ..Options::default() }).expect("a free port");
    let mut client = client(&mock);
    let readings = ticks(&mut client, DVec3::ZERO, |client, _| client.trouble().unasked >= 400);
    sound(&readings);
    // 20 old frames before each 10th: what is left over of one burst would be answers to the next forces, and the lag would grow
    let record = mock.record();
    let bursts = record.frames / 10;
    assert!(
        client.trouble().unasked.abs_diff(20 * bursts) <= 20,
        "{} unasked, {bursts} bursts",
        client.trouble().unasked
    );
    client.write(0.0, push(DVec3::ZERO));
    wait("all is heard", || client.frames() == 1 + mock.record().frames + 20 * (mock.record().frames / 10));
    let newest = client.read(0.0).position.x;
    // the hand moves by 0.1 mm per frame, a quarter of a 10 ms of it behind its target
    let target = 1e-4 * mock.record().frames as f64;
    assert!((newest - target + 0.1 * 8.0 / STIFFNESS).abs() < 3e-4, "{newest} m, target {target} m");
}

#[test]
fn grip_and_arm_follow_the_hand() {
    let options = Options { port: 0, path: moving(), buttons: vec![(0.1, 1), (0.2, 6)], ..Options::default() };
    let mock = Mock::start(options).expect("a free port");
    let mut client = client(&mock);
    let readings = ticks(&mut client, DVec3::ZERO, |client, _| client.frames() > 400);
    let last = readings[readings.len() - 1];
    assert!((last.velocity - DVec3::X * 0.1).length() < 1e-3, "{last:?}");
    // 1 rad in 10 s
    let angle = last.rotation.to_scaled_axis();
    assert!((angle.z - last.position.x).abs() < 6e-3 && angle.z > 0.02, "{last:?}");
    let mut seen: Vec<u32> = readings.iter().map(|r| r.buttons).collect();
    seen.dedup();
    assert_eq!(seen, [0, 1, 6]);
}

#[test]
fn an_arm_alone_is_not_turned() {
    let mock =
        Mock::start(Options { port: 0, path: moving(), grips: Vec::new(), ..Options::default() }).expect("a port");
    let mut client = client(&mock);
    assert_eq!(client.name(), "Haply inverse3 MOCK");
    let readings = ticks(&mut client, DVec3::ZERO, |client, _| client.frames() > 100);
    assert!(readings.iter().all(|r| r.rotation == DQuat::IDENTITY && r.buttons == 0));
}

#[test]
fn the_named_device_is_taken_of_several() {
    let arms = vec![(ArmKind::Inverse3, "A".into()), (ArmKind::Inverse3, "B".into()), (ArmKind::Minverse, "C".into())];
    let grips = vec![(GripKind::Wired, "G".into()), (GripKind::Custom, "H".into())];
    let mock = Mock::start(Options { port: 0, arms, grips, ..Options::default() }).expect("a free port");
    for (number, (device, name)) in
        [("A", "inverse3 A"), ("B", "inverse3 B"), ("C", "minverse C")].into_iter().enumerate()
    {
        let named = Settings { device: Some(device.into()), grip: Some("H".into()), ..settings(&mock) };
        let mut client = open(&named).expect("it is there");
        assert_eq!(client.name(), format!("Haply {name} with custom_verse_grip H"));
        ticks(&mut client, DVec3::Z, |_, _| mock.record().forces[number] == DVec3::Z);
        let others: DVec3 = (0..3).filter(|k| *k != number).map(|k| mock.record().forces[k]).sum();
        assert_eq!(others, DVec3::ZERO, "{device}");
    }
}

#[test]
fn two_clients_of_two_services_do_not_meet() {
    let mocks = [mock(Faults::default()), mock(Faults::default())];
    let forces = [DVec3::X, DVec3::Y];
    std::thread::scope(|scope| {
        for (mock, force) in mocks.iter().zip(forces) {
            scope.spawn(move || {
                let mut client = client(mock);
                let mut found = (DVec3::ZERO, DVec3::ZERO);
                for turn in 1..=5 {
                    let readings = ticks(&mut client, force, |client, _| client.frames() > 600 * turn);
                    found = (readings[readings.len() - 1].position - REST, mock.record().forces[0]);
                    if (found.0 - force / STIFFNESS).abs().max_element() < QUANTUM && found.1 == force {
                        return;
                    }
                }
                panic!("{found:?}");
            });
        }
    });
}

#[test]
fn before_3_5_a_force_is_sent_as_values() {
    let mock = Mock::start(Options { port: 0, version: "3.4.2".into(), ..Options::default() }).expect("a free port");
    let mut client = client(&mock);
    ticks(&mut client, DVec3::Z, |_, _| mock.record().forces[0] == DVec3::Z);
    let record = mock.record();
    assert_eq!((record.wording, record.required_version.as_deref()), (Some("values"), Some(">=3.1")));
    // that service does not hear the newer word
    let newer = Settings { version: Some(Version::VECTOR), ..settings(&mock) };
    let mut wrong = open(&newer).expect("a stated version is not asked for");
    client.close().expect("it lets go");
    ticks(&mut wrong, DVec3::Z, |client, _| client.frames() > 50);
    assert_eq!(mock.record().forces[0], DVec3::ZERO);
}

#[test]
fn reading_and_writing_allocate_nothing() {
    let mock = mock(Faults::default());
    let mut client = client(&mock);
    ticks(&mut client, DVec3::Z, |client, _| client.frames() > 20);
    let counted = allocation_counter::measure(|| {
        for tick in 0..2000 {
            let reading = client.read(f64::from(tick) * 1e-3);
            client.write(0.0, push(reading.velocity + DVec3::X));
        }
        client.write(0.0, push(DVec3::NAN));
        client.write(0.0, push(DVec3::MAX));
    });
    assert_eq!(counted.count_total, 0, "{counted:?}");
    let name = allocation_counter::measure(|| drop(std::hint::black_box(client.name().to_string())));
    assert_eq!(name.count_total, 1, "the counter counts");
}

/// The message of a failed `open`, after a check of its kind and exit status.
fn refusal(settings: &Settings, kind: fn(&Refused) -> bool, exit_code: u8) -> String {
    let opened: Result<Client> = open(settings);
    let error = opened.err().expect("it is refused");
    let Error::Haply(refused) = &error else { panic!("{error:?}") };
    assert!(kind(refused), "{error:?}");
    assert_eq!(error.exit_code(), exit_code, "{error}");
    error.to_string()
}

fn contains(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "no `{word}` in: {message}");
    }
}

#[test]
fn an_address_that_is_none_is_refused() {
    let settings = Settings { url: "localhost:10001".into(), ..Settings::default() };
    let said = refusal(&settings, |e| matches!(e, Refused::Address { .. }), 2);
    contains(&said, &["localhost:10001: no address", "write ws://host:port"]);
}

#[test]
fn a_limit_that_is_none_is_refused() {
    for force in [-1.0, f64::NAN, f64::INFINITY] {
        let settings = Settings { limits: Limits { force, torque: 0.0 }, ..Settings::default() };
        let said = refusal(&settings, |e| matches!(e, Refused::ForceLimit { .. }), 2);
        contains(&said, &["force limit", "wanted a number from 0 up"]);
    }
}

#[test]
fn nobody_at_the_address_is_said() {
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port").local_addr().expect("it has one");
    let url = format!("ws://{free}");
    let settings = Settings { url: url.clone(), ..Settings::default() };
    let said = refusal(&settings, |e| matches!(e, Refused::Nobody { .. }), 1);
    contains(&said, &[&url, "nothing listens there", "cutis haply-mock"]);
}

/// Listens, writes a text to whoever comes, and keeps the connection for a while.
fn somebody(text: &'static str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let url = format!("ws://{}", listener.local_addr().expect("it has one"));
    std::thread::spawn(move || {
        let mut kept = Vec::new();
        for mut stream in listener.incoming().flatten() {
            stream.write_all(text.as_bytes()).ok();
            kept.push(stream);
        }
    });
    url
}

#[test]
fn somebody_else_at_the_address_is_said() {
    for text in ["SSH-2.0-OpenSSH_9.6\r\n", "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", ""] {
        let settings = Settings { url: somebody(text), ..Settings::default() };
        let said = refusal(&settings, |e| matches!(e, Refused::NoService { .. }), 1);
        contains(&said, &[&settings.url, "no Inverse Service", "10001"]);
    }
}

#[test]
fn a_service_without_an_inventory_is_said() {
    let mock = mock(Faults { silent: true, ..Faults::default() });
    let said = refusal(&settings(&mock), |e| matches!(e, Refused::NoService { .. }), 1);
    contains(&said, &["no inventory came within 2 s"]);
}

#[test]
fn a_version_that_is_too_old_is_said() {
    let mock = Mock::start(Options { port: 0, version: "3.0.5".into(), ..Options::default() }).expect("a free port");
    let said = refusal(&settings(&mock), |e| matches!(e, Refused::Version { .. }), 2);
    contains(&said, &[&mock.url(), "version 3.0.5", "wanted 3.1 or newer", "update the service"]);
}

#[test]
fn a_service_without_an_arm_says_what_it_has() {
    let mock = Mock::start(Options { port: 0, arms: Vec::new(), ..Options::default() }).expect("a free port");
    let said = refusal(&settings(&mock), |e| matches!(e, Refused::NoArm { .. }), 2);
    contains(&said, &["no Inverse3", "verse_grip GRIP", "plug one in"]);
    let bare =
        Mock::start(Options { port: 0, arms: vec![], grips: vec![], ..Options::default() }).expect("a free port");
    contains(&refusal(&settings(&bare), |e| matches!(e, Refused::NoArm { .. }), 2), &["no device at all"]);
}

#[test]
fn a_device_that_is_not_there_says_what_is() {
    let mock = mock(Faults::default());
    let arm = Settings { device: Some("049D".into()), ..settings(&mock) };
    let said = refusal(&arm, |e| matches!(e, Refused::Unknown { .. }), 2);
    contains(&said, &["no arm \"049D\"", "inverse3 MOCK, verse_grip GRIP", "name one of these"]);
    let grip = Settings { grip: Some("1402".into()), ..settings(&mock) };
    let said = refusal(&grip, |e| matches!(e, Refused::Unknown { .. }), 2);
    contains(&said, &["no grip \"1402\"", "verse_grip GRIP"]);
}

#[test]
fn a_taken_port_is_said() {
    let mock = mock(Faults::default());
    let port = mock.url().rsplit(':').next().and_then(|p| p.parse().ok()).expect("a port");
    let error = Mock::start(Options { port, ..Options::default() }).err().expect("the port is taken");
    let Error::Haply(refused) = &error else { panic!("{error:?}") };
    assert!(matches!(**refused, Refused::Port { .. }) && error.exit_code() == 1, "{error:?}");
    contains(&error.to_string(), &[&format!("127.0.0.1:{port}"), "--port 0 takes a free one"]);
    let wrong = Mock::start(Options { port: 0, version: "new".into(), ..Options::default() }).err();
    contains(&wrong.expect("it is none").to_string(), &["version \"new\"", "such as 3.5.0"]);
}
