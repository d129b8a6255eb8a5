"""Natural modes of a drive at rest or running."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np

from ..base.checks import Array, flag, integer, positive
from ..base.described import suggesting
from ..base.naming import ByPulley, by_index
from ..base.rounding import percent
from ..base.run_warnings import BeltdynWarning, caller
from ..drive.params import Params
from ..loads.torques import TorqueLike
from ..outputs.state import State
from . import participation as parts
from .count import counted
from .eigenvalues import STEADY, Found, growing, residuals, search
from .equilibrium import imbalance, states_over
from .linearised import Complex, Linear, linearise, passing_of, torque_slopes
from .mode_set import Modes, Shapes
from .turning import rigid_rates, without_turning

#: Force left over against the tension above which a state is no equilibrium: settled ones leave
#: 1e-9, steady runs at their tolerance up to 5e-3. Residual above which an eigenvector is no mode.
UNBALANCED, LEFT_OVER = 1e-2, 1e-5
#: Share of pulleys and mounts in a decay that is reported.
BODIES = 0.3
#: Damping ratio below which, negative, a mode is said to grow.
UNSTABLE = 1e-3
#: Damping ratio above which modes of a running belt are left out.
DAMPED = 0.25
#: Modes more that are sought at another phase, and likeness (0 to 1) from which on one is the same.
MORE, ALIKE = 3, 0.3
#: Modes more that are sought where they are counted, for a gap between them.
SPARE = 4


@suggesting
def modes(
    params: Params,
    state: State,
    torque: TorqueLike | None = None,
    *,
    n: int = 8,
    damping: float | None = None,
    motion: ByPulley[object] | None = None,
    phases: int = 1,
    count: bool = False,
) -> Modes:
    """Find the lowest modes of a drive for small motions about a state.

    The drive is linearised by the analytic Jacobian of the model: contact and friction on the side
    of their kinks on which the state stands, so friction that sticks is a spring. A running belt
    carries its links along; frequencies are those seen in places fixed in space. The state of
    friction is then carried through the wraps, which makes a series of strongly damped modes, a
    period each time the belt takes to pass a wrap.

    **The mesh.** A state has one phase of the mesh: the last joint on a pulley lies by s, up to
    half a link, before or after the point where the belt leaves, which takes T s off, or adds it
    to, the stiffness of a sticking pulley against turning. Over all phases this averages to zero; a
    belt that slid to rest without friction is where it is largest. ``mesh_error`` is its effect on
    each frequency; ``phases`` averages it out. A belt at rest is moved along by a link, so slowly
    that it stays in equilibrium, its prescribed pulleys or the heaviest one driven; the result has
    means of the eigenvalues over that many phases, 12 suffice, with the shapes of the state itself.
    Of a running belt, which goes through all phases, Floquet's problem is solved over that many:
    each mode is then the one that is the same for all. 6 suffice for its frequency to half a
    percent. Damping converges more slowly: 160 links on pulleys of 50 and 80 mm have a mode at
    47.6, 47.7, 47.9, 47.8 Hz that decays by 14.6, 14.3, 11.5, 12.3 1/s with 3, 6, 9, 12 phases. The
    cells of an ALE belt stand still: their mesh has one phase alone, and nothing to average.

    Args:
        params: The drive.
        state: In equilibrium, at rest or running steadily: from :func:`beltdyn.settle`, or
            ``result.final_state``.
        torque: Torques that depend on speeds or angles; None: they are constant.
        n: How many modes, at most as many as there are links. Fewer are returned for an ALE belt
            whose mesh has no more: those below ``Modes.beyond``.
        damping: Damping ratio above which modes are left out; None: 1 at rest, 0.25 running.
        motion: Pulleys whose motion is prescribed, by index or name, as of
            :func:`beltdyn.simulate`: ``{"crank": 0.0}`` holds it. Only the names count, for a small
            motion of the rest leaves what is prescribed as it is.
        phases: Phases of the mesh, evenly over the passing of a link; 1: that of the state. Of an
            ALE belt there is one.
        count: Whether to count the eigenvalues of the band independently and compare with those
            found, at several times the cost of the search; with several phases at rest, those of
            the first.

    Raises:
        ImportError: SciPy is not installed.
        TypeError, ValueError: An argument breaks its rule.
        SimulationError: The drive could not be moved from phase to phase.

    Warns:
        BeltdynWarning: The state is not in equilibrium; the drive is unstable there; an
            eigenvector is inaccurate; eigenvalues of the band have not converged; not as many were
            found as are counted; a mode is not found at every phase.
    """
    n, phases, count = integer("n", n, 1), integer("phases", phases, 1), flag("count", count)
    check_drive(params, state)
    if params._flows:
        phases = 1
    if n > params.n_bodies:
        nodes = "cells" if params._flows else "links"
        raise ValueError(
            f"n must be at most {params.n_bodies}, the number of {nodes}, got {n}: modes beyond "
            f"have waves shorter than two {nodes}, which the mesh makes and no belt; more {nodes} "
            "have more modes"
        )
    least = None if damping is None else positive("damping", damping)
    linear = linear_drive(params, state, torque, motion, phases=phases)
    most = (1.0 if linear.speed == 0.0 else DAMPED) if least is None else least
    found, still, band, turning, left_out = _lowest(linear, n, most, count)
    grows, complete = growing(linear, band, found)
    if min(rigid_rates(linear)) >= 0.0:  # what makes the drive turn away is then the mesh alone
        grows, away = without_turning(linear, grows)
        turning = away if turning is None else turning
    if not complete:
        _warn("modes_missing: not all eigenvalues of growing motions have converged")
    of_still = parts.participation(linear, still.vectors)
    # of motions that decay those of pulleys and mounts; those of friction and contact are many
    still = still.of(of_still.pulleys.sum(axis=1) + of_still.mounts.sum(axis=1) > BODIES)
    left = residuals(linear, found)
    if (left > LEFT_OVER).any():
        _warn(f"modes: eigenvectors of a residual up to {left.max():.2g}")
    values, by_phase = found.values, np.empty((0, found.values.size))
    highest = float(abs(values).max()) if values.size else band[1]
    if phases > 1 and linear.passing == 0.0:
        seen = _at_phases(linear, found, torque, phases, most)
        values, by_phase = seen.mean(axis=0), seen.imag / (2.0 * np.pi)
    grow_names = parts.names(linear, grows.vectors)
    _warn_unstable(grows.values, grow_names, values)
    return Modes(
        frequency=values.imag / (2.0 * np.pi),
        damping=-values.real / abs(values),
        eigenvalue=values,
        shapes=_shapes(linear, found, values),
        names=parts.names(linear, found.vectors),
        participation=parts.participation(linear, found.vectors),
        residual=left,
        grows=grows.values,
        grow_names=grow_names,
        decay=-still.values.real,
        decay_names=parts.names(linear, still.vectors),
        turning=turning,
        left_out=left_out,
        band=(band[0] / (2.0 * np.pi), min(highest, band[1]) / (2.0 * np.pi)),
        speed=linear.speed,
        beyond=linear.trusted / (2.0 * np.pi),
        prescribed=tuple(params.pulley_names[k] for k in linear.prescribed),
        mesh_error=_mesh_error(linear, found, state),
        phases=phases,
        by_phase=by_phase,
        params=params,
        state=state,
    )


def _warn_unstable(grows: Complex, names: tuple[str, ...], values: Complex) -> None:
    """Warn of motions that grow: modes with a damping below -0.1 %, unless due to the mesh."""
    texts = [
        f"{name} grows by {value.real:.3g} 1/s" for value, name in zip(grows, names, strict=True)
    ]
    texts += [
        f"mode {k} by {value.real:.3g} 1/s"
        for k, value in enumerate(values)
        if value.real > UNSTABLE * abs(value)
    ]
    if texts:
        more = f", and {len(texts) - 3} more" if len(texts) > 3 else ""
        _warn(f"unstable: {', '.join(texts[:3])}{more}")


def _lowest(
    linear: Linear, n: int, most: float, check: bool = False
) -> tuple[Found, Found, tuple[float, float], complex | None, int]:
    """Find the lowest n modes; last how many below them are more damped than ``most``."""
    sought = n + (1 if not check else SPARE)
    while True:
        found, still, band, complete = search(linear, sought, most)
        here = parts.steady_share(linear, found.vectors) > STEADY
        few = int(np.count_nonzero(here)) < min(n + 1, len(here)) and sought < 8 * n
        bound = float(linear.params.info["spectral_bound"])
        if not few or band[1] > min(bound, linear.trusted):
            break
        sought *= 2
    if not complete:
        _warn("modes_missing: not all eigenvalues of the band have converged, some may be missing")
    if check:
        _compare(linear, found, band[0], n)
    here &= abs(found.values) < linear.trusted
    found, turning = without_turning(linear, found.of(here))
    band = band[0], min(band[1], linear.trusted)
    keep = np.flatnonzero(-found.values.real < most * abs(found.values))[:n]
    left_out = int(keep[-1]) + 1 - keep.size if keep.size else 0
    return found.of(keep), still, band, turning, left_out


def _compare(linear: Linear, found: Found, low: float, n: int) -> None:
    """Warn unless as many eigenvalues are counted as are found."""
    rates, ratios = abs(found.values), -found.values.real / abs(found.values)
    # an outline far from eigenvalues: the widest gap above the n-th, and of damping
    above = np.sort(rates[abs(ratios) < DAMPED])[n - 1 :]
    if above.size < 2:
        high = 1.01 * float(rates.max(initial=low))
    else:
        k = int(np.argmax(above[1:] / above[:-1]))
        high = float(np.sqrt(above[k] * above[k + 1]))
    limits = np.array([1.0, 0.9, 0.8]) * DAMPED
    limit = float(limits[np.argmax([abs(abs(ratios) - one).min(initial=1.0) for one in limits])])
    inside = int(np.count_nonzero((rates > low) & (rates < high) & (abs(ratios) < limit)))
    there = counted(linear, inside, low, high, limit)
    if there != inside:
        number = "too many to tell" if there is None else str(there)
        _warn(
            f"modes_missing: {inside} eigenvalue(s) found between {low / (2.0 * np.pi):.3g} and "
            f"{high / (2.0 * np.pi):.4g} Hz of less than {100.0 * limit:.3g} % damping, where "
            f"{number} are counted"
        )


def _at_phases(
    linear: Linear, found: Found, torque: TorqueLike | None, phases: int, most: float
) -> Complex:
    """Eigenvalues of the same modes (phases, n) as the belt is moved along by a link."""
    params, prescribed = linear.params, linear.prescribed
    own, out = parts.weighted(linear, found.vectors), []
    state = State._from_core(linear.state)
    for one in states_over(params, state, torque, prescribed, phases):
        slopes = None if torque is None else torque_slopes(params, one, torque)
        other = linearise(params, one, slopes, prescribed)
        seen = _lowest(other, found.values.size + MORE, most)[0]
        same = parts.same_modes(own, parts.weighted(other, seen.vectors))
        if (same[1] < ALIKE).any():
            _warn(
                f"modes_of_phases: mode(s) {', '.join(map(str, np.flatnonzero(same[1] < ALIKE)))} "
                "are not found alike at every phase of the mesh: more links give more even ones"
            )
        out.append(seen.values[same[0]])
    return np.array(out)


def check_drive(params: Params, state: State) -> None:
    """Raise TypeError, ValueError unless these are a drive and a state of it."""
    if not isinstance(params, Params):
        raise TypeError(f"params must be a Params, got {type(params).__name__}")
    if not isinstance(state, State):
        raise TypeError(f"state must be a State, got {type(state).__name__}")
    state.check_fits(params, "state")


def linear_drive(
    params: Params,
    state: State,
    torque: TorqueLike | None,
    motion: ByPulley[object] | None,
    *,
    phases: int = 1,
) -> Linear:
    """Linearise a drive, a running one over phases; check ``motion``, and that it is in balance."""
    if motion is not None and not isinstance(motion, Mapping):
        raise TypeError(f"motion must be a mapping by pulley, got {type(motion).__name__}")
    prescribed = tuple(sorted(by_index("motion", motion or {}, params.pulley_names)))
    slopes = None if torque is None else torque_slopes(params, state, torque)
    off, what = imbalance(params, state, torque, prescribed)
    if off > UNBALANCED:
        _warn(
            f"not_in_equilibrium: {what} has a force left over of {percent(off)} of the "
            "belt's tension: this is about a state that does not last"
        )
    runs = passing_of(params, state._to_core(params)) != 0.0
    many = phases > 1 and runs
    states = states_over(params, state, torque, prescribed, phases) if many else [state]
    return linearise(params, states, slopes, prescribed)


def _mesh_error(linear: Linear, found: Found, state: State) -> Array:
    """Return the scatter due to T s (see :func:`modes`), s independent at each end of a wrap."""
    # s is even within a link. The stiffness of a mode is twice its kinetic energy.
    params = linear.params
    turned = abs(linear.field(found.vectors, "theta")) ** 2
    if params._flows:
        return np.zeros(turned.shape[1])
    one = state.tension(params).mean * float(params.info["link_length"]) / np.sqrt(12.0) * turned
    stiffness = np.sum(abs(parts.weighted(linear, found.vectors)) ** 2, axis=0)
    return np.asarray(np.sqrt(2.0 * np.sum(one**2, axis=0)) / (2.0 * stiffness))


def _shapes(linear: Linear, found: Found, values: Complex) -> Shapes:
    """Return vectors of which the largest displacement is 1 m, as fields."""
    place = np.isin(linear.names, ["x", "y", "a", "along", "theta", "travel"])
    moved = np.where(place[:, None], found.vectors / linear.norms(1.0)[:, None], 0.0)
    largest = moved[np.argmax(abs(moved), axis=0), np.arange(values.size)]
    scaled = np.asarray(found.vectors / largest)
    fields = {name: linear.field(scaled, name).T for name in ("phi", "theta", "travel")}
    x, y = parts.moves(linear, scaled, values)
    a, n_p = linear.field(scaled, "a").T, len(linear.params.pulleys)
    deflection = a.reshape(len(values), n_p, a.shape[1] // n_p)
    return Shapes(x=x.T, y=y.T, deflection=deflection, **fields)


def _warn(message: str) -> None:
    warnings.warn(message, BeltdynWarning, stacklevel=caller()[0])
