//! The vendor's own client against `cutis haply-mock`. It reads each frame into types of its own, and shows no device where one key is
//! missing.

use haply::HaplyDevice;
use haply::device_model::{ControlDomain, ControlMode, DeviceMode, DeviceType, Force, ForceInput, ServiceData};
use std::error::Error;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

type Failure = Box<dyn Error + Send + Sync>;

/// How long anything may take that is waited for.
const PATIENCE: Duration = Duration::from_secs(20);
/// Name of the stand-in's arm.
const ARM: &str = "049D";
/// N/m, of the stand-in's hand.
const STIFFNESS: f32 = 200.0;

/// A stand-in of the built program, ended when dropped.
struct StandIn {
    process: Child,
    url: String,
}

impl StandIn {
    fn start() -> Result<Self, Failure> {
        let program =
            std::env::var("CUTIS").map_err(|_| "CUTIS is not set; set it to the built program, as tests/run does")?;
        let mut command = Command::new(program);
        command.args(["haply-mock", "--port", "0", "--device", ARM, "--grip", "1401"]);
        let mut process = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn()?;
        let mut first = String::new();
        BufReader::new(process.stdout.take().ok_or("no output")?).read_line(&mut first)?;
        let url = first.split_whitespace().find(|word| word.starts_with("ws://")).ok_or("no address")?.to_string();
        Ok(Self { process, url })
    }
}

impl Drop for StandIn {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

/// Pushes with a force along z, N, until `done`; the last state.
async fn push(
    device: &mut HaplyDevice,
    z: f32,
    mut done: impl FnMut(&ServiceData) -> bool,
) -> Result<ServiceData, Failure> {
    let begin = Instant::now();
    loop {
        let state = device.read_state().await?;
        if done(&state) {
            return Ok(state);
        }
        assert!(begin.elapsed() < PATIENCE, "not within {PATIENCE:?}: {state:?}");
        let force = ForceInput { device_id: ARM.into(), forces: Force { x: 0.0, y: 0.0, z } };
        device.update_force(vec![force], Some(true), Some(true)).await?;
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
}

/// Height of the arm's cursor, m.
fn height(state: &ServiceData) -> f32 {
    state.inverse3[0].state.cursor_position.expect("an arm has a position").z
}

async fn drive(url: &str) -> Result<(), Failure> {
    let mut device = HaplyDevice::new(&url.replace("ws://", "http://"), url).await?;
    let version = device.get_service_version().await?;
    assert_eq!(version.project_version, "3.5.0");
    assert!(!version.build_time.is_empty(), "{version:?}");
    // the inventory: each device with its configuration
    let first = push(&mut device, 0.0, |state| !state.inverse3.is_empty()).await?;
    let arm = &first.inverse3[0];
    let config = arm.config.as_ref().expect("the inventory has configurations");
    assert_eq!((arm.device_id.as_str(), config.device_info.id.as_str()), (ARM, ARM));
    assert_eq!(config.device_info.device_type, DeviceType::Inverse3);
    assert!(!config.device_info.uuid.is_empty(), "{config:?}");
    assert!(arm.status.calibrated && arm.status.ready && arm.status.started, "{:?}", arm.status);
    assert!(first.verse_grip[0].config.is_some() && first.verse_grip[0].state.orientation.is_some(), "{first:?}");
    // without a force the cursor is controlled by nothing
    assert_eq!(arm.state.control_mode, Some(ControlMode::Idle), "{:?}", arm.state);
    let rest = height(&first);
    // the hand gives way by the force over its stiffness, and comes back
    let pushed = push(&mut device, 1.0, |state| (height(state) - rest - 1.0 / STIFFNESS).abs() < 1e-4).await?;
    let state = &pushed.inverse3[0].state;
    assert_eq!(state.control_mode, Some(ControlMode::Force), "{state:?}");
    // no position or joint is asked for
    assert_eq!((state.mode, state.control_domain), (DeviceMode::Idle, Some(ControlDomain::Cartesian)), "{state:?}");
    push(&mut device, 0.0, |state| (height(state) - rest).abs() < 1e-4).await?;
    device.shutdown().await
}

#[test]
fn the_vendors_client_drives_the_stand_in() -> Result<(), Failure> {
    let stand_in = StandIn::start()?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(drive(&stand_in.url))
}
