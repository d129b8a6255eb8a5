"""The readers of files and the binding under Atheris, libFuzzer for Python.

    python tests/fuzz/python.py TARGET CORPUS [options of libFuzzer, as -max_total_time=60]

TARGET: `toml` (scenes, drives), `saved` (states, results), `binding` (beltdyn._core called with
whatever). Coverage is that of the package's Python code. A call may give a result or one of the
documented exceptions; anything else, a crash or a hang is a finding, which libFuzzer writes to a
file that can be given in the place of CORPUS.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import atheris
import attrs

with atheris.instrument_imports(include=["beltdyn", "tomllib"]):
    import beltdyn as bd
    from beltdyn import _core
    from beltdyn.result.errors import SimulationError

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

Bytes = atheris.FuzzedDataProvider


# --- files --------------------------------------------------------------------------------------


def _edited(given: Bytes, content: bytes, pieces: list[bytes]) -> bytes:
    """With up to eight pieces of it replaced: by bytes, by a usual piece, by another part of it."""
    for _ in range(given.ConsumeIntInRange(0, 8)):
        at = given.ConsumeIntInRange(0, len(content))
        cut = given.ConsumeIntInRange(0, 12)
        which = given.ConsumeIntInRange(0, 3)
        if which == 0:
            new = given.ConsumeBytes(given.ConsumeIntInRange(0, 6))
        elif which == 1:
            new = pieces[given.ConsumeIntInRange(0, len(pieces) - 1)]
        elif which == 2:
            start = given.ConsumeIntInRange(0, len(content))
            new = content[start : start + given.ConsumeIntInRange(0, 40)]
        else:
            new = b""
        content = content[:at] + new + content[at + cut :]
    return content


PIECES = [
    b"\n",
    b"[",
    b"]",
    b"[[pulleys]]\n",
    b"[friction]\n",
    b"[[torque]]\n",
    b"kind = 'piecewise_linear'\n",
    b"= 0\n",
    b"= -1\n",
    b"= nan\n",
    b"= inf\n",
    b"= 1e308\n",
    b"= 1e-300\n",
    b"= []\n",
    b"= {}\n",
    b"= [[]]\n",
    b"= [0.0, 1.0]\n",
    b"= true\n",
    b"= ''\n",
    b"= 1979-05-27\n",
    b"= 'outside'\n",
    b"mount = {kind = 'slider'}\n",
    b"pulley = 1\n",
    b"length",
    b"preload",
    b"t_end",
    b"0x" + b"f" * 40,
]


def toml() -> Callable[[bytes], None]:
    names = ("kubas-case-1", "ntarladima-2023", "tensioned-alternator", "conveyor")
    documents = [bd.scenes.find(name).to_toml().encode() for name in names]

    def check(data: bytes) -> None:
        given = Bytes(data)
        whole = given.ConsumeIntInRange(0, len(documents))
        if whole == len(documents):
            content = given.ConsumeBytes(sys.maxsize)
        else:
            content = _edited(given, documents[whole], PIECES)
        text = content.decode("utf-8", "replace") + "\n"
        for kind in (bd.Scene, bd.Params):
            try:
                read = kind.from_toml(text)
            except ValueError as error:
                assert type(error) is ValueError and str(error) and "\n" not in str(error)
                continue
            assert kind.from_toml(read.to_toml()) == read, "what is read is written and read again"

    return check


def saved() -> Callable[[bytes], None]:
    folder = Path(tempfile.mkdtemp())
    import drives

    params = drives.plain()
    params = attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=24))
    rest = bd.settle(params)
    result = bd.simulate(params, bd.Viscous([0.0, 0.0]), 1e-4, initial=rest, t_eval=[0.0, 1e-4])
    rest.save(folder / "state.npz")
    result.save(folder / "result.npz")
    good = [(bd.State, (folder / "state.npz").read_bytes())]
    good += [(bd.Result, (folder / "result.npz").read_bytes())]
    path = folder / "read.npz"
    pieces = [
        b"\x00" * 8,
        b"\xff" * 8,
        b"'<f8'",
        b"(1,)",
        b"(-1,)",
        b"PK\x03\x04",
        b"PK\x01\x02",
        b"}",
        b"O",
    ]
    crcs = _checksums_right

    def check(data: bytes) -> None:
        given = Bytes(data)
        kind, content = good[given.ConsumeIntInRange(0, 1)]
        right = given.ConsumeBool()
        content = _edited(given, content, pieces)
        path.write_bytes(crcs(content) if right else content)
        try:
            read = kind.load(path)
        except ValueError as error:
            assert str(error).startswith(f"{path} is not a saved {kind.__name__}: ")
            assert "\n" not in str(error)
            return
        read.save(path)
        kind.load(path)

    return check


def _checksums_right(content: bytes) -> bytes:
    """With the check sums of an archive's members made those of their content, so that what is
    edited in them is read.
    """
    import io
    import struct
    import zipfile
    import zlib

    out = bytearray(content)
    with contextlib.suppress(Exception), zipfile.ZipFile(io.BytesIO(content)) as archive:
        at = archive.start_dir
        for member in archive.infolist():
            begin = member.header_offset
            name, extra = struct.unpack_from("<HH", content, begin + 26)
            begin_of_data = begin + 30 + name + extra
            crc = zlib.crc32(content[begin_of_data : begin_of_data + member.file_size])
            struct.pack_into("<I", out, begin + 14, crc)
            struct.pack_into("<I", out, at + 16, crc)
            at += 46 + sum(struct.unpack_from("<HHH", content, at + 28))
    return bytes(out)


# --- the binding --------------------------------------------------------------------------------


class Hostile(Exception):
    """What objects raise that are asked for anything."""


class Refuses:
    def _no(self, *_: Any, **__: Any) -> Any:
        raise Hostile

    __float__ = __index__ = __len__ = __iter__ = __getitem__ = __array__ = __call__ = __hash__ = _no


class Lies:
    """A sequence and a mapping whose length is another each time."""

    def __init__(self) -> None:
        self.asked = 0

    def __len__(self) -> int:
        self.asked += 1
        return self.asked % 7

    def __getitem__(self, key: Any) -> Any:
        self.asked += 1
        if self.asked % 11 == 10:
            raise IndexError
        return 0.1 * self.asked

    def keys(self) -> list[str]:
        return ["t", "x"]


def value(given: Bytes) -> Any:
    """Anything that somebody may hand over."""
    n = given.ConsumeIntInRange(0, 5)
    odd: list[Callable[[], Any]] = [
        lambda: None,
        given.ConsumeBool,
        given.ConsumeFloat,
        lambda: given.ConsumeIntInRange(-3, 100),
        lambda: given.ConsumeInt(9),
        lambda: 10 ** given.ConsumeIntInRange(0, 400),
        lambda: given.ConsumeRegularFloat(),
        lambda: given.ConsumeUnicode(n),
        lambda: given.ConsumeBytes(n),
        lambda: [value(given) for _ in range(n)],
        lambda: tuple(value(given) for _ in range(n)),
        lambda: np.array(given.ConsumeFloatListInRange(n, -1.0, 1.0)),
        lambda: np.zeros((n, given.ConsumeIntInRange(0, 3))),
        lambda: np.zeros(
            n, ["f4", ">f8", "i8", "O", "U3", "c16", "M8[s]", "?"][given.ConsumeIntInRange(0, 7)]
        ),
        lambda: np.ma.masked_array(np.zeros(n), n * [True]),
        lambda: np.broadcast_to(np.float64(1.0), (n, 2)),
        lambda: np.float64(given.ConsumeFloat()),
        lambda: math.nan,
        lambda: {"t": value(given)},
        lambda: {given.ConsumeUnicode(2)},
        lambda: lambda *a: value(given),
        lambda: lambda *a: [0.0, 0.0],
        Refuses,
        Lies,
        lambda: iter([1.0, 2.0]),
        lambda: object,
        lambda: _core.Model,
    ]
    return odd[given.ConsumeIntInRange(0, len(odd) - 1)]()


def changed(given: Bytes, tree: Any) -> Any:
    """The tree with one thing in it, or all, replaced; left out; or given twice."""
    if given.ConsumeIntInRange(0, 3) == 0:
        return value(given)
    if isinstance(tree, (list, tuple)) and tree:
        at, does = given.ConsumeIntInRange(0, len(tree) - 1), given.ConsumeIntInRange(0, 9)
        items = list(tree)
        if does == 0:
            del items[at]
        elif does == 1:
            items.insert(at, items[at])
        else:
            items[at] = changed(given, items[at])
        return type(tree)(items)
    if isinstance(tree, dict) and tree:
        at = given.ConsumeIntInRange(0, len(tree) - 1)
        key = list(tree)[at]
        if given.ConsumeIntInRange(0, 9) == 0:
            return {k: v for k, v in tree.items() if k != key}
        return {**tree, key: changed(given, tree[key])}
    if isinstance(tree, np.ndarray) and tree.size:
        tree = tree.copy()
        at = given.ConsumeIntInRange(0, tree.size - 1)
        tree.flat[at] = given.ConsumeFloat() if tree.dtype.kind == "f" else 7
        return tree
    if isinstance(tree, float):
        return tree * 10.0 ** given.ConsumeIntInRange(-6, 6)
    return value(given)


#: What calls are documented to raise, OverflowError of integers beyond C's as Python's own do (the
#: package checks them before), with what the objects handed over raise themselves.
DOCUMENTED = (
    TypeError, ValueError, OverflowError, RuntimeError, MemoryError, SimulationError, Hostile
)  # fmt: skip


def binding() -> Callable[[bytes], None]:
    from module_common import N_B, N_P, SCENE, TORQUE

    ring = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    full: dict[str, Any] = SCENE | {
        "drag": [None, (0.1, 1e-3, 0.0)],
        "pulley_friction": [None, ("lugre", (0.6, 0.8, 0.05, 1e4, 0.1, 0.0))],
        "mesh": "joint",
        "outside": [False, False],
        "names": ["crank", None],
        "mounts": [
            None,
            ("slider", (1.0, 0.0), (1.0, 0.0, 1e5, 1e3, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        ],
        "model": "auto",
    }
    terms: list[Any] = [
        *TORQUE,
        ("load", 1, (1.0, 0.1, 0.0), None),
        ("table", 1, [0.0, 10.0], [0.0, 5.0], ([0.0, 1e-3], [0.0, 1.0])),
        ("harmonics", 1, 0, [1.0], [0.5], [0.0], None),
        ("curve", 0, [-1.0, 1.0], [2.0, -2.0], None),
        ("call", lambda t, theta, omega: [0.0, 0.0]),
    ]
    motions: list[Any] = [
        (0, "piecewise", [0.0, 1.0], [0.0, 1.0]),
        (0, "speed", lambda t: 0.0),
        (0, "crank", [0.0, 1e-3], [0.0, 1.0], [2.0], [0.01], [0.0], (0.0, 1e-3)),
    ]
    friction = ("maxwell_slip", ((0.3, 0.3), (2e7, 1e7), (400.0, 300.0), 0.0, 0.0))
    calls: list[tuple[Callable[..., Any], dict[str, Any] | list[Any]]] = [
        (
            _core.belt_line,
            {"centers": SCENE["centers"], "radii": [0.1, 0.1], "outside": [False, False]},
        ),
        (_core.check_parameter, ["belt", "length", "belt", 1.0]),
        (
            _core.friction_law,
            {
                "friction": friction,
                "link_length": 0.05,
                "z": ring,
                "v": ring,
                "normal": ring,
                "element": 1,
            },
        ),
        (_core.friction_states, [friction]),
        (
            _core.span_tension,
            {
                "pulley": np.array([0, -1, -1, 1, -1, -1], np.int32),
                "force": ring[:6],
                "n_pulleys": 2,
            },
        ),
    ]
    model = _core.Model(**SCENE)
    settling = _core.Simulation.settle(model, friction=True)
    settling.advance(math.inf)
    rest = settling.state()
    options: dict[str, Any] = {
        "method": "auto",
        "rtol": 1e-4,
        "step": 0.0,
        "max_step": 0.0,
        "max_steps": 20,
        "ledger": True,
        "breakpoints": [1e-4],
        "torque_interval": 5e-4,
        "guards": True,
    }
    settle_options: dict[str, Any] = {
        "friction": True,
        "free_pulleys": False,
        "offset": np.zeros((2, 2)),
        "move_time": 0.0,
        "shift": 0.0,
        "tolerance": 1e-5,
        "max_time": 1e-4,
        "speed": 0.0,
    }
    assert len(rest["x"]) == N_B and len(rest["omega"]) == N_P

    def call(given: Bytes, function: Callable[..., Any], arguments: Any) -> Any:
        if given.ConsumeBool():
            arguments = changed(given, arguments)
        try:
            if isinstance(arguments, dict) and all(isinstance(name, str) for name in arguments):
                return function(**arguments)
            return (
                function(*arguments)
                if isinstance(arguments, (list, tuple))
                else function(arguments)
            )
        except DOCUMENTED as error:
            assert type(error) is not RuntimeError or str(error)
            return None

    def use(given: Bytes, made: Any) -> None:
        if isinstance(made, _core.Model):
            for name in ("info", "rest", "friction", "belt_model", "energy_terms"):
                getattr(made, name)
            n = made.info["n_bodies"]
            if n > 500:
                return
            call(given, made.check_geometry, [])
            call(given, made.centers, [made.rest])
            call(given, made.mount_forces, [made.rest])
            call(given, made.depth, [[0.1], [300.0], [10.0]])
            call(given, made.rate, {"state": rest, "torque": [0.0, 0.0]})
            call(given, made.set_going, {"state": rest, "speed": 1.0})
            call(given, made.observe, [rest])
            call(given, made.solve, {"state": rest, "g": 1e-5, "c": rest})
        elif isinstance(made, _core.Simulation):
            for _ in range(given.ConsumeIntInRange(0, 6)):
                which = given.ConsumeIntInRange(0, 6)
                if which == 0:
                    call(given, made.sample, {"t": [0.0, 1e-5], "outputs": ["x", "span_tension"]})
                elif which == 1:
                    call(given, made.import_record, [call(given, made.export_record, [])])
                elif which == 2:
                    call(given, made.advance, [0.0])
                elif which == 3:
                    call(given, made.time_passes, [1])
                elif which == 4:
                    made.stop()
                    with contextlib.suppress(KeyboardInterrupt):
                        call(given, made.advance, [0.0])
                    return
                else:
                    state = made.state()
                    assert all(np.isfinite(field).all() for field in state.values())
            for name in (
                "time",
                "samples",
                "method",
                "choice",
                "passes",
                "effects",
                "sizes",
                "stats",
                "warnings",
            ):
                getattr(made, name)

    def check(data: bytes) -> None:
        given = Bytes(data)
        which = given.ConsumeIntInRange(0, len(calls) + 3)
        if which < len(calls):
            call(given, *calls[which])
        elif which == len(calls):
            use(given, call(given, _core.Model, full))
        elif which == len(calls) + 1:
            arguments = {
                "model": model,
                "state": None if given.ConsumeBool() else rest,
                **settle_options,
            }
            use(given, call(given, _core.Simulation.settle, arguments))
        else:
            torque = [t for t in terms if given.ConsumeBool()]
            motion = [m for m in motions if given.ConsumeBool()]
            arguments = {
                "model": model,
                "state": rest,
                "torque": torque,
                "t_end": 1e-3,
                "motion": motion,
            }
            use(given, call(given, _core.Simulation, arguments | options))

    return check


def main() -> None:
    target: Callable[[], Callable[[bytes], None]] = {
        "toml": toml,
        "saved": saved,
        "binding": binding,
    }[sys.argv[1]]
    for corpus in sys.argv[2:3]:
        if not corpus.startswith("-") and not Path(corpus).is_file():
            os.makedirs(corpus, exist_ok=True)
    check = target()
    np.seterr(all="ignore")
    atheris.Setup([sys.argv[0], *sys.argv[2:]], check)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
