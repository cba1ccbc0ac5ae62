"""MuJoCo as a peer of the bench. Needs `pip install mujoco` (made with 3.17.0 and 4.0.0); see protocol.py.

Options: "cone", "elliptic" (taken here) or "pyramidal" (MuJoCo's default: stiffer, but along the diagonals of its
axes friction is 71 % of what was asked); "timeconst", seconds, of the contacts' spring (default 0.02; MuJoCo takes at
least two steps).
"""

import time

import mujoco
import numpy as np

from protocol import (
    check_options, finite_lists, frictions, named_options, not_modelled, quat_between, quat_mul, Refused, serve, timed,
)

# Full warnings: contacts or rows that found no room. The others tell of bad numbers, which the state shows as null.
DROPPED = (mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL)


CONES = {"elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC, "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL}
OPTIONS = ("cone", "timeconst")


def wxyz(q):
    return [q[3], q[0], q[1], q[2]]


class Engine:
    def load(self, gravity, bodies, dt, substeps, threads, options, _half_space_edge):
        start = time.perf_counter()
        spec = mujoco.MjSpec()
        spec.option.timestep = dt / substeps
        spec.option.gravity = gravity
        # The cone is round, as in the other engines; MuJoCo's own default is a pyramid inside it.
        check_options(options, OPTIONS)
        spec.option.cone = CONES[options.get("cone", "elliptic")]
        # A state that blows up is to be seen, not put back to the start.
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        # Reserved, not touched, until contacts and rows need it; overflow is an error in `step`.
        spec.memory = max(256 << 20, len(bodies) << 20)
        for i, body in enumerate(bodies):
            add_body(spec.worldbody, body, f"body {i}", options.get("timeconst", 0.02))
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        if threads > 1:
            mujoco.mju_threadpool(self.data, threads)
        self.substeps = substeps

        self.moving = np.array([i for i, b in enumerate(bodies) if b["type"] == "dynamic"], dtype=int)
        self.translation = np.array([b["translation"] for b in bodies], dtype=float).reshape(-1, 3)
        self.rotation = np.array([b["rotation"] for b in bodies], dtype=float).reshape(-1, 4)
        # Body 0 is the world.
        self.centre = self.model.body_ipos[1 + self.moving]
        velocity = np.array([bodies[i]["linvel"] + bodies[i]["angvel"] for i in self.moving]).reshape(-1, 6)
        orientation = self.matrices()
        spin = velocity[:, 3:]
        # A free joint's speed is that of the frame's origin in world axes, its spin is in the body's axes.
        arm = np.einsum("nij,nj->ni", orientation, self.centre)
        self.qvel()[:, :3] = velocity[:, :3] - np.cross(spin, arm)
        self.qvel()[:, 3:] = np.einsum("nji,nj->ni", orientation, spin)
        mujoco.mj_forward(self.model, self.data)
        return {
            "engine": "mujoco", "version": mujoco.__version__, "adapter": f"CPU, {max(threads, 1)} threads",
            "differs": self.differs(bodies, dt, substeps, threads, options), "mass": float(self.model.body_mass.sum()),
            "load_ms": (time.perf_counter() - start) * 1e3, "warm_ms": 0.0,
        }

    def differs(self, bodies, dt, substeps, threads, options):
        h = dt / substeps
        timeconst = options.get("timeconst", 0.02)
        out = [
            f"no sub-steps: {substeps} full steps of {h:.6g} s each, with collision in each",
            "double precision; the others compute in single",
            "one implicit problem of all contacts, Newton to 1e-8 or 100 iterations (defaults), not sweeps",
            f"soft contacts (solref {timeconst:g} 1, solimp 0.9 0.95 0.001; defaults are 0.02 1 and the same): time "
            f"constant {max(timeconst, 2 * h):.4g} s, not below 2 steps; it sets how deep resting contacts sink, not "
            "the number of steps; friction creeps",
            "convex contacts: a body that slides fast is lifted a little by friction, and may hop",
            "impratio 1, no-slip iterations 0 (defaults)",
            "no contact margin: a contact exists only once the shapes touch",
            "integrator Euler (default): gyroscopic torque is taken at the step's start",
        ]
        if options.get("cone", "elliptic") == "elliptic":
            out.append("friction cone elliptic, round as in the other engines; MuJoCo's default is a pyramid inside it")
        if np.abs(self.centre).max(initial=0) > 1e-9:
            out.append("bodies whose frame is not at the centre of mass: Euler's method drifts (freejoint align off)")
        if len(frictions(bodies)) > 1:
            out.append("friction coefficients differ: of a pair MuJoCo takes the larger")
        if threads > 1:
            out.append("thread pool on, which MuJoCo leaves off by default: contacts and islands are shared out")
        return out + named_options(options)

    def qvel(self):
        return self.data.qvel.reshape(-1, 6)

    def matrices(self):
        w, x, y, z = self.data.qpos.reshape(-1, 7)[:, 3:].T
        return np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]).transpose(2, 0, 1)

    def step(self, count):
        ms = timed(lambda: mujoco.mj_step(self.model, self.data, self.substeps), count)
        for kind in DROPPED:
            if self.data.warning[kind].number:
                raise Refused(f"{kind.name}: contacts or rows were dropped, so results are void; raise spec.memory")
        return ms

    def state(self):
        qpos, qvel = self.data.qpos.reshape(-1, 7), self.qvel()
        orientation = self.matrices()
        spin = np.einsum("nij,nj->ni", orientation, qvel[:, 3:])
        arm = np.einsum("nij,nj->ni", orientation, self.centre)
        velocity = np.zeros((len(self.translation), 6))
        velocity[self.moving] = np.hstack([qvel[:, :3] + np.cross(spin, arm), spin])
        self.translation[self.moving] = qpos[:, :3]
        self.rotation[self.moving] = qpos[:, [4, 5, 6, 3]]
        return {
            "translation": finite_lists(self.translation), "rotation": finite_lists(self.rotation),
            "linvel": finite_lists(velocity[:, :3]), "angvel": finite_lists(velocity[:, 3:]),
        }


def add_body(world, body, where, timeconst):
    if body["type"] == "kinematic" and (any(body["linvel"]) or any(body["angvel"])):
        raise not_modelled(where, "a kinematic body that moves (mocap bodies have no velocity)", "leave it out")
    if body["linear_damping"] or body["angular_damping"]:
        raise not_modelled(where, "damping as a rate (MuJoCo damps by force)", "set it to 0")
    frame = world.add_body(pos=body["translation"], quat=wxyz(body["rotation"]))
    if body["type"] == "dynamic":
        frame.add_freejoint(align=0)
        frame.gravcomp = 1 - body["gravity_scale"]
    for k, collider in enumerate(body["colliders"]):
        kind, value = collider["shape"]
        if collider["restitution"]:
            raise not_modelled(f"{where}, collider {k}", "restitution", "set it to 0 or skip this engine")
        rotation = collider["rotation"]
        if kind == "ball":
            kind, size = mujoco.mjtGeom.mjGEOM_SPHERE, [value, 0, 0]
        elif kind == "cuboid":
            kind, size = mujoco.mjtGeom.mjGEOM_BOX, value
        else:
            # A plane without end; its normal is its z axis, the third number only the drawn grid.
            kind, size = mujoco.mjtGeom.mjGEOM_PLANE, [0, 0, 1]
            rotation = quat_mul(rotation, quat_between([0, 0, 1], value))
        geom = frame.add_geom(
            type=kind, size=size, pos=collider["translation"], quat=wxyz(rotation),
            friction=[collider["friction"], 0.005, 0.0001], solref=[timeconst, 1],
        )
        if collider["mass"] is None:
            geom.density = collider["density"]
        else:
            geom.mass = collider["mass"]


if __name__ == "__main__":
    serve(Engine)
