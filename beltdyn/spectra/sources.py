"""What repeats itself in a drive, and so makes lines: pulleys, the belt, its links."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from ..checks import Array

if TYPE_CHECKING:
    from ..result import Result  # imports the report, which imports this

__all__ = ["Source", "belt_rate", "sources"]


@attrs.frozen(kw_only=True)
class Source:
    """What repeats itself in a drive, and so makes lines at multiples of its frequency.

    Attributes:
        name: "link passing", "belt passing", or that of a pulley.
        kind: "link", "belt" or "pulley".
        frequency: The fundamental, a mean over the window [Hz].
        spread: By how much the frequency changed in the window, as a share [1].
    """

    name: str
    kind: str
    frequency: float
    spread: float


def belt_rate(result: Result, rows: Any = slice(None)) -> Array | None:
    """Give the belt passing frequency: revolutions of the belt per second (n_t,) [Hz].

    The mean speed of the links over the present length of the belt. In steady running that is
    exactly the rate at which its stress-free length passes any place, over L: both numbers hold the
    same mean stretch. The length counts arcs for the chords between neighbouring links.

    Where the run did not keep positions and velocities, the mean speed of the rims over L, which is
    off by stretch, creep and the belt's sinking into the pulleys; None without their speeds either.
    """
    params = result.params
    if all(result._has(f"belt.{name}") for name in ("x", "y", "phi", "vx", "vy")):
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
        return np.asarray(np.abs(speed.mean(axis=-1)) / arc.sum(axis=-1))
    if result._has("pulleys.omega"):
        radii = np.array([pulley.radius for pulley in params.pulleys])
        rims = np.abs(result.pulleys.omega[rows]) * radii
        return np.asarray(rims.mean(axis=-1) / params.info["length"])
    return None


def sources(result: Result, rows: Any = slice(None)) -> tuple[Source, ...]:
    """Give what repeats itself in a run, as means over samples: links, pulleys, the belt.

    Pulleys that stand still are left out, and a belt that does.
    """
    found = []

    def add(name: str, kind: str, rate: Array) -> None:
        mean = float(rate.mean())
        # of the moving mean over a tenth of the window: what fluctuates round it is no drift
        width = max(1, rate.size // 10)
        smooth = np.convolve(rate, np.full(width, 1.0 / width), mode="valid")
        if mean > 0.0 and rate.max() > 1e-9:
            spread = float(smooth.max() - smooth.min()) / mean
            found.append(Source(name=name, kind=kind, frequency=mean, spread=spread))

    belt = belt_rate(result, rows)
    if belt is not None:
        add("link passing", "link", belt * result.params.belt.n_bodies)
    if result._has("pulleys.omega"):
        turns = np.abs(result.pulleys.omega[rows]) / (2.0 * np.pi)
        for name, rate in zip(result.params.pulley_names, turns.T, strict=True):
            add(name, "pulley", rate)
    if belt is not None:
        add("belt passing", "belt", belt)
    return tuple(found)
