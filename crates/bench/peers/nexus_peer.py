"""nexus (dimforge's GPU physics) as a peer of the bench, without a window. Needs `pip install dimforge-nexus3d`
(made with 0.3.0); see protocol.py.

On a software adapter the very first run of a machine compiles for minutes; Mesa keeps the result in its cache, and
later runs start in seconds. `load` therefore runs small scenes and the scene itself for a few steps, throws them away,
and builds the scene anew (`warm_ms`).

Options: whatever `NexusState.set_rbd_solver_params` takes, for instance {"friction_model": "simplified"}.
"""

import ctypes
import importlib.metadata
import math
import os
import time

import nexus3d

from protocol import (
    finite_lists, frictions, named_options, not_modelled, quat_between, quat_mul, read_scene, Refused, rotate, serve,
    timed,
)

# Pairs that the buffers hold for each collider: six times what a pile of 1,000 boxes has (2.6 a body). nexus grows full
# buffers, but a step or more late and without a word; this keeps it from having to.
PAIRS_PER_COLLIDER = 16
FLOOR_THICKNESS = 20.0
WARM_STEPS = 4
FRICTION = {
    "coulomb": "friction at each point (default); a sliding box sees 0.87 to 1 of the coefficient, by direction",
    "simplified": "friction at the middle of a contact, with twist, as in Rapier; not nexus's default",
}


class Engine:
    def __init__(self):
        self.viewer = None
        self.threads = None

    def load(self, gravity, bodies, dt, substeps, threads, options, half_space_edge):
        start = time.perf_counter()
        side = half_space_edge or reach(bodies)
        self.open(threads)
        for scene in (small_scene(), wide_scene()) if self.first else ():
            self.build(*read_scene(scene), 1 / 60, 4, {}, 100)
            self.step(WARM_STEPS)
        self.first = False
        self.build(gravity, bodies, dt, substeps, options, side)
        self.step(WARM_STEPS)
        warm = time.perf_counter()
        self.build(gravity, bodies, dt, substeps, options, side)
        poses = self.state_api.read_body_poses(self.viewer)
        if len(poses[0]) < len(self.slots) - self.slots.count(None):
            raise Refused(f"nexus holds {len(poses[0])} bodies of {len(bodies)}; try fewer")
        return {
            "engine": "nexus", "version": importlib.metadata.version("dimforge-nexus3d"), "adapter": adapters(),
            "differs": self.differs(bodies, threads, options, side), "mass": None,
            "load_ms": (time.perf_counter() - start) * 1e3, "warm_ms": (warm - start) * 1e3,
        }

    def open(self, threads):
        """Takes the adapter, once a process: the software adapter reads its number of threads there."""
        if self.viewer is not None:
            if threads != self.threads:
                raise Refused(
                    f"threads {threads}: the adapter already runs with {self.threads}; start a new process for each"
                )
            return
        if threads > 0:
            os.environ["LP_NUM_THREADS"] = str(threads)
        viewer = nexus3d.NexusViewer(64, 64, True)
        viewer.with_backend("webgpu")
        viewer.init_backend()
        self.pipeline = nexus3d.NexusPipeline()
        self.pipeline.preload_pipelines(viewer)
        self.viewer, self.threads, self.first = viewer, threads, True

    def build(self, gravity, bodies, dt, substeps, options, side):
        state = nexus3d.NexusState()
        colliders = sum(len(b["colliders"]) for b in bodies)
        state.set_rbd_collisions_capacity(max(4096, PAIRS_PER_COLLIDER * colliders))
        state.set_rbd_timestep(dt, substeps)
        state.set_rbd_solver_params(**options)
        handles = [add_body(state, body, f"body {i}", side) for i, body in enumerate(bodies)]
        state.finalize(self.viewer)
        # Before `finalize` this does nothing, and says nothing.
        state.set_rbd_gravity(self.viewer, vec3(gravity))
        self.state_api = state
        self.slots = [state.body_gpu_index(0, handle) for handle in handles]
        self.poses = [b["translation"] + b["rotation"] for b in bodies]

    def differs(self, bodies, threads, options, side):
        p = self.state_api.rbd_solver_params()
        out = [
            "no gyroscopic torque on free bodies: angular velocity stays without torque",
            FRICTION[p["friction_model"]],
            f"soft contacts at nexus's defaults: {p['contact_natural_frequency']:g} Hz, damping ratio "
            f"{p['contact_damping_ratio']:g} (static: {p['static_contact_natural_frequency']:g} Hz, "
            f"{p['static_contact_damping_ratio']:g}), {p['internal_pgs_iterations']} iteration a "
            f"sub-step, friction in it: {p['friction_in_bias_pass']}",
            f"penetration up to {p['allowed_linear_error'] * 1e3:.3g} mm is left, contacts exist from "
            f"{p['prediction_distance'] * 1e3:.3g} mm, recovery at most {p['max_corrective_velocity']:g} m/s",
            f"deterministic mode {self.state_api.deterministic()} (default): runs "
            "may differ",
            f"room for {PAIRS_PER_COLLIDER} pairs a collider, 4,096 at least; nexus grows it, but reports no overflow",
            "a step's time holds one read-back of all poses, so that the result is there",
        ]
        if any(c["shape"][0] == "halfspace" for b in bodies for c in b["colliders"]):
            out.append(
                f"half-spaces are boxes, {FLOOR_THICKNESS:g} m thick and {2 * side:.0f} m wide, top face exact"
            )
        if len(frictions(bodies)) > 1:
            out.append("friction coefficients differ: of a pair nexus takes the mean")
        if threads > 0:
            out.append(f"threads are those of Mesa's software adapter (LP_NUM_THREADS={threads}); a GPU ignores it")
        return out + named_options(options)

    def advance(self):
        self.pipeline.simulate(self.viewer, self.state_api)
        self.state_api.read_body_poses(self.viewer)

    def step(self, count):
        return timed(self.advance, count)

    def state(self):
        positions, quaternions = self.state_api.read_body_poses(self.viewer)
        linear, angular = self.state_api.read_body_velocities(self.viewer)
        rows = {"translation": [], "rotation": [], "linvel": [], "angvel": []}
        for slot, pose in zip(self.slots, self.poses):
            held = slot is not None
            rows["translation"].append(positions[slot] if held else pose[:3])
            rows["rotation"].append(quaternions[slot][[1, 2, 3, 0]] if held else pose[3:])
            rows["linvel"].append(linear[slot] if held else [0, 0, 0])
            rows["angvel"].append(angular[slot] if held else [0, 0, 0])
        return {key: finite_lists(value) for key, value in rows.items()}


def add_body(state, body, where, side):
    if body["linear_damping"] or body["angular_damping"]:
        raise not_modelled(where, "damping", "set it to 0")
    moving = body["type"] == "dynamic"
    if moving and body["gravity_scale"] != 1:
        raise not_modelled(where, "gravity_scale (nexus ignores it on free bodies)", "set it to 1")
    if not moving and (any(body["linvel"]) or any(body["angvel"])):
        raise not_modelled(where, "a body that moves without mass (nexus holds it still)", "leave it out")
    builder = nexus3d.RigidBodyBuilder.dynamic() if moving else nexus3d.RigidBodyBuilder.fixed()
    pose = nexus3d.Pose.from_parts(vec3(body["translation"]), nexus3d.Quat.from_xyzw(*body["rotation"]))
    builder = builder.pose(pose).linvel(vec3(body["linvel"])).angvel(vec3(body["angvel"])).can_sleep(False)
    handle = state.insert_body(builder.build(), nexus3d.RbdCoupling.NONE)
    for collider in body["colliders"]:
        state.insert_collider_in(0, build_collider(collider, side), handle)
    return handle


def build_collider(collider, side):
    kind, value = collider["shape"]
    translation, rotation = collider["translation"], collider["rotation"]
    if kind == "ball":
        builder = nexus3d.ColliderBuilder.ball(value)
    elif kind == "cuboid":
        builder = nexus3d.ColliderBuilder.cuboid(*value)
    else:
        # A box whose top face is the plane.
        depth = FLOOR_THICKNESS / 2
        builder = nexus3d.ColliderBuilder.cuboid(side, depth, side)
        down = rotate(rotation, [-depth * x for x in value])
        translation = [t + d for t, d in zip(translation, down)]
        rotation = quat_mul(rotation, quat_between([0, 1, 0], value))
    builder = builder.translation(vec3(translation)).rotation(vec3(scaled_axis(rotation)))
    builder = builder.friction(collider["friction"]).restitution(collider["restitution"])
    if collider["mass"] is None:
        return builder.density(collider["density"]).build()
    return builder.mass(collider["mass"]).build()


def reach(bodies):
    """Half the side of a box that stands for a half-space: beyond every body by as much again, and 100 m."""
    return 100 + 2 * max((math.hypot(*b["translation"]) for b in bodies), default=0)


def vec3(v):
    return nexus3d.vec3(*v)


def scaled_axis(q):
    """The rotation vector (axis times angle) of a quaternion x, y, z, w."""
    sine = math.hypot(*q[:3])
    if sine == 0:
        return [0.0, 0.0, 0.0]
    angle = 2 * math.atan2(sine, q[3])
    return [x / sine * angle for x in q[:3]]


def small_scene():
    return wall(3, 1)


def wide_scene():
    """Enough colliders and pairs for the kernels of large scenes (from 64 colliders and 128 pairs on)."""
    return wall(3, 80)


def wall(height, width):
    """Towers of boxes, a ball on each, on a floor: every pair of shapes that scenes have."""
    def body(x, y, shape):
        return {"translation": [x, y, 0], "colliders": [{"shape": shape}]}

    bodies = [{"type": "fixed", "colliders": [{"shape": {"halfspace": {"normal": [0, 1, 0]}}}]}]
    for x in range(width):
        bodies += [body(x, y + 0.5, {"cuboid": {"half_extents": [0.5, 0.5, 0.5]}}) for y in range(height)]
        bodies.append(body(x, height + 0.5, {"ball": {"radius": 0.5}}))
    bodies.append(body(-2, 0.5, {"ball": {"radius": 0.5}}))
    return {"gravity": [0, -9.81, 0], "bodies": bodies}


def adapters():
    """Names of the Vulkan devices of this machine: nexus does not say which it took, and mostly there is one."""
    try:
        vulkan = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return "unknown: no libvulkan.so.1 to ask"
    # VkInstanceCreateInfo: type 1, then nothing asked for.
    create = (ctypes.c_uint64 * 8)(1)
    instance = ctypes.c_void_p()
    if vulkan.vkCreateInstance(create, None, ctypes.byref(instance)) != 0:
        return "unknown: Vulkan gave no instance"
    count = ctypes.c_uint32()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    devices = (ctypes.c_void_p * count.value)()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), devices)
    names = []
    for device in devices[: count.value]:
        # VkPhysicalDeviceProperties (824 bytes): five numbers, then the name of at most 256 bytes.
        properties = ctypes.create_string_buffer(4096)
        vulkan.vkGetPhysicalDeviceProperties(ctypes.c_void_p(device), properties)
        names.append(properties.raw[20:276].split(b"\0")[0].decode())
    vulkan.vkDestroyInstance(instance, None)
    return " or ".join(names) or "unknown: Vulkan lists no device"


if __name__ == "__main__":
    serve(Engine)
    # Ends without Python's teardown, in which the GPU's thread-locals may abort.
    os._exit(0)
