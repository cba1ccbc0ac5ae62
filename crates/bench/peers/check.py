"""Numbers that an engine peer must get right, over the pipe: `python3 check.py nexus_peer.py|mujoco_peer.py`.

Run it when a wheel changes. Each line names the oracle, all of them analysis; tolerances are at least twice what
nexus 0.3.0 and MuJoCo 3.17.0 and 4.0.0 showed, in the worse of the three.
"""

import json
import math
import subprocess
import sys

G = 9.81
DT = 1 / 60
STILL = {"translation": [0, 0, 0]}
CUBE = {"cuboid": {"half_extents": [0.5, 0.5, 0.5]}}


class Peer:
    def __init__(self, script):
        self.process = subprocess.Popen(
            [sys.executable, script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def ask(self, **request):
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def run(self, scene, steps, substeps=4):
        answer = self.ask(op="load", scene=scene, dt=DT, substeps=substeps)
        if "error" in answer:
            sys.exit(f"load: {answer['error']}")
        times = self.ask(op="step", count=steps)["ms"]
        assert len(times) == steps
        return answer, self.ask(op="state")


def body(translation, shape, mu=0.6, **more):
    return {"translation": translation, "colliders": [{"shape": shape, "friction": mu}], **more}


def scene(*bodies, gravity=(0, -G, 0)):
    return {"gravity": list(gravity), "bodies": list(bodies)}


def floor(mu=0.6, normal=(0, 1, 0)):
    return body([0, 0, 0], {"halfspace": {"normal": list(normal)}}, mu, type="fixed")


def checks(peer):
    """Yields (what, found, wanted, tolerance)."""
    _, state = peer.run(scene(body([1, 100, 0], CUBE, linvel=[1, 2, 3])), 60)
    # Velocity first, then position: the sum over 240 sub-steps, not the integral.
    yield "free fall of 1 s, y", state["translation"][0][1], 100 + 2 - G / 2 * (1 + 1 / 240), 1e-3
    yield "free fall of 1 s, x", state["translation"][0][0], 2, 1e-3

    _, state = peer.run(scene(body([0, 0, 0], CUBE), gravity=[0, 0, -1]), 60)
    yield "gravity along z, speed after 1 s", state["linvel"][0][2], -1, 1e-4

    # Two cubes, turned by 90 degrees, that spin about their common centre, 1 m above the frame's origin.
    turned = [0, 0, math.sqrt(0.5), math.sqrt(0.5)]
    pair = {
        "rotation": turned, "angvel": [0, 0, 3],
        "colliders": [{"shape": CUBE}, {"shape": CUBE, "translation": [2, 0, 0], "mass": 1000}],
    }
    answer, state = peer.run(scene(pair, gravity=[0, 0, 0]), 60, substeps=16)
    x, y, z = state["translation"][0]
    angle = 3 + math.pi / 2
    yield "compound, x of its centre", x + math.cos(angle), 0, 0.01
    yield "compound, y of its centre", y + math.sin(angle), 1, 0.01
    yield "compound, speed of its centre", math.hypot(*state["linvel"][0]), 0, 0.02
    yield "compound, angle's sine", 2 * state["rotation"][0][2] * state["rotation"][0][3], math.sin(angle), 1e-3
    if answer["mass"] is not None:
        yield "compound, mass by density and by number", answer["mass"], 2000, 1e-6

    wide = {"cuboid": {"half_extents": [2, 0.5, 2]}}
    v = 10 / math.sqrt(2)
    _, state = peer.run(scene(floor(0.4), body([0, 0.5, 0], wide, 0.4, linvel=[v, 0, v])), 240)
    x, y, z = state["translation"][1]
    yield "box sliding at 45 degrees, way v^2 / (2 mu g)", math.hypot(x, z), 100 / (2 * 0.4 * G), 0.05

    # Sliding becomes rolling at 5/7 of the speed, whatever the friction: the ball's inertia is 2/5 m r^2.
    _, state = peer.run(scene(floor(), body([0, 0.5, 0], {"ball": {"radius": 0.5}}, linvel=[7, 0, 0])), 120)
    yield "ball from sliding to rolling, speed", state["linvel"][1][0], 5, 0.05
    yield "ball from sliding to rolling, spin", state["angvel"][1][2], -10, 0.1

    # A plane that is tilted by 20 degrees in the shape's normal, a box that lies on it and sticks.
    tilt = math.radians(20)
    normal = [math.sin(tilt), math.cos(tilt), 0]
    lying = body([0.5 * n for n in normal], CUBE, rotation=[0, 0, -math.sin(tilt / 2), math.cos(tilt / 2)])
    _, state = peer.run(scene(floor(normal=normal), lying), 60)
    height = sum(a * b for a, b in zip(state["translation"][1], normal))
    yield "box on a tilted plane, height above it", height, 0.5, 0.005
    yield "box on a tilted plane, way in 1 s", math.dist(state["translation"][1], lying["translation"]), 0, 0.02

    _, state = peer.run(scene(floor(), *[body([0, 0.5 + i, 0], CUBE) for i in range(10)]), 240)
    yield "column of 10, height of the top's centre", state["translation"][10][1], 9.5, 0.06


def main():
    peer = Peer(sys.argv[1])
    wrong = 0
    for what, found, wanted, tolerance in checks(peer):
        good = found is not None and abs(found - wanted) <= tolerance
        wrong += not good
        print(f"{'ok   ' if good else 'WRONG'} {what}: {found:.6g}, wanted {wanted:.6g} within {tolerance:g}")
    refused = {
        "damping": scene(body([0, 0, 0], CUBE, linear_damping=0.1)),
        "moving kinematic": scene(body([0, 0, 0], CUBE, type="kinematic", linvel=[1, 0, 0])),
        "unknown shape": scene(body([0, 0, 0], {"torus": {}})),
        "mass of nothing": scene(STILL),
    }
    for what, bad in refused.items():
        answer = peer.ask(op="load", scene=bad, dt=DT, substeps=4)
        good = answer.get("error", "").startswith("not modelled: body 0")
        wrong += not good
        print(f"{'ok   ' if good else 'WRONG'} refuses {what}: {answer.get('error', answer)}")
    after = peer.ask(op="step", count=1)
    print(f"{'ok   ' if 'error' in after else 'WRONG'} no step after a failed load: {after}")
    wrong += "error" not in after
    peer.process.stdin.close()
    code = peer.process.wait()
    print(f"{'ok   ' if code == 0 else 'WRONG'} exit {code} at the end of input")
    sys.exit(wrong > 0 or code != 0)


if __name__ == "__main__":
    main()
