"""Spectra with the lines that a drive makes of itself, and Campbell diagrams."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from ..base.checks import Array, pair, positive, real, real_array, shown
from ..base.naming import index_of
from ..outputs.orders import STILL
from ..result.result import Result
from ..spectra import Spectrogram, Spectrum, folded, speed_spectra
from ..spectra import spectrum as spectrum_of
from . import style
from .panel import Curve, draws, lines

_RPM = 60.0 / (2.0 * np.pi)
_LINK, _BELT = style.COLOURS[1], style.COLOURS[2]
_MARKERS = "osD^vP"
#: Harmonics of the link passing that are marked, and orders of a Campbell diagram.
_PASSINGS, _ORDERS = 3, (1, 2, 4, 6, 8)
#: Range of the colours of a Campbell diagram, from the largest amplitude down.
_DECADES = 2.0
#: Fewest slices of time of a diagram.
_SLICES = 3


@draws()
def spectrum(
    result: Result,
    output: str = "span_tension",
    *,
    last: float = 0.5,
    marks: bool = True,
    count: int = 4,
    up_to: float | None = None,
    ax: Axes | None = None,
    span: int | str | None = None,
    pulley: int | str | None = None,
    joint: int | None = None,
    link: int | None = None,
    mount: int | str | None = None,
    **line: Any,
) -> Axes:
    """Draw the amplitude spectrum of an output, its largest lines named.

    A sine of amplitude A is a peak of height A. Lines at the link passing frequency v / l0, and
    beside it, are artefacts of the mesh: they are named so, and their places are marked, unless the
    speed changes too much in the window for that. The title says so, and how close lines may be;
    what the sampling folds is named in the legend (:mod:`beltdyn.spectra`). Needs SciPy.

    Args:
        last: The part of the run, counted from its end, as a share of it, 0 < last <= 1: steady
            running.
        marks: Whether to mark the belt passing and link passing frequencies and name the lines.
        count: How many of the largest lines to name, none below 2 % of the largest.
        up_to: Highest frequency shown [Hz]; None: just beyond the link passing and all lines named.
        joint: For outputs of joints.
        link: For outputs of belt and contact.

    Raises:
        ImportError: SciPy is not there.
        TypeError, ValueError: An argument breaks its rule; samples that are not even in time, or
            too few.
        AttributeError: The run was not asked for this output.
    """
    high = None if up_to is None else positive("up_to", up_to, "Hz")
    where: Any = {"span": span, "pulley": pulley, "joint": joint, "link": link, "mount": mount}
    found = spectrum_of(result, output, last=last, **where)
    named = found.lines(count)
    ax = style.axes(ax)
    lines(ax, [Curve(0, style.plain(found.label), found.frequency, found.amplitude)], line)
    if high is None:
        tops = [1.15 * one.frequency for one in named]
        links = [one for one in found.sources if one.kind == "link"]
        tops += [1.15 * one.frequency for one in links if found.harmonics(one)]
        high = min(max([*tops, 50.0 * found.resolution]), found.limit)
    ax.set_xlim(0.0, high)
    ax.set_ylim(0.0, None)
    if marks:
        _mark_passing(ax, found, high)
        look: dict[str, Any] = {"ms": 6, "mfc": "white", "ls": "", "zorder": 3, "clip_on": False}
        for k, one in enumerate(named):
            if one.frequency <= high:
                what = style.plain(" or ".join(one.names[:2])) or "no order of belt or pulleys"
                label = f"{one.frequency:.4g} Hz, {one.amplitude:.3g} {found.unit}: {what}"
                look |= {"marker": _MARKERS[k % len(_MARKERS)], "label": label}
                look |= {"mec": _LINK if one.from_mesh else "black"}
                ax.plot(one.frequency, one.amplitude, **look)
    style.dress(ax, "frequency [Hz]", f"amplitude [{found.unit}]")
    style.legend_below(ax)  # the width of the axes is known then
    style.set_title(ax, style.plain(_title(found, marks)), "small")
    return ax


def _title(found: Spectrum, marks: bool) -> str:
    """Describe what the window shows and, where lines are named, why others have no names."""
    said = [
        f"{found.begin:.3g} to {found.end:.3g} s, lines closer than {found.resolution:.2g} Hz merge"
    ]
    if marks:
        notes = [note for note in found.notes()[1:] if "up to x" not in note]
        said += [note.replace(" %", "\N{NO-BREAK SPACE}%") for note in notes]
    return "\n".join(said)


def _mark_passing(ax: Axes, found: Spectrum, high: float) -> None:
    """Mark harmonics of the link passing by dotted lines, of the belt by ticks at the bottom."""
    for source in found.sources:
        shown = min(found.harmonics(source), _PASSINGS)
        at = source.frequency * np.arange(1, shown + 1)
        if not shown:
            continue
        if source.kind == "link":
            above = at[0] > found.limit
            places = folded(at, 2.0 * found.limit)
            look: dict[str, Any] = {"color": _LINK, "lw": 0.9, "ls": (0, (1.2, 1.6)), "zorder": 1}
            name = f"link passing, {at[0]:.4g} Hz and multiples: the mesh"
            if above:
                name = f"link passing, {at[0]:.4g} Hz, folded: above {found.limit:.4g} Hz"
            for k, place in enumerate(places):
                if place <= high and (k == 0 or not above):
                    ax.axvline(place, label=name if k == 0 else "_", **look)
        elif source.kind == "belt":
            look = {"transform": ax.get_xaxis_transform(), "color": _BELT, "lw": 1.4}
            ax.vlines(at, 0.0, 0.04, label=f"belt passing, {at[0]:.3g} Hz and multiples", **look)


@draws()
def campbell(
    result: Result,
    output: str = "span_tension",
    *,
    over: int | str = 0,
    orders: Iterable[float] = _ORDERS,
    modes: Sequence[Any] = (),
    window: float | None = None,
    up_to: float | None = None,
    limits: tuple[float, float] | None = None,
    ax: Axes | None = None,
    span: int | str | None = None,
    pulley: int | str | None = None,
    joint: int | None = None,
    link: int | None = None,
    mount: int | str | None = None,
) -> Axes:
    """Draw a Campbell diagram of a run-up: amplitudes over frequency and the speed of a pulley.

    What an order of the pulley excites lies on its line through the origin, what resonates on a
    level one, and what the mesh makes on that of the link passing, dashed; where that is above half
    the rate of sampling it is drawn where it appears. Needs SciPy.

    Args:
        orders: Of that pulley, whose lines are drawn.
        modes: Natural frequencies to draw over it: pairs of a speed of that pulley [rad/s] and
            frequencies (n,) [Hz] there, joined into lines in their order if there are equally many
            everywhere; or ``bd.Modes``, one or several, of a drive at rest as level lines.
        window: Length of a slice of time [s]; None: chosen (:func:`beltdyn.spectra.speed_spectra`).
        up_to: Highest frequency shown [Hz]; None: that of the highest of ``orders``.
        limits: Ends of the logarithmic colour scale, in the unit of the output; None: two decades
            down from the largest amplitude shown.
        joint: For outputs of joints.
        link: For outputs of belt and contact.

    Raises:
        ImportError: SciPy is not there.
        TypeError, ValueError: An argument breaks its rule; samples that are not even in time; a
            speed that does not change.
        AttributeError: The run was not asked for this output, or not for "pulleys.omega".
    """
    multiples = [positive(f"orders[{k}]", order) for k, order in enumerate(orders)]
    ends = None if limits is None else _ends(limits)
    index = index_of("over", over, result.params.pulley_names)
    frequencies = _entries(modes, index)
    where: Any = {"span": span, "pulley": pulley, "joint": joint, "link": link, "mount": mount}
    found = speed_spectra(result, output, over=over, window=window, **where)
    name = result.params.pulley_names[index]
    _check_speeds(result, found, index)
    speed, amplitude = _by_speed(found)
    top = max(multiples, default=8.0) * float(speed.max()) / (2.0 * np.pi)
    high = min(found.limit, top) if up_to is None else positive("up_to", up_to, "Hz")
    seen = found.frequency <= max(1.05 * high, float(found.frequency[1]))
    largest = float(np.nanmax(amplitude[:, seen]))
    if not largest > 0.0:
        raise ValueError(f"{found.label} does not change at all: there is nothing to draw")
    low_, high_ = ends or (largest * 10.0**-_DECADES, largest)
    ax = style.axes(ax)
    mesh = ax.pcolormesh(
        _RPM * speed,
        found.frequency[seen],
        amplitude[:, seen].T,
        norm=LogNorm(low_, high_),
        cmap="Blues",
        shading="nearest",
        rasterized=True,
    )
    ax.figure.colorbar(mesh, ax=ax, label=f"amplitude [{found.unit}]", extend="min", pad=0.09)
    ax.set_xlim(_RPM * speed.min(), _RPM * speed.max())
    ax.set_ylim(0.0, high)
    for k in multiples:
        _order(ax, speed, k * speed / (2.0 * np.pi), f"{k:g}", high)
    if multiples:
        ax.plot([], [], label=f"orders of {style.plain(name)}", **_ORDER)
    _passing(ax, found, speed, high)
    _modes(ax, frequencies, _RPM * speed, high)
    style.dress(ax, f"speed of {style.plain(name)} [rpm]", "frequency [Hz]")
    ax.grid(False)
    ax.set_title(style.plain(found.label), fontsize="medium")
    style.legend_below(ax)
    style.settle_layout(ax)
    return ax


_ORDER: dict[str, Any] = {"color": "0.25", "lw": 0.9, "ls": "-"}


def _ends(limits: object) -> tuple[float, float]:
    """Check the ends of the colour scale."""
    low, high = pair("limits", limits, "")
    if not 0.0 < low < high:
        raise ValueError(
            f"limits must be (low, high) with 0 < low < high, the scale being logarithmic, "
            f"got ({low:g}, {high:g})"
        )
    return low, high


def _entries(modes: Any, pulley: int) -> list[tuple[float | None, Array]]:
    """Check modes, or pairs of a speed and frequencies there; return pairs, None: any speed."""
    entries: list[tuple[float | None, Array]] = []
    for k, one in enumerate(list(modes) if isinstance(modes, (list, tuple)) else [modes]):
        if hasattr(one, "frequency"):
            speed = float(one.state.omega[pulley]) if one.speed else None
            entries.append((speed, np.atleast_1d(one.frequency)))
            continue
        if not isinstance(one, (list, tuple)) or len(one) != 2:
            raise TypeError(
                f"modes[{k}] must be a bd.Modes or a pair of a speed (rad/s) and frequencies (Hz), "
                f"got {shown(one)}"
            )
        speed = real(f"modes[{k}][0]", one[0], "rad/s")
        entries.append((speed, real_array(f"modes[{k}][1]", np.atleast_1d(one[1]), ndim=1)))
    return entries


def _check_speeds(result: Result, found: Spectrogram, pulley: int) -> None:
    """Raise ValueError where a run has too few speeds of the pulley to draw over."""
    name = result.params.label(pulley)
    omega = np.abs(result.pulleys.omega[:, pulley])
    turns = float(np.trapezoid(omega, result.t)) / (2.0 * np.pi)
    if turns < STILL:
        raise ValueError(
            f"{name} stands still: there are no speeds to draw a Campbell diagram over; for a "
            "drive at rest draw plot.spectrum"
        )
    if found.t.size < _SLICES and float(np.ptp(omega)) > 1e-3 * float(omega.max()):
        slices = f"slices of {1.5 / found.resolution:.3g} s"
        raise ValueError(
            f"{result.t.size} samples give {found.t.size} {slices}, a Campbell diagram needs "
            f"{_SLICES} at least: give simulate a t_eval with more samples, or a shorter window"
        )
    slow, fast = float(found.speed.min()), float(found.speed.max())
    if fast - slow <= 1e-3 * fast:
        raise ValueError(
            f"the speed stays at {_RPM * fast:.4g} rpm: a Campbell diagram needs a run-up or "
            "run-down, for steady running draw plot.spectrum"
        )


def _by_speed(found: Spectrogram) -> tuple[Array, Array]:
    """Sort the slices by speed: (n,) rising, and amplitudes (n, n_f), means of slices as fast."""
    low, high = float(found.speed.min()), float(found.speed.max())
    bins = max(2, min(found.speed.size, 400))
    width = (high - low) / bins
    at = np.minimum(((found.speed - low) / width).astype(int), bins - 1)
    used = np.unique(at)
    speed = np.array([found.speed[at == k].mean() for k in used])
    return speed, np.array([found.amplitude[at == k].mean(axis=0) for k in used])


def _order(ax: Axes, speed: Array, frequency: Array, label: str, high: float) -> None:
    """Draw the line of an order, its number where it leaves the picture: off the title above."""
    ax.plot(_RPM * speed, frequency, path_effects=style.HALO, zorder=2, **_ORDER)
    end, top = (_RPM * speed[-1], frequency[-1]), (_RPM * speed[-1] * high / frequency[-1], high)
    look: dict[str, Any] = {"fontsize": "small", "path_effects": style.HALO}
    look |= {"textcoords": "offset points", "annotation_clip": False}
    if frequency[-1] <= high:
        ax.annotate(label, end, (3, 0), ha="left", va="center", **look)
    elif top[0] >= _RPM * speed[0]:
        ax.annotate(label, top, (-6, -2), ha="right", va="top", **look)


def _passing(ax: Axes, found: Spectrogram, speed: Array, high: float) -> None:
    """Draw the lines of belt and link passing."""
    turning = found.speed > 0.05 * found.speed.max()
    ratio = float(np.mean(found.belt[turning] / found.speed[turning]))
    if not np.isfinite(ratio):
        return
    belt: dict[str, Any] = {"color": _BELT, "lw": 1.2, "ls": (0, (6, 1.5, 1, 1.5))}
    ax.plot(_RPM * speed, ratio * speed, zorder=2, label="belt passing", **belt)
    fine = np.linspace(speed[0], speed[-1], 2000)
    at = ratio * found.n_bodies * fine
    place = np.asarray(folded(at, 2.0 * found.limit))
    seen = place <= high
    if found.n_bodies and seen.any():
        link: dict[str, Any] = {"color": _LINK, "lw": 1.2, "ls": (0, (4, 2))}
        link["label"] = "link passing: the mesh"
        if (at[seen] > found.limit).any():
            link["label"] += ", folded"
        ax.plot(_RPM * fine, np.where(seen, place, np.nan), zorder=2, **link)


def _modes(ax: Axes, entries: list[tuple[float | None, Array]], rpm: Array, high: float) -> None:
    """Draw natural frequencies over speed; the legend names them if any is in the picture."""
    look: dict[str, Any] = {"color": style.COLOURS[3], "lw": 1.1, "ls": "-"}
    level = [values for speed, values in entries if speed is None]
    pairs = [(_RPM * abs(speed), values) for speed, values in entries if speed is not None]
    pairs.sort(key=lambda pair: pair[0])
    if len(pairs) == 1:
        level.append(pairs.pop()[1])
    for values in level:
        ax.plot(rpm[[0, -1]], [values[values <= high]] * 2, zorder=2.5, **look)
    if len({values.size for _, values in pairs}) == 1:
        at, lines_of = zip(*pairs, strict=True)
        ax.plot(at, np.array(lines_of), marker="o", ms=3, zorder=2.5, **look)
    else:
        for place, values in pairs:
            ax.plot(np.full(values.size, place), values, "o", ms=3, zorder=2.5, color=look["color"])
    if any((values <= high).any() for _, values in entries):
        ax.plot([], [], label="natural frequencies", **look)
