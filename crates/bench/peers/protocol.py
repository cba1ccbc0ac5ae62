"""What the engine peers of the bench share: the pipe, the scene's shape, quaternions.

One JSON object a line. Requests come on stdin, each gets exactly one line on the stdout that the process was
started with; whatever a library prints goes to stderr.

    {"op":"load","scene":{...},"dt":s,"substeps":n,"threads":t,"options":{}}
        -> {"ok":true,"engine":..,"version":..,"adapter":..,"differs":[..],"mass":kg|null,"load_ms":..,"warm_ms":..}
    {"op":"step","count":n}  -> {"ms":[one a step, host clock, result waited for]}
    {"op":"state"}           -> {"translation":[[x,y,z]..],"rotation":[[x,y,z,w]..],"linvel":[..],"angvel":[..]}

`threads` may be left out or 0: the engine's own choice. `options` may be left out: settings of this one engine that
leave its defaults, named in its script; all that were given are named in `differs`. `half_space_edge` may be left out:
half the edge, m, of the box that stands for a half-space in an engine without them. `mass` is that of the dynamic
bodies as the engine reads it back, null where it cannot. `load_ms` contains `warm_ms`, the time for compiling.

A failure answers {"error":"what, where, what to do"} and the process goes on. A scene that the engine cannot model
answers {"error":"not modelled: ..."}. The end of input ends the process with 0.

Scene: {"gravity":[x,y,z],"bodies":[{"type":"dynamic"|"fixed"|"kinematic","translation","rotation","linvel","angvel",
"gravity_scale","linear_damping","angular_damping","colliders":[{"shape":{"ball":{"radius"}}|{"cuboid":
{"half_extents"}}|{"halfspace":{"normal"}},"translation","rotation","density","mass","friction","restitution"}]}]}.
What a body or a collider leaves out has the values of `BODY` and `COLLIDER`. SI units, quaternions x, y, z, w.
Translation and rotation are those of the body's own frame; linvel is the velocity of the centre of mass, angvel is in
world axes, both in and out.
"""

import json
import math
import os
import sys
import time

BODY = {
    "type": "dynamic", "translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "linvel": [0, 0, 0], "angvel": [0, 0, 0],
    "gravity_scale": 1, "linear_damping": 0, "angular_damping": 0, "colliders": [],
}
COLLIDER = {
    "shape": None, "translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "density": 1000, "mass": None, "friction": 0.5,
    "restitution": 0,
}
PARAMETERS = {"ball": "radius", "cuboid": "half_extents", "halfspace": "normal"}
LENGTHS = {"translation": 3, "rotation": 4, "linvel": 3, "angvel": 3, "gravity": 3, "half_extents": 3, "normal": 3}


class Refused(Exception):
    """A request that this engine does not serve; the text goes to the caller as it is."""


def not_modelled(where, what, instead):
    return Refused(f"not modelled: {where}: {what}; {instead}")


def read_scene(scene):
    """Fills in what was left out and refuses what no engine could read: a copy, with `shape` as (kind, value)."""
    gravity = vector(scene.get("gravity", [0, -9.81, 0]), "gravity", "scene")
    bodies = []
    for i, given in enumerate(scene["bodies"]):
        where = f"body {i}"
        body = filled(BODY, given, where)
        if body["type"] not in ("dynamic", "fixed", "kinematic"):
            raise Refused(f"{where}: type {body['type']!r} is unknown; use dynamic, fixed or kinematic")
        body["colliders"] = [
            read_collider(c, f"{where}, collider {k}", body["type"]) for k, c in enumerate(body["colliders"])
        ]
        if body["type"] == "dynamic" and not body["colliders"]:
            raise not_modelled(where, "a dynamic body without a collider has no mass", "give it a collider")
        bodies.append(body)
    return gravity, bodies


def read_collider(given, where, body_type):
    collider = filled(COLLIDER, given, where)
    shape = collider["shape"]
    if not isinstance(shape, dict) or len(shape) != 1 or next(iter(shape)) not in PARAMETERS:
        raise not_modelled(where, f"shape {shape!r}", f"the peers know {', '.join(PARAMETERS)}")
    (kind, parameters), = shape.items()
    value = parameters[PARAMETERS[kind]]
    value = float(value) if kind == "ball" else vector(value, PARAMETERS[kind], where)
    if kind == "halfspace" and body_type == "dynamic":
        raise not_modelled(where, "a half-space on a dynamic body", "make the body fixed")
    if kind == "halfspace":
        length = math.hypot(*value)
        if length == 0:
            raise Refused(f"{where}: the half-space's normal is zero; give it a direction")
        value = [x / length for x in value]
    collider["shape"] = (kind, value)
    return collider


def filled(defaults, given, where):
    unknown = set(given) - set(defaults)
    if unknown:
        raise Refused(f"{where}: unknown field {sorted(unknown)}; known are {sorted(defaults)}")
    out = {**defaults, **given}
    for key, value in out.items():
        if key in LENGTHS:
            out[key] = vector(value, key, where)
    return out


def vector(value, name, where):
    if len(value) != LENGTHS[name] or not all(math.isfinite(x) for x in value):
        raise Refused(f"{where}: {name} is {value}; it must be {LENGTHS[name]} finite numbers")
    return [float(x) for x in value]


def check_options(options, known):
    unknown = set(options) - set(known)
    if unknown:
        raise Refused(f"options: {sorted(unknown)} are unknown; this engine knows {sorted(known)}")


def named_options(options):
    """The sentences of `differs` for options that were given."""
    return [f"asked for, not the default: {key} {value}" for key, value in sorted(options.items())]


def frictions(bodies):
    return {c["friction"] for b in bodies for c in b["colliders"]}


def quat_mul(a, b):
    """Product of two quaternions x, y, z, w: first b, then a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def quat_between(a, b):
    """The shortest rotation (x, y, z, w) from unit vector a to unit vector b."""
    dot = sum(x * y for x, y in zip(a, b))
    if dot < -0.999999:
        # Half a turn about any axis across a.
        axis = [0.0, -a[2], a[1]] if abs(a[0]) < 0.9 else [-a[2], 0.0, a[0]]
        length = math.hypot(*axis)
        return [x / length for x in axis] + [0.0]
    cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    length = math.hypot(*cross, 1 + dot)
    return [x / length for x in cross] + [(1 + dot) / length]


def rotate(q, v):
    """Vector v turned by the unit quaternion q (x, y, z, w)."""
    return quat_mul(quat_mul(q, [*v, 0.0]), [-q[0], -q[1], -q[2], q[3]])[:3]


def finite_lists(rows):
    """Rows of numbers as lists; what is not finite becomes null."""
    return [[float(x) if math.isfinite(x) else None for x in row] for row in rows]


def timed(step, count):
    """Milliseconds of each of `count` calls of `step`, which returns only when its result is there."""
    ms = []
    for _ in range(count):
        start = time.perf_counter()
        step()
        ms.append((time.perf_counter() - start) * 1e3)
    return ms


def serve(make_engine):
    """Answers requests until the end of input. `make_engine` is called at the first load."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    engine = None
    loaded = False
    for line in sys.stdin:
        if not line.strip():
            continue
        try:
            request = json.loads(line)
            op = request.get("op")
            if op == "load":
                loaded = False
                engine = engine or make_engine()
                answer = {"ok": True, **engine.load(
                    *read_scene(request["scene"]), float(request["dt"]), int(request["substeps"]),
                    int(request.get("threads") or 0), request.get("options") or {}, request.get("half_space_edge"),
                )}
                loaded = True
            elif op not in ("step", "state"):
                answer = {"error": f"op {op!r} is unknown; use load, step or state"}
            elif not loaded:
                answer = {"error": f"{op} without a scene: no load has succeeded; send a load first"}
            else:
                answer = {"ms": engine.step(int(request["count"]))} if op == "step" else engine.state()
        except Refused as refused:
            answer = {"error": str(refused)}
        except KeyError as missing:
            answer = {"error": f"field {missing} is missing in the request; see protocol.py"}
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as failure:  # A Rust panic comes as a BaseException.
            answer = {"error": f"{type(failure).__name__}: {failure}"}
        print(json.dumps(answer, allow_nan=False), file=answers, flush=True)
