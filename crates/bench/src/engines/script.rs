//! Engines with a Python wheel, nexus and MuJoCo, each in a process of its own: one line of JSON asks, one answers
//! (`peers/protocol.py` tells the words). The process times its steps itself, so that the pipe costs nothing, and serves
//! one scene after the other, since its start takes seconds.

use super::{Engine, Facts, Means, Refusal, Setting, half_space_edge};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tumble_core::{BodyHandle, ColliderBuilder, Pose, Poses, RigidBodyType, Scene, Shape, Velocities, Velocity};

const PROTOCOL: &str = include_str!("../../peers/protocol.py");
const NEXUS: &str = include_str!("../../peers/nexus_peer.py");
const MUJOCO: &str = include_str!("../../peers/mujoco_peer.py");

/// A process that runs one of the programs.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

/// Processes that wait for a scene, by program.
pub(super) type Idle = Arc<Mutex<Vec<(&'static str, Process)>>>;

/// A process that holds a scene.
pub(super) struct Script {
    program: &'static str,
    process: Option<Process>,
    idle: Idle,
    bodies: Vec<BodyHandle>,
    facts: Facts,
}

pub(super) fn has_nexus(means: &Means) -> Result<(), String> {
    has_wheel(means, "nexus3d", "dimforge-nexus3d")
}

pub(super) fn has_mujoco(means: &Means) -> Result<(), String> {
    has_wheel(means, "mujoco", "mujoco")
}

/// Whether the interpreter has the module that `wheel` brings.
fn has_wheel(means: &Means, module: &str, wheel: &str) -> Result<(), String> {
    let python = means.python.as_ref().ok_or("no --python was given")?;
    let told = Command::new(python).args(["-c", &format!("import numpy, {module}")]).output();
    match told {
        Ok(output) if output.status.success() => Ok(()),
        Ok(_) => Err(format!("{} cannot import {module}: pip install {wheel} numpy", python.display())),
        Err(error) => Err(format!("{}: {error}", python.display())),
    }
}

pub(super) fn nexus(scene: &Scene, setting: &Setting, means: &Means) -> Result<Box<dyn Engine>, Refusal> {
    load(scene, setting, means, NEXUS, "default", json!({}))
}

pub(super) fn mujoco(scene: &Scene, setting: &Setting, means: &Means) -> Result<Box<dyn Engine>, Refusal> {
    load(scene, setting, means, MUJOCO, "default", json!({}))
}

/// Contacts as stiff as MuJoCo lets them be: a time constant of two of its steps.
pub(super) fn stiff_mujoco(scene: &Scene, setting: &Setting, means: &Means) -> Result<Box<dyn Engine>, Refusal> {
    let step = f64::from(setting.dt) / f64::from(setting.substeps);
    load(scene, setting, means, MUJOCO, "stiff", json!({"timeconst": 2.0 * step}))
}

fn load(
    scene: &Scene,
    setting: &Setting,
    means: &Means,
    program: &'static str,
    solver: &str,
    options: Value,
) -> Result<Box<dyn Engine>, Refusal> {
    super::without_joints(scene)?;
    let idle = means.idle.clone();
    let waiting = {
        let mut idle = lock(&idle);
        idle.iter().position(|(name, _)| *name == program).map(|i| idle.swap_remove(i).1)
    };
    let process = match waiting {
        Some(process) => process,
        None => Process::start(means, program).map_err(Refusal::Failed)?,
    };
    let bodies = scene.bodies().collect();
    let mut script = Script { program, process: Some(process), idle, bodies, facts: Facts::default() };
    let load = json!({
        "op": "load", "scene": scene_json(scene), "dt": setting.dt, "substeps": setting.substeps,
        "threads": setting.threads, "half_space_edge": half_space_edge(scene), "options": options,
    });
    let told = script.ask(&load).map_err(|error| match error.strip_prefix("not modelled: ") {
        Some(what) => Refusal::Unmodelled(what.into()),
        None => Refusal::Failed(error),
    })?;
    let text = |key: &str| told[key].as_str().unwrap_or_default().to_owned();
    let differs =
        told["differs"].as_array().map(|list| list.iter().filter_map(Value::as_str).map(Into::into).collect());
    script.facts = Facts {
        version: text("version"),
        adapter: text("adapter"),
        solver: solver.into(),
        differs: differs.unwrap_or_default(),
        ..Facts::default()
    };
    Ok(Box::new(script))
}

/// What a panic elsewhere left is as good as before.
fn lock(idle: &Idle) -> MutexGuard<'_, Vec<(&'static str, Process)>> {
    idle.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Process {
    fn start(means: &Means, program: &str) -> Result<Self, String> {
        let python = means.python.clone().unwrap_or_else(|| PathBuf::from("python3"));
        // Both texts as a module each, without a file: this program may run where its sources are not. A string in JSON
        // is one in Python too.
        let (protocol, main) = (json!(PROTOCOL), json!(program));
        let both = format!(
            "import sys, types\nm = types.ModuleType('protocol')\nexec({protocol}, m.__dict__)\n\
             sys.modules['protocol'] = m\nexec(compile({main}, 'peer.py', 'exec'), {{'__name__': '__main__'}})\n"
        );
        let mut child = Command::new(&python)
            .args(["-u", "-c", &both])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("{}: {error}", python.display()))?;
        let requests = child.stdin.take();
        let answers = BufReader::new(child.stdout.take().ok_or("its output is no pipe")?);
        Ok(Self { child, requests, answers })
    }

    /// Asks, waits for the answer.
    fn ask(&mut self, request: &Value) -> Result<Value, String> {
        let pipe = self.requests.as_mut().ok_or("it has ended")?;
        writeln!(pipe, "{request}").and_then(|()| pipe.flush()).map_err(|error| format!("it has ended: {error}"))?;
        let mut line = String::new();
        let read = self.answers.read_line(&mut line).map_err(|error| error.to_string())?;
        if read == 0 {
            return Err("it ended without an answer".into());
        }
        serde_json::from_str(&line).map_err(|error| format!("no JSON ({error}): {line}"))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The end of its input ends it.
        self.requests = None;
        let _ = self.child.wait();
    }
}

impl Script {
    /// Asks, waits for the answer. An answer with `error` in it is an error; a process that does not answer is let go.
    fn ask(&mut self, request: &Value) -> Result<Value, String> {
        let process = self.process.as_mut().ok_or("it has ended")?;
        match process.ask(request) {
            Ok(answer) => match answer["error"].as_str() {
                Some(error) => Err(error.into()),
                None => Ok(answer),
            },
            Err(error) => {
                self.process = None;
                Err(error)
            }
        }
    }
}

impl Engine for Script {
    fn step(&mut self, count: u32) -> Result<Vec<f64>, String> {
        let answer = self.ask(&json!({"op": "step", "count": count}))?;
        let times = answer["ms"].as_array().ok_or("no times came")?;
        Ok(times.iter().filter_map(Value::as_f64).collect())
    }

    fn state(&mut self) -> Result<(Poses, Velocities), String> {
        let answer = self.ask(&json!({"op": "state"}))?;
        let row = |key: &str, i: usize, n: usize| -> Vec<f32> {
            // What is not finite comes as null.
            (0..n).map(|k| answer[key][i][k].as_f64().map_or(f32::NAN, |x| x as f32)).collect()
        };
        let vector = |key: &str, i: usize| glam::Vec3::from_slice(&row(key, i, 3));
        let pose = |i: usize| Pose {
            translation: vector("translation", i),
            rotation: glam::Quat::from_slice(&row("rotation", i, 4)),
        };
        let velocity = |i: usize| Velocity { linear: vector("linvel", i), angular: vector("angvel", i) };
        let each = || self.bodies.iter().enumerate();
        let poses = Poses::collect(0, each().map(|(i, &b)| (b, pose(i))));
        Ok((poses, Velocities::collect(0, each().map(|(i, &b)| (b, velocity(i))))))
    }

    fn facts(&mut self) -> Facts {
        self.facts.clone()
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        if let Some(process) = self.process.take() {
            lock(&self.idle).push((self.program, process));
        }
    }
}

fn scene_json(scene: &Scene) -> Value {
    let body = |handle: BodyHandle| {
        let b = scene.body(handle).expect("a living body");
        let colliders = scene.colliders_of(handle).expect("a living body");
        json!({
            "type": match b.body_type {
                RigidBodyType::Fixed => "fixed",
                RigidBodyType::KinematicVelocityBased | RigidBodyType::KinematicPositionBased => "kinematic",
                RigidBodyType::Dynamic => "dynamic",
            },
            "translation": b.translation.to_array(), "rotation": b.rotation.to_array(),
            "linvel": b.linvel.to_array(), "angvel": b.angvel.to_array(), "gravity_scale": b.gravity_scale,
            "linear_damping": b.linear_damping, "angular_damping": b.angular_damping,
            "colliders": colliders.iter().map(|(_, c)| collider_json(c)).collect::<Vec<_>>(),
        })
    };
    json!({"gravity": scene.gravity.to_array(), "bodies": scene.bodies().map(body).collect::<Vec<_>>()})
}

fn collider_json(c: &ColliderBuilder) -> Value {
    let shape = match c.shape {
        Shape::Ball { radius } => json!({"ball": {"radius": radius}}),
        Shape::Cuboid { half_extents } => json!({"cuboid": {"half_extents": half_extents.to_array()}}),
        Shape::HalfSpace { normal } => json!({"halfspace": {"normal": normal.normalize().to_array()}}),
        _ => unreachable!("a shape that the scripts are not told of"),
    };
    json!({
        "shape": shape, "translation": c.translation.to_array(), "rotation": c.rotation.to_array(),
        "density": c.density, "mass": c.mass, "friction": c.friction, "restitution": c.restitution,
    })
}
