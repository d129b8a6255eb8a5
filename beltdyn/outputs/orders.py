"""Periodic sources in a drive, which make lines: pulleys, the belt, links."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array
from .averages import integral
from .sampled import Sampled

#: Harmonics by which a line is recognised: of links; of pulleys; of the belt.
HARMONICS = {"link": 4, "pulley": 12, "belt": 3}
#: A peak is found this close to the line that it comes from, in resolutions.
NEAR = 0.2
#: Share of its height that a line must keep, in spite of the changes of speed in the window, to be
#: named: half of its power.
KEPT = 0.7
#: How well a frequency is known, as a share: from the speeds of pulleys or links, by the times
#: between the samples; from the rims for the belt, by stretch, creep and running radii.
MEASURED, FROM_RIMS = 5e-4, 2e-2
#: Periods in the window below which a line at the link passing only may be of the mesh: that near,
#: 3 % of its frequency, another line may well be.
SURE = 10.0
#: Turns in the window below which something stands still.
STILL = 1e-3


@attrs.frozen(kw_only=True)
class Source:
    """A periodic source in a drive, which makes lines at multiples of its frequency.

    Attributes:
        name: "link passing", "belt passing", or that of a pulley.
        kind: "link", "belt" or "pulley".
        frequency: The fundamental [Hz]: the slope of its turns over time in the window, weighted
            with Hann's window as a spectrum is, which is where its line stands. Turns forth and
            back cancel: a pulley that only rocks has 0.
        spread: Change of the frequency in the window, as a share of its mean [1]; what fluctuates
            within a tenth of the window is left out.
        kept: Share of its height that the line of each harmonic keeps, the first one first: 1 at an
            even speed, less where the speed changes and smears it [1].
        known: Error of the frequency, as a share [1].
    """

    name: str
    kind: str
    frequency: float
    spread: float
    kept: tuple[float, ...]
    known: float

    @property
    def sharp(self) -> int:
        """Number of harmonics that are lines, the speed being even enough."""
        return next((k for k, kept in enumerate(self.kept) if kept < KEPT), len(self.kept))


def belt_rate(result: Sampled, rows: Any = slice(None)) -> Array | None:
    """Return the belt passing frequency: revolutions of the belt per second, >= 0, (n_t,) [Hz].

    The flow of an ALE belt over L. Else the mean speed of the links over the present length of the
    belt, with arcs for the chords between neighbouring links: in steady running exactly the rate at
    which its stress-free length passes any place, over L, as both hold the same mean stretch.

    Where the run did not keep positions and velocities, the mean speed of the rims over L, which is
    off by stretch, creep and the belt's sinking into the pulleys; None without their speeds either.
    """
    rate = belt_turning(result, rows)
    return None if rate is None else np.abs(rate)


def belt_turning(result: Sampled, rows: Any = slice(None)) -> Array | None:
    """Return :func:`belt_rate` with its sign, positive in the order of the links."""
    params = result.params
    if result._has("belt.flow"):
        return np.asarray(result.belt.flow[rows] / params.info["length"])
    if _has_links(result):
        belt = result.belt
        x, y, phi = belt.x[rows], belt.y[rows], belt.phi[rows]
        vx, vy = belt.vx[rows], belt.vy[rows]
        dx, dy = x - np.roll(x, 1, axis=-1), y - np.roll(y, 1, axis=-1)
        chord = np.hypot(dx, dy)
        half = 0.5 * (phi - np.roll(phi, 1, axis=-1))
        half -= np.pi * np.round(half / np.pi)  # round the closed belt
        arc = chord / np.sinc(half / np.pi)
        # along the belt: half of the way from the neighbour before and half to the one after
        tx, ty = dx + np.roll(dx, -1, axis=-1), dy + np.roll(dy, -1, axis=-1)
        speed = (vx * tx + vy * ty) / np.hypot(tx, ty)
        return np.asarray(speed.mean(axis=-1) / arc.sum(axis=-1))
    if result._has("pulleys.omega"):
        rims = result.pulleys.omega[rows] * params._rolling
        return np.asarray(rims.mean(axis=-1) / params.info["length"])
    return None


def _has_links(result: Sampled) -> bool:
    return all(result._has(f"belt.{name}") for name in ("x", "y", "phi", "vx", "vy"))


def sources(result: Sampled, rows: Any = slice(None)) -> tuple[Source, ...]:
    """Return the periodic sources of a run, over some samples: links, pulleys, belt that turn."""
    t, params, belt = np.asarray(result.t[rows]), result.params, belt_turning(result, rows)
    known = MEASURED if _has_links(result) or result._has("belt.flow") else FROM_RIMS
    found = []
    if belt is not None and not params._flows:
        found.append(_source("link passing", "link", t, belt * params.n_bodies, known))
    if result._has("pulleys.omega"):
        turning = result.pulleys.omega[rows] / (2.0 * np.pi)
        for name, rate in zip(params.pulley_names, turning.T, strict=True):
            found.append(_source(name, "pulley", t, rate, MEASURED))
    if belt is not None:
        found.append(_source("belt passing", "belt", t, belt, known))
    return tuple(one for one in found if one is not None)


def _source(name: str, kind: str, t: Array, rate: Array, known: float) -> Source | None:
    """Make the source that turns at a rate (n_t,) [Hz]; None if it stands still."""
    turns = integral(t, rate)
    if t.size < 3 or float(np.ptp(turns)) < STILL:
        return None
    weights = np.hanning(t.size + 2)[1:-1]
    weights /= weights.sum()
    centred = t - float(weights @ t)
    slope = float(weights @ (centred * turns)) / float(weights @ centred**2)
    left = turns - slope * centred
    kept = [
        float(abs(weights @ np.exp(2j * np.pi * k * left))) for k in range(1, HARMONICS[kind] + 1)
    ]
    # of the moving mean over a tenth of the window: what fluctuates round it is no drift
    width = max(1, rate.size // 10)
    smooth = np.convolve(rate, np.full(width, 1.0 / width), mode="valid")
    mean = abs(float(rate.mean()))
    return Source(
        name=name,
        kind=kind,
        frequency=abs(slope),
        spread=float(np.ptp(smooth)) / mean if mean > 0.0 else float("inf"),
        kept=tuple(kept),
        known=known,
    )


def folded(frequency: Any, rate: float) -> Any:
    """Return where a frequency [Hz] appears in samples taken at ``rate`` [Hz].

    Itself up to half the rate, above that mirrored back into 0 ... rate / 2 (aliasing).
    """
    return np.abs(frequency - rate * np.round(np.asarray(frequency) / rate))


def lines_at(
    found: Iterable[Source], frequency: float, resolution: float, limit: float
) -> tuple[str, ...]:
    """Name the harmonics that lie where a line is; see :meth:`beltdyn.spectra.Spectrum.names`."""
    names = []
    for source in found:
        if source.frequency < resolution:
            continue
        for k in range(1, source.sharp + 1):
            at = k * source.frequency
            above = at > limit
            if above and source.kind != "link":
                break
            off = abs(float(folded(at, 2.0 * limit)) - frequency)
            allowed = NEAR * resolution + at * source.known
            if off <= allowed:
                sure = source.kind != "link" or frequency >= SURE * resolution / 1.5
                name = f"{'' if sure else 'may be '}{source.name} x{k}"
                names.append((above, off / allowed, name + (", folded" if above else "")))
    ordered = [name for _, _, name in sorted(names)]
    # what is folded may be anywhere: where something is known to be, that is no guess worth telling
    guesses = [name for name in ordered if name.startswith("may be ") and name.endswith(", folded")]
    if len(guesses) < len(ordered):
        ordered = [name for name in ordered if name not in guesses]
    return tuple(ordered)
