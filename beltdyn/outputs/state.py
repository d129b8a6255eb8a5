"""The state of a drive: positions, velocities and friction, from which a run can start."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from typing import Any

import attrs
import numpy as np

from .. import _core
from ..base import npz
from ..base.checks import Array, real, real_array
from ..base.described import ruled
from ..base.naming import ByPulley, by_index, key, labels
from ..drive.couplings import OverrunningClutch
from ..drive.params import Params
from .spans import span_tension

#: By what rims of pulleys that a belt runs on without load may differ: more than the radii on which
#: it runs and creep make of them, and less than slip.
RIMS = 0.01

TABLE = _core.STATE_FIELDS
SIZES: dict[str, str] = {row[0]: row[1] for row in TABLE}
SPEEDS = tuple(name for name, _, unit, _ in TABLE if "/s" in unit)
#: Those that can have several rows, each of all links.
ROWS = ("STATES", "SLOTS")
#: Which array of a size says how many values there are.
_FIRST = {size: name for name, size in reversed(SIZES.items())} | dict.fromkeys(ROWS, "x")
_RESIDUAL = "after settling, the largest unbalanced force over the mean tension; else None."
#: Those that only some drives have.
PARTS = tuple(size for size in _FIRST if size not in ("PULLEYS", *ROWS))


def _checked(_cls: type, fields: list[attrs.Attribute[Any]]) -> list[attrs.Attribute[Any]]:
    """Set how every field is read and compared."""

    def reads(name: str) -> Any:
        if name in SIZES:
            most = 2 if SIZES[name] in ROWS else 1
            return partial(real_array, f"State.{name}", ndim=1, most=most)
        number = partial(real, f"State.{name}")
        return attrs.converters.optional(number) if name == "residual" else number

    same = attrs.cmp_using(eq=np.array_equal)
    return [field.evolve(converter=reads(field.name), eq_key=same) for field in fields]


def belt_speed(name: str, params: Params, omega: ByPulley[float]) -> tuple[dict[int, float], float]:
    """Check speeds of pulleys that a belt runs with; return them and the speed of their rims."""
    names = params.pulley_names
    if not isinstance(omega, Mapping):
        raise TypeError(
            f"{name} must be a mapping from pulleys to speeds, such as "
            f"{{{key(0, names)}: 100.0}} [rad/s], got {omega!r}"
        )
    if not omega:
        raise ValueError(f"{name} must name at least one pulley")
    speeds = {
        index: real(f"{name}[{key(index, names)}]", value, "rad/s")
        for index, value in by_index(name, omega, names).items()
    }
    rims = {index: float(params._rolling[index]) * value for index, value in speeds.items()}
    slowest, fastest = (choose(rims, key=rims.__getitem__) for choose in (min, max))
    v = rims[fastest]
    if v - rims[slowest] > RIMS * max(map(abs, rims.values())):
        raise ValueError(
            f"the rims of {labels(slowest, fastest, names)} must run at one speed, got "
            f"{rims[slowest]:.10g} and {v:.10g} m/s along the belt: name one of them, or make "
            "a state with these speeds yourself"
        )
    return speeds, next(iter(rims.values()))


def _zeros(like: str) -> Any:
    """Return the default of a field: as many zeros as this one has."""
    return attrs.Factory(lambda self: np.zeros_like(getattr(self, like)), takes_self=True)


_NONE = attrs.Factory(lambda: np.empty(0))
_LINKS, _CELLS, _MODES, _PULLEYS = map(_zeros, ("x", "m", "a", "theta"))
_MOUNTS, _COUPLINGS, _ALONG = map(_zeros, ("travel", "rim_angle", "along"))


@attrs.frozen(kw_only=True, eq=False)
class Tensions:
    """The tensions of a belt at one moment.

    Attributes:
        joints: Force in the joint on the left of each link (n_b,) [N], tension positive.
        spans: Mean of these over the free span that follows each pulley (n_p,) [N]; NaN where no
            joint is free.
        mean: Mean over all joints, or over the belt in all cells [N].
    """

    joints: Array
    spans: Array
    mean: float

    def __str__(self) -> str:
        spans = ", ".join(f"{tension:.5g}" for tension in self.spans)
        return f"mean tension {self.mean:.5g} N; spans {spans} N"


def _described(cls: type[State]) -> type[State]:
    """Append what the core's table says of each field to the docstring."""
    count = {"PULLEYS": "n_p", "MOUNTS": "n_m", "COUPLINGS": "n_c"}
    count |= {"MODES": "n_p n", "ALONG": "n_p"}
    ruled(
        cls,
        {name: f"{text} ({count.get(of, 'n_b')},) [{unit}]." for name, of, unit, text in TABLE}
        | {"t": "time [s].", "residual": _RESIDUAL},
    )
    return cls


@_described
@attrs.frozen(kw_only=True, repr=False, field_transformer=_checked)
class State:
    """Positions, velocities and friction of every link, angle and speed of every pulley.

    Arrays are copies that cannot be changed. Everything but positions and angles is zero if not
    given; of what a drive does not have arrays are empty: ``x`` to ``vphi`` are of links, ``m``,
    ``v``, ``a`` and ``p`` of the cells and spans of an ALE belt (``Belt(mesh="ale")``), in the
    order of the belt: the span behind pulley 0, the arc of pulley 1, and so on; ``along`` and
    ``along_speed`` of one whose spans are heavy against the inertia of its pulleys (MODEL section
    11.5), whose runs may start from a state without them, too. Across joint 0, between the last
    link and the first, ``phi`` differs by a whole turn (MODEL section 1).

    ``mu`` is the state of the friction law: of Dahl's the friction coefficient (2.9) [1], of
    LuGre's the part of it that the bristles carry [1], of an elastic/plastic law the stretch of the
    spring [m]; 0 of laws without a state and off the pulleys. A law with several states, such as
    MaxwellSlip, has a row for each (n_states, n_b). Where spans are so short that a joint of two
    links touches both of their pulleys, all rows of one pulley come before those of the other, and
    ``slip`` has rows, too. ``theta`` and ``omega`` of a pulley with a coupling are those of its
    hub; what its rim has is in the order of ``params.coupled``, and the windup of a clutch is never
    negative.
    """

    x: Array = _NONE
    y: Array = _LINKS
    phi: Array = _LINKS
    vx: Array = _LINKS
    vy: Array = _LINKS
    vphi: Array = _LINKS
    m: Array = _NONE
    v: Array = _CELLS
    mu: Array = attrs.Factory(lambda self: np.zeros(self.n_bodies), takes_self=True)
    slip: Array = _LINKS
    theta: Array
    omega: Array = _PULLEYS
    travel: Array = _NONE
    travel_speed: Array = _MOUNTS
    mount_friction: Array = _MOUNTS
    rim_angle: Array = _NONE
    rim_speed: Array = _COUPLINGS
    windup: Array = _COUPLINGS
    a: Array = _NONE
    p: Array = _MODES
    along: Array = _NONE
    along_speed: Array = _ALONG
    t: float = 0.0
    residual: float | None = None

    def __attrs_post_init__(self) -> None:
        for name, size in SIZES.items():
            shape, like = getattr(self, name).shape, _FIRST[size]
            expected = (self.n_bodies,) if size == "STATES" else getattr(self, like).shape
            if shape[-1:] != expected:
                raise ValueError(
                    f"State.{name} must have shape {expected} like {like}, got {shape}"
                )

    @property
    def n_bodies(self) -> int:
        """Number of links, n_b; of cells for an ALE belt."""
        return max(self.x.size, self.m.size)

    @property
    def n_pulleys(self) -> int:
        """Number of pulleys, n_p."""
        return self.theta.size

    def __reduce__(self) -> tuple[Any, ...]:
        # Through the constructor, so that a copy is checked and immutable as well.
        return partial(State, **attrs.asdict(self, recurse=False)), ()

    def __repr__(self) -> str:
        at_rest = "" if self.residual is None else f", residual {self.residual:.2g}"
        nodes = "cells" if self.m.size else "links"
        return (
            f"State(t={self.t:.6g}, {self.n_bodies} {nodes}, {self.n_pulleys} pulley(s){at_rest})"
        )

    def check_fits(self, params: Params, argument: str = "initial") -> None:
        """Raise ValueError unless the state can be one of a drive, by its shapes and clutches."""
        sizes, lacks = params._model.sizes, params._belt_facts["lacks"]
        for name, size in SIZES.items():
            shape, of_rows = getattr(self, name).shape, size in ROWS and size not in lacks
            expected = (int(params.info["n_bodies"]) if of_rows else sizes[size],)
            if shape[-1:] != expected and not (size == "ALONG" and 0 in shape + expected):
                raise ValueError(
                    f"{argument}.{name} must have shape {expected}, got {shape}: it is a state of "
                    "another mesh or drive"
                )
        for k, windup in zip(params.coupled, self.windup, strict=True):
            if isinstance(params.pulleys[k].coupling, OverrunningClutch) and windup < -1e-9:
                raise ValueError(
                    f"{argument}.windup of a clutch must be >= 0 (rad), got {windup:g} of that of "
                    f"{params.label(k)}"
                )

    def tension(self, params: Params) -> Tensions:
        """Return the tensions of the belt, as a run reports them (``result.span_tension``).

        Args:
            params: The drive.

        Raises:
            ValueError: The state is not one of this drive.
        """
        self.check_fits(params)
        seen = params._model.observe(self._to_core(params))
        spans = span_tension(seen["pulley"], seen["force"], len(params.pulleys))
        joints = seen["force"][0]
        mean = float(np.average(joints, weights=self.m if self.m.size else None))
        return Tensions(joints=joints, spans=spans[0], mean=mean)

    def at_speed(self, params: Params, omega: ByPulley[float]) -> State:
        """Return the same state with the belt running, and all pulleys turning with it.

        The belt circulates along itself at the speed of the pulleys named where it runs on them,
        and the others turn with it. Positions, angles and friction stay as they are: what the
        centrifugal force of the running belt changes is not in this state, and develops in a
        transient. ``settle(params, speed=...)`` returns a belt that runs steadily.

        Args:
            params: The drive.
            omega: Speeds of one or several pulleys, by index or name [rad/s]; of several, the
                speeds of their rims must agree to 1 %, and the belt goes with the first.

        Raises:
            TypeError: Not a mapping from pulleys to numbers.
            ValueError: No pulley is named, or there is no such one; the rims' speeds differ.
        """
        self.check_fits(params)
        speeds, v = belt_speed("omega", params, omega)
        core = self._to_core(params)
        if v != 0.0:
            # to the first order the belt has the speed of the rim; then that of where it runs
            first, value = next(iter(speeds.items()))
            v *= value / float(params._model.set_going(core, v)["omega"][first])
        going = params._model.set_going(core, v)
        turning = np.array(going["omega"])
        turning[list(speeds)] = list(speeds.values())
        moving = {name: going[name] for name in SPEEDS}
        for c, k in enumerate(params.coupled):
            moving["rim_speed"][c] = turning[k]
        return attrs.evolve(self, **moving | {"omega": turning}, residual=None)

    @classmethod
    def _from_core(cls, state: Mapping[str, Any], **changes: Any) -> State:
        # Without friction the core has no friction state; mu and slip are zero then.
        fields = {name: state[name] for name in SIZES if np.size(state[name])}
        n_bodies = next(iter(fields.values())).size
        for name in (name for name in fields if SIZES[name] in ROWS):
            if fields[name].size > n_bodies:
                fields[name] = fields[name].reshape(-1, n_bodies)
        return cls(**{"t": state["t"], **fields, **changes})

    def _with_waves(self, params: Params) -> State:
        """Return the state with waves along its spans, at rest, if the drive has them."""
        # States go from drive to drive, of lighter pulleys (with such waves) or heavier ones.
        if self.along.size == params.info["n_along"]:
            return self
        along = speed = np.empty(0)
        if not self.along.size:
            spans = np.flatnonzero(params._cells < 0)
            speed = 2.0 / np.pi * (self.v[spans] + self.v[spans + 1])
            along = np.zeros_like(speed)
        return attrs.evolve(self, along=along, along_speed=speed)

    def _to_core(self, params: Params) -> dict[str, Any]:
        own = self._with_waves(params)
        slots, states = int(params.info["n_slots"]), int(params.info["n_states"])
        counts = {"SLOTS": slots, "STATES": slots * states}

        def flat(name: str, size: str) -> Array:
            value: Array = getattr(own, name)
            count = counts.get(size, 1)
            if count == 0:
                return np.empty(0)
            if value.size == count * value.shape[-1]:
                return value.ravel()
            if not value.any():
                return np.zeros(count * value.shape[-1])
            each = count // slots  # rows of a slot
            rows = value.size // value.shape[-1]
            if rows % each or rows // each != self.slip.size // self.n_bodies:
                raise ValueError(
                    f"initial.{name} must have {count} row(s), one for each state of the "
                    f"friction laws, got {rows}: is it of a drive with other laws? Settle "
                    "this one, or give a state with zeros"
                )
            # of another number of slots: of each link what it has; a run leaves it to the pulley
            # that the link touches
            by_slot = value.reshape(-1, each, self.n_bodies)
            most = np.abs(by_slot).argmax(axis=0)[None]
            return np.tile(np.take_along_axis(by_slot, most, axis=0)[0], (slots, 1)).ravel()

        return {"t": self.t, **{name: flat(name, size) for name, size in SIZES.items()}}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.npz`` file, exactly to ``path``.

        Raises:
            OSError: It cannot be written; a file that was there before is unchanged.
        """
        values: dict[str, Any] = {name: getattr(self, name) for name in (*SIZES, "t")}
        if self.residual is not None:
            values["residual"] = self.residual
        npz.write(path, values)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> State:
        """Read what :meth:`save` wrote.

        Raises:
            OSError: The file cannot be read.
            MemoryError: It is larger than the memory.
            ValueError: It is not a saved state; the message says what is wrong.
        """

        def build(values: dict[str, Any]) -> State:
            numbers: dict[str, Any] = {
                name: float(npz.number_array(name, values[name], np.float64, ()))
                for name in ("t", "residual")
                if name == "t" or name in values
            }
            return cls._of_file(values, "", **numbers)

        return npz.read(path, "State", (*SIZES, "t", "residual"), build)

    @classmethod
    def _of_file(
        cls,
        arrays: Mapping[str, Any],
        prefix: str,
        sizes: Mapping[str, int] | None = None,
        **others: Any,
    ) -> State:
        """Make a state of the arrays whose names have a prefix."""
        # Files of earlier versions have no arrays of parts that their drive does not have.
        fields: dict[str, Any] = {}
        for name, size in SIZES.items():
            if size in PARTS and prefix + name not in arrays and not (sizes and sizes[size]):
                continue
            value = arrays[prefix + name]
            shape = (value.size if sizes is None else sizes[size],)
            if size in ROWS:
                shape = value.shape if value.ndim == 2 else (value.size,)
            fields[name] = npz.number_array(prefix + name, value, np.float64, shape)
        return cls(**fields, **others)
