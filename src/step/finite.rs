//! Non-finite values end the run: tools, hands and bodies are checked at the start of a step and before it is accepted.
//!
//! If a step's solves leave a tool, a body or a contact force non-finite, the step is solved once more from its start: with the contact
//! forces of the previous step, without contacts that are themselves non-finite, and without warm starts or known compliance. Nothing of a
//! step is kept before this check, so it costs nothing where all is finite. If the second try is non-finite too, or a value is so at the
//! start of the step, the step ends in an error that names it.

use super::contact::Resolved;
use super::in_full::NOT_IN_FULL;
use super::{Refused, Simulation, StepReport};
use crate::bodies::rigid::{Instrument, UnconstrainedMotion};
use crate::collide::Contact;
use crate::error::{Error, Result};
use crate::scene::{BodyId, STEP, device_of};

/// Advice for a body or a tool.
const SHORTER: &str = "take a shorter step_ms, move and load it more slowly, and look at the last rows of probes.csv and the last picture";
/// Advice where the step was solved twice.
const TWICE: &str = "the step was solved again with the contact forces of the previous step, to the same result; take a shorter step_ms, move and \
                     load it more slowly, and look at the last rows of probes.csv and the last picture";
/// Advice for a hand.
const HAND: &str = "look at its device or its path there, and at the damping of [tool.coupling]";

impl Simulation {
    /// Error that names a non-finite body.
    pub fn non_finite(&self, who: BodyId) -> Error {
        self.non_finite_body_error(who, SHORTER)
    }

    fn non_finite_body_error(&self, who: BodyId, fix: &'static str) -> Error {
        let (what, name) = match who {
            BodyId::Rigid(number) => ("the tool", &self.scene.tools[number].name),
            BodyId::Deformable(number) => ("the body", &self.scene.skins[number].name),
            BodyId::Plane(number) => ("the force on the wall", &self.scene.planes[number].name),
            BodyId::World => ("the force on a tie of", &self.scene.title),
        };
        self.non_finite_of(STEP, what, name, fix)
    }

    /// `key` of [`crate::scene::Scene::lines`] is what to change.
    fn non_finite_of(&self, key: &str, what: &'static str, name: &str, fix: &'static str) -> Error {
        Refused::NonFinite { at: self.scene.at(key), what, name: name.into(), time: self.time, fix }.into()
    }

    /// Refuses non-finite unconstrained motions, such as those of a non-finite hand pose.
    pub(super) fn hands_are_finite(&self, free: &[UnconstrainedMotion]) -> Result<()> {
        let non_finite = free.iter().position(|free| !(free.translation.is_finite() && free.rotation.is_finite()));
        let Some(number) = non_finite else { return Ok(()) };
        let (position, rotation) = self.tools[number].hand(self.time);
        match is_finite(&self.tools[number]) && !(position.is_finite() && rotation.is_finite()) {
            true => {
                let name = &self.scene.tools[number].name;
                Err(self.non_finite_of(&device_of(name), "the hand of the tool", name, HAND))
            }
            false => Err(self.non_finite(BodyId::Rigid(number))),
        }
    }

    /// First body that a step's solves have left non-finite, if any: tools, then deformable bodies.
    pub(super) fn non_finite_body(&self, solved: &Resolved) -> Option<BodyId> {
        let force = |(_, f): &(u32, [f64; 3])| f.iter().all(|c| c.is_finite());
        let non_finite = |number: usize| {
            let forces = solved.forces.as_ref().and_then(|forces| forces.get(number));
            self.bodies[number].non_finite || !forces.is_none_or(|forces| forces.iter().all(force))
        };
        let tool = self.tools.iter().position(|tool| !is_finite(tool)).map(BodyId::Rigid);
        tool.or_else(|| (0..self.bodies.len()).find(|number| non_finite(*number)).map(BodyId::Deformable))
    }

    /// Solves a step a second time; `old` are the tools at its start.
    pub(super) fn solve_again(
        &mut self,
        old: &[Instrument],
        free: &[UnconstrainedMotion],
        report: &mut StepReport,
    ) -> Result<Resolved> {
        report.warn("step_retried", 1);
        if self.scene.in_full() && !report.warnings.contains_key(NOT_IN_FULL) {
            report.warn(NOT_IN_FULL, 1); // by its linearisation
        }
        // reset tools, loads, warm starts and compliance
        let begin = self.loaded_at();
        self.tools.clone_from_slice(old);
        for body in &mut self.bodies {
            body.non_finite = false;
            body.compliance = Default::default();
            body.restart(&self.scene, [begin, self.time])?;
        }
        // drop non-finite contacts
        report.contact.on_tool.clear();
        (report.contact.shortened, report.contact.residual_n, report.contact.residual_m) = (false, 0.0, 0.0);
        let mut contacts = std::mem::take(&mut report.contact.contacts);
        contacts.retain(is_finite_contact);
        let solved = self.solve(contacts, free, true, report)?;
        match self.non_finite_body(&solved) {
            Some(who) => Err(self.non_finite_body_error(who, TWICE)),
            None => Ok(solved),
        }
    }

    /// Refuses a step whose probes are non-finite, with an error that names their body.
    pub(super) fn probes_are_finite(&self, report: &StepReport) -> Result<()> {
        let Some(number) = report.probes.iter().position(|value| !value.is_finite()) else { return Ok(()) };
        Err(self.non_finite(self.scene.probes[number].kind.body()))
    }
}

/// Whether all of a contact's rows are finite.
fn is_finite_contact(contact: &Contact) -> bool {
    let vectors = contact.axes.iter().chain([&contact.point]).all(|v| v.is_finite());
    let weights = contact.points.iter().flat_map(|point| &point.0).map(|(_, weight)| *weight);
    vectors && weights.chain(contact.gap).all(f64::is_finite)
}

/// Whether a tool's state is finite.
fn is_finite(tool: &Instrument) -> bool {
    let vectors = [tool.position, tool.velocity, tool.angular_velocity];
    vectors.iter().all(|v| v.is_finite()) && tool.rotation.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{FREE, Vector};
    use crate::scene::{Scene, read};
    use crate::step::Platform;
    use std::path::Path;

    fn pressed() -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hard/press_vertex_edge_face.toml");
        let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
        scene.skins[0].cells = [8, 8];
        scene
    }

    /// Runs `steps` steps; if `spoilt`, the last one's unconstrained motion starts from NaN. Returns the last step's result and the
    /// simulation.
    fn run(scene: &Scene, steps: u32, spoilt: bool) -> (Result<StepReport>, Simulation) {
        let mut simulation = Simulation::new(scene, &Platform::Cpu64).expect("the scene fits");
        for _ in 1..steps {
            simulation.step(false).expect("nothing is wrong yet");
        }
        if spoilt {
            let nan = vec![[f64::NAN; 4]; simulation.bodies[0].model.node_count()];
            simulation.bodies[0].backend.set_vector(Vector::Solution, FREE, &nan).expect("no device to fail");
        }
        let last = simulation.step(true);
        (last, simulation)
    }

    #[test]
    fn a_non_finite_step_is_tried_again_with_the_last_forces() {
        let scene = pressed();
        let force = |report: &StepReport| report.contact.on_tool[0][2];
        let ((again, _), (plain, _)) = (run(&scene, 8, true), run(&scene, 8, false));
        let (again, plain) = (again.expect("the second try is finite"), plain.expect("nothing is wrong"));
        assert_eq!(again.warnings.get("step_retried"), Some(&1), "{:?}", again.warnings);
        assert_eq!(plain.warnings.get("step_retried"), None, "the counter-test: {:?}", plain.warnings);
        let before = force(&run(&scene, 7, false).0.expect("nothing is wrong"));
        assert!(before > 1e-3 && (force(&again) - before).abs() < 1e-9 * before, "{} N, {before} N", force(&again));
        assert!(force(&plain) > 1.001 * before, "the counter-test: the press goes on, {} N", force(&plain));
    }

    #[test]
    fn a_retried_step_goes_on_where_the_run_would_have_gone() {
        let scene = pressed();
        let end = |spoilt| {
            let (last, mut simulation) = run(&scene, 8, spoilt);
            last.expect("the step is finite");
            let last = (0..20).map(|_| simulation.step(false).expect("nothing is wrong any more")).last();
            last.map_or(0.0, |report| report.contact.on_tool[0][2])
        };
        let (again, plain) = (end(true), end(false));
        assert!(plain > 1e-3 && (again - plain).abs() < 1e-2 * plain, "{again} N, {plain} N");
    }

    #[test]
    fn what_stays_non_finite_ends_the_run_by_its_name() {
        let mut scene = pressed();
        scene.time.gravity = [0.0, 0.0, f64::MAX];
        let said = run(&scene, 1, false).0.expect_err("gravity overflows").to_string();
        assert!(said.contains("the body \"skin\" is non-finite at 0.00"), "{said}");
        assert!(said.contains("was solved again"), "{said}");
        let mut simulation = Simulation::new(&pressed(), &Platform::Cpu64).expect("the scene fits");
        simulation.tools[0].velocity.x = f64::NAN;
        let said = simulation.step(false).expect_err("the tool is non-finite").to_string();
        assert!(said.contains("the tool \"") && said.contains("is non-finite"), "{said}");
        let mut simulation = Simulation::new(&pressed(), &Platform::Cpu64).expect("the scene fits");
        simulation.tools[0].follow((glam::DVec3::NAN, glam::DQuat::IDENTITY), 0.0, 0.01);
        let said = simulation.step(false).expect_err("the hand is non-finite").to_string();
        assert!(said.contains("the hand of the tool \""), "{said}");
    }
}
