"""Frequency response of a drive: from a torque or a motion of pulleys to motions and tensions."""

from __future__ import annotations

import numbers
import warnings
from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import Array, integer, real_array, shown
from ..base.described import suggesting
from ..base.naming import ByPulley, PulleyLike, by_index, key
from ..base.run_warnings import BeltdynWarning
from ..drive.params import Params
from ..loads.torques import TorqueLike
from ..outputs.spans import span_tension
from ..outputs.state import State
from .linearised import Complex, Linear
from .modes import check_drive, linear_drive
from .participation import moves
from .turning import mesh_stiffness

#: Displacement of the differences that tensions are read off [m].
_STEP = 1e-8
_NOT_REMOVED = (
    "mesh_turning: the polygon of links resists the whole drive turning, which cannot be separated "
    "from friction that creeps and stays in the response (from {:.3g} Hz): more links make it less,"
    " and a motion prescribed on a pulley, or a law of friction that sticks, does without"
)


@attrs.frozen(kw_only=True, eq=False)
class FrequencyResponse:
    """Complex amplitudes a at each frequency f, of motions ``Re(a exp(2 pi i f t))``.

    Attributes:
        frequency: Frequencies (n_f,) [Hz].
        theta: Angles of the pulleys (n_f, n_p) [rad], those prescribed included.
        omega: Their speeds (n_f, n_p) [rad/s].
        span_tension: Mean tensions of the free spans after each pulley (n_f, n_p) [N]; NaN where no
            joint is free.
        joint_force: Force in the joint on the left of each link (n_f, n_b) [N].
        travel: Travels of the mounts (n_f, n_m) [rad or m].
        x: Displacements of the links in x (n_f, n_b) [m]; of a running belt at places fixed in
            space, of an ALE belt where its cells begin.
        y: The same.
        torque: Amplitudes of the exciting torques (n_p,) [N m].
        motion: Amplitudes of the exciting motions (n_p,) [rad].
        residual: |(i w - J) x - b| / |b| (n_f,).
        mesh_turning: Frequency [Hz] at which the drive would swing as a whole on the polygon of
            links; its stiffness is removed from the response, in which the drive turns freely. 0
            of an ALE belt, where a pulley's motion is prescribed, or the phases of the mesh average
            it out; NaN if it could not be determined and is not removed.
        phases: Number of phases of the mesh of a running belt over which the response is averaged.
        params: The drive.
    """

    frequency: Array
    theta: Complex
    omega: Complex
    span_tension: Complex
    joint_force: Complex
    travel: Complex
    x: Complex
    y: Complex
    torque: Complex
    motion: Complex
    residual: Array
    mesh_turning: float
    phases: int
    params: Params

    def __str__(self) -> str:
        names = self.params.pulley_names
        sources = [
            f"{abs(a):g} {unit} on {names[k]}"
            for values, unit in ((self.torque, "N m"), (self.motion, "rad"))
            for k, a in enumerate(values)
            if a != 0.0
        ]
        low, high = self.frequency.min(), self.frequency.max()
        rows = [
            f"Frequency response to {', '.join(sources)}: "
            f"{self.frequency.size} frequencies from {low:g} to {high:g} Hz"
        ]
        for k, name in enumerate(names):
            top = int(np.argmax(abs(self.theta[:, k])))
            rows.append(
                f"  {name}: at most {abs(self.theta[top, k]):.4g} rad, at "
                f"{self.frequency[top]:.4g} Hz"
            )
        return "\n".join(rows)


@suggesting
def frequency_response(
    params: Params,
    state: State,
    frequencies: ArrayLike,
    *,
    torque: PulleyLike | ByPulley[complex] | None = None,
    motion: PulleyLike | ByPulley[complex] | None = None,
    loads: TorqueLike | None = None,
    phases: int = 1,
) -> FrequencyResponse:
    """Return the response of a drive to a small harmonic torque or motion.

    Args:
        params: The drive.
        state: In equilibrium, at rest or running steadily, as of :func:`beltdyn.modes`.
        frequencies: Frequencies (n_f,) [Hz], > 0.
        torque: Pulley on which a torque of 1 N m acts, or complex amplitudes by pulley [N m].
        motion: Pulley whose angle is prescribed with an amplitude of 1 rad, or complex amplitudes
            by pulley [rad]; 0 holds a pulley, or leaves its speed constant.
        loads: Torques that depend on speeds or angles; None: they are constant.
        phases: Number of phases of the mesh that are combined for a running belt; a passing link
            goes through them one after the other (see :func:`beltdyn.modes`). 6 suffice for the
            frequencies of resonances, not for their damping, which 12 change by a seventh. The
            response is then that at the exciting frequency, without the side bands of the passing
            links; 1: as the links stand in ``state``, as at rest in any case. States from other
            moments of a run give somewhat other responses, the less the shorter the links: with 160
            links on pulleys of 50 and 80 mm a resonance at 47.5 Hz within 0.15 Hz and, of six
            phases, 5 % of its damping.

    Where no pulley's motion is prescribed, the drive turns as a whole at low frequencies. The
    resistance of the polygon of links to that, which no real belt has, is removed: a term of rank
    one, so that a steady torque alone turns it (``mesh_turning``).

    Raises:
        ImportError: SciPy is not installed.
        TypeError, ValueError: An argument breaks its rule; nothing excites the drive.
    """
    at, phases = real_array("frequencies", frequencies, ndim=1), integer("phases", phases, 1)
    if at.size == 0 or (at <= 0.0).any():
        raise ValueError("frequencies must hold at least one value, all > 0 (Hz)")
    check_drive(params, state)
    moments, moved = _amplitudes(params, "torque", torque), _amplitudes(params, "motion", motion)
    if not any(moments.values()) and not any(moved.values()):
        raise ValueError("torque or motion must excite at least one pulley")
    linear = linear_drive(params, state, loads, {k: 0.0 for k in moved}, phases=phases)
    for k in moments:
        if k in moved:
            raise ValueError(f"torque and motion are both given on {params.label(k)}")
    n_p = len(params.pulleys)
    torques, motions = np.zeros(n_p, complex), np.zeros(n_p, complex)
    torques[list(moments)] = list(moments.values())
    motions[list(moved)] = list(moved.values())
    mesh, resisted = None, 0.0
    if not (linear.prescribed or len(linear.parts) > 1 or params._flows):
        mesh = mesh_stiffness(linear)
        resisted = np.nan if mesh is None else float(np.sqrt(abs(mesh[2])) / (2.0 * np.pi))
        if mesh is None:
            warnings.warn(_NOT_REMOVED.format(at.min()), BeltdynWarning, stacklevel=2)
    vectors, left = _solve(linear, 2.0 * np.pi * at, torques, motions, mesh)

    def turning(part: Linear, of_part: Complex) -> tuple[Complex, Complex]:
        """Angles and speeds of the pulleys."""
        theta = part.field(of_part, "theta").T + motions
        return theta, part.field(of_part, "omega").T + 2j * np.pi * at[:, None] * motions

    theta, omega = turning(linear, vectors)
    moved_x, moved_y = moves(linear, vectors, 2j * np.pi * at)
    forces, tensions = [], []
    for k, part in enumerate(linear.parts):
        of_part = vectors[linear.phase == k]
        forces.append(_forces(part, of_part, *turning(part, of_part)))
        tensions.append(_spans(part, forces[-1]))
    return FrequencyResponse(
        frequency=at,
        theta=theta,
        omega=omega,
        span_tension=np.mean(tensions, axis=0),
        joint_force=np.mean(forces, axis=0),
        travel=linear.field(vectors, "travel").T,
        x=moved_x.T,
        y=moved_y.T,
        torque=torques,
        motion=motions,
        residual=left,
        mesh_turning=resisted,
        phases=len(linear.parts),
        params=params,
    )


def _amplitudes(params: Params, name: str, given: Any) -> dict[int, complex]:
    if given is None:
        return {}
    by_pulley, names = given if isinstance(given, Mapping) else {given: 1.0}, params.pulley_names
    found = {}
    for k, value in by_index(name, by_pulley, names).items():
        where = f"{name}[{key(k, names)}]"
        if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Complex):
            raise TypeError(f"{where} must be a real or complex number, got {shown(value)}")
        found[k] = complex(value)
        if not np.isfinite(found[k]):
            raise ValueError(f"{where} must be finite, got {shown(value)}")
    return found


def _solve(
    linear: Linear,
    rates: Array,
    torques: Complex,
    motions: Complex,
    mesh: tuple[Array, Array, float] | None,
) -> tuple[Any, Array]:
    """Solve (i w - J) x = b at each w, in unknowns scaled for w; J without the mesh's stiffness."""
    # That stiffness is a term of rank one, added by Sherman and Morrison's formula.
    pushed = linear.filled({"omega": torques / linear.params.shaft_inertias})
    out, left = np.empty((linear.size, rates.size), complex), np.empty(rates.size)
    for f, w in enumerate(rates):
        size, matrix, solve = linear.solver(w)
        b = (linear.given[0] @ motions + linear.given[1] @ (1j * w * motions) + pushed) / size
        x = solve(b)
        if mesh is not None:
            by, on = mesh[2] * mesh[0] / size, mesh[1] * size
            turned = solve(by)
            x += turned * (on @ x) / (1.0 - on @ turned)
            b = b + by * (on @ x)
        left[f] = np.linalg.norm(matrix @ x - b) / np.linalg.norm(b)
        out[:, f] = size * x
    return out, left


def _forces(linear: Linear, vectors: Complex, theta: Complex, omega: Complex) -> Complex:
    """Return the forces in the joints (n_f, n_b), linear in the motion: by central differences."""
    model = linear.params._model
    size = linear.norms(1.0)
    place = np.isin(linear.names, ["x", "y", "m", "a", "along", "theta", "travel"])
    out = []
    for f in range(vectors.shape[1]):
        largest = np.abs(vectors[place, f] / size[place]).max()
        h = _STEP / max(float(largest), 1e-300)
        parts = []
        for turn in (1.0, 1j):  # the real part, and the imaginary one
            eta = (vectors[:, f] / turn).real
            ends = []
            for step in (h, -h):
                moved = linear.displaced(step * eta)
                moved["theta"] = linear.state["theta"] + step * (theta[f] / turn).real
                moved["omega"] = linear.state["omega"] + step * (omega[f] / turn).real
                ends.append(model.observe(moved)["force"][0])
            parts.append((ends[0] - ends[1]) / (2.0 * h))
        out.append(parts[0] + 1j * parts[1])
    return np.array(out)


def _spans(linear: Linear, force: Complex) -> Complex:
    """Means over the joints that are free at the state, by span."""
    touched = linear.params._model.observe(linear.state)["pulley"]
    n_p = len(linear.params.pulleys)
    seen = np.repeat(touched, len(force), axis=0)
    real = span_tension(seen, np.ascontiguousarray(force.real), n_p)
    imaginary = span_tension(seen, np.ascontiguousarray(force.imag), n_p)
    return np.asarray(real + 1j * imaginary)
