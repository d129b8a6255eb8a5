"""Cost of a step: the size of the state, the passes in order and their times."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable

import attrs

from .. import _core
from ..outputs.state import ROWS, SIZES

#: Part of the state of fields with several rows: of friction, at links in contact.
_FRICTION, _LEDGER = "friction", "ledger"
#: A number of the core's state.
_BYTES = 8
#: Rounds over all passes, of which medians are taken; a round takes some 2 ms.
_ROUNDS = 21
#: CPU time of the run in which a step is measured as a whole, and of the one before it in which
#: "auto" finds its method [s].
_RUN, _CHOICE = 0.15, 0.1


@attrs.frozen(kw_only=True)
class StateSize:
    """Size of the state.

    Attributes:
        parts: Numbers by part: "links", or "cells" and "modes" of an ALE belt, "friction",
            "pulleys", "mounts", "couplings", "ledger".
        fields: Names of what each part holds.
        numbers: Length of the state vector as the core keeps it, with its padding for vectors.
        bytes: The same in bytes.
        simulation: Bytes of the whole simulation: states, stages, linear systems, scratch, the
            one that runs beside it to see whether differences grow; without samples.
    """

    parts: dict[str, int]
    fields: dict[str, tuple[str, ...]]
    numbers: int
    bytes: int
    simulation: int


@attrs.frozen(kw_only=True)
class Pass:
    """A pass of a step.

    Attributes:
        name: What it does.
        calls: Number of calls in a step.
        seconds: Time of a call [s], the median of some rounds over all passes at a state of the
            run; called over and over, it finds its data in the cache.
    """

    name: str
    calls: float
    seconds: float

    @property
    def per_step(self) -> float:
        """Time of a step that it takes [s]."""
        return self.calls * self.seconds


@attrs.frozen(kw_only=True)
class Step:
    """Cost of a step of the method.

    Attributes:
        method: The method.
        passes: Its passes in their order.
        alone: Time of a whole step, called over and over like its passes [s].
        measured: CPU time of an accepted step in a short run [s]: with rejected steps, samples, the
            guards of the run and, now and then, the steps of the simulation beside it.
        steps: Number of accepted steps of that run.
        rejected: Number of its rejected steps.
    """

    method: str
    passes: tuple[Pass, ...]
    alone: float
    measured: float
    steps: int
    rejected: int

    @property
    def between(self) -> float:
        """Time of a whole step less that of its passes [s]."""
        return self.alone - sum(one.per_step for one in self.passes)


def size_of(sim: _core.Simulation, belt: _core.BeltFacts) -> StateSize:
    """Return the size of the state of a run."""
    state, sizes = sim.state(), sim.sizes
    parts: dict[str, int] = {}
    fields: dict[str, tuple[str, ...]] = {}
    for name, size in SIZES.items():
        if size in belt["lacks"] or (size == "LINKS" and name not in belt["fields"]):
            continue
        part = _FRICTION if size in ROWS else size.lower()
        parts[part] = parts.get(part, 0) + int(state[name].size)
        fields[part] = (*fields.get(part, ()), name)
    parts[_LEDGER] = sizes["works"]
    works = [name for name, kind, _ in _core.ENERGY_TERMS if kind in ("SUPPLIED", "LOST")]
    fields[_LEDGER] = tuple(works[: sizes["works"]])
    return StateSize(
        parts=parts,
        fields=fields,
        numbers=sizes["state"],
        bytes=_BYTES * sizes["state"],
        simulation=sizes["bytes"],
    )


def time_step(start: Callable[[str], _core.Simulation], method: str) -> Step:
    """Measure a step and its passes."""
    if method == "auto":
        method = _chosen(start(method))
    sim = start(method)
    begin = time.thread_time()
    while time.thread_time() - begin < _RUN and not sim.advance(0.0):
        pass
    seconds = time.thread_time() - begin
    steps, rejected = int(sim.stats["steps"]), int(sim.stats["rejected"])
    *passes, whole = sim.time_passes(_ROUNDS)
    return Step(
        method=method,
        passes=tuple(Pass(name=n, calls=c, seconds=max(s, 0.0)) for n, c, s in passes),
        alone=whole[2],
        measured=seconds / steps,
        steps=steps,
        rejected=rejected,
    )


def _chosen(sim: _core.Simulation) -> str:
    """Return the method with which "auto" covers the most time; it tries others now and then."""
    far: defaultdict[str, float] = defaultdict(float)
    begin, done = time.thread_time(), False
    while time.thread_time() - begin < _CHOICE and not done:
        at = sim.time
        done = sim.advance(0.0)
        far[sim.method] += sim.time - at
    return max(far, key=far.__getitem__)
