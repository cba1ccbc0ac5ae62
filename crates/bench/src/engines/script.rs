//! Engines with a Python wheel, nexus and MuJoCo, each in a process of its own: one line of JSON asks, one answers
//! (`peers/protocol.py` tells the words). The process times its steps itself, so that the pipe costs nothing.

use super::{Engine, Facts, Means, Refusal, Setting, half_space_edge};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use tumble_core::{BodyHandle, ColliderBuilder, Pose, Poses, RigidBodyType, Scene, Shape, Velocities, Velocity};

const PROTOCOL: &str = include_str!("../../peers/protocol.py");
const NEXUS: &str = include_str!("../../peers/nexus_peer.py");
const MUJOCO: &str = include_str!("../../peers/mujoco_peer.py");

/// A process that holds a scene.
struct Script {
    process: Child,
    ask: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
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
    start(scene, setting, means, NEXUS).map(|script| Box::new(script) as Box<dyn Engine>)
}

pub(super) fn mujoco(scene: &Scene, setting: &Setting, means: &Means) -> Result<Box<dyn Engine>, Refusal> {
    start(scene, setting, means, MUJOCO).map(|script| Box::new(script) as Box<dyn Engine>)
}

fn start(scene: &Scene, setting: &Setting, means: &Means, program: &str) -> Result<Script, Refusal> {
    let python = means.python.clone().unwrap_or_else(|| PathBuf::from("python3"));
    // Both texts as a module each, without a file: this program may run where its sources are not. A string in JSON is
    // one in Python too.
    let (protocol, main) = (json!(PROTOCOL), json!(program));
    let both = format!(
        "import sys, types\nm = types.ModuleType('protocol')\nexec({protocol}, m.__dict__)\nsys.modules['protocol'] = m\n\
         exec(compile({main}, 'peer.py', 'exec'), {{'__name__': '__main__'}})\n"
    );
    let mut process = Command::new(&python)
        .args(["-u", "-c", &both])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|error| Refusal::Failed(format!("{}: {error}", python.display())))?;
    let answers = BufReader::new(process.stdout.take().expect("its output is a pipe"));
    let ask = process.stdin.take();
    let bodies = scene.bodies().collect();
    let mut script = Script { process, ask, answers, bodies, facts: Facts::default() };
    let load = json!({
        "op": "load", "scene": scene_json(scene), "dt": setting.dt, "substeps": setting.substeps,
        "threads": setting.threads, "half_space_edge": half_space_edge(scene),
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
        differs: differs.unwrap_or_default(),
        ..Facts::default()
    };
    Ok(script)
}

impl Script {
    /// Asks, waits for the answer. An answer with `error` in it is an error.
    fn ask(&mut self, request: &Value) -> Result<Value, String> {
        let pipe = self.ask.as_mut().ok_or("it has ended")?;
        writeln!(pipe, "{request}").and_then(|()| pipe.flush()).map_err(|error| format!("it has ended: {error}"))?;
        let mut line = String::new();
        let read = self.answers.read_line(&mut line).map_err(|error| error.to_string())?;
        if read == 0 {
            return Err("it ended without an answer".into());
        }
        let answer: Value = serde_json::from_str(&line).map_err(|error| format!("no JSON ({error}): {line}"))?;
        match answer["error"].as_str() {
            Some(error) => Err(error.into()),
            None => Ok(answer),
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
        // The end of its input ends it.
        self.ask = None;
        let _ = self.process.wait();
    }
}

fn scene_json(scene: &Scene) -> Value {
    let body = |handle: BodyHandle| {
        let b = scene.body(handle).expect("a living body");
        let colliders = scene.colliders_of(handle).expect("a living body");
        json!({
            "type": match b.body_type {
                RigidBodyType::Fixed => "fixed",
                RigidBodyType::KinematicVelocityBased => "kinematic",
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
