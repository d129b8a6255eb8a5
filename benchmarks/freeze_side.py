"""What one build gives, for `freeze.py`: run by it, once for each build and kernel level.

    python benchmarks/freeze_side.py OUT.json texts|"" ONLY

Writes for every kind of output a text, or check sums of arrays, by name. What depends on time or on
addresses is masked. Only the public interface is used, so that builds of other commits run it.
"""

from __future__ import annotations

import hashlib
import inspect
import itertools
import json
import math
import re
import resource
import sys
import warnings
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import attrs
import numpy as np

import beltdyn as bd

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests"))
import drive_table as table
import drives

#: Built-in scenes are run on a coarse mesh for this long [s].
SCENE_LINKS, SCENE_TIME = 60, 0.02
METHODS = {
    method: table.OPTIONS.get(method, {"method": method}) for method in table.VALUES["method"]
}
TIMES = {"cpu_time", "wall_time", "settle_time"}

told: dict[str, dict[str, Any]] = defaultdict(dict)


def masked(text: object) -> str:
    """Without addresses, and times that were measured."""
    text = re.sub(r"0x[0-9a-f]{6,}", "0x...", str(text))
    text = re.sub(r"[\d.e+-]+ s (of )?CPU", r"... s \1CPU", text)
    return re.sub(r"(CPU time +|expected to take )[\d.e+-]+ s", r"\1... s", text)


def error_text(error: BaseException) -> str:
    notes = "".join(f"\nnote: {note}" for note in getattr(error, "__notes__", ()))
    return masked(f"{type(error).__name__}: {error}{notes}")


def tried(make: Callable[[], object]) -> str:
    """The text of what is made, or of the error."""
    try:
        return masked(make())
    except Exception as error:  # whatever it is, its text is looked at
        return error_text(error)


def sums(group: str, part: object) -> dict[str, str]:
    """Check sums of the arrays of a part of a result."""
    found = {}
    for name in dir(part):
        value = getattr(part, name, None) if not name.startswith("_") else None
        if isinstance(value, np.ndarray) and value.size:  # of what a drive has
            content = (
                f"{value.dtype} {value.shape}".encode() + np.ascontiguousarray(value).tobytes()
            )
            found[f"{group}.{name}"] = hashlib.sha256(content).hexdigest()[:12]
    return found


def arrays_of(result: Any) -> dict[str, str]:
    parts = ("belt", "joints", "contact", "pulleys", "mounts", "energy", "final_state")
    found = {"t": hashlib.sha256(result.t.tobytes()).hexdigest()[:12]}
    for part in parts:
        found |= sums(part, getattr(result, part))
    return found


def counters_of(result: Any) -> str:
    counters = {k: v for k, v in attrs.asdict(result.stats).items() if k not in TIMES}
    lines = [f"{name} {value}" for name, value in counters.items()]
    return masked("\n".join([*lines, result.status, result.message, *result.effects]))


def run(name: str, level: str, make: Callable[[], Any], forces: dict[str, Any]) -> Any:
    """Run and tell trajectory, counters and warnings; of a failure what was computed."""
    result = None
    try:
        result = make()
    except bd.SimulationError as failure:
        told["message"][f"run of {name} at {level}"] = error_text(failure)
        result = failure.result
    if result is not None:
        told["trajectory"][f"{name} at {level}"] = arrays_of(result)
        told["counters"][f"{name} at {level}"] = counters_of(result)
        told["warnings"][f"{name} at {level}"] = masked("\n".join(map(repr, result.warnings)))
        forces[name] = result.joints.force
    return result


def texts(name: str, scene: bd.Scene, result: Any) -> None:
    told["toml"][name] = tried(scene.to_toml)
    told["print"][name] = tried(lambda: f"{scene}\n{scene.params!r}\n{scene.torque_fn!r}")
    derived = {key: scene.params.info[key] for key in scene.params.info}
    told["print"][f"numbers of {name}"] = "\n".join(f"{k} {v!r}" for k, v in derived.items())
    if result is None:
        return
    told["report"][f"result of {name}"] = tried(lambda: f"{result}\n{result!r}")
    told["report"][f"accuracy of {name}"] = tried(lambda: result.accuracy)
    told["report"][f"dataset of {name}"] = tried(lambda: dataset_text(result.to_xarray()))
    try:
        report = result.report()
    except Exception as error:
        told["report"][name] = error_text(error)
        return
    told["report"][name] = masked(report)
    told["report"][f"numbers of {name}"] = masked(json.dumps(report.to_dict(), indent=1))


def dataset_text(dataset: Any) -> str:
    """Names, dimensions, attributes and values; of large arrays a check sum."""
    lines = [f"{key} = {value}" for key, value in dataset.attrs.items() if key not in TIMES]
    for name, array in dataset.variables.items():
        if name in TIMES:
            continue
        values = np.asarray(array.values)
        numbers = values.dtype.kind in "biuf"
        exact = values.astype(float).tobytes() if numbers else repr(values.tolist()).encode()
        shown = values.tolist() if values.size <= 40 else hashlib.sha256(exact).hexdigest()[:12]
        lines.append(f"{name} {array.dims} {values.dtype.kind} {dict(array.attrs)} {shown}")
    return masked("\n".join(lines))


def of_drive(name: str, level: str, with_texts: bool, forces: dict[str, Any]) -> None:
    drive = table.drive(name)
    start = drive.settle()
    told["trajectory"][f"{name} settled at {level}"] = sums("state", start)

    def by(options: dict[str, Any]) -> Callable[[], Any]:
        return lambda: drive.run(start, **options)

    results = {m: run(f"{name} {m}", level, by(METHODS[m]), forces) for m in METHODS}
    if with_texts:
        texts(name, drive.scene, results[drive.row["method"]])


def built_in(name: str, level: str, with_texts: bool, forces: dict[str, Any]) -> None:
    scene = bd.scenes.get(name)
    if with_texts:
        texts(f"scene {name}", scene, None)
    coarse = attrs.evolve(scene.params, belt=attrs.evolve(scene.params.belt, n_bodies=SCENE_LINKS))
    times = np.linspace(0.0, SCENE_TIME, 41)

    def simulated() -> Any:
        return bd.simulate(coarse, scene.torque_fn, SCENE_TIME, scene.motion, t_eval=times)

    run(f"scene {name}", level, simulated, forces)


# --- further kinds --------------------------------------------------------------------------------


def explained(name: str, scene: bd.Scene) -> None:
    explanation = bd.explain(*scene, ablation=False, method="rodas4")
    rows = [*explanation.effects, explanation.state, explanation.step.method]
    told["explain"][name] = masked(
        "\n".join(map(repr, [*rows, *(p.name for p in explanation.passes)]))
    )


def swept(name: str, scene: bd.Scene) -> None:
    over = {"belt.axial_stiffness": [18e3, -1.0, 22e3], "torque.scale": [0.5, 1.0]}
    measure = ["report.pulleys.margin", "span_tension.least", "pulleys.omega.mean", "stats.steps"]
    options = {"executor": "threads", "progress": False, "rtol": 1e-3}
    told["sweep"][name] = tried(lambda: dataset_text(bd.sweep(scene, over, measure, **options)))
    told["sweep"][f"all of {name}"] = tried(
        lambda: dataset_text(bd.sweep(scene, {"t_end": [0.004, 0.008]}, **options))
    )


def modes_of(name: str) -> bd.Modes:
    drive = table.drive(name)
    return bd.modes(drive.scene.params, drive.settle())


def further(drives: list[str]) -> None:
    """One of each of what takes longer, on drives that have mounts, loads and several pulleys."""
    for name in drives[::6]:
        explained(name, table.drive(name).scene)
    first = {}
    for name in drives:
        row = table.drive(name).row
        if row["loads"] in ("terms", "engine", "speed", "crank") and row["start"] == "rest":
            first.setdefault(row["belt"], name)
    for name in first.values():
        swept(name, table.drive(name).scene)
        told["modes"][name] = tried(partial(modes_of, name))


# --- what is refused ------------------------------------------------------------------------------


def refused() -> dict[str, Callable[[], object]]:
    """Inputs that the library refuses, each for another reason."""
    belt = {"length": 1.2, "n_bodies": 24, "linear_density": 0.1, "axial_stiffness": 7e4}
    one = bd.Pulley(center=(0.0, 0.0), radius=0.1, inertia=0.01, name="crank")
    two = bd.Pulley(center=(0.29, 0.0), radius=0.1, inertia=0.01)
    params = bd.Params(
        belt=bd.Belt(**belt), pulleys=[one, two], friction=bd.Dahl(mu_k=0.8, sigma=1e4)
    )
    still = bd.Viscous([0.0, 0.0])
    rest = bd.settle(params)

    def of(**changes: Any) -> Callable[[], object]:
        return lambda: attrs.evolve(params, **changes)

    def belted(**changes: Any) -> Callable[[], object]:
        return lambda: attrs.evolve(params, belt=bd.Belt(**{**belt, **changes}))

    def moved(**changes: Any) -> Callable[[], object]:
        return lambda: attrs.evolve(params, pulleys=[one, attrs.evolve(two, **changes)])

    def simulated(
        torque: Any = still, t_end: float = 0.002, **options: Any
    ) -> Callable[[], object]:
        return lambda: bd.simulate(params, torque, t_end, **{"initial": rest, **options})

    def raising(_t: float, _theta: Any, _omega: Any) -> list[float]:
        raise ZeroDivisionError("of the user's")

    toml = bd.Scene(params, still, 1.0).to_toml()

    def read(old: str, new: str) -> Callable[[], object]:
        return lambda: bd.Scene.from_toml(toml.replace(old, new))

    return {
        "no length": belted(length=None),
        "slack": belted(length=1.4),
        "overstretched": belted(length=0.9),
        "length and preload": belted(preload=100.0),
        "negative stiffness": belted(axial_stiffness=-1.0),
        "not a number": belted(linear_density=float("nan")),
        "a text": belted(axial_damping="1"),
        "few links": belted(n_bodies=2),
        "half a link": belted(n_bodies=24.5),
        "unknown mesh": belted(mesh="fine"),
        "string with bending": belted(model="string", bending_stiffness=0.1),
        "overlap": moved(center=(0.1, 0.0)),
        "no radius": moved(radius=0.0),
        "unknown side": moved(side="left"),
        "same name": moved(name="crank"),
        "name of a number": moved(name="3"),
        "drag backwards": lambda: bd.Drag(viscous=-1.0),
        "no pulley": of(pulleys=[]),
        "no such friction": of(friction="dahl"),
        "gravity of one number": of(gravity=9.81),
        "offset of no pulley": of(tensioning=bd.Tensioning(offset={"fan": (0.0, 0.0)})),
        "friction without limit": lambda: bd.Dahl(mu_k=0.0, sigma=1.0),
        "half a Stribeck curve": lambda: bd.Dahl(mu_k=0.5, sigma=1e4, mu_s=0.6),
        "lists of two lengths": lambda: bd.MaxwellSlip(
            mu=(0.2, 0.3), stiffness=(1e7,), damping=(100.0,)
        ),
        "arm without lever": moved(mount=bd.Arm(pivot=(0.29, 0.0), inertia=0.1)),
        "slider nowhere": lambda: bd.Slider(direction=(0.0, 0.0), mass=1.0),
        "stops reversed": lambda: bd.Slider(direction=(1.0, 0.0), mass=1.0, stops=(0.1, 0.0)),
        "path backwards": lambda: bd.Path(t=(1.0, 0.0), displacement=((0.0, 0.0), (1.0, 0.0))),
        "mount that holds nothing": moved(mount=bd.Slider(direction=(1.0, 0.0), mass=1.0)),
        "times backwards": lambda: bd.PiecewiseLinear([1.0, 0.0], [1.0, 1.0]),
        "table backwards": lambda: bd.SpeedTable(0, [2.0, 1.0], [1.0, 1.0]),
        "load that drives": lambda: bd.Load(0, viscous=-1.0),
        "order 0": lambda: bd.Harmonics(0, [0.0], [1.0]),
        "ramp of no time": lambda: bd.Ramp(0, 1.0, 1.0, 1.0),
        "motion of nothing": lambda: bd.Motion(),
        "fade backwards": lambda: bd.CrankMotion(1.0, [2.0], [0.1], fade=(1.0, 0.0)),
        "torque for three": simulated(bd.Viscous([0.0, 0.0, 0.0])),
        "torque on no pulley": simulated(bd.Load("fan", viscous=1.0)),
        "torque of no kind": simulated(3.0),
        "torque of one number": simulated(lambda t, theta, omega: [1.0]),
        "torque not finite": simulated(lambda t, theta, omega: [float("inf"), 0.0]),
        "torque that raises": simulated(raising),
        "speed that jumps": simulated(motion={0: bd.PiecewiseLinear([0.0, 0.0], [0.0, 1.0])}),
        "motion that begins elsewhere": simulated(motion={0: bd.PiecewiseLinear([0.0], [5.0])}),
        "end before begin": simulated(t_end=-1.0),
        "unknown method": simulated(method="euler"),
        "no tolerance": simulated(rtol=0.0),
        "unknown output": simulated(outputs=("joints.colour",)),
        "samples outside": simulated(t_eval=[0.0, 1.0]),
        "fixed step too long": simulated(still, method="rk4", step=1e-3),
        "too many steps": simulated(still, max_steps=3),
        "checkpoint and verify": simulated(checkpoint="here", verify=True),
        "state of another drive": lambda: bd.simulate(
            attrs.evolve(params, belt=bd.Belt(**{**belt, "n_bodies": 30})), still, 0.1, initial=rest
        ),
        "settling in no time": lambda: bd.settle(params, max_time=1e-5),
        "rims that disagree": lambda: bd.settle(params, speed={0: 1.0, 1: 2.0}),
        "belt that flies off": lambda: bd.settle(params, speed={0: 5000.0}),
        "unknown scene": lambda: bd.scenes.get("kubas"),
        "TOML without an end": lambda: bd.Scene.from_toml("gravity = [0, 0]\n"),
        "TOML of another kind": read("viscous", "oil"),
        "TOML with a rule broken": read("n_bodies = 24", "n_bodies = 1"),
        "TOML with a field too many": read("[belt]", "[belt]\ncolour = 1"),
        "sweep of nothing": lambda: bd.sweep(bd.Scene(params, still, 0.01), {"belt.colour": [1.0]}),
    }  # fmt: skip


# --- what is warned of ----------------------------------------------------------------------------


def codes() -> list[str]:
    """All that the library lists."""
    listed = inspect.getdoc(bd.RunWarning) or ""
    return sorted({*re.findall(r"^    (\w+)(?: \*)? {1,13}\S", listed, re.MULTILINE)})


def warned() -> dict[str, Callable[[], bd.Params | bd.Result | list[str]]]:
    """Drives, runs and sweeps that the library warns of; names begin with the code."""
    plain, ramp = drives.plain_scene()[:2]
    rest = bd.settle(plain)
    small, larger = (drives.small_idler(radius, 20) for radius in (0.02, 0.025))
    still, jump = bd.Viscous([0.0, 1.0]), bd.PiecewiseLinear([0.0], [[-1000.0, 1000.0]])
    turning = attrs.evolve(rest, omega=np.array([9.0, 0.0]))
    coarse = {"method": "rodas4", "rtol": 1e-2, "torque_interval": 0.01}
    coarse["t_eval"] = np.linspace(0.0, 0.03, 3001)

    def of(belt: dict[str, Any] | None = None, **changes: Any) -> bd.Params:
        changes["belt"] = attrs.evolve(plain.belt, bending_stiffness=0.0, **(belt or {}))
        return attrs.evolve(plain, **changes)

    def run(
        torque: Any, t_end: float, params: bd.Params = plain, **options: Any
    ) -> Callable[[], bd.Result]:
        return lambda: bd.simulate(params, torque, t_end, **{"initial": rest, **options})

    def second(**changes: Any) -> bd.Params:
        return attrs.evolve(
            plain, pulleys=[*plain.pulleys[:1], attrs.evolve(plain.pulleys[1], **changes)]
        )

    backward = second(coupling=bd.OverrunningClutch(inertia=1e-3, clockwise=True))
    twenty = {0: bd.PiecewiseLinear([0.0], [20.0])}

    def thrown(share: float, **others: Any) -> bd.State:
        wave = math.sqrt(plain.belt.axial_stiffness / plain.belt.linear_density)
        return attrs.evolve(rest, vy=rest.vy + share * wave * np.sign(rest.y), **others)

    def pulse(t: float, _theta: Any, _omega: Any) -> list[float]:
        return [-100.0 if 0.02 < t < 0.02002 else 0.0, 0.0]

    def over_budget() -> bd.Result:
        # Each run fits, as the clock goes 0.4 s a look; all of them together do not. The mesh is
        # that of the state: else it would depend on how fast this machine is.
        with mock.patch("time.thread_time", itertools.count(0.0, 0.4).__next__):
            return bd.simulate(plain, ramp, 0.005, budget=1.0, initial=rest)

    def full_disk() -> bd.Result:
        """A torque that lets no file grow."""
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)

        def torque(_t: float, _theta: Any, _omega: Any) -> list[float]:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1, limits[1]))
            return [0.0, 0.0]

        try:
            return bd.simulate(plain, torque, 0.002, initial=rest, checkpoint="checkpoint")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            Path("checkpoint").unlink()

    def without_result() -> list[str]:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            bd.sweep(bd.Scene(plain, still, 0.001), {"max_steps": [1, 1000]}, executor=1)
        return [str(one.message) for one in caught]

    light = drives.light_scene().params
    small_pulleys = [attrs.evolve(one, radius=0.012, inertia=2e-6) for one in light.pulleys]
    jagged = attrs.evolve(
        light, belt=attrs.evolve(light.belt, mesh="joint", n_bodies=160), pulleys=small_pulleys
    )
    lively = of({"axial_damping": 0.03})
    chattering = of(contact=bd.Contact(linear=2.5e7, damping=100.0))
    ringing = attrs.evolve(
        drives.on_mesh(of(), "joint"), contact=bd.Contact(linear=2.5e7, damping=190.0)
    )
    return {
        "mesh": lambda: plain,
        "strain": lambda: of({"length": 1.16}),
        "compliance": lambda: of(contact=bd.Contact(linear=2e5, damping=100.0)),
        "long_links": lambda: drives.small_idler(0.02, 30),
        "units of gravity": lambda: of(gravity=(0.0, -9810.0)),
        "units of a stiffness": lambda: of({"axial_stiffness": 2.1e11}),
        "units of a mass": lambda: of({"linear_density": 1e-4}),
        "units of an inertia": lambda: second(inertia=1e-10),
        "units of friction": lambda: second(friction=bd.Dahl(mu_k=30.0, sigma=1e4)),
        "units of a torque": run(bd.PiecewiseLinear([0.0], [[0.0, -5e4]]), 1e-3),
        "mesh_speed": run(bd.Ramp(0, 0.0, 2e-3, 0.1), 0.02, jagged, initial=None),
        "no_friction": run(bd.PiecewiseLinear([0.0], [[0.0, 1.0]]), 0.01, of(friction=None)),
        "full_slip": run(bd.PiecewiseLinear([0.0], [[-300.0, 300.0]]), 0.02),
        "slack_span": run(still, 0.003, initial=thrown(1.0)),
        "never_drives": run(
            still, 0.02, backward, initial=bd.settle(backward, speed={0: 20.0}), motion=twenty
        ),
        "balance": lambda: bd.simulate(
            *bd.scenes.three_pulleys()[:2], 0.5, method="lbdf2", step=4e-4
        ),
        "stretch": run(still, 2e-3, initial=thrown(0.1)),
        "no_contact": run(
            bd.Viscous([0.0, 0.0, 1.0]), 0.02, small, initial=bd.settle(larger)
        ),
        "growth, chatter": run(ramp, 0.35, chattering, initial=bd.settle(chattering)),
        "undamped": run(still, 0.03, lively, initial=bd.settle(lively), method="rodas4"),
        "undamped on the contact": run(
            ramp, 0.4, ringing, initial=bd.settle(ringing), method="rodas4"
        ),
        "torque": run(pulse, 0.03, **coarse),
        "rough_torque": run(lambda t, *_: [0.0, -100.0 * math.sin(3e5 * t)], 0.03, **coarse),
        "fallback": run(
            still, 1e6 + 1e-6, initial=thrown(0.02, t=1e6), method="lbdf2", rtol=1e-8
        ),
        "fixed_step": run(jump, 4e-3, method="lbdf2", step=1e-3),
        "budget": over_budget,
        "checkpoint": full_disk,
        "torque_ignored": run(
            ramp, 0.002, motion={0: bd.PiecewiseLinear([0.0, 1.0], [0.0, -9.0])}
        ),
        "beyond_table": run(
            bd.SpeedTable(0, [1.0, 8.0], [0.0, 0.0]), 0.001, initial=turning
        ),
        "no_result": without_result,
    } | (warned_of_cells() if any(map(can_be, ALE)) else {})  # fmt: skip


#: Drives whose belts flow through cells, which builds before them cannot have.
ALE = tuple(name for name in table.names() if name.startswith("ale-"))


def warned_of_cells() -> dict[str, Callable[[], bd.Params | bd.Result]]:
    """Drives and runs of ALE belts near their limits."""
    belt = bd.Belt(
        mesh="ale", preload=320.0, linear_density=0.1, axial_stiffness=60e3, axial_damping=20.0,
        bending_stiffness=0.02,
    )  # fmt: skip
    pulleys = [
        bd.Pulley(center=(x, 0.0), radius=r, inertia=0.01) for x, r in ((0.0, 0.05), (0.5, 0.08))
    ]
    drive = bd.Params(belt=belt, pulleys=pulleys, friction=bd.Dahl(mu_k=3.0, sigma=1e4))
    still = bd.Viscous([0.0, 0.0])

    def run(torque: Any, t_end: float, speed: float) -> Callable[[], bd.Result]:
        motion = {0: bd.PiecewiseLinear([0.0], [speed])}
        return lambda: bd.simulate(drive, torque, t_end, motion)

    def swinging() -> bd.Result:
        rest = bd.settle(drive)
        first = 0.12 * 0.5 / math.pi * (np.arange(rest.a.size) == 0)
        return bd.simulate(drive, still, 5e-3, initial=attrs.evolve(rest, a=first))

    def squealing() -> bd.Result:
        straight = attrs.evolve(belt, bending_stiffness=0.0, axial_damping=0.3)
        contact = bd.Contact(linear=1e9, damping=200.0)
        one = attrs.evolve(drive, belt=straight, contact=contact)
        load = bd.PiecewiseLinear([0.0, 0.05], [[0.0, 0.0], [0.0, 35.0]])
        return bd.simulate(one, load, 0.05, {0: bd.PiecewiseLinear([0.0], [-100.0])})

    bent = attrs.evolve(belt, bending_stiffness=0.6)
    return {
        "near_limit": lambda: attrs.evolve(drive, belt=bent),
        "tensioning": lambda: attrs.evolve(drive, tensioning=bd.Tensioning(friction=True)),
        "near_slack": run(bd.PiecewiseLinear([0.0, 0.2], [[0.0, 0.0], [0.0, -58.0]]), 0.2, 0.0),
        "span_modes": run(still, 0.01, 900.0),
        "steep_span": swinging,
        "squeal": squealing,
    }


def warn_of(name: str, make: Callable[[], bd.Params | bd.Result | list[str]]) -> set[str]:
    """Return what is warned of, and give the codes."""
    made = make()
    if isinstance(made, bd.Params):
        notes = re.findall(r"^  note  ((\w+): .*)", str(made), re.MULTILINE)
        texts, found = [text for text, _ in notes], {code for _, code in notes}
    elif isinstance(made, list):
        texts, found = made, {text.partition(":")[0] for text in made}
    else:
        texts, found = [*map(repr, made.warnings)], {one.code for one in made.warnings}
    told["warnings"][f"warned: {name}"] = masked("\n".join(texts))
    return found


def can_be(name: str) -> bool:
    """Whether this build has the belt of a drive."""
    try:
        table.drive(name)
    except ValueError:
        return False
    return True


def main() -> None:
    out, with_texts, only = Path(sys.argv[1]), sys.argv[2] == "texts", sys.argv[3]
    warnings.simplefilter("ignore")
    forces: dict[str, Any] = {}
    level = out.stem
    drives = [name for name in table.names() if only in name and can_be(name)]
    for name in drives:
        of_drive(name, level, with_texts, forces)
    for name in (name for name in bd.scenes.names() if only in name):
        built_in(name, level, with_texts, forces)
    if with_texts:
        further(drives)
        told["message"] |= {f"refused: {k}": tried(v) for k, v in refused().items()}
        found = set().union(*(warn_of(name, make) for name, make in warned().items()))
        told["codes never warned of"] |= dict.fromkeys({*codes()} - found, "")
    np.savez(out.with_suffix(".npz"), **forces)
    out.write_text(json.dumps(told, indent=0), "utf-8")


if __name__ == "__main__":
    main()
