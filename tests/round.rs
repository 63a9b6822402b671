//! Spheres and capsules on the skin: what holds them, what they feel, and what each check would miss without it.

use cutis::scene::{Filter, Pose, Round, Scene};
use cutis::step::{Place, Simulation, StepReport};
use glam::DVec3;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use rand::Rng;
use std::path::Path;
