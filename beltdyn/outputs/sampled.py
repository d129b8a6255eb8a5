"""A run as it was sampled: what reports, spectra and accuracy are read off."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.run_warnings import RunWarning
from ..drive import sanity
from ..drive.params import Params
from .accuracy_report import SPACE_FLOOR, TENSIONS, WORDS, Accuracy, QuantityError
from .averages import LAST, time_weights
from .histories import (
    GROUPS,
    BeltHistory,
    ContactHistory,
    CouplingHistory,
    EnergyLedger,
    JointHistory,
    MountHistory,
    PulleyHistory,
    SpanHistory,
    Stats,
)
from .quantity import SPANS
from .selection import has, lacking
from .spans import span_tension
from .state import State

#: Samples at which tensions are looked at; all change what they show by 1 to 3 %.
LOOKS = 100

#: Least friction force by which its errors are measured, as a share of the tension.
MIN_FRICTION = 1e-2


@attrs.frozen(eq=False, repr=False, kw_only=True)
class Sampled:
    """The part of :class:`beltdyn.Result`, which describes it, that was sampled."""

    t: Array
    pulleys: PulleyHistory
    belt: BeltHistory
    joints: JointHistory
    contact: ContactHistory
    spans: SpanHistory
    mounts: MountHistory | None
    couplings: CouplingHistory | None
    energy: EnergyLedger | None
    stats: Stats
    params: Params
    prescribed: tuple[str, ...] = ()
    warnings: tuple[RunWarning, ...] = ()
    outputs: tuple[str, ...] | None = None
    status: str
    message: str
    #: None of one read from a file, which has the accuracy that follows from it.
    _running: Running | None = None
    accuracy: Accuracy = attrs.Factory(lambda run: known(run), takes_self=True)
    #: Of a run asked for these, and not for the forces of all joints.
    _sampled_spans: Array | None = None

    def __attrs_post_init__(self) -> None:
        pulleys = PulleyHistory(**self.pulleys.arrays(), names=self.params.pulley_names)
        object.__setattr__(self, "pulleys", pulleys)

    @cached_property
    def span_tension(self) -> Array:
        """Mean joint force of the free span that follows each pulley (n_t, n_p) [N].

        Span k runs from pulley k on to the next pulley in the numbering of the links. Only joints
        between two links that touch nothing count, of a span with a single such link the joint
        before it. NaN where a span has none, and where no link touches one of its pulleys, as now
        and then on a wrap of less than a link or two: take ``numpy.nanmean``; reports leave these
        samples out and say how many they are. It is a mean over all of these joints, also where a
        belt with bending stiffness runs off its pulleys:
        there the force is up to EI / (2 r^2) less than in the middle of the span.
        """
        return self._span_tension(slice(None))

    def _span_tension(self, rows: Any) -> Array:
        """Return :attr:`span_tension` at some of the samples."""
        if self._sampled_spans is not None:
            return np.asarray(self._sampled_spans[rows])
        if not self._has("span_tension"):
            raise AttributeError(
                "span_tension was not asked for: run simulate with outputs=(..., 'span_tension'), "
                "or without outputs for all of them"
            )
        touched, force = self.contact.pulley[rows], self.joints.force[rows]
        return span_tension(touched, force, len(self.params.pulleys))

    def _has(self, name: str) -> bool:
        """Return whether an output is there."""
        return has(self.outputs, name) and name not in self._lacking

    @cached_property
    def _lacking(self) -> frozenset[str]:
        return lacking(self.params)

    def _histories(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of all groups by their dotted names."""
        return {
            f"{name}.{field}": array
            for name in GROUPS
            if (group := getattr(self, name)) is not None
            for field, array in group.arrays().items()
        }

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return all histories by their dotted names."""
        spans = {SPANS: self.span_tension} if self._has(SPANS) else {}
        return self._histories() | spans

    @property
    def _travel(self) -> Array | None:
        """Travels of the mounts (n_t, n_m) [rad or m]; None in a drive without."""
        return None if self.mounts is None else self.mounts.travel

    def _rims(self) -> Array | None:
        """Angular velocities of the rims under the belt (n_t, n_p) [rad/s]; None: not kept."""
        if not self._has("pulleys.omega"):
            return None
        on_rim = [
            (c, k) for c, k in enumerate(self.params.coupled) if self.params.pulleys[k].has_rim
        ]
        if not on_rim or self.couplings is None:
            return self.pulleys.omega
        if not self._has("couplings.rim_speed"):
            return None
        rims = np.array(self.pulleys.omega)
        for c, k in on_rim:
            rims[:, k] = self.couplings.rim_speed[:, c]
        return rims


def known(run: Sampled) -> Accuracy:
    """Return the accuracy of a run as far as it is known without another run.

    ``stats.error`` is that of all joint forces, which no span's tension exceeds by much.
    """
    stats, of_contact = run.stats, run.params._compliance_error
    with np.errstate(all="ignore"):  # a failed run may end with huge numbers
        of_mesh = {name: value for name, value in _of_mesh(run).items() if math.isfinite(value)}
    return Accuracy(
        errors=tuple(
            QuantityError(
                quantity=name,
                time=None if name not in TENSIONS or not stats.error else stats.error,
                space=max(SPACE_FLOOR, of_mesh[name]) if name in of_mesh else None,
                compliance=of_contact[name],
            )
            for name in WORDS
        ),
        local_error=stats.local_error,
        balance=stats.balance,
    )


@attrs.frozen(kw_only=True)
class Running:
    """Motion and load of the belt in a run, the same whatever outputs are kept."""

    rim_speed: float  # of the fastest rim, rms over the last part; the belt's but for creep [m/s]
    shaking: float  # relative rise of the mean tension by links that land then [1]
    shaking_over_time: float  # the same over the whole run
    pull: float = 0.0  # largest difference of mean tensions across a pulley, of its torque [N]
    power: float = 0.0  # largest mean power of a torque [W]
    # over the whole run:
    travel: float = 0.0  # of the rim that comes farthest [m]
    net: float = 0.0  # of the torques along the belt, mean [N]
    pushed: float = 0.0  # how far that would take pulleys and belt from rest [m]
    work: float = 0.0  # largest work of a torque [J]
    landed: float = 0.0  # the most that links lose as they land [J]
    turned: float = 0.0  # lost in dampers of links that turn with the belt [J]
    slipped: float = 0.0  # the most that friction takes without a mesh [J]


def running(params: Params, t: Array, arrays: Mapping[str, Array], end: State) -> Running:
    """Read motion and load of the belt off a run."""
    radii = params._radii
    omega, torque, across = arrays["omega"], arrays["torque"], arrays["across"][:, 0]
    if t.size < 2:
        speed = float(np.max(np.abs(end.omega * radii)))
        shaken = sanity.shaken(params, speed)
        return Running(rim_speed=speed, shaking=shaken, shaking_over_time=shaken)
    rims, lasts = np.max(np.abs(omega * radii), axis=1) ** 2, float(t[-1] - t[0])
    there = np.flatnonzero(~np.isnan(across))  # looked at in some samples

    def seen(last: float) -> tuple[float, float]:
        speed = math.sqrt(float(time_weights(t, t[-1] - last * lasts) @ rims))
        late = there[t[there] >= t[-1] - last * lasts]
        square = float(np.mean(across[late if late.size else there]))
        return speed, sanity.shaking_seen(params, speed, square, lasts)

    speed, shaken = seen(LAST)
    found = Running(rim_speed=speed, shaking=shaken, shaking_over_time=seen(1.0)[1])
    if not lasts > 0.0:
        return found
    # Means: motions that are prescribed need torques that jump with every link.
    late = time_weights(t, t[-1] - LAST * lasts)
    most = 2.0 * float(params.info["strain_tension"])  # all it can hold
    pull = min(most, float(np.max(np.abs(late @ torque) / radii)))
    power = float(np.max(np.abs(late @ (torque * omega))))
    inertia = np.array([pulley.inertia for pulley in params.pulleys])
    pulls = (torque - inertia * np.gradient(omega, t, axis=0)) / radii
    whole = time_weights(t, t[0]) * lasts
    landed, turned = sanity.landing_loss(params, np.sqrt(rims)) @ whole
    net = abs(float(time_weights(t, t[0]) @ torque @ (params.route.senses / radii)))
    mass = params.belt.linear_density * params.info["length"] + float(np.sum(inertia / radii**2))
    return attrs.evolve(
        found,
        pull=pull,
        power=power,
        travel=float(np.max(np.abs(whole @ omega) * radii)),
        net=net,
        pushed=0.5 * net / mass * lasts**2,
        work=float(np.max(np.abs(whole @ (torque * omega)))),
        landed=float(landed),
        turned=float(turned),
        slipped=float(np.sum(whole @ sanity.slip_loss(params, pulls, omega * params._rolling))),
    )


def _vibration(run: Sampled) -> float:
    """Return the vibration of the span tensions at the end of a run, root mean square [N]."""
    # Where small differences grow, other meshes vibrate as much at other phases.
    t, n_p = run.t, len(run.params.pulleys)
    rows = np.flatnonzero(t >= t[-1] - LAST * (t[-1] - t[0]))
    rows = rows[:: 1 + rows.size // LOOKS]
    tension = span_tension(run.contact.pulley[rows], run.joints.force[rows], n_p)
    tension = tension[:, np.isfinite(tension).all(axis=0)]
    return math.sqrt(float(np.mean(np.var(tension, axis=0)))) if tension.size else 0.0


def slowed(run: Sampled) -> tuple[float, float] | None:
    """Estimate by how much links slow the pulleys down, relative to their speed (MODEL section 6).

    What links that land, rub and catch take, and what their dampers do, which no mesh changes.
    None where speeds are prescribed or it is unknown, and of pulleys that only give way to the
    belt's stretch, unless torques push on while links can hold them: infinite.
    """
    seen, energy, info = run._running, run.energy, run.params.info
    if seen is None or energy is None or run.prescribed or not run._has("energy"):
        return None
    if run.params._flows:
        return None
    force, catch = sanity.cogging(run.params)
    if seen.travel <= (gives := info["strain"] * info["length"]):
        return (math.inf, 0.0) if seen.net < force and seen.pushed > gives else None
    swing = 2.0 * float(time_weights(run.t, run.t[0]) @ energy.kinetic)
    moving = swing + 0.5 * seen.work
    damped = float(np.ptp(energy.contact_loss) + np.ptp(energy.joint_loss))
    rubbed = max(0.0, float(np.ptp(energy.friction_loss)) - seen.slipped)
    lost = min(seen.landed, damped) + rubbed
    return (lost + catch) / moving, min(seen.turned, damped) / moving


def _of_mesh(run: Sampled) -> dict[str, float]:
    """Estimate the errors of the mesh, from the speeds, torques and losses of a run."""
    params, t, seen = run.params, run.t, run._running
    if seen is None:
        return {}
    shaking = {"tension": seen.shaking_over_time, "span_mean": seen.shaking}
    found = {
        name: sanity.mesh_error(params, shaken, seen.pull)[name] for name, shaken in shaking.items()
    }
    tension = float(params.info["strain_tension"])
    if run.stats.growth > 0.0 and run._has("joints.force") and run._has("contact.pulley"):
        found["tension"] = max(found["tension"], _vibration(run) / tension)
    if (slower := slowed(run)) is not None:
        found["speed"] = sum(slower)
    if not seen.power > 0.0 or not run._has("energy") or run.energy is None:
        return found
    first = int(np.argmax(time_weights(t, t[-1] - LAST * (t[-1] - t[0])) > 0.0))
    losses = (run.energy.contact_loss, run.energy.friction_loss)
    lost = sanity.mesh_loss(params, *(float(one[-1] - one[first]) for one in losses))
    lost /= float(t[-1] - t[first])
    carried = seen.rim_speed * max(seen.pull, MIN_FRICTION * tension)
    # a link at the ends of arcs, in the belt's forces and means
    half = 0.0 if params._flows else 0.5 / params.info["n_bodies"]
    if carried > 0.0:
        # set torques know nothing of the ends of arcs, those that a motion needs do
        of_torques = half if run.prescribed else 0.0
        found |= {"power": lost / seen.power + of_torques, "friction": lost / carried + half}
    return found
