"""Natural modes of a drive at rest or running."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import attrs
import numpy as np

from ..checks import Array, integer, positive
from ..naming import ByPulley, by_index
from ..params import Params
from ..run_warnings import BeltdynWarning
from ..state import State
from ..torques import TorqueLike
from . import participation as parts
from .linear import Complex, Linear, linearise
from .search import Found, residuals, search
from .torque_slopes import imbalance, torque_slopes

__all__ = ["Modes", "Shapes", "linear_drive", "modes"]

#: Unbalanced torque on a pulley over the belt's tension on its radius, above which the state is no
#: equilibrium, and residual of an eigenvector above which it is no mode.
UNBALANCED, LEFT_OVER = 1e-2, 1e-5
#: Difference of the rims' motions below which a drive turns as a whole; share of pulleys and mounts
#: in a decay that is reported.
TURNING, BODIES = 0.02, 0.3
#: Damping ratio above which modes of a running belt are left out.
DAMPED = 0.25


@attrs.frozen(kw_only=True, eq=False)
class Shapes:
    """Shapes of modes, complex: the motion is the real part of shape * exp(eigenvalue t).

    The largest displacement of the belt, of a rim or of an axis is 1 m, and real.

    Attributes:
        x: Of the links (n, n_b) [m].
        y: The same.
        phi: Turning of the links (n, n_b) [rad]; 0 of a string.
        theta: Turning of the pulleys (n, n_p) [rad].
        travel: Travels of the mounts (n, n_m) [rad or m].
    """

    x: Complex
    y: Complex
    phi: Complex
    theta: Complex
    travel: Complex


@attrs.frozen(kw_only=True, eq=False)
class Modes:
    """The lowest modes of a drive that oscillate, by their angular frequency |lambda|.

    Attributes:
        frequency: Frequencies of the damped oscillations (n,) [Hz].
        damping: Damping ratios (n,) [1]: 1 is critical; below 0 the mode grows.
        eigenvalue: lambda (n,) [1/s], complex.
        shapes: What moves, see :class:`Shapes`.
        names: What moves most in each mode (n,), such as "span crank-alternator, 1st lateral".
        participation: Shares of the kinetic energy, see :class:`Participation`.
        residual: |J x - lambda x| / |lambda x| (n,), what is left over of the eigenvalue problem.
        decay: Rates of motions of pulleys and mounts that decay without oscillating, more slowly
            than the spans' lowest frequency (m,) [1/s].
        decay_names: What moves most in these.
        turning: Eigenvalue of the whole drive turning, which is none of the modes [1/s]: 0 but
            for what the polygon of links resists; None if it was not met.
        left_out: Number of modes left out for their damping, below the highest given.
        band: Frequencies between which no mode of less than a quarter of critical damping is
            missing (2,) [Hz], up to the highest mode given.
        speed: Of the belt along its numbering [m/s], 0 at rest.
        params: The drive.
        state: The state about which it is linearised.
    """

    frequency: Array
    damping: Array
    eigenvalue: Complex
    shapes: Shapes
    names: tuple[str, ...]
    participation: parts.Participation
    residual: Array
    decay: Array
    decay_names: tuple[str, ...]
    turning: complex | None
    left_out: int
    band: tuple[float, float]
    speed: float
    params: Params
    state: State

    def __len__(self) -> int:
        return self.frequency.size

    def __str__(self) -> str:
        running = f"belt running at {abs(self.speed):.4g} m/s" if self.speed else "at rest"
        rows = [f"Modes of the drive, {running}:", "   k  frequency  damping  what moves"]
        for k, name in enumerate(self.names):
            frequency, damping = self.frequency[k], 100.0 * self.damping[k]
            rows.append(f"  {k:2d}  {frequency:6.4g} Hz  {damping:5.2f} %  {name}")
        if (self.damping < -1e-6).any():
            grow = ", ".join(str(k) for k in np.flatnonzero(self.damping < -1e-6))
            rows.append(f"  negative damping: mode(s) {grow} grow")
        for rate, name in zip(self.decay, self.decay_names, strict=True):
            rows.append(f"  not oscillating: {name}, decays within {1.0 / rate:.3g} s")
        if self.left_out:
            rows.append(f"  left out for strong damping: {self.left_out} mode(s) below the last")
        rows.append(f"  searched from {self.band[0]:.3g} Hz on")
        return "\n".join(rows)


def modes(
    params: Params,
    state: State,
    torque: TorqueLike | None = None,
    *,
    n: int = 8,
    damping: float | None = None,
    motion: ByPulley[object] | None = None,
) -> Modes:
    """Find the lowest modes of a drive for small motions about a state.

    The drive is linearised by the analytic Jacobian of the model: contact and friction on the side
    of their kinks on which the state stands, so friction that sticks is a spring. A running belt
    carries its links along; frequencies are those seen in places fixed in space. What friction
    keeps of the past is then carried through the wraps, which makes a series of strongly damped
    modes, a period each time the belt takes to pass a wrap.

    Args:
        params: The drive.
        state: In equilibrium, at rest or running steadily: from :func:`beltdyn.settle`, or
            ``result.final_state``.
        torque: Torques that depend on speeds or angles; None: they are constant.
        n: How many modes.
        damping: Damping ratio above which modes are left out; None: 1 at rest, 0.25 running.
        motion: Pulleys whose motion is prescribed, by index or name, as of
            :func:`beltdyn.simulate`: ``{"crank": 0.0}`` holds it. Only the names count, for a small
            motion of the rest leaves what is prescribed as it is.

    Raises:
        ImportError: SciPy is not installed.
        TypeError, ValueError: An argument breaks its rule.

    Warns:
        BeltdynWarning: The state is not in equilibrium; an eigenvector is inaccurate;
            eigenvalues of the band have not converged.
    """
    n = integer("n", n, 1)
    least = None if damping is None else positive("damping", damping)
    linear = linear_drive(params, state, torque, motion)
    where = parts.sections(linear)
    most = (1.0 if linear.passing == 0.0 else DAMPED) if least is None else least
    found, still, band, complete = search(linear, n + 1, most)
    if not complete:
        _warn("modes_missing: not all eigenvalues of the band have converged, some may be missing")
    across = parts.participation(linear, found[1], where).spans.sum(axis=1)
    found, turning = _without_turning(linear, found, across)
    found, left_out = _least_damped(found, n, most)
    shares = parts.participation(linear, found[1], where)
    still = _of_bodies(still, parts.participation(linear, still[1], where))
    scaled = _scaled(linear, found)
    left = residuals(linear, found)
    if (left > LEFT_OVER).any():
        _warn(f"modes: eigenvectors of a residual up to {left.max():.2g}")
    of_still = parts.participation(linear, still[1], where)
    values = found[0]
    highest = float(abs(values).max()) if values.size else band[1]
    return Modes(
        frequency=values.imag / (2.0 * np.pi),
        damping=-values.real / abs(values),
        eigenvalue=values,
        shapes=Shapes(
            **{name: linear.field(scaled, name).T for name in ("x", "y", "phi", "theta", "travel")}
        ),
        names=parts.names(linear, found[1], where, shares),
        participation=shares,
        residual=left,
        decay=-still[0].real,
        decay_names=parts.names(linear, still[1], where, of_still),
        turning=turning,
        left_out=left_out,
        band=(band[0] / (2.0 * np.pi), min(highest, band[1]) / (2.0 * np.pi)),
        speed=linear.passing * float(params.info["link_length"]),
        params=params,
        state=state,
    )


def linear_drive(
    params: Params,
    state: State,
    torque: TorqueLike | None,
    motion: ByPulley[object] | None,
) -> Linear:
    """Check the arguments of :func:`modes`; linearise the drive."""
    if not isinstance(params, Params):
        raise TypeError(f"params must be a Params, got {type(params).__name__}")
    if not isinstance(state, State):
        raise TypeError(f"state must be a State, got {type(state).__name__}")
    state.check_fits(params.belt.n_bodies, len(params.pulleys), len(params.mounted))
    if motion is not None and not isinstance(motion, Mapping):
        raise TypeError(f"motion must be a mapping by pulley, got {type(motion).__name__}")
    prescribed = tuple(sorted(by_index("motion", motion or {}, params.pulley_names)))
    slopes = None if torque is None else torque_slopes(params, state, torque)
    off, what = imbalance(params, state, torque, prescribed)
    if off > UNBALANCED:
        _warn(
            f"not_in_equilibrium: {what} has a torque left over of {100.0 * off:.2g} % of the "
            "belt's tension: the modes are those about a state that does not last"
        )
    return linearise(params, state, slopes, prescribed)


def _without_turning(linear: Linear, found: Found, across: Array) -> tuple[Found, complex | None]:
    """Leave out the motion in which all pulleys turn with the belt, which only a mesh holds."""
    if linear.prescribed:
        return found, None
    params = linear.params
    radii = params.route.senses * np.array([pulley.radius for pulley in params.pulleys])
    rims = radii[:, None] * linear.field(found[1], "theta")
    largest = abs(rims).max(axis=0)
    turns = (abs(rims - rims[0]).max(axis=0) < TURNING * largest) & (across < TURNING)
    keep = np.flatnonzero(~turns)
    turning = complex(found[0][turns][0]) if turns.any() else None
    return (found[0][keep], found[1][:, keep]), turning


def _least_damped(found: Found, n: int, most: float) -> tuple[Found, int]:
    """Give the lowest n of a damping ratio below ``most``, and how many others are below these."""
    keep = np.flatnonzero(-found[0].real < most * abs(found[0]))[:n]
    left_out = int(keep[-1]) + 1 - keep.size if keep.size else 0
    return (found[0][keep], found[1][:, keep]), left_out


def _of_bodies(still: Found, shares: parts.Participation) -> Found:
    """Of what decays the motions of pulleys and mounts; those of friction and contact are many."""
    keep = shares.pulleys.sum(axis=1) + shares.mounts.sum(axis=1) > BODIES
    return still[0][keep], still[1][:, keep]


def _scaled(linear: Linear, found: Found) -> Complex:
    """Vectors of which the largest displacement is 1 m."""
    vectors = found[1]
    size = linear.norms(1.0)
    place = np.isin(linear.names, ["x", "y", "theta", "travel"])
    moved = np.where(place[:, None], vectors / size[:, None], 0.0)
    largest = moved[np.argmax(abs(moved), axis=0), np.arange(vectors.shape[1])]
    return np.asarray(vectors / largest)


def _warn(message: str) -> None:
    warnings.warn(message, BeltdynWarning, stacklevel=4)
