//! Changes between steps. Each becomes a record in an ordered log; a gated pass applies the records at the start of
//! their step, on whichever side the world runs, so that a step run again neither loses nor doubles one.

use crate::builder::{
    ColliderBuilder, RigidBodyBuilder, RigidBodyType, check_finite, check_position, check_rotation, check_speed,
};
use crate::choice::Spread;
use crate::error::{Result, check};
use crate::handle::{BodyHandle, ColliderHandle, Inserted, JointHandle};
use crate::joint::{JointAxis, JointBuilder, JointMotor};
use crate::joint_edits::{JointEdits, JointSet};
use crate::layout::{BodyProps, Collider, EditRange, EditRecord, edit_op};
use crate::packed::{PackedBody, PackedScene, pack_body};
use crate::plan::Plan;
use crate::poses::Pose;
use crate::scene::Scene;
use crate::topology::JointSolver;
use bytemuck::Zeroable;
use glam::{Quat, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Collects edits for the next step and keeps the description of the scene in step with them.
#[derive(Debug, Clone)]
pub struct Editor {
    scene: Scene,
    plan: Plan,
    records: Vec<EditRecord>,
    /// Impulses and forces of the coming step, by body slot.
    pushes: HashMap<u32, u32>,
    /// Whether something came that the plan may not have yet.
    grown: bool,
    spread: Spread,
    stale: Stale,
    /// Who was at a collider slot before the edits that no step has taken.
    before: HashMap<u32, Option<(ColliderHandle, BodyHandle)>>,
    joints: JointEdits,
}

/// Most impulses and forces on one body in one step: one loop of a shader applies them.
const MAX_PUSHES: u32 = 49_000;

/// What edits mean for a tree over colliders that is kept from step to step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stale {
    /// A collider that is not fixed came or went.
    pub moving: bool,
    /// A fixed one came, went, or was moved.
    pub fixed: bool,
}

/// The edits of one step, grouped by what they change.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EditBatch {
    /// Which trees they make stale.
    pub stale: Stale,
    /// The joints that the step has.
    pub joints: Arc<JointSet>,
    /// Sorted by target, in the order of the calls within one.
    pub records: Vec<EditRecord>,
    /// One for each body or collider that changes.
    pub ranges: Vec<EditRange>,
}

impl Editor {
    /// Takes over a scene whose packed form a backend is about to load.
    pub fn new(scene: Scene) -> Result<(Self, PackedScene)> {
        let packed = PackedScene::new(&scene)?;
        let editor = Self {
            plan: packed.plan,
            spread: Spread::of(&scene),
            scene,
            records: Vec::new(),
            pushes: HashMap::new(),
            grown: false,
            stale: Stale::default(),
            before: HashMap::new(),
            joints: JointEdits::default(),
        };
        Ok((editor, packed))
    }

    /// What the choice of a broad phase rests on: looked at anew when the number of colliders has changed by a quarter, and
    /// its extent every so often ([`LOOK_EVERY`](crate::limits::LOOK_EVERY)).
    pub fn spread(&self) -> &Spread {
        &self.spread
    }

    /// The scene as edited so far. Poses and velocities in it are those at insertion.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Tells how far the middles of colliders lie apart now, as a world has seen it. Backends call it.
    #[doc(hidden)]
    pub fn look(&mut self, extent: Vec3) {
        self.spread = self.spread.across(extent);
    }

    /// What the scene could need when edits were last taken.
    pub fn plan(&self) -> Plan {
        self.plan
    }

    /// Body slots that the next step must have room for.
    pub fn body_slots(&self) -> usize {
        self.scene.bodies.len()
    }

    /// Collider slots that the next step must have room for.
    pub fn collider_slots(&self) -> usize {
        self.scene.colliders.len()
    }

    /// Records that the next step must have room for.
    pub fn edit_count(&self) -> usize {
        self.records.len()
    }

    /// The collider that was at this slot when edits were last taken, and its body.
    #[doc(hidden)]
    pub fn collider_at(&self, slot: u32) -> Option<(ColliderHandle, BodyHandle)> {
        self.before.get(&slot).copied().unwrap_or_else(|| self.scene.collider_at(slot))
    }

    /// Adds a body with its first collider.
    pub fn insert(&mut self, body: RigidBodyBuilder, collider: ColliderBuilder) -> Result<Inserted> {
        let inserted = self.scene.try_insert(body, collider)?;
        self.before.entry(inserted.collider.slot).or_insert(None);
        self.grown = true;
        self.touch(inserted.body, true);
        let PackedBody { state, props, colliders } = pack_body(&self.scene, inserted.body)?;
        let mut spawn = self.props_record(edit_op::SPAWN, inserted.body, &props);
        spawn.kind = state.flags;
        spawn.generation = state.generation;
        self.records.push(spawn);
        let builder = self.scene.body(inserted.body)?;
        let (translation, rotation) = (builder.translation, builder.rotation.normalize());
        self.push(edit_op::POSE, inserted.body, translation.extend(0.0).to_array(), rotation.to_array());
        self.push(edit_op::VELOCITY, inserted.body, pad(state.linear_velocity), pad(state.angular_velocity));
        for (slot, collider) in colliders {
            self.push_collider(edit_op::COLLIDER, slot, &collider);
        }
        Ok(inserted)
    }

    /// Adds a further collider to a body; mass and inertia follow, the body's own frame and motion stay. Its contacts
    /// are found anew.
    pub fn attach(&mut self, body: BodyHandle, collider: ColliderBuilder) -> Result<ColliderHandle> {
        let before = pack_body(&self.scene, body)?.props;
        let handle = self.scene.attach(body, collider)?;
        self.before.entry(handle.slot).or_insert(None);
        self.grown = true;
        self.joints.changed(self.scene.joints_of(body)?);
        self.touch(body, true);
        self.restore_props(body, &before);
        let PackedBody { props, colliders, .. } = pack_body(&self.scene, body)?;
        let mut record = self.props_record(edit_op::PROPS, body, &props);
        record.data[5] = pad(before.center_of_mass).map(f32::to_bits);
        record.data[6] = before.frame.map(f32::to_bits);
        self.records.push(record);
        for (slot, collider) in colliders {
            self.push_collider(edit_op::COLLIDER, slot, &collider);
        }
        Ok(handle)
    }

    /// Joins two bodies: see [`Scene::insert_joint`].
    pub fn insert_joint(&mut self, body1: BodyHandle, body2: BodyHandle, joint: JointBuilder) -> Result<JointHandle> {
        let handle = self.scene.insert_joint(body1, body2, joint)?;
        self.grown = true;
        self.change_joint(handle)?;
        Ok(handle)
    }

    /// Removes a joint.
    pub fn remove_joint(&mut self, joint: JointHandle) -> Result<()> {
        self.change_joint(joint)?;
        self.scene.remove_joint(joint)
    }

    /// Describes a joint anew; what it bears stays, and it stays broken if it is.
    pub fn set_joint(&mut self, joint: JointHandle, builder: JointBuilder) -> Result<()> {
        self.scene.set_joint(joint, builder)?;
        self.change_joint(joint)
    }

    /// Gives an axis of a joint another motor, or none.
    pub fn set_joint_motor(&mut self, joint: JointHandle, axis: JointAxis, motor: Option<JointMotor>) -> Result<()> {
        let mut builder = self.scene.joint(joint)?.clone();
        builder.motors[axis as usize] = motor;
        self.set_joint(joint, builder)
    }

    /// Takes down that the joint is another one, and wakes its bodies.
    fn change_joint(&mut self, joint: JointHandle) -> Result<()> {
        for body in self.scene.joined(joint)? {
            self.wake(body)?;
        }
        self.joints.changed(&[joint]);
        Ok(())
    }

    /// Removes a body with its colliders, contacts and joints.
    pub fn remove(&mut self, body: BodyHandle) -> Result<()> {
        for joint in self.scene.joints_of(body)?.to_vec() {
            self.change_joint(joint)?;
        }
        let handles: Vec<_> = self.scene.colliders_of(body)?.into_iter().map(|(handle, _)| handle).collect();
        handles.iter().for_each(|&handle| _ = self.before.entry(handle.slot).or_insert(Some((handle, body))));
        let colliders: Vec<_> = handles.into_iter().map(ColliderHandle::slot).collect();
        self.touch(body, true);
        self.scene.remove(body)?;
        self.push(edit_op::REMOVE, body, [0.0; 4], [0.0; 4]);
        for slot in colliders {
            self.push_collider(edit_op::COLLIDER_REMOVE, slot, &Collider { body: body.slot, ..Collider::zeroed() });
        }
        Ok(())
    }

    /// Puts the body's own frame somewhere else.
    pub fn set_pose(&mut self, body: BodyHandle, pose: Pose) -> Result<()> {
        self.scene.entry(body)?;
        self.push_pose(edit_op::POSE, body, pose)
    }

    /// Where a body of [`RigidBodyBuilder::kinematic_position_based`] is to be at the end of the next step: its own frame.
    /// Within the step it has the velocity that leads there: the way over `dt`, and the turn, of no more than pi, over `dt`.
    /// Contacts see it, and [`Velocities`](crate::Velocities) tell it. In steps for which nothing is set it stands still.
    ///
    /// Of several for one step the last one counts. A velocity beyond 1e9 (m/s, rad/s) puts the body in quarantine; to
    /// put it somewhere at once, without a velocity, take [`set_pose`](Self::set_pose).
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) for a body of another type, a translation beyond 1e7 m or not finite, and a
    /// rotation that is none; [`Error::StaleBody`](crate::Error::StaleBody).
    pub fn set_next_kinematic_pose(&mut self, body: BodyHandle, pose: Pose) -> Result<()> {
        let kind = self.scene.body(body)?.body_type;
        const KIND: &str = "KinematicPositionBased (`RigidBodyBuilder::kinematic_position_based`); others are put somewhere \
                            by `set_pose`";
        check(kind == RigidBodyType::KinematicPositionBased, || body.to_string(), "body_type", kind, KIND)?;
        self.push_pose(edit_op::NEXT_POSE, body, pose)
    }

    /// Sets the velocity of the centre of mass (m/s) and the angular velocity (rad/s, world axes). A kinematic body that is
    /// moved by poses keeps it for one step.
    pub fn set_velocity(&mut self, body: BodyHandle, linear: Vec3, angular: Vec3) -> Result<()> {
        self.scene.entry(body)?;
        check_speed(linear, || body.to_string(), "linear velocity")?;
        check_speed(angular, || body.to_string(), "angular velocity")?;
        self.push(edit_op::VELOCITY, body, pad(linear.to_array()), pad(angular.to_array()));
        Ok(())
    }

    /// Adds an impulse (N s) at the centre of mass.
    pub fn apply_impulse(&mut self, body: BodyHandle, impulse: Vec3) -> Result<()> {
        self.act(edit_op::IMPULSE, body, "impulse", impulse, Vec3::ZERO)
    }

    /// Adds an angular impulse (N m s).
    pub fn apply_torque_impulse(&mut self, body: BodyHandle, impulse: Vec3) -> Result<()> {
        self.act(edit_op::IMPULSE, body, "torque impulse", Vec3::ZERO, impulse)
    }

    /// Adds an impulse (N s) at a point of the world.
    pub fn apply_impulse_at_point(&mut self, body: BodyHandle, impulse: Vec3, point: Vec3) -> Result<()> {
        self.act(edit_op::IMPULSE_AT, body, "impulse at a point", impulse, point)
    }

    /// Adds a force (N) at the centre of mass, for the next step alone.
    pub fn add_force(&mut self, body: BodyHandle, force: Vec3) -> Result<()> {
        self.act(edit_op::FORCE, body, "force", force, Vec3::ZERO)
    }

    /// Adds a torque (N m), for the next step alone.
    pub fn add_torque(&mut self, body: BodyHandle, torque: Vec3) -> Result<()> {
        self.act(edit_op::FORCE, body, "torque", Vec3::ZERO, torque)
    }

    /// Adds a force (N) at a point of the world, for the next step alone.
    pub fn add_force_at_point(&mut self, body: BodyHandle, force: Vec3, point: Vec3) -> Result<()> {
        self.act(edit_op::FORCE_AT, body, "force at a point", force, point)
    }

    /// Changes gravity, m/s².
    pub fn set_gravity(&mut self, gravity: Vec3) -> Result<()> {
        check(
            gravity.is_finite() && gravity.length() <= 1e6,
            || "Scene".into(),
            "gravity",
            gravity.to_array(),
            "finite numbers up to 1e6 m/s²",
        )?;
        self.scene.gravity = gravity;
        Ok(())
    }

    /// Wakes a body and all that sleep with it. Every other edit of a body does so too, and that of gravity wakes all; one
    /// that sleeps again does so after the usual time.
    pub fn wake(&mut self, body: BodyHandle) -> Result<()> {
        self.scene.entry(body)?;
        self.push(edit_op::WAKE, body, [0.0; 4], [0.0; 4]);
        Ok(())
    }

    /// Puts a body in quarantine by hand: it stands still, as if fixed, until it is removed.
    #[doc(hidden)]
    pub fn freeze(&mut self, body: BodyHandle) -> Result<()> {
        self.scene.entry(body)?;
        self.push(edit_op::FREEZE, body, [0.0; 4], [0.0; 4]);
        Ok(())
    }

    /// Test hook: sets a velocity without looking at it.
    #[doc(hidden)]
    pub fn poison(&mut self, body: BodyHandle, linear: Vec3, angular: Vec3) -> Result<()> {
        self.scene.entry(body)?;
        self.push(edit_op::VELOCITY, body, pad(linear.to_array()), pad(angular.to_array()));
        Ok(())
    }

    /// Hands over the edits since the last call, for the step that begins now.
    pub fn take(&mut self, joint_solver: JointSolver) -> EditBatch {
        self.pushes.clear();
        self.before.clear();
        if std::mem::take(&mut self.grown) {
            let needed = Plan::of(&self.scene);
            self.plan.widen(&needed);
        }
        let (count, before) = (self.scene.collider_count() as u64, u64::from(self.spread.all));
        if 4 * count > 5 * before || 2 * count < before {
            self.spread = Spread::of(&self.scene);
        }
        let mut records = std::mem::take(&mut self.records);
        records.sort_by_key(target_key);
        let mut ranges: Vec<EditRange> = Vec::new();
        for (i, record) in records.iter().enumerate() {
            match ranges.last_mut() {
                Some(range) if target_key(&records[range.first as usize]) == target_key(record) => range.count += 1,
                _ => ranges.push(EditRange { first: i as u32, count: 1 }),
            }
        }
        let joints = self.joints.set(&self.scene, joint_solver);
        EditBatch { stale: std::mem::take(&mut self.stale), joints, records, ranges }
    }

    /// Takes edits back that were handed over for a step that did not run, before those made since.
    pub fn put_back(&mut self, batch: EditBatch) {
        self.records.splice(..0, batch.records);
        self.stale.moving |= batch.stale.moving;
        self.stale.fixed |= batch.stale.fixed;
    }

    /// Before the first of the body's edits in this step goes a record of its properties, where there is none yet: a
    /// step that is run again finds those that the later edits left.
    fn restore_props(&mut self, body: BodyHandle, props: &BodyProps) {
        let own = |record: &EditRecord| record.op < edit_op::COLLIDER && record.target == body.slot;
        let begins = |record: &EditRecord| matches!(record.op, edit_op::SPAWN | edit_op::PROPS);
        if let Some(first) = self.records.iter().position(own)
            && !self.records.iter().any(|record| own(record) && begins(record))
        {
            let record = EditRecord { kind: 1, ..self.props_record(edit_op::PROPS, body, props) };
            self.records.insert(first, record);
        }
    }

    fn act(&mut self, op: u32, body: BodyHandle, field: &'static str, a: Vec3, b: Vec3) -> Result<()> {
        self.scene.entry(body)?;
        check_finite(a, || body.to_string(), field)?;
        check_finite(b, || body.to_string(), field)?;
        let count = self.pushes.entry(body.slot).or_insert(0);
        *count += 1;
        const MOST: &str = "up to 49,000 impulses and forces on one body in one step: add them up first";
        check(*count <= MAX_PUSHES, || body.to_string(), field, *count, MOST)?;
        self.push(op, body, pad(a.to_array()), pad(b.to_array()));
        Ok(())
    }

    /// An edit of this body; `members` when its colliders come or go.
    fn touch(&mut self, body: BodyHandle, members: bool) {
        match self.scene.body(body) {
            Ok(builder) if builder.body_type == RigidBodyType::Fixed => self.stale.fixed = true,
            _ => self.stale.moving |= members,
        }
    }

    fn push_pose(&mut self, op: u32, body: BodyHandle, pose: Pose) -> Result<()> {
        check_position(pose.translation, || body.to_string(), "translation")?;
        check_rotation(pose.rotation, || body.to_string(), "rotation")?;
        self.push(op, body, pose.translation.extend(0.0).to_array(), pose.rotation.normalize().to_array());
        Ok(())
    }

    fn push(&mut self, op: u32, body: BodyHandle, a: [f32; 4], b: [f32; 4]) {
        self.touch(body, false);
        let zero = [0; 4];
        self.records.push(EditRecord {
            op,
            target: body.slot,
            kind: 0,
            generation: 0,
            data: [a.map(f32::to_bits), b.map(f32::to_bits), zero, zero, zero, zero, zero],
        });
    }

    fn props_record(&self, op: u32, body: BodyHandle, props: &BodyProps) -> EditRecord {
        let words: [[u32; 4]; 5] = bytemuck::cast(*props);
        let mut record = EditRecord { op, target: body.slot, ..EditRecord::zeroed() };
        record.data[..5].copy_from_slice(&words);
        record
    }

    fn push_collider(&mut self, op: u32, slot: usize, collider: &Collider) {
        let words: [[u32; 4]; 6] = bytemuck::cast(*collider);
        let mut record = EditRecord { op, target: slot as u32, ..EditRecord::zeroed() };
        record.data[..6].copy_from_slice(&words);
        self.records.push(record);
    }
}

fn target_key(record: &EditRecord) -> (bool, u32) {
    (record.op >= edit_op::COLLIDER, record.target)
}

fn pad(v: [f32; 3]) -> [f32; 4] {
    [v[0], v[1], v[2], 0.0]
}

/// The identity, for callers that need a rotation to go with a translation.
impl From<Vec3> for Pose {
    fn from(translation: Vec3) -> Self {
        Self { translation, rotation: Quat::IDENTITY }
    }
}
