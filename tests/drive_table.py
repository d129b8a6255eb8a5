"""A table of small named drives that has every pair of things a drive can have.

`ROWS` is the table: each row names a value of every column, and every pair of values of two columns
that the library allows is in some row (`tests/test_drive_table.py` shows it). What a value means is
in the functions below. Belts are coarse and runs last `T_END`, so that a drive takes milliseconds.
Only the public interface is used, for `benchmarks/freeze.py` runs the drives with other builds.

A new law, load or mount: add its value to `VALUES` and its meaning below, run this file, and put
the rows that it prints at the end of `ROWS`; rows that are there stay as they are.
"""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import attrs
import numpy as np

import beltdyn as bd

T_END, N_SAMPLES = 0.012, 21
#: Speed of the first pulley where a drive begins at speed [rad/s].
SPEED = -40.0
#: Times of a kink and a jump of the torque functions [s].
KINKS = (0.003, 0.0071)

#: The columns of `ROWS`, and the values of each.
VALUES: dict[str, tuple[str, ...]] = {
    "belt": ("paper", "joint", "string", "ale"),
    "law": ("none", "dahl", "lugre", "elastic", "coulomb", "creep", "threlfall", "maxwell"),
    "given": ("whole", "curve", "each"),
    "mount": ("fixed", "arm", "stops", "spring", "weight", "path"),
    "loads": ("terms", "engine", "function", "compiled", "speed", "crank", "moved"),
    "contact": ("quadratic", "linear", "hunt", "offset", "chosen"),
    "layout": ("two", "crossed", "back", "named"),
    "drag": ("-", "drag"),
    "gravity": ("-", "gravity"),
    "bending": ("-", "bends"),
    "length": ("length", "found"),
    "start": ("rest", "speed", "tension"),
    "method": ("auto", "tsit5", "rk4", "rodas4", "lbdf2", "lbdf2-h", "lie", "lie-h"),
}

#: Pairs that there are not, and why; where it begins with a class, that is what the library raises.
REFUSED: dict[tuple[tuple[str, str], tuple[str, str]], str] = {
    **{
        (("belt", "paper"), ("mount", mount)): "ValueError: a pulley with a mount needs belt.mesh "
        '"joint"'
        for mount in VALUES["mount"][1:]
    },
    (("belt", "string"), ("bending", "bends")): "ValueError: belt.bending_damping must be 0",
    (("law", "none"), ("given", "curve")): "no friction has no Stribeck curve",
    (("law", "creep"), ("given", "curve")): "TypeError: mu_s: unknown field",
    (("law", "threlfall"), ("given", "curve")): "TypeError: mu_s: unknown field",
}

#: Columns of which not every value must meet every method; most do.
DEALT = ("law", "loads")

ROWS = """
paper  none      whole fixed  terms    quadratic two     -    -       -     length rest    tsit5
joint  dahl      curve arm    engine   linear    crossed drag gravity bends found  speed   lie
string lugre     each  stops  function hunt      back    -    gravity -     found  tension lbdf2
joint  elastic   whole spring compiled offset    named   drag -       bends length tension rodas4
string coulomb   curve weight speed    chosen    two     drag -       -     found  rest    rodas4
string creep     each  path   crank    quadratic crossed -    -       -     length speed   rodas4
paper  threlfall each  fixed  moved    linear    back    drag gravity bends length rest    lie-h
string maxwell   whole arm    terms    hunt      named   -    gravity -     found  speed   lie-h
joint  none      each  stops  engine   offset    two     -    gravity bends length rest    lie-h
string dahl      whole spring function chosen    crossed -    -       -     length rest    lie-h
joint  lugre     curve weight compiled quadratic back    -    gravity bends length speed   lie-h
string elastic   curve path   speed    linear    named   -    gravity -     found  tension lie-h
paper  coulomb   curve fixed  crank    hunt      crossed drag gravity bends found  tension lie-h
joint  creep     whole arm    moved    offset    two     drag -       -     found  tension tsit5
joint  threlfall each  stops  terms    chosen    named   drag -       bends found  speed   tsit5
joint  maxwell   whole spring engine   quadratic back    drag -       bends found  tension rk4
string none      whole weight function linear    named   drag -       -     found  speed   rk4
joint  dahl      each  path   compiled hunt      two     drag -       bends length rest    rk4
paper  lugre     whole fixed  speed    offset    crossed drag -       bends length speed   rk4
joint  elastic   each  arm    crank    chosen    back    -    gravity -     length rest    lbdf2-h
joint  coulomb   curve stops  moved    quadratic named   -    gravity -     length speed   lie
string creep     each  spring terms    linear    two     -    gravity -     found  speed   lbdf2
string threlfall whole weight engine   hunt      crossed -    -       -     length tension lbdf2-h
string maxwell   curve path   function offset    back    drag gravity -     length rest    tsit5
string none      each  arm    compiled chosen    crossed -    -       -     found  tension lbdf2
joint  dahl      whole stops  speed    quadratic back    drag gravity bends found  tension lbdf2-h
joint  lugre     curve spring crank    linear    two     -    -       bends length rest    tsit5
string elastic   each  weight moved    hunt      crossed drag gravity -     found  speed   tsit5
paper  creep     whole fixed  engine   chosen    named   -    -       bends length rest    lbdf2
joint  coulomb   whole path   terms    offset    back    drag gravity bends found  tension lbdf2-h
joint  threlfall each  arm    function quadratic two     -    -       bends length rest    rodas4
paper  maxwell   each  fixed  compiled linear    two     drag gravity bends found  speed   lbdf2-h
string none      each  spring speed    hunt      back    -    -       -     length tension auto
string dahl      whole weight crank    offset    named   drag gravity -     found  rest    lbdf2
joint  lugre     curve path   moved    chosen    named   -    -       bends length speed   auto
string elastic   curve stops  terms    quadratic crossed drag gravity -     found  tension rk4
joint  coulomb   each  arm    engine   linear    two     -    -       bends length rest    auto
string creep     whole stops  function hunt      back    drag gravity -     found  speed   rodas4
joint  threlfall whole spring compiled offset    crossed -    -       bends length tension lie
string maxwell   curve weight speed    chosen    crossed drag gravity -     found  rest    lie
joint  none      each  path   crank    quadratic named   -    -       bends length speed   lie
paper  dahl      curve fixed  moved    linear    two     drag gravity bends found  tension rodas4
string lugre     curve arm    terms    hunt      back    -    -       -     length rest    lie
paper  elastic   curve fixed  engine   offset    two     drag gravity bends found  speed   lie
joint  coulomb   curve spring function chosen    named   -    -       -     length tension lbdf2-h
string creep     whole weight compiled quadratic crossed drag gravity -     found  rest    auto
joint  threlfall each  path   speed    linear    back    -    -       bends length speed   lbdf2
string maxwell   curve stops  crank    linear    named   drag gravity -     found  tension auto
joint  none      whole spring moved    hunt      two     -    -       bends length rest    lbdf2-h
string dahl      curve weight terms    offset    crossed drag gravity -     found  speed   auto
joint  lugre     each  path   engine   chosen    back    -    -       bends length tension rodas4
paper  elastic   whole fixed  function quadratic named   drag gravity bends found  rest    auto
string coulomb   curve stops  compiled hunt      two     -    -       -     length speed   tsit5
joint  creep     each  arm    speed    offset    crossed drag gravity bends found  tension rk4
string threlfall whole fixed  crank    chosen    back    -    -       -     length rest    rk4
joint  maxwell   curve arm    moved    quadratic named   drag gravity bends found  speed   lbdf2
joint  none      each  fixed  terms    linear    two     -    -       -     length tension rodas4
ale    dahl      whole stops  engine   hunt      crossed drag gravity bends found  rest    auto
ale    lugre     curve spring function offset    back    -    -       -     length speed   tsit5
ale    elastic   each  weight compiled chosen    named   drag gravity bends found  tension rk4
ale    coulomb   whole path   speed    quadratic two     -    -       -     length rest    lbdf2
ale    creep     each  arm    crank    linear    crossed drag gravity bends found  speed   lbdf2-h
ale    threlfall whole fixed  moved    hunt      back    -    -       -     length tension lie
ale    maxwell   curve stops  terms    offset    named   drag gravity bends found  rest    lie-h
ale    none      each  spring engine   chosen    two     -    -       -     length speed   rodas4
"""

OPTIONS: dict[str, dict[str, Any]] = {
    "lbdf2": {"method": "lbdf2", "rtol": 1e-3},
    "lbdf2-h": {"method": "lbdf2", "step": 2e-5},
    "lie": {"method": "lie", "rtol": 1e-2},
    "lie-h": {"method": "lie", "step": 2e-5},
}

Row = Mapping[str, str]


@attrs.frozen(kw_only=True)
class Drive:
    """A drive of the table, made new for whoever asks for it.

    Attributes:
        name: Of its row.
        row: Its values by column.
        scene: Drive, torque, end and motions.
        speed: As `bd.settle` takes it; None: at rest.
        options: Of `bd.simulate`.
    """

    name: str
    row: Row
    scene: bd.Scene
    speed: dict[int, float] | None
    options: dict[str, Any]

    def settle(self) -> bd.State:
        return bd.settle(self.scene.params, speed=self.speed)

    def run(self, start: bd.State, **others: Any) -> bd.Result:
        """Run it with its method; ``others`` are further options of `bd.simulate`."""
        times = np.linspace(start.t, self.scene.t_end, N_SAMPLES)
        options = {"initial": start, "t_eval": times, **self.options, **others}
        return bd.simulate(*self.scene, **options)


def names() -> tuple[str, ...]:
    return tuple(_BY_NAME)


def drive(name: str) -> Drive:
    return make(_BY_NAME[name])


def make(row: Row) -> Drive:
    w = SPEED if row["start"] == "speed" else 0.0
    pulleys = _pulleys(row)
    params = bd.Params(
        belt=_belt(row, pulleys),
        pulleys=pulleys,
        contact=_CONTACTS[row["contact"]],
        friction=_law(row) if row["given"] != "each" else _SECOND,
        gravity=(0.5, -9.81) if row["gravity"] == "gravity" else (0.0, 0.0),
        tensioning=bd.Tensioning(friction=True, offset={0: (0.003, 0.001)})
        if row["start"] == "tension"
        else bd.Tensioning(),
    )
    crank, driven = (params.pulleys[k].name or k for k in (0, _driven(row)))
    torque, motion = _LOADS[row["loads"]](len(pulleys), crank, driven, w)
    return Drive(
        name=name_of(row),
        row=row,
        scene=bd.Scene(params, torque, T_END, motion),
        speed={0: w} if w else None,
        options=OPTIONS.get(row["method"], {"method": row["method"]}),
    )


_LAWS: dict[str, Callable[..., bd.Friction]] = {
    "dahl": lambda **curve: bd.Dahl(mu_k=0.8, sigma=1e4, **curve),
    "lugre": lambda mu_s=0.6, v_stribeck=0.05: bd.LuGre(
        mu_k=0.6, mu_s=mu_s, v_stribeck=v_stribeck, sigma=1e4, damping=0.1, viscous=0.02
    ),
    "elastic": lambda **curve: bd.ElasticPlastic(mu=0.8, stiffness=2e7, damping=400.0, **curve),
    "coulomb": lambda **curve: bd.Coulomb(mu=0.8, v_reg=0.1, **curve),
    "creep": lambda **curve: bd.CreepRate(mu=0.8, v_critical=0.15, **curve),
    "threlfall": lambda **curve: bd.Threlfall(mu=0.8, v_reg=0.25, **curve),
    "maxwell": lambda **curve: bd.MaxwellSlip(
        mu=(0.2, 0.35, 0.25), stiffness=(3e7, 1.5e7, 4e6), damping=(600.0, 400.0, 200.0), **curve
    ),
}
#: Where the first pulley has a law of its own, that of the second, and that of the drive.
_FIRST = bd.ElasticPlastic(mu=0.5, stiffness=1e7, damping=300.0)
_SECOND = bd.Dahl(mu_k=0.5, sigma=5e3)

_CONTACTS = {
    "quadratic": bd.Contact(quadratic=3e11, damping=1e3),
    "linear": bd.Contact(linear=5e7, damping=2e3),
    "hunt": bd.Contact(quadratic=1e10, linear=2.5e7, hunt_crossley=0.3),
    "offset": bd.Contact(quadratic=1e10, linear=5e7, damping=2e3, compensate=True),
    "chosen": bd.Contact(),
}


def _law(row: Row) -> bd.Friction | None:
    if row["law"] == "none":
        return None
    curve = {"mu_s": 1.0, "v_stribeck": 0.04} if row["given"] == "curve" else {}
    return _LAWS[row["law"]](**curve)


def _driven(row: Row) -> int:
    """Index of the pulley that takes the load."""
    return 2 if row["layout"] == "back" else 1


def _pulleys(row: Row) -> list[bd.Pulley]:
    """A crank, on the back of the belt an idler, the pulley of the load, and a third."""
    crank = bd.Pulley(center=(0.0, 0.0), radius=0.08, inertia=0.01)
    driven = bd.Pulley(center=(0.30, 0.02), radius=0.06, inertia=0.004)
    idler = bd.Pulley(center=(0.135, 0.068), radius=0.04, inertia=2e-4, side="outside")
    pump = bd.Pulley(center=(0.14, -0.16), radius=0.05, inertia=5e-4, name="pump")
    pulleys = {
        "two": [crank, driven],
        "crossed": [crank, attrs.evolve(driven, side="outside")],
        "back": [crank, idler, driven],
        "named": [attrs.evolve(crank, name="crank"), attrs.evolve(driven, name="fan"), pump],
    }[row["layout"]]
    if row["drag"] == "drag":
        pulleys[0] = attrs.evolve(pulleys[0], drag=bd.Drag(viscous=1e-3))
        drag = bd.Drag(coulomb=0.05, viscous=1e-3, quadratic=1e-5)
        pulleys[1] = attrs.evolve(pulleys[1], drag=drag)
    if row["given"] == "each":
        of_each = [_law(row) or bd.Frictionless(), _FIRST, None]
        pulleys = [attrs.evolve(p, friction=law) for p, law in zip(pulleys, of_each, strict=False)]
    at, mount = _mount(row)
    pulleys[at] = attrs.evolve(pulleys[at], mount=mount)
    return pulleys


def _mount(row: Row) -> tuple[int, bd.Arm | bd.Slider | bd.Path | None]:
    """The mounted pulley and its mount; an arm is on the back of the belt where there is one.

    Stops are so near that arms run into them, or rest on them.
    """
    kind, at = row["mount"], _driven(row)
    near = (-0.02, 0.002) if row["layout"] == "back" else (-0.001, 0.01)
    stops = {"friction": 0.3, "stops": near} if kind == "stops" else {}
    if kind in ("arm", "stops") and row["layout"] == "back":
        return 1, bd.Arm(
            pivot=(0.215, 0.105), inertia=0.0025, mass=0.2, stiffness=10.0, preload=6.0,
            damping=0.03, **stops,
        )  # fmt: skip
    if kind in ("arm", "stops"):
        return at, bd.Arm(
            pivot=(0.30, -0.10), inertia=0.02, mass=0.8, stiffness=200.0, free_angle=-0.14,
            damping=1.0, stop_stiffness=2e4, stop_damping=20.0, **stops,
        )  # fmt: skip
    if kind == "spring":
        return at, bd.Slider(
            direction=(1.0, 0.1), mass=1.0, stiffness=2e3, preload=240.0, damping=60.0,
            friction=20.0,
        )  # fmt: skip
    if kind == "weight":
        return at, bd.Slider(
            direction=(2.0, 0.0), mass=1.0, weight=24.0, damping=60.0, stops=(-0.02, 0.02)
        )
    if kind == "path":
        way = ((0.0, 0.0), (5e-4, 2e-4), (1.2e-3, -4e-4))
        return at, bd.Path(t=(0.0, 0.004, 0.010), displacement=way)
    return at, None


def _belt(row: Row, pulleys: list[bd.Pulley]) -> bd.Belt:
    """Of some 120 N; its length is given, or found for a preload or for what the mounts hold."""
    given: dict[str, Any] = {"length": bd.route(pulleys).length / 1.006}
    if row["length"] == "found":
        held = row["mount"] in ("fixed", "path")
        given = {"preload": 300.0} if held else {}
    if row["bending"] == "bends":
        given |= {"bending_stiffness": 0.01, "bending_damping": 1e-5}
    return bd.Belt(
        n_bodies={"two": 25, "crossed": 31, "back": 39, "named": 36}[row["layout"]],
        linear_density=0.1,
        axial_stiffness=20e3,
        axial_damping=1.0,
        mesh="joint" if row["belt"] == "string" else row["belt"],
        model={"string": "string", "ale": "auto"}.get(row["belt"], "links"),
        **given,
    )


Loads = tuple[bd.Torque | Callable[..., Any], dict[int | str, Any] | None]
_REAL = ctypes.POINTER(ctypes.c_double)
_COMPILED = ctypes.CFUNCTYPE(None, ctypes.c_double, _REAL, _REAL, _REAL, ctypes.c_void_p)


def _resisting(driven: int | str) -> bd.Torque:
    return bd.Load(driven, viscous=0.02) + bd.PiecewiseLinear([0.0], [0.2], pulley=driven)


def _terms(n: int, _crank: int | str, _driven: int | str, _w: float) -> Loads:
    values = np.zeros((5, n))
    values[:, 0] = (0.0, -4.0, -4.0, -6.0, -5.0)  # with a jump
    piecewise = bd.PiecewiseLinear([0.0, 0.004, 0.007, 0.007, 0.010], values)
    return piecewise + bd.Viscous([0.01, *[0.03] * (n - 1)]), None


def _engine(n: int, crank: int | str, driven: int | str, _w: float) -> Loads:
    switched = bd.PiecewiseLinear([0.004, 0.006], [1.0, 0.4])
    return (
        bd.Ramp(crank, 0.0, 0.006, -5.0)
        + bd.Load(driven, coulomb=0.3, viscous=0.01, quadratic=1e-4, factor=switched)
        + bd.SpeedTable(driven, [0.2, 1.0, 30.0], [0.2, 0.6, 0.4])
        + bd.Harmonics(crank, [2.0, 3.5], [0.8, 0.3], [0.0, 0.7], of=driven)
        + bd.Step(driven, 0.005, 0.5),
        None,
    )


def _pulse(t: float) -> float:
    """A ramp and a jump."""
    return -6.0 if t > KINKS[1] else -4.0 * min(1.0, t / KINKS[0])


def _function(n: int, _crank: int | str, _driven: int | str, _w: float) -> Loads:
    def torque(t: float, _theta: Any, omega: Any) -> list[float]:
        return [_pulse(t), *[-0.03 * float(omega[k]) for k in range(1, n)]]

    return torque, None


def _compiled(n: int, _crank: int | str, _driven: int | str, _w: float) -> Loads:
    def torque(t: float, _theta: Any, omega: Any, out: Any, _user: Any) -> None:
        out[0] = _pulse(t) - 0.01 * omega[0]
        for k in range(1, n):
            out[k] = -0.02 * omega[k]

    return _COMPILED(torque), None


def _speed(_n: int, crank: int | str, driven: int | str, w: float) -> Loads:
    speed = bd.PiecewiseLinear([0.0, 0.006, 0.010], [w, w - 2.0, w - 2.5])
    return _resisting(driven), {crank: speed}


def _crank(_n: int, crank: int | str, driven: int | str, w: float) -> Loads:
    mean = bd.PiecewiseLinear([0.0, 0.008], [w, w - 4.0])
    uneven = bd.CrankMotion(mean, [2.0, 4.0], [0.01, 0.002], [0.3, 0.0], fade=(0.0, 0.006))
    return bd.SpeedTable(driven, [0.2, 1.0, 50.0], [0.2, 0.6, 1.4]), {crank: uneven}


def _moved(n: int, crank: int | str, driven: int | str, w: float) -> Loads:
    """A function of time: of two pulleys the angle of the first, of three its speed."""
    if n == 2:
        return _resisting(driven), {crank: bd.Motion(angle=lambda t: w * t - 120.0 * t * t)}
    return _resisting(driven), {crank: lambda t: w - 240.0 * t}


_LOADS: dict[str, Callable[..., Loads]] = {
    "terms": _terms,
    "engine": _engine,
    "function": _function,
    "compiled": _compiled,
    "speed": _speed,
    "crank": _crank,
    "moved": _moved,
}


Pair = tuple[tuple[str, str], tuple[str, str]]


def name_of(row: Row) -> str:
    parts = [row[column] for column in ("belt", "law", "mount", "loads", "layout")]
    return "-".join(part.replace("_", "-") for part in parts)


def pairs(row: Row) -> Iterator[Pair]:
    return itertools.combinations(row.items(), 2)


def wanted() -> dict[Pair, None]:
    """The pairs that rows must have, in order."""
    return {
        (one, other): None
        for a, b in itertools.combinations(VALUES, 2)
        if not (b == "method" and a in DEALT)
        for one in ((a, value) for value in VALUES[a])
        for other in ((b, value) for value in VALUES[b])
        if (one, other) not in REFUSED
    }


def missing(rows: list[Row]) -> dict[Pair, None]:
    """The pairs that these rows lack."""
    there = {pair for row in rows for pair in pairs(row)}
    return {pair: None for pair in wanted() if pair not in there}


def further_rows(rows: list[Row]) -> Iterator[Row]:
    """The rows that the table lacks, each with as many missing pairs as can be found greedily."""
    lacking = missing(rows)
    used = [item for row in rows for item in row.items()]
    by_choice = sorted(VALUES, key=lambda column: -len(VALUES[column]))
    while lacking:
        row: Row = dict(min(lacking, key=lambda pair: sum(map(used.count, pair))))
        for column in (column for column in by_choice if column not in row):
            trials = [_ordered({**row, column: value}) for value in VALUES[column]]
            allowed = [trial for trial in trials if REFUSED.keys().isdisjoint(pairs(trial))]
            row = max(
                allowed,
                key=lambda trial, new=column: (
                    sum(pair in lacking for pair in pairs(trial)),
                    -used.count((new, trial[new])),
                ),
                default=row,
            )
        for pair in pairs(row):
            lacking.pop(pair, None)
        used += row.items()
        yield row


def _ordered(row: Row) -> Row:
    return {column: row[column] for column in VALUES if column in row}


def _read(table: str) -> list[Row]:
    return [dict(zip(VALUES, line.split(), strict=True)) for line in table.split("\n") if line]


_BY_NAME = {name_of(row): row for row in _read(ROWS)}


if __name__ == "__main__":
    lacking = list(further_rows(_read(ROWS)))
    for added in lacking:
        print(" ".join(added.values()))
    if not lacking:
        print(f"complete: the {len(_BY_NAME)} rows have every pair")
