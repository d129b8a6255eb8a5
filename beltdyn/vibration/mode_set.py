"""Modes as they are returned and printed: frequencies, damping, shapes and other motions."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

import attrs
import numpy as np

from ..base import tables
from ..base.checks import Array
from ..base.rounding import percent
from ..drive.params import Params
from ..outputs.state import State
from .linearised import Complex
from .participation import Participation

#: Motions that decay without oscillating of which each has a line in print.
LISTED = 4
#: Estimated error of a frequency by the mesh from which on it is reported.
MESHED = 0.01


@attrs.frozen(kw_only=True, eq=False)
class Shapes:
    """Shapes of modes, complex: the motion is the real part of shape * exp(eigenvalue t).

    The largest displacement of the belt, of a rim or of an axis is 1 m, and real.

    Attributes:
        x: Displacements of the links in x (n, n_b) [m].
        y: The same.
        phi: Turning of the links (n, n_b) [rad]; 0 of a string, none (n, 0) of an ALE belt.
        theta: Turning of the pulleys (n, n_p) [rad].
        travel: Travels of the mounts (n, n_m) [rad or m].
        deflection: Amplitudes of the sine modes of an ALE belt's spans (n, n_p, K) [m], K = 0 for
            links; x and y are then those of the belt where its cells begin.
    """

    x: Complex
    y: Complex
    phi: Complex
    theta: Complex
    travel: Complex
    deflection: Complex


@attrs.frozen(kw_only=True, eq=False)
class Modes:
    """The lowest oscillating modes of a drive, ordered by angular frequency |lambda|.

    Attributes:
        frequency: Frequencies of the damped oscillations (n,) [Hz].
        damping: Damping ratios (n,) [1]: 1 is critical; below 0 the mode grows.
        eigenvalue: lambda (n,) [1/s], complex.
        shapes: Mode shapes, see :class:`Shapes`.
        names: Part that moves most in each mode (n,), such as "span crank-alternator, 1st lateral".
        participation: Shares of the kinetic energy, see :class:`Participation`.
        residual: |J x - lambda x| / |lambda x| (n,), the residual of the eigenvalue problem.
        grows: Eigenvalues (m,) [1/s] with a real part > 0 of motions that grow without oscillating,
            or too fast to count as oscillations; none for a stable drive.
        grow_names: Parts that move most in these.
        decay: Rates of motions of pulleys and mounts that decay without oscillating, more slowly
            than the spans' lowest frequency (m,) [1/s].
        decay_names: Parts that move most in these.
        turning: Eigenvalue of the drive turning as a whole, the belt along itself and the rims with
            it, which is not among the modes [1/s]: it would be 0 but for the resistance of the
            polygon of links or, of an ALE belt, of the friction that it rolls on at the ends of its
            wraps; None if it was not found, a pulley is prescribed, or torques give it a stiffness.
        left_out: Number of modes left out for their damping, below the highest given.
        band: Frequencies between which no mode of less than a quarter of critical damping is
            missing (2,) [Hz], up to the highest mode given: by the search, or as counted.
        speed: Speed of the belt in the order of its links [m/s], 0 at rest.
        beyond: Frequency [Hz] above which no modes are returned for an ALE belt: it has only the
            first few lateral modes of each span, and as it runs some are off by more than 1 %;
            infinite for links.
        prescribed: Names of the pulleys whose motion is prescribed.
        mesh_error: Estimated relative scatter of each frequency with the phase of the mesh (n,); it
            falls with the length of a link. With several phases most of it is averaged out.
        phases: Phases of the mesh that were taken together, see :func:`modes`.
        by_phase: Frequencies at each of them (phases, n) [Hz], of which ``frequency`` is the mean;
            none (0, n) for one phase and for a running belt.
        params: The drive.
        state: The state about which it is linearised.
    """

    frequency: Array
    damping: Array
    eigenvalue: Complex
    shapes: Shapes
    names: tuple[str, ...]
    participation: Participation
    residual: Array
    grows: Complex
    grow_names: tuple[str, ...]
    decay: Array
    decay_names: tuple[str, ...]
    turning: complex | None
    left_out: int
    band: tuple[float, float]
    speed: float
    beyond: float
    prescribed: tuple[str, ...]
    mesh_error: Array
    phases: int
    by_phase: Array
    params: Params
    state: State

    def __len__(self) -> int:
        return self.frequency.size

    def __str__(self) -> str:
        above, table = self._printed()
        rows = tables.columns([table.heading, *table.rows], ">>><", width=80)
        return "\n".join([*_lines(above), *rows, *_lines(table.remarks)])

    def _repr_html_(self) -> str:
        above, table = self._printed()
        return tables.html([*above, table])

    def _printed(self) -> tuple[list[str], tables.Table]:
        """Return the lines above the modes, and their table with those below."""
        running = f"belt running at {abs(self.speed):.4g} m/s" if self.speed else "at rest"
        held = ", ".join(self.prescribed) or "none"
        above = [f"Modes of the drive, {running}; pulleys of prescribed motion: {held}"]
        for value, name in zip(self.grows, self.grow_names, strict=True):
            above.append(f"  unstable: {name}, grows e-fold within {1.0 / value.real:.3g} s")
        modes: list[tuple[str, ...]] = []
        for k, name in enumerate(self.names):
            if self.by_phase.size:
                low, high = self.by_phase[:, k].min(), self.by_phase[:, k].max()
                name += f"; {low:.4g} to {high:.4g} Hz over the mesh"
            percents = f"{100.0 * self.damping[k]:.2f}"
            modes.append((str(k), f"{self.frequency[k]:.4g}", percents, name))
        rows: list[str] = []
        if (self.damping < -1e-6).any():
            grow = ", ".join(str(k) for k in np.flatnonzero(self.damping < -1e-6))
            rows.append(f"  negative damping: mode(s) {grow} grow")
        off = np.flatnonzero(self.mesh_error > MESHED)
        if self.phases == 1 and off.size:
            rows.append(
                f"  mode(s) {', '.join(map(str, off))}: off by some "
                f"{percent(self.mesh_error.max())} for the phase of the mesh, which "
                "phases=12 averages out"
            )
        elif self.phases == 1 and self.mesh_error.any():
            most = percent(self.mesh_error.max())
            rows.append(f"  the phase of the mesh changes frequencies by {most} at most")
        for rate, name in list(zip(self.decay, self.decay_names, strict=True))[:LISTED]:
            rows.append(f"  not oscillating: {name}, decays within {1.0 / rate:.3g} s")
        if self.decay.size > LISTED:
            rows.append(f"  not oscillating: and {self.decay.size - LISTED} more (modes.decay)")
        if self.turning is not None and self.turning.real > abs(self.turning.imag):
            rows.append(
                f"  the whole drive turning grows e-fold within {1.0 / self.turning.real:.3g} s: "
                "by the mesh alone, no drive does"
            )
        if self.left_out:
            rows.append(f"  left out for strong damping: {self.left_out} mode(s) below the last")
        upto = f" to {self.beyond:.3g} Hz, where the mesh lacks modes of spans"
        upto = upto if np.isfinite(self.beyond) else " on"
        rows.append(f"  searched from {self.band[0]:.3g} Hz{upto}")
        heading = ("k", "frequency Hz", "damping %", "what moves")
        return above, tables.Table("", heading, modes, rows)


def _lines(texts: Iterable[str]) -> list[str]:
    return [line for one in texts for line in textwrap.wrap(one, 80, subsequent_indent=" " * 6)]
