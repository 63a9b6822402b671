//! Contact points of a step as data: bodies, point, normal, gap, force and slip of each.

use super::ContactReport;
use crate::collide::Contact;
use crate::constraints::Law;
use crate::scene::BodyId;
use glam::DVec3;

/// What a contact point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// Unilateral contact with friction.
    Contact,
    /// Piece of a blade's edge inside the tissue, which resists up to its toughness.
    Edge,
    /// Attached node.
    Attachment,
    /// Attached node that slides along its path.
    Path,
}

impl PointKind {
    /// Its word in tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Contact => "contact",
            Self::Edge => "edge",
            Self::Attachment => "attachment",
            Self::Path => "path",
        }
    }
}

/// A contact point of a step, in world axes. It is of the last substep, and of the last solve of a static step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPoint {
    /// The two bodies.
    pub bodies: [BodyId; 2],
    /// What it is.
    pub kind: PointKind,
    /// Position at the start of the step, m.
    pub point: DVec3,
    /// Unit normal from the second body to the first; of an edge that of the blade's plane; zero for attachments, which have none.
    pub normal: DVec3,
    /// Separation along the normal at the end of the step, beyond the rest gap of the scene's contact, m: negative where the bodies overlap.
    /// Of an attachment the length of what is left of its violation.
    pub gap: f64,
    /// Force on the first body, N; that on the second is its opposite.
    pub force: DVec3,
    /// Displacement of the first body relative to the second in the step (of a static one in its last solve), along the directions in which the
    /// law lets them slide, m: tangential for a contact, in the blade's plane for an edge, along its path for an attachment. As small as the contact solve's residual
    /// (`residual_m`) where friction holds.
    pub slip: DVec3,
}

impl ContactPoint {
    fn new(contact: &Contact, along: [f64; 3], moved: DVec3) -> Self {
        let axes = contact.axes;
        let violation = |k: usize| contact.gap[k] + axes[k].dot(moved);
        // axes along which it slides, and the normal's
        let (kind, free, normal): (_, &[usize], _) = match contact.law {
            Law::Coulomb { .. } => (PointKind::Contact, &[1, 2], Some(0)),
            Law::Cut { .. } => (PointKind::Edge, &[0, 1], Some(2)),
            Law::Bilateral { rows } => (PointKind::Attachment, &[0, 1, 2][rows..], None),
            Law::Slide { .. } => (PointKind::Path, &[2], None),
        };
        let held = (0..3).filter(|k| !free.contains(k));
        Self {
            bodies: contact.on,
            kind,
            point: contact.point,
            normal: normal.map_or(DVec3::ZERO, |k| axes[k]),
            gap: normal.map_or_else(|| held.map(|k| violation(k).powi(2)).sum::<f64>().sqrt(), violation),
            force: contact.in_world(along),
            slip: free.iter().map(|k| axes[*k] * axes[*k].dot(moved)).sum(),
        }
    }

    /// Force on a body, N; zero on a body that it is not of. Both sides count where they are one body's, as of the lips of a wound.
    pub fn force_on(&self, body: BodyId) -> DVec3 {
        let share = |side: usize| f64::from(u8::from(self.bodies[side] == body));
        self.force * (share(0) - share(1))
    }
}

impl ContactReport {
    /// Contact points of the step, those without a force included; none without contact.
    ///
    /// ```
    /// use cutis::scene::{BodyId, incision};
    /// use cutis::step::{Platform, Simulation};
    /// use glam::DVec3;
    ///
    /// let scene = incision()?.in_test_form();
    /// let mut simulation = Simulation::new(&scene, &Platform::Cpu64)?;
    /// for _ in 0..30 {
    ///     let step = simulation.step(false)?;
    ///     for p in step.contact.points().filter(|p| p.force != DVec3::ZERO) {
    ///         let [first, second] = p.bodies.map(|body| scene.body_name(body));
    ///         println!("{first} on {second} at {}: {} N, gap {} m, slip {} m", p.point, p.force, p.gap, p.slip);
    ///     }
    ///     let scalpel: DVec3 = step.contact.points().map(|p| p.force_on(BodyId::Rigid(0))).sum();
    ///     assert!((scalpel - step.contact.force(BodyId::Rigid(0), None)).length() < 1e-12);
    /// }
    /// # Ok::<(), cutis::error::Error>(())
    /// ```
    pub fn points(&self) -> impl Iterator<Item = ContactPoint> + '_ {
        let all = self.contacts.iter().zip(&self.forces).zip(&self.slips);
        all.map(|((contact, along), moved)| ContactPoint::new(contact, *along, *moved))
    }
}
