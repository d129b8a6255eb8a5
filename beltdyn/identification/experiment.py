"""Experiments on a test rig, and what was measured in them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import attrs
import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import Array, close_to, positive, real_array, refuse_masked, sample_times
from ..base.naming import ByPulley
from ..drive.parameters import changed, check_name
from ..drive.params import Params
from ..drive.scene import Scene, first_speeds
from ..loads.motions import MotionLike
from ..loads.torques import TorqueLike
from ..outputs.quantity import QUANTITIES, dimensions
from ..outputs.state import State
from ..result.labelled import places
from ..result.result import Result
from ..run.settling import settle
from ..run.simulation import simulate

#: Gets numbers from a run.
Read: TypeAlias = "Callable[[Result], ArrayLike]"

_MOST_DIMENSIONS = 64  #: of NumPy
_NAMES = 20  #: of columns that a message lists
_QUANTITY = re.compile(r"([a-z_.]+)(?:\[(.+)\])?")


def _keywords(function: Callable[..., Any], *others: str) -> set[str]:
    return {
        name
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY and name not in others
    }


_SETTLING = _keywords(settle, "initial", "progress")
_OPTIONS = _keywords(simulate, "t_eval", "initial", "progress")
_QUANTITIES = (*QUANTITIES, "energy.total", "energy.losses", "slip")


def _dict(value: Mapping[str, Any] | None) -> dict[str, Any]:
    if value is not None and not isinstance(value, Mapping):
        raise TypeError(f"settling, changes and options must be mappings, got {value!r}")
    return dict(value or {})


def _t_end(value: object) -> float:
    return positive("Experiment.t_end", value, "s")


@attrs.frozen(eq=False)
class Experiment:
    """One run on the test rig: its loads and motions, its duration, its initial state.

    Measurements are added with :meth:`curve` and :meth:`number`; all of them are compared with one
    and the same simulation.

    Attributes:
        torque_fn: The set torques, as :func:`beltdyn.simulate` takes them; a Python function is
            called from several threads.
        t_end: End of the run [s].
        settling: Arguments of :func:`beltdyn.settle` that override ``params.tensioning``, such as
            ``{"friction": True, "tolerance": 1e-5}``.
        motion: Prescribed motions of pulleys, {pulley: motion}, as :func:`beltdyn.simulate` takes
            them, such as the measured speed of the driving motor; the belt begins at the speeds
            that they begin with. None: the torques alone move the drive.
        changes: Parameters that differ in this run, by name; they replace the values in ``params``
            and those searched for: ``{"friction.sigma": 5e3}``,
            ``{"pulleys[1].center": (0.3, 0.0)}``.
        initial: The initial state: a State, or ``initial(params) -> State``, called from several
            threads; None: from :func:`beltdyn.settle`.
        options: Arguments of :func:`beltdyn.simulate`, such as ``{"rtol": 1e-3}``.
        name: Its name in messages and tables; None: "run", numbered if there are several.

    Raises:
        TypeError, ValueError: An argument breaks its rule.
    """

    torque_fn: TorqueLike
    t_end: float = attrs.field(converter=_t_end)
    settling: dict[str, Any] = attrs.field(default=None, converter=_dict, kw_only=True)
    motion: ByPulley[MotionLike] | None = attrs.field(default=None, kw_only=True)
    changes: dict[str, Any] = attrs.field(default=None, converter=_dict, kw_only=True)
    initial: State | Callable[[Params], State] | None = attrs.field(default=None, kw_only=True)
    options: dict[str, Any] = attrs.field(default=None, converter=_dict, kw_only=True)
    name: str | None = attrs.field(default=None, kw_only=True)

    def __attrs_post_init__(self) -> None:
        for field, known in (("settling", _SETTLING), ("options", _OPTIONS)):
            for key in getattr(self, field):
                if key not in known:
                    raise ValueError(
                        f"Experiment.{field} has no {key!r}{close_to(str(key), known)}: "
                        f"it takes {', '.join(sorted(known))}"
                    )
        for name in self.changes:
            check_name(name)
        if not (self.initial is None or isinstance(self.initial, State) or callable(self.initial)):
            raise TypeError(
                "Experiment.initial must be a State, a function of the parameters or None, "
                f"got {type(self.initial).__name__}"
            )
        if self.initial is not None and self.settling:
            raise ValueError("Experiment.settling has no effect where initial is given")
        if self.start >= self.t_end:
            raise ValueError(
                f"Experiment.t_end must be > initial.t ({self.start:g} s), got {self.t_end:g} s"
            )

    @property
    def start(self) -> float:
        """Time at which the run begins [s]."""
        return self.initial.t if isinstance(self.initial, State) else 0.0

    def drive(self, params: Params) -> Params:
        """Return the drive of this run.

        Raises:
            ValueError: There is no such drive.
        """
        return changed(params, self.changes)

    def begin(self, drive: Params) -> State:
        """Return the state this run starts from.

        Raises:
            SimulationError: The belt did not come to rest.
        """
        if self.initial is None:
            scene = Scene(drive, self.torque_fn, self.t_end, self.motion)
            speeds = first_speeds(scene, self.options.get("breakpoints", ()))
            return settle(drive, **{"speed": speeds, **self.settling})
        if isinstance(self.initial, State):
            return self.initial
        return self.initial(drive)

    def curve(
        self,
        quantity: str | Read,
        t: ArrayLike,
        values: ArrayLike,
        *,
        sigma: ArrayLike | None = None,
        name: str | None = None,
    ) -> Target:
        """Add a measured curve.

        Args:
            quantity: What was measured, as it is called in a Result, with its column:
                "pulleys.omega[1]", "pulleys.omega[fan]", "span_tension[crank to fan]",
                "joints.force[15]"; without a column, all of them. Or ``quantity(result)``, which
                returns the values at ``result.t``; it is called from several threads.
            t: Times of the samples (n_t,) [s], non-decreasing.
            values: The measured values (n_t,) or (n_t, k).
            sigma: Standard deviation of a measured value, one or an array that broadcasts to
                ``values``; None: unknown, see :func:`beltdyn.identify`.
            name: Its name in messages and tables; None: the quantity.

        Raises:
            TypeError, ValueError: An argument breaks its rule.
        """
        read = _reader(quantity)
        name = name or (quantity if isinstance(quantity, str) else _name_of(read))
        measured = real_array(f"target {name!r}: values", values, ndim=1, most=2)
        target = self._target(read, t, measured, sigma, name=name, parts=None, is_curve=True)
        if measured.shape[0] != target.t.size:
            raise ValueError(
                f"target {name!r}: values must have one row for each of the {target.t.size} times, "
                f"got shape {measured.shape}"
            )
        return target

    def number(
        self,
        read: Read,
        values: ArrayLike,
        *,
        t: ArrayLike | None = None,
        sigma: ArrayLike | None = None,
        name: str | None = None,
        names: Sequence[str] | None = None,
    ) -> Target:
        """Add one measured number, or several that are read together.

        Args:
            read: ``read(result)`` returns the number, or an array like ``values``; it is called
                from several threads.
            values: The measured value, or values (n,).
            t: Times of the samples in the Result that ``read`` receives [s]; None: 1001 equally
                spaced ones.
            sigma: Standard deviation of a measured value, one or (n,); None: unknown, see
                :func:`beltdyn.identify`.
            name: Its name in messages and tables; None: the name of ``read``.
            names: The same for each of several values (n,).

        Raises:
            TypeError, ValueError: An argument breaks its rule.
        """
        if not callable(read):
            raise TypeError(f"read must be callable, got {read!r}; a text is for curve()")
        name = name or _name_of(read)
        measured = np.atleast_1d(real_array(f"target {name!r}: values", values, ndim=0, most=1))
        if measured.size == 0:
            raise ValueError(f"target {name!r}: values must hold at least one number")
        if names is not None and len(names) != measured.size:
            raise ValueError(
                f"target {name!r}: names must hold one for each of the {measured.size} values, "
                f"got {len(names)}"
            )
        times = np.linspace(self.start, self.t_end, 1001) if t is None else t
        parts = None if names is None else tuple(names)
        return self._target(read, times, measured, sigma, name=name, parts=parts, is_curve=False)

    def _target(
        self, read: Read, t: ArrayLike, values: Array, sigma: ArrayLike | None, **others: Any
    ) -> Target:
        label = f"target {others['name']!r}"
        times = sample_times(f"{label}: t", t, self.start, self.t_end)
        if times.size == 0:
            raise ValueError(f"{label}: t must hold at least one time")
        if sigma is not None:
            sigma = _sigma(f"{label}: sigma", sigma, values.shape)
        return Target(experiment=self, read=read, t=times, values=values, sigma=sigma, **others)


@attrs.frozen(eq=False, kw_only=True)
class Target:
    """What was measured, and how to get the same from a simulation; see :class:`Experiment`.

    Attributes:
        experiment: The run in which it was measured.
        read: Function that reads it from a Result.
        t: Sample times of that Result (n_t,) [s].
        values: What was measured (n,), (n_t,) or (n_t, k).
        sigma: Standard deviation of the values, of their shape; None: unknown.
        name: Its name in messages and tables.
        parts: Names of the single numbers, if they have any.
        is_curve: Whether the values belong to the sample times.
    """

    experiment: Experiment = attrs.field(repr=False)
    read: Read = attrs.field(repr=False)
    t: Array = attrs.field(repr=False)
    values: Array = attrs.field(repr=False)
    sigma: Array | None = attrs.field(repr=False)
    name: str
    parts: tuple[str, ...] | None
    is_curve: bool

    def labels(self, name: str) -> list[str]:
        """Name every single number."""
        if self.is_curve:
            columns = [""]
            if self.values.ndim > 1:
                columns = [f"[{k}]" for k in range(self.values.shape[1])]
            return [f"{name}{column} at {t:g} s" for t in self.t for column in columns]
        if self.parts is not None:
            return list(self.parts)
        count = self.values.size
        return [name] if count == 1 else [f"{name}[{k}]" for k in range(count)]

    def compute(self, name: str, result: Result) -> Array:
        """Get the target from a run at its own times; NaN where the run has no value.

        Raises:
            TypeError, ValueError: It does not have the type or shape of the measurement.
        """
        read = self.read(result)
        refuse_masked(f"target {name!r}: what read gives", read)
        given = np.asarray(read)
        if given.dtype.kind not in "iuf":
            raise TypeError(f"target {name!r}: read must give real numbers, got {given.dtype}")
        if not self.is_curve:
            given = np.atleast_1d(given)
        if given.shape != self.values.shape:
            raise ValueError(
                f"target {name!r}: the run gives shape {given.shape}, the measured values have "
                f"{self.values.shape}"
            )
        return given.astype(np.float64)


def _name_of(read: Read) -> str:
    return str(getattr(read, "__name__", type(read).__name__))


def _sigma(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    given = real_array(name, value, ndim=0, most=_MOST_DIMENSIONS)
    try:
        array = np.broadcast_to(given, shape)
    except ValueError:
        raise ValueError(
            f"{name} must be one number or fit values of shape {shape}, got shape {given.shape}"
        ) from None
    if (array <= 0.0).any():
        raise ValueError(f"{name} must be > 0, got {array.min():g}")
    return array


def _reader(quantity: str | Read) -> Read:
    if callable(quantity):
        return quantity
    if not isinstance(quantity, str):
        raise TypeError(f"quantity must be a str or a function of a Result, got {quantity!r}")
    match = _QUANTITY.fullmatch(quantity)
    path, column = match.groups() if match else (quantity, None)
    if path not in _QUANTITIES:
        raise ValueError(f"a Result has no {path!r}{close_to(path, _QUANTITIES)}")

    def read(result: Result) -> Array:
        values = result._history(path)
        if column is None:
            return np.asarray(values)
        if values.ndim < 2:
            raise ValueError(f"{quantity}: {path} has no columns")
        if column.isdecimal():
            if int(column) >= values.shape[1]:
                raise ValueError(f"{quantity}: {path} has {values.shape[1]} columns")
            return np.asarray(values[:, int(column)])
        size = QUANTITIES[path].size if path in QUANTITIES else "PULLEYS"  # "slip"
        names = [str(one) for one in places(result.params)[dimensions(size)[0]]]
        if column not in names:
            raise ValueError(
                f"{quantity}: there is no {column!r}{close_to(column, names)}; there are "
                f"{', '.join(names[:_NAMES])}{', ...' * (len(names) > _NAMES)}"
            )
        return np.asarray(values[:, names.index(column)])

    return read
