"""Results of a run: histories by group, the energy ledger, and counters."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import attrs
import numpy as np
from numpy.typing import NDArray

from . import _core
from .checks import Array
from .errors import RunWarning
from .params import Params
from .state import State

__all__ = [
    "BeltHistory",
    "ContactHistory",
    "EnergyLedger",
    "JointHistory",
    "PulleyHistory",
    "Result",
    "Stats",
]


def _names(kind: type[_Group]) -> list[str]:
    return [field.name for field in attrs.fields(kind)]  # type: ignore[arg-type]


class _Group:
    """Arrays with time as the first axis."""

    __slots__ = ()

    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {name: getattr(self, name) for name in _names(type(self))}

    def __repr__(self) -> str:
        arrays = self._arrays()
        shape = next(iter(arrays.values())).shape
        return f"{type(self).__name__}({', '.join(arrays)}: {shape})"


@attrs.frozen(eq=False, repr=False)
class PulleyHistory(_Group):
    """Pulleys over time, each (n_t, n_p).

    Attributes:
        theta: Angle, counter-clockwise [rad].
        omega: Angular velocity [rad/s].
        torque: Set torque M_d of (2.12) [N m].
    """

    theta: Array
    omega: Array
    torque: Array


@attrs.frozen(eq=False, repr=False)
class BeltHistory(_Group):
    """Links over time, the coordinates of (2.1), each (n_t, n_b).

    Attributes:
        x: Mass centre [m].
        y: Mass centre [m].
        phi: Angle, continuous [rad].
        vx: Velocity of the mass centre [m/s].
        vy: Velocity of the mass centre [m/s].
        vphi: Angular velocity [rad/s].
    """

    x: Array
    y: Array
    phi: Array
    vx: Array
    vy: Array
    vphi: Array


@attrs.frozen(eq=False, repr=False)
class JointHistory(_Group):
    """Joints (2.2) over time, each (n_t, n_b); joint i is on the left of link i.

    Attributes:
        deformation: Stretch along the joint [m].
        force: Force along the joint, tension positive [N].
    """

    deformation: Array
    force: Array


@attrs.frozen(eq=False, repr=False)
class ContactHistory(_Group):
    """Contact of the links over time, (2.3)-(2.10), each (n_t, n_b).

    Attributes:
        pulley: Index of the touched pulley, -1 for none (int).
        normal: Normal force N on the link (2.8) [N].
        friction: Friction force mu N (2.10) [N], on the link against the counter-clockwise tangent.
        mu: Friction coefficient (2.9) [1].
        slip: Slip displacement since contact began [m].
        velocity: Relative velocity v_T, counter-clockwise [m/s].
    """

    pulley: NDArray[np.int32]
    normal: Array
    friction: Array
    mu: Array
    slip: Array
    velocity: Array


@attrs.frozen(eq=False, repr=False)
class EnergyLedger(_Group):
    """Stored energies, work and losses over time, each (n_t,) [J]; MODEL section 7.

    Attributes:
        kinetic: Of links and pulleys.
        axial: Stored in the stretch of the joints.
        bending: Stored in the bending of the joints.
        contact: Stored in the contact.
        gravity: Potential.
        drive: Work done by the set torques since the start.
        joint_loss: Lost in the dampers of the joints since the start.
        contact_loss: Lost in the dampers of the contact since the start.
        friction_loss: Work of friction against slip since the start.
        residual: E(t) - E(0) - (drive - losses): zero but for the error of integration. It needs
            no reference solution.
        passed: Energy transmitted so far, the scale to judge the residual by: the largest of the
            energy put in (summed over the samples), the net work, the losses and the change of
            the stored energy.
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

    @property
    def total(self) -> Array:
        """Stored energy E (n_t,) [J]."""
        return self.kinetic + self.axial + self.bending + self.contact + self.gravity

    @property
    def losses(self) -> Array:
        """Energy dissipated by dampers and friction since the start (n_t,) [J]."""
        return self.joint_loss + self.contact_loss + self.friction_loss

    @classmethod
    def _from_core(cls, t: Array, columns: Array, power: Array) -> EnergyLedger:
        """``power``: of the set torques, per pulley (n_t, n_p) [W]."""
        named = {name: columns[:, k] for k, (name, _) in enumerate(_core.ENERGY_TERMS)}
        ledger = cls(**named, passed=np.zeros_like(t))
        fed = np.maximum(power, 0.0).sum(axis=1)
        fed_in = np.concatenate([[0.0], np.cumsum(np.diff(t) * (fed[1:] + fed[:-1]) / 2.0)])
        with np.errstate(invalid="ignore"):  # a failed run may hold infinite energies
            gained = np.abs(ledger.total - ledger.total[:1])
        scale = np.max([fed_in[: t.size], np.abs(ledger.drive), ledger.losses, gained], axis=0)
        return attrs.evolve(ledger, passed=np.maximum.accumulate(scale))


@attrs.frozen(kw_only=True)
class Stats:
    """Counters, times and error estimates of a run.

    Attributes:
        method: Integration method used; "auto" if the run changed between two.
        choice: Why that one, or what share each of the two had.
        kernels: Instruction level of the C core's inner loops: "baseline", "avx2" or "avx512".
        steps: Accepted steps.
        rejected: Rejected steps.
        nfev: Evaluations of the right-hand side.
        njev: Evaluations of the Jacobian; explicit methods need none.
        nlu: Factorisations; explicit methods need none.
        changes: Changes of method, by "auto".
        fallbacks: Steps in which only the linearly implicit Euler method succeeded.
        searches: Rebuilds of the list of links that can touch a pulley.
        smallest_step: Smallest accepted step [s].
        largest_step: Largest accepted step [s].
        spectral_bound: Closed-form bound of the joints' eigenvalues [1/s].
        cpu_time: CPU time of the run [s], without settling.
        wall_time: Wall time of the run [s], without settling.
        settle_time: Wall time of settling before the run [s], 0 if there was none.
        balance: Largest residual of the energy balance, over the energy transmitted: zero but for
            the error of integration, whatever the method; negative where energy was lost. It is
            checked with ``ledger=False`` as well.
        growth: Exponential growth rate of a small difference between two runs [1/s]; 0: none was
            seen. Slow growth may go undetected, because it is measured over short intervals only.
        twin_steps: Steps repeated from a slightly displaced state to measure this growth.
        error: Estimated error in time of the joint forces over the mean tension (root mean square
            over joints and time): the larger of ``local_error`` (five times that where a joint's
            stretch is more than three times the slip mu_k / sigma) and, with the ledger, five times
            ``balance``, multiplied by the growth of small differences where some was seen. Errors
            of "lbdf2" and "lie" accumulate: theirs is also multiplied by sqrt(k), where the run is
            k > 1 times as long as 780 round trips of a stretch wave along the belt, a second of
            the paper's drive. Within a factor of five of the true error, mostly above it, in 98 of
            100 random drives. It does not include the error of the mesh. None where no estimate
            holds: fixed steps, belts almost without damping, histories that diverge exponentially,
            links that chatter, torque functions that change faster than the steps, slack spans.
        local_error: Largest local error of a step, in the units of ``rtol``, which bounds it where
            errors are controlled. With fixed steps, their error: from 0.5 on there is a warning,
            and it is at least 1 if some had to be repeated with shorter ones. None if none was
            estimated, as in the first steps of "lbdf2" and "lie".
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
    error: float | None = None
    local_error: float | None = None
    choice: str = ""

    @classmethod
    def _from_core(cls, counters: Mapping[str, Any], **others: Any) -> Stats:
        known = {field.name for field in attrs.fields(cls)}
        values = {name: value for name, value in counters.items() if name in known}
        for name in ("error", "local_error"):
            values[name] = values[name] or None
        return cls(**values, **others)


_G = TypeVar("_G", bound=_Group)


def _mean(values: Array) -> Array:
    """Mean over time, without NaN; NaN where there is nothing else."""
    there = ~np.isnan(values)
    count = there.sum(axis=0)
    total = np.where(there, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


@attrs.frozen(eq=False, repr=False, kw_only=True)
class Result:
    """A run, finished or not.

    Time is the first axis of every array, of n_t samples; n_b links, joints, and n_p pulleys::

        pulleys   theta, omega, torque                             (n_t, n_p)
        belt      x, y, phi, vx, vy, vphi                          (n_t, n_b)
        joints    deformation, force                               (n_t, n_b)
        contact   pulley, normal, friction, mu, slip, velocity     (n_t, n_b)
        span_tension, slip                                         (n_t, n_p)
        energy    kinetic, ..., residual, passed                   (n_t,)

    Attributes:
        t: Sample times (n_t,) [s]; those reached, if the run did not finish.
        pulleys: Angles, speeds and set torques of the pulleys.
        belt: Coordinates and velocities of the links.
        joints: Deformation and force of the joints.
        contact: Contact and friction of the links; for a link on two pulleys those of the one with
            the larger normal force.
        energy: The energy ledger, None for ``ledger=False``.
        stats: Counters, times and error estimates.
        effects: Names of the effects that were simulated; one that the drive does not have
            (bending, gravity, friction, the ledger) is not computed either.
        success: Whether the run reached its end.
        status: "finished", "failed" or "interrupted".
        message: How the run ended, in words.
        params: The drive.
        final_state: State at the end of the run or, if it did not finish, at the last step; pass
            it as ``initial`` to continue.
        warnings: Everything found that a user may not expect, or that may make the results less
            accurate; each was also issued as a :class:`beltdyn.BeltdynWarning`.
    """

    t: Array
    pulleys: PulleyHistory
    belt: BeltHistory
    joints: JointHistory
    contact: ContactHistory
    energy: EnergyLedger | None
    stats: Stats
    effects: tuple[str, ...]
    success: bool
    status: str
    message: str
    params: Params
    final_state: State
    warnings: tuple[RunWarning, ...] = ()

    _GROUPS: ClassVar[dict[str, type[_Group]]] = {
        "pulleys": PulleyHistory,
        "belt": BeltHistory,
        "joints": JointHistory,
        "contact": ContactHistory,
        "energy": EnergyLedger,
    }

    @classmethod
    def _from_core(
        cls, t: Array, arrays: Mapping[str, NDArray[Any]], samples: int, **others: Any
    ) -> Result:
        done = {name: array[:samples] for name, array in arrays.items()}

        def group(kind: type[_G]) -> _G:
            return kind(**{name: done[name] for name in _names(kind)})

        t = t[:samples]
        return cls(
            t=t,
            pulleys=group(PulleyHistory),
            belt=group(BeltHistory),
            joints=group(JointHistory),
            contact=group(ContactHistory),
            energy=(
                EnergyLedger._from_core(t, done["energy"], done["torque"] * done["omega"])
                if "energy" in done
                else None
            ),
            **others,
        )

    @cached_property
    def span_tension(self) -> Array:
        """Mean joint force of the free span that follows each pulley (n_t, n_p) [N].

        Span k runs from pulley k on to the next pulley in the numbering of the links. Only joints
        between two links that touch nothing count; NaN where a span has none.
        """
        return self._span_tension(slice(None))

    def _span_tension(self, rows: Any) -> Array:
        """Compute :attr:`span_tension` at some of the samples."""
        touched, force = self.contact.pulley[rows], self.joints.force[rows]
        n_t, n_p = touched.shape[0], len(self.params.pulleys)
        before = _last_touched(touched)
        after = _last_touched(touched[:, ::-1])[:, ::-1]
        free = touched < 0
        in_span = free & np.roll(free, 1, axis=1) & (before >= 0)
        if n_p > 1:
            # A link lifted off within a wrap is not in a span.
            in_span &= before != after
        tension = np.full((n_t, n_p), np.nan)
        for k in range(n_p):
            here = in_span & (before == k)
            count = here.sum(axis=1)
            total = np.where(here, force, 0.0).sum(axis=1)
            np.divide(total, count, out=tension[:, k], where=count > 0)
        return tension

    @cached_property
    def slip(self) -> Array:
        """Speed lost against pulley 0, 1 - omega_k r_k / (omega_0 r_0) (n_t, n_p) [1].

        NaN while pulley 0 almost stands still, below a thousandth of its highest speed.
        """
        return self._slip(self.pulleys.omega)

    def _slip(self, omega: Array) -> Array:
        speed = omega * np.array([pulley.radius for pulley in self.params.pulleys])
        first = np.abs(speed[:, :1])
        stands = first <= 1e-3 * np.max(first, initial=0.0)
        return np.where(stands, np.nan, 1.0 - speed / np.where(stands, 1.0, speed[:, :1]))

    def __repr__(self) -> str:
        span = f"t = {self.t[0]:g} to {self.t[-1]:g} s" if self.t.size else "no samples"
        return (
            f"Result({self.status}: {self.t.size} samples, {span}, {self.belt.x.shape[1]} links, "
            f"{self.pulleys.theta.shape[1]} pulley(s); {self.stats.method}, {self.stats.steps} "
            f"steps, {self.stats.cpu_time:.3g} s CPU)"
        )

    def __str__(self) -> str:
        rows = self.summary()
        width = max(len(label) for label, _ in rows)
        return "\n".join([repr(self), *(f"  {label:<{width}}  {value}" for label, value in rows)])

    def summary(self) -> list[tuple[str, str]]:
        """List the most important results as pairs of label and value.

        Speeds, tensions and slip are means over the last tenth of the run, because links that
        arrive at a pulley or leave it make them fluctuate from sample to sample.
        """

        def per_pulley(values: Array, form: str, unit: str) -> str:
            return ", ".join("-" if v != v else f"{v:{form}}" for v in values) + unit

        stats = self.stats
        rows = [("status", self.status), ("time", f"{self.final_state.t:.6g} s")]
        if self.warnings:
            rows.append(("warnings", f"{len(self.warnings)}: {', '.join(_named(self.warnings))}"))
        if self.t.size:
            late = self.t >= self.t[-1] - 0.1 * (self.t[-1] - self.t[0])
            speeds = self.pulleys.omega[late].mean(axis=0)
            slip = self._slip(speeds[None])[0, 1:]
            rows += [
                ("mean over", f"the last {self.t[-1] - self.t[late][0]:.3g} s"),
                ("  pulley speeds", per_pulley(speeds, ".5g", " rad/s")),
                ("  span tensions", per_pulley(_mean(self.span_tension[late]), ".5g", " N")),
            ]
            # Beyond 100 % the pulleys turn in opposite directions and slip has no meaning.
            if slip.size and (np.abs(slip) <= 1.0).all():
                rows.append(("  slip against pulley 0", per_pulley(100 * slip, ".3g", " %")))
        if self.t.size and self.energy is not None:
            residual, passed = self.energy.residual[-1], self.energy.passed[-1]
            share = f" ({abs(residual) / passed:.2g} of {passed:.3g} J)" if passed > 0 else ""
            rows.append(("energy residual", f"{residual:.2g} J{share}"))
        return [
            *rows,
            ("method", stats.choice or stats.method),
            ("steps", f"{stats.steps} accepted, {stats.rejected} rejected"),
            ("estimated error", "unknown" if stats.error is None else f"{stats.error:.2g}"),
            ("local error", "-" if stats.local_error is None else f"{stats.local_error:.2g}"),
            ("evaluations", f"{stats.nfev}"),
            ("CPU time", f"{stats.cpu_time:.3g} s"),
            ("instruction level", stats.kernels),
        ]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an ``.npz`` file, exactly to ``path``: arrays by dotted name, such as "belt.x".

        Raises:
            OSError: It cannot be written; a file that was there before is unchanged.
        """
        from . import saved

        saved.write(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Result:
        """Read a file of :meth:`save`; nothing in it is executed, everything is checked.

        Raises:
            OSError: The file cannot be read.
            MemoryError: It is larger than the memory.
            ValueError: It is not a saved result, or one of another format; the message says what is
                wrong.
        """
        from . import saved

        return saved.read(path)


def _named(warnings: tuple[RunWarning, ...]) -> list[str]:
    """Name each warning, with the pulley or span if several have the same code."""
    codes = [one.code for one in warnings]
    return [
        f"{one.code} ({one.where})" if codes.count(one.code) > 1 and one.where else one.code
        for one in warnings
    ]


def _last_touched(touched: NDArray[np.int32]) -> NDArray[np.int32]:
    """Give the pulley touched by each link, or else by the nearest one before it; -1: none."""
    n_b = touched.shape[1]
    twice = np.concatenate([touched, touched], axis=1)
    index = np.where(twice >= 0, np.arange(2 * n_b), 0)
    nearest = np.maximum.accumulate(index, axis=1)[:, n_b:]
    return np.take_along_axis(twice, nearest, axis=1)
