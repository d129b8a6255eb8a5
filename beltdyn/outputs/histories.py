"""Parts of a result: histories by group, the energy ledger, and counters.

Each class has exactly the rows of a table in ``csrc/fields.h``; a row of the core without a field
here, or a field without a row, is an error.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any, NoReturn, TypeVar

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base.checks import Array
from ..base.described import listed
from .averages import integral
from .quantity import LEDGER, QUANTITIES

_Kind = TypeVar("_Kind", bound="Group")
#: Groups by the name that they have in a result, in the order of files.
GROUPS: dict[str, type[Group]] = {}


class Group:
    """Arrays with time as the first axis.

    An array that a run was not asked for (``outputs`` of :func:`beltdyn.simulate`) is an
    AttributeError that says so.
    """

    def __init__(self, **arrays: Any) -> None:
        vars(self).update(arrays)

    def __getattr__(self, name: str) -> NoReturn:
        kind = type(self)
        if name not in kind.array_names() and not isinstance(getattr(kind, name, None), property):
            raise AttributeError(f"{kind.__name__!r} object has no attribute {name!r}")
        group = next(group for group, one in GROUPS.items() if one is kind)
        needed = group if group == LEDGER else f"{group}.{name}"
        raise AttributeError(
            f"{group}.{name} was not asked for: run simulate with outputs=(..., {needed!r}), or "
            f"without outputs for all that its belt has{absent(needed, '; ')}"
        )

    @classmethod
    def array_names(cls) -> tuple[str, ...]:
        """Return the names of the arrays."""
        return tuple(name for name in cls.__annotations__ if name != "names")

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by name; not those that the drive does not have, or not asked for."""
        arrays = {name: vars(self).get(name) for name in self.array_names()}
        return {name: array for name, array in arrays.items() if array is not None}

    def __repr__(self) -> str:
        arrays = self.arrays()
        if not arrays:
            return f"{type(self).__name__}(not asked for)"
        shape = next(iter(arrays.values())).shape
        return f"{type(self).__name__}({', '.join(arrays)}: {shape})"


def _group(name: str) -> Callable[[type[_Kind]], type[_Kind]]:
    """Enter a class in GROUPS; complete its docstring by the rows of its quantities."""

    def enter(kind: type[_Kind]) -> type[_Kind]:
        GROUPS[name] = kind
        rows = {field: QUANTITIES[f"{name}.{field}"] for field in kind.array_names()}
        return listed(kind, {one: f"{row.meaning} [{row.unit}]." for one, row in rows.items()})

    return enter


def absent(output: str, before: str = "") -> str:
    """Name the meshes that lack an output, such as "contact.slip"; "" if none does."""
    size = QUANTITIES[output].size if output in QUANTITIES else ""
    without = dict.fromkeys(f'"{row["mesh"]}"' for row in _core.BELTS if size in row["lacks"])
    return f"{before}belts on the mesh {' or '.join(without)} have none" if without else ""


@_group("pulleys")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class PulleyHistory(Group):
    """Pulleys over time, each (n_t, n_p), ``load`` (n_t, n_p, 2); their names (n_p,).

    Angle and speed of a pulley with a coupling are those of its shaft. ``torque`` of a pulley whose
    motion is prescribed is what it needs. ``load`` is what the bearings carry besides weights and
    the inertia of a pulley that moves; for a running belt it includes the relief by centrifugal
    force (``Result.hub_load``). It fluctuates as links land, an artefact of the mesh: its extremes
    are no design loads, they fall as ``n_bodies`` rises; those of the report are.
    """

    theta: Array
    omega: Array
    torque: Array
    load: Array
    names: tuple[str, ...]


@_group("belt")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class BeltHistory(Group):
    """Links over time, the coordinates of (2.1), each (n_t, n_b).

    For a string ``phi`` is the direction of the bar behind each mass, continuous along the belt;
    mass 0 has it within +-pi at every sample. Of an ALE belt places and velocities are those of the
    belt where each cell begins, on pulleys and at the ends of spans, and there are no angles; ALE
    belts alone have ``flow`` and its integral ``passed`` (n_t,), positive in the order of the
    cells, by which a mark on the belt is followed.
    """

    x: Array
    y: Array
    phi: Array
    vx: Array
    vy: Array
    vphi: Array
    # which attrs.evolve takes links without
    flow: Array = attrs.field(init=False)
    passed: Array = attrs.field(init=False)


@_group("joints")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class JointHistory(Group):
    """Joints (2.2) over time, each (n_t, n_b); joint i is on the left of link i."""

    deformation: Array
    force: Array


@_group("contact")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class ContactHistory(Group):
    """Contact of the links over time, (2.3)-(2.10), each (n_t, n_b).

    Without friction, ``friction``, ``mu`` and ``slip`` are zeros that take no memory and cannot be
    changed.
    """

    pulley: NDArray[np.int32]
    normal: Array
    friction: Array
    mu: Array
    slip: Array
    velocity: Array


@_group("spans")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class SpanHistory(Group):
    """Spans over time, of an ALE belt, which vibrates in them by sine modes.

    ``deflection`` has the amplitudes a_k of ``sin(k pi s)`` across the span after each pulley, s
    from 0 where it begins to 1, k from 1 on (n_t, n_p, K), from the straight line of the span.
    """

    deflection: Array = attrs.field(init=False)


@_group("mounts")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class MountHistory(Group):
    """Mounts over time, each (n_t, n_m), in the order of ``params.mounted``.

    Travels of arms are angles, counter-clockwise, and forces are torques [N m]; those of sliders
    are distances along the direction and forces [N]. Forces are positive in the sense of the
    travel. A path has a travel, the time, and the force of the belt alone.
    """

    travel: Array
    travel_speed: Array
    spring_force: Array
    damper_force: Array
    friction_force: Array
    stop_force: Array
    belt_force: Array


@_group("couplings")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class CouplingHistory(Group):
    """Couplings over time, each (n_t, n_c), in the order of ``params.coupled``.

    ``pulleys.theta`` and ``.omega`` are those of the hubs. For a torsional damper, rim stands for
    its ring. ``transmitted`` is 0 while a clutch overruns.
    """

    rim_angle: Array
    rim_speed: Array
    windup: Array
    transmitted: Array


@_group("energy")
@attrs.frozen(init=False, eq=False, repr=False, slots=False)
class EnergyLedger(Group):
    """Stored energies, work and losses over time, each (n_t,) [J]; MODEL section 7.

    The scale ``passed`` is the largest of the energy put in (summed over the samples), the net
    work, the losses and the change of the stored energy. Terms of effects that a drive does not
    have are None: ``drag_loss``, ``mount``, ``mount_loss``, ``path_work``, ``coupling``,
    ``coupling_loss``.
    """

    kinetic: Array
    axial: Array
    bending: Array
    contact: Array
    gravity: Array
    drive: Array
    joint_loss: Array
    contact_loss: Array
    friction_loss: Array
    residual: Array
    passed: Array
    drag_loss: Array | None
    mount: Array | None
    mount_loss: Array | None
    path_work: Array | None
    coupling: Array | None
    coupling_loss: Array | None

    def __init__(self, **terms: Any) -> None:  # none: the run was not asked for it
        super().__init__(**dict.fromkeys(self.array_names() if terms else ()) | terms)

    @property
    def total(self) -> Array:
        """Stored energy E (n_t,) [J]."""
        return self._sum("STORED")

    @property
    def losses(self) -> Array:
        """Energy dissipated by dampers, friction and drag since the start (n_t,) [J]."""
        return self._sum("LOST")

    def _sum(self, kind: str) -> Array:
        """Add up the terms of a kind of ``_core.ENERGY_TERMS``."""
        terms = [getattr(self, name) for name, of, _ in _core.ENERGY_TERMS if of == kind]
        return functools.reduce(np.add, [term for term in terms if term is not None])

    @classmethod
    def _from_core(cls, t: Array, params: Any, columns: Array, power: Array) -> EnergyLedger:
        """``power``: of the set torques, per pulley (n_t, n_p) [W]."""
        named = dict(zip(params._model.energy_terms, columns.T, strict=True))
        ledger = cls(**named)
        fed_in = integral(t, np.maximum(power, 0.0).sum(axis=1))
        with np.errstate(invalid="ignore"):  # a failed run may hold infinite energies
            gained = np.abs(ledger.total - ledger.total[:1])
        scale = np.max([fed_in, np.abs(ledger.drive), ledger.losses, gained], axis=0)
        return cls(**named, passed=np.maximum.accumulate(scale))


#: What Python adds to the counters of the core.
_OF_PYTHON = {
    "method": 'integration method used; "auto" if the run changed between two',
    "choice": "why that one, or what share each of the two had",
    "kernels": 'instruction level of the C core\'s inner loops: "baseline", "avx2" or "avx512"',
    "cpu_time": "CPU time of the run [s], without settling",
    "wall_time": "wall time of the run [s], without settling",
    "settle_time": "wall time of settling before the run [s], 0 if there was none",
}
_OF_CORE = {name: text for name, text in _core.STATS if name != "residual"}  # that of settling


@partial(listed, texts={name: f"{text}." for name, text in (_OF_PYTHON | _OF_CORE).items()})
@attrs.frozen(kw_only=True)
class Stats:
    """Counters, times and error estimates of a run.

    The balance of energy closes but for the error of integration, whatever the method; it is
    negative where energy was lost, and checked with ``ledger=False`` as well. Slow growth of
    differences may go undetected, because it is measured over short intervals only: with less than
    1 % of critical damping of the joints' fastest vibration and implicit steps longer than that, in
    4000 short ones or a tenth as many as the run has, if that is more. Invariants are forces on the
    belt without a source and losses that supply energy, which must be rounding; they are seen at
    the end of the run.

    ``error`` is the root mean square over joints and time; not that of the mesh, mostly the larger
    one, which ``result.accuracy`` has. It was, on the paper's mesh, within a factor of five of the
    true error, mostly above it, in 98 of 100 random drives; on other meshes up to forty times too
    large, where a few steps have the largest local errors. It is computed from the larger of
    ``local_error`` and, with the ledger, of ``balance``, each times a factor that was measured
    (``csrc/run/driver.c``); times the growth of differences, if they grew, times what bounces of
    mounts on stops add, and of "lbdf2" and "lie", whose errors add up, times the root of the length
    of a long run. None for fixed steps, histories that diverge, links that vibrate on their contact
    hardly damped or chatter while nothing shows that differences do not grow, torque functions that
    change faster than the steps, slack spans. It leaves out that links which land cause vibrations
    that change friction, which long implicit steps damp out: 0.3 % of the tension of the paper's
    drive near its limit with 60 links, part of the error of such a mesh.

    ``rtol`` bounds ``local_error`` where errors are controlled. With fixed steps it is their error,
    of "rk4" that of a formula of order 3, many times its own: from 0.5 on there is a warning, and
    it is at least 1 if some steps had to be repeated with shorter ones. None if none was estimated,
    as in the first steps of "lbdf2" and "lie".
    """

    method: str
    kernels: str
    steps: int
    rejected: int
    nfev: int
    njev: int = 0
    nlu: int = 0
    changes: int = 0
    fallbacks: int = 0
    searches: int
    smallest_step: float
    largest_step: float
    spectral_bound: float
    cpu_time: float
    wall_time: float
    settle_time: float = 0.0
    balance: float = 0.0
    growth: float = 0.0
    twin_steps: int = 0
    invariant: float = 0.0
    error: float | None = None
    local_error: float | None = None
    choice: str = ""

    @classmethod
    def _from_core(cls, counters: Mapping[str, Any], **others: Any) -> Stats:
        values = dict(counters)
        del values["residual"]  # of settling alone: State.residual has it
        for name in ("error", "local_error"):
            values[name] = values[name] or None
        return cls(**values, **others)


def absent_groups(params: Any) -> set[str]:
    """Return the groups that a drive does not have."""
    return {row.group for row in QUANTITIES.values() if params._having.get(row.size) == ()}


def shape_of(size: str, params: Any) -> tuple[int, ...]:
    """Return the shape of a history of this size, at one sample."""
    n_p = len(params.pulleys)
    count = params._model.sizes.get(size, n_p)  # spans, which the core does not count
    if size == "FLOW":
        return ()
    if size == "MODES":
        return n_p, count // n_p
    return (count or params.n_bodies, *((2,) if size == "PLANE" else ()))  # zeros: no friction


def _passed(t: Array, flow: Array, theta: Array | None, omega: Array) -> Array:
    """Integrate the flow (n_t,) over time: by the angle of pulley 0, and by samples of creep."""
    square = float(omega @ omega)
    ratio = float(flow @ omega) / square if theta is not None and square > 0.0 else 0.0
    gone = integral(t, flow - ratio * omega)
    return gone if theta is None else gone + ratio * (theta - theta[:1])


def kept(names: Collection[str] | None, params: Any) -> dict[str, tuple[int, ...]]:
    """Return which arrays a run has that was asked for these, None: all, and shapes at a sample."""
    lacks, terms = params._belt_facts["lacks"], {*params._model.energy_terms, "passed"}
    found = {}
    for name, row in QUANTITIES.items():
        asked = bool(row.group) if names is None else (name in names or row.group in names)
        has = row.size not in lacks and params._having.get(row.size) != ()
        if asked and (row.field in terms if row.group == LEDGER else has):
            found[name] = () if row.group == LEDGER else shape_of(row.size, params)
    return found


def grouped(
    arrays: Mapping[str, NDArray[Any]], names: Collection[str] | None, params: Any
) -> dict[str, Any]:
    """Put arrays, by dotted names, into groups; None of those that drive or run do not have."""
    found: dict[str, dict[str, Any]] = {group: {} for group in GROUPS}
    for name, values in arrays.items():
        group, _, field = name.partition(".")
        found[group][field] = values
    none = absent_groups(params)
    if names is None and not found[LEDGER]:
        none.add(LEDGER)
    return {name: None if name in none else GROUPS[name](**own) for name, own in found.items()}


def histories(
    t: Array,
    arrays: Mapping[str, NDArray[Any]],
    params: Any,
    names: Collection[str] | None = None,
) -> dict[str, Any]:
    """Return the groups by name, with what was asked for of what the core has sampled."""
    if "flow" in arrays:
        theta = arrays["theta"][:, 0] if "theta" in arrays else None
        with np.errstate(all="ignore"):  # a failed run may end with huge numbers
            passed = _passed(t, arrays["flow"].reshape(t.size), theta, arrays["omega"][:, 0])
        arrays = {**arrays, "passed": passed}
    found = {}
    for name, shape in kept(names, params).items():
        row = QUANTITIES[name]
        if row.size in ("FRICTION", "SLIPS") and row.field not in arrays:
            found[name] = np.broadcast_to(0.0, (t.size, *shape))
        elif row.group not in ("", LEDGER):
            found[name] = np.reshape(arrays[row.field], (t.size, *shape))
    groups = grouped(found, names, params)
    if LEDGER in arrays and (names is None or LEDGER in names):
        power = arrays["torque"] * arrays["omega"]
        groups[LEDGER] = EnergyLedger._from_core(t, params, arrays[LEDGER], power)
    return groups
