"""Runs of the oracle, kept as data: a test reads one in a millisecond that takes SciPy seconds.

    python tests/stored_runs.py test_oracle/case-1-from-rest [NAME ...] | --all | --stale

A test module declares its runs, ``RUNS = stored_runs.Runs(__name__, {"a name": make})`` where
``make()`` gives a `Case`, and reads one by ``RUNS["a name"]``. A file of `tests/data/` holds the
states that `reference_run.integrate` has given, the state it began with, all that was handed to it
as text, and a hash of the oracle's source. A run whose inputs or oracle have changed since fails,
and names the command that makes all such runs anew.

Nothing here but the start comes from the core. It is an input, a state like any other, kept so that
both codes begin with the same bits whatever the core is now; it is made anew only if other inputs
have changed.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import importlib
import io
import os
import re
import token
import tokenize
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import pytest
import reference_mounts
import reference_run
from bridge import fields, oracle_of
from numpy.typing import NDArray
from reference import Motion, Reference

import beltdyn as bd

Array = NDArray[np.float64]

TESTS = Path(__file__).resolve().parent
DIRECTORY = TESTS / "data"
#: What the states of a run follow from, besides its inputs.
SOURCES = ("", "_run", "_friction", "_line", "_mounts", "_string")


@attrs.frozen(kw_only=True)
class Case:
    """A run of the oracle.

    The oracle stops at the kinks of its torque, and at breakpoints. `start` makes its first state.
    """

    oracle: Reference
    torque: bd.Torque
    start: Callable[[], bd.State | Mapping[str, Any]]
    after: Array  # times of the samples after the start [s]
    tol: float = 1e-8
    breakpoints: Sequence[float] = ()

    @classmethod
    def of(
        cls,
        params: bd.Params,
        torque: bd.Torque,
        start: Callable[[], bd.State | Mapping[str, Any]],
        after: Array,
        motion: Mapping[int, Motion] | None = None,
        **options: Any,
    ) -> Case:
        """The run of a drive of beltdyn, with prescribed speeds as the oracle takes them."""
        oracle = dataclasses.replace(oracle_of(params), motion=motion or {})
        return cls(oracle=oracle, torque=torque, start=start, after=after, **options)

    def stops(self) -> list[float]:
        terms = self.torque.terms([f"pulley {j}" for j in range(self.oracle.n_pulleys)])
        kinks = [t for term in terms if term[0] == "piecewise" for t in np.asarray(term[1])]
        mounts = self.oracle.mounts.values()
        paths = [t for one in mounts if isinstance(one, reference_mounts.Path) for t in one.t]
        return sorted({float(t) for t in (*kinks, *paths, *self.breakpoints)})

    def described(self) -> str:
        """All inputs but the start as text, a line each; numbers as another machine has them."""
        names = [f"pulley {j}" for j in range(self.oracle.n_pulleys)]
        given = {one.name: getattr(self.oracle, one.name)
                 for one in dataclasses.fields(self.oracle) if one.init}  # fmt: skip
        # a prescribed speed is a function: what it gives at the samples tells it from another
        given["motion"] = {j: [law(float(t)) for t in self.after]
                           for j, law in self.oracle.motion.items()}  # fmt: skip
        given |= {"belt": type(self.oracle).__name__, "torque": self.torque.terms(names)}
        given |= {"after": self.after, "tol": self.tol, "stops": self.stops()}
        return "\n".join(f"{name} = {_plain(value)}" for name, value in given.items())

    def integrate(self, start: Mapping[str, Any], samples: int | None = None) -> reference_run.Run:
        """Run the oracle to the last sample, or through the first few."""
        t = float(start["t"])
        with np.errstate(over="ignore", invalid="ignore"):  # in SciPy's far too long trial step
            return reference_run.integrate(
                self.oracle, self.oracle.pack(start), self.torque, t + self.after[:samples],
                t0=t, tol=self.tol, breakpoints=self.stops(),
            )  # fmt: skip


def _plain(value: Any) -> Any:
    """Plain text and lists of a value, floats to 12 digits."""
    if dataclasses.is_dataclass(value):
        mapping = {one.name: getattr(value, one.name) for one in dataclasses.fields(value)
                   if one.init}  # fmt: skip
        return {"": type(value).__name__, **_plain(mapping)}
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.12g}") + 0.0
    return value.item() if isinstance(value, np.generic) else value


@cache
def hash_of_oracle() -> str:
    """Of the oracle's modules without comments, docstrings and layout."""
    text = "".join(_code((TESTS / f"reference{name}.py").read_bytes()) for name in SOURCES)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _code(source: bytes) -> str:
    """Tokens of a source, a line for a statement; strings that are statements are left out, and
    spaces, since versions of Python differ in what they take for the tokens of an f-string.
    """
    ignored = (token.NL, token.COMMENT, token.ENCODING, token.ENDMARKER)
    tokens = tokenize.tokenize(io.BytesIO(source).readline)
    marks = {token.INDENT: "{", token.DEDENT: "}"}
    text, line = "", []
    for one in (each for each in tokens if each.type not in ignored):
        if one.type in marks:
            text += marks[one.type]
        elif one.type != token.NEWLINE:
            line.append(one)
        else:
            if [each.type for each in line] != [token.STRING]:
                text += "".join(each.string for each in line).replace(" ", "") + "\n"
            line = []
    return text


@attrs.frozen(eq=False, kw_only=True)
class Stored:
    """A run that was kept: the case, the state it began with, and the oracle's states."""

    case: Case
    start: dict[str, Any]
    y: Array
    steps: int

    @property
    def oracle(self) -> Reference:
        return self.case.oracle

    @property
    def t(self) -> Array:
        return float(self.start["t"]) + self.case.after

    @property
    def state(self) -> bd.State:
        """The start, for the core."""
        return bd.State(**self.start)


class Runs:
    """The runs of a test module, by name."""

    def __init__(self, module: str, cases: Mapping[str, Callable[[], Case]]) -> None:
        self.module, self.cases = module, cases
        self.slugs = {name: re.sub("[^a-z0-9]+", "-", name.lower()).strip("-") for name in cases}
        if len(set(self.slugs.values())) < len(cases):
            raise ValueError(f"two runs of {module} have the same file")

    def path(self, name: str) -> Path:
        return DIRECTORY / self.module / f"{self.slugs[name]}.npz"

    def read(self, name: str) -> tuple[Case, dict[str, Any], str]:
        """Return the case, what its file holds, and what is wrong with that, if anything."""
        case, path = self.cases[name](), self.path(name)
        if not path.exists():
            return case, {}, "is missing"
        with np.load(path, allow_pickle=False) as file:
            held = {key: value if value.ndim else value.item() for key, value in file.items()}
        now, then = case.described().split("\n"), str(held["inputs"]).split("\n")
        if now != then:
            changed = sorted(line.partition(" = ")[0] for line in {*now} ^ {*then})
            return case, held, f"is of other inputs ({', '.join(dict.fromkeys(changed))})"
        if held["oracle"] != hash_of_oracle():
            return case, held, "is of an oracle that has changed"
        return case, held, ""

    def __getitem__(self, name: str) -> Stored:
        case, held, wrong = self.read(name)
        if wrong:
            pytest.fail(
                f"tests/data/{self.module}/{self.slugs[name]}.npz {wrong}; if the change was "
                "meant: python tests/stored_runs.py --stale"
            )
        return Stored(case=case, start=_start(held), y=held["y"], steps=held["steps"])

    def make(self, name: str) -> None:
        case, held, wrong = self.read(name)
        if not held or wrong.startswith("is of other inputs"):
            start = case.start()
            given = fields(start) if isinstance(start, bd.State) else dict(start)
        else:
            given = _start(held)
        run = case.integrate(given)
        write(
            self.path(name),
            {"inputs": case.described(), "oracle": hash_of_oracle(), "y": run.y, "steps": run.steps}
            | {f"start.{key}": value for key, value in given.items()},
        )


def _start(held: Mapping[str, Any]) -> dict[str, Any]:
    return {key.removeprefix("start."): held[key] for key in held if key.startswith("start.")}


def write(path: Path, values: Mapping[str, Any]) -> None:
    """Write a compressed file whole or not at all: one cut short would look like a stale one."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **values)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_bytes(buffer.getvalue())
    os.replace(part, path)


@cache
def all_runs() -> list[Runs]:
    """Those of all test modules."""
    modules = [path.stem for path in sorted(TESTS.glob("test_*.py"))
               if "stored_runs.Runs(" in path.read_text("utf-8")]  # fmt: skip
    found = [vars(importlib.import_module(module)).values() for module in modules]
    return [one for values in found for one in values if isinstance(one, Runs)]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", help="MODULE/RUN, or MODULE for all of its runs")
    parser.add_argument("--all", action="store_true", help="all runs of all modules")
    parser.add_argument("--stale", action="store_true", help="those that do not fit their files")
    arguments = parser.parse_args()
    if not (arguments.names or arguments.all or arguments.stale):
        parser.error("name runs, or give --all or --stale")
    known = {(runs.module, runs.slugs[name]): (runs, name) for runs in all_runs()
             for name in runs.cases}  # fmt: skip
    wanted = {tuple(name.split("/")) for name in arguments.names}
    if unknown := wanted - {*known, *((module,) for module, _ in known)}:
        parser.error(f"there is no {', '.join('/'.join(one) for one in unknown)}")
    made = 0
    for (module, slug), (runs, name) in known.items():
        named = arguments.all or {(module,), (module, slug)} & wanted
        if named or (arguments.stale and runs.read(name)[2]):
            runs.make(name)
            print(f"{module}/{slug}: {runs.path(name).stat().st_size} bytes", flush=True)
            made += 1
    print(f"{made} of {len(known)} stored runs made anew")


if __name__ == "__main__":
    # test modules know the classes of the module that they import
    importlib.import_module("stored_runs").main()
