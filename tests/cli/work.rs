//! A folder with a small scene in it, and the program run there.

use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

/// A block of 4 × 4 × 2 cells for five steps, and what else is in its scene.
macro_rules! block {
    ($title:literal, $more:literal) => {
        concat!(
            "title = \"",
            $title,
            r#""

[time]
step_ms = 5.0
duration_s = 0.025

[skin]
size_mm = [8.0, 8.0]
cells = [4, 4]

[[skin.layer]]
name = "dermis"
thickness_mm = 2.0
cells = 2
young_kpa = 100.0
poisson = 0.4
density_kg_m3 = 1100.0

[[boundary]]
region = "bottom"
"#,
            $more
        )
    };
}

/// A blunt tip that presses from above, four steps in contact out of five.
pub const PRESS: &str = block!(
    "A blunt tip presses a block",
    r#"
[solver]
true_residual_every = 2

[[tool]]
name = "tip"
mesh = "tip.obj"
trajectory = "hand.csv"
mass_g = 10.0
inertia_g_mm2 = [100.0, 100.0, 100.0]
points_mm = [[0.0, 0.0, 0.0]]

[[probe]]
name = "top"
kind = "displacement"
point_mm = [0.0, 0.0, 2.0]

[[probe]]
name = "bed"
kind = "reaction"
region = "bottom"

[view]
frames = 2
size_px = [96, 64]
"#
);

/// The same block alone, settling under gravity.
pub const ALONE: &str = block!("A block settles", "\n[view]\nframes = 1\nsize_px = [96, 64]\n");

const TIP: &str = "v 0 0 0\nv 1 0 2\nv -1 1 2\nv -1 -1 2\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";
const HAND: &str = "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0.3,0.2,2.05,0,0,0,1\n0.02,0.3,0.2,1.7,0,0,0,1\n";

/// A folder of its own, removed at the end.
pub struct Work(PathBuf);

/// What the program said.
pub struct Said {
    /// Exit status.
    pub code: i32,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Work {
    /// A folder with a scene, the tip and its hand.
    pub fn with(scene: &str) -> Result<Self, String> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("cutis-cli-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).map_err(|e| e.to_string())?;
        let work = Self(path);
        work.write("scene.toml", scene)?;
        work.write("tip.obj", TIP)?;
        work.write("hand.csv", HAND)?;
        Ok(work)
    }

    /// A file of the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) -> Result<(), String> {
        std::fs::write(self.path(name), text).map_err(|e| e.to_string())
    }

    /// Reads a file.
    pub fn read(&self, name: &str) -> Result<String, String> {
        std::fs::read_to_string(self.path(name)).map_err(|e| format!("{name}: {e}"))
    }

    /// Runs the program in the folder.
    pub fn cutis(&self, arguments: &[&str]) -> Result<Said, String> {
        let ran = Command::new(env!("CARGO_BIN_EXE_cutis")).args(arguments).current_dir(&self.0).output();
        let ran = ran.map_err(|e| e.to_string())?;
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Ok(Said { code: ran.status.code().unwrap_or(-1), out: text(ran.stdout), err: text(ran.stderr) })
    }

    /// Runs the program and reads its JSON; wants the given exit status.
    pub fn json(&self, arguments: &[&str], code: i32) -> Result<serde_json::Value, String> {
        let said = self.cutis(arguments)?;
        if said.code != code {
            return Err(format!("{arguments:?}: exit status {}, wanted {code}: {}", said.code, said.err));
        }
        serde_json::from_str(&said.out).map_err(|e| format!("{arguments:?}: {e} in {}", said.out))
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).ok();
    }
}
