"""Rows of the spans: tensions, dominant line, frequency as a moving string."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.naming import span_names
from ..drive.span import Span
from ..outputs.averages import mean_over, time_weights
from ..outputs.orders import Source, lines_at, sources
from .rows import SpanRow, Spread
from .window import Window

#: A line stands out if it holds this part of the variance and is this many times the median of the
#: spectrum: of noise, the largest of 1e4 bins is not so high in one case of a hundred.
PART, ABOVE = 0.25, 20.0
#: Least amplitude of one, over the mean tension: below it is what rounding and tolerances leave.
MIN_AMPLITUDE = 1e-4
#: Periods that the window must hold: less is a trend.
LEAST = 3
#: How even samples must be, over their interval.
EVEN = 1e-3


class Line(NamedTuple):
    """A line of a spectrum."""

    frequency: float  # [Hz]
    amplitude: float


def dominant(t: Array, values: Array) -> Line | None:
    """Find the dominant line in the spectrum of evenly spaced samples; None if there is none."""
    n = t.size
    if n < 2 * (LEAST + 2):
        return None
    centred = np.linspace(-1.0, 1.0, n)
    less = values - values.mean()
    less = less - centred * (centred @ less) / (centred @ centred)
    shape = np.hanning(n + 1)[:-1]
    power = np.abs(np.fft.rfft(shape * less)) ** 2
    if n % 2 == 0:
        power = power[:-1]  # at half the sampling rate amplitude and phase cannot be told apart
    tail = power[LEAST:]
    k = LEAST + int(np.argmax(tail)) if tail.size > 2 else power.size
    near = power[k - 1 : k + 2]
    if near.size < 3 or not near[1] > 0.0 or near[1] < near.max():  # the flank of a trend
        return None
    if near.sum() < PART * power[1:].sum() or near[1] < ABOVE * np.median(power[1:]):
        return None
    left, middle, right = np.log(np.maximum(near, 1e-300 + 1e-30 * near[1]))
    shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
    if k + shift < LEAST * n / (n - 1):  # a window of n - 1 intervals
        return None
    step = 1.0 / (n * (t[-1] - t[0]) / (n - 1))
    # A sine on a bin has A n / 4 there, half of it in both neighbours; off a bin the same in all.
    whole = power[max(1, k - 2) : k + 3].sum()
    amplitude = np.sqrt(whole / (1.5 * (n / 4.0) ** 2))
    return Line(float((k + shift) * step), float(amplitude))


def line_of(window: Window, history: Array, least: float) -> dict[str, float]:
    """Return frequency and amplitude of the dominant line, if there is one above ``least``."""
    line = None if uneven(window) else dominant(window.t, history)
    return {} if line is None or not line.amplitude > least else line._asdict()


def span_rows(window: Window) -> list[SpanRow]:
    """Return the rows; note what is missing in them."""
    params, run, notes, way = window.params, window.run, window.notes, window.route
    if len(params.pulleys) == 1:
        notes.append("one pulley: there is no span between two")
        return []
    spans, middles = window.spans, None if way is None else window.middles
    means = None if spans is None else window.mean(spans)
    not_even = uneven(window)
    found = () if not_even else sources(run, window.rows)
    if not_even:
        notes.append(f"no frequencies of spans: {not_even}")
    rows = []
    for k, name in enumerate(span_names(params.pulley_names)):
        row: dict[str, Any] = {"name": name, "length": None if way is None else float(way.spans[k])}
        known = [one[:, k] for one in (middles, spans) if one is not None]
        history = next((one for one in known if not np.isnan(one).any()), None)
        samples = spans[:, k] if history is None and spans is not None else history
        tension = None if samples is None else window.spread(samples, window.passing)
        if tension is not None and means is not None:
            tension = attrs.evolve(tension, mean=float(means[k]))
        if spans is not None:
            whole = run.span_tension[:, k]
            there = whole[~np.isnan(whole)]
            row["absent"] = 1.0 - there.size / whole.size
            if there.size:
                mean = float(mean_over(time_weights(run.t), whole))
                row["of_run"] = Spread(mean, float(there.min()), float(there.max()))
            if 0 < there.size < whole.size:
                notes.append(f"span {name}: {_without(window, k, np.isnan(whole))}")
        if tension is None and known:
            notes.append(f"span {name}: no link of it is free of both pulleys in this window")
        least = math.inf if tension is None else tension.least
        if history is not None:
            least = float(np.nanmin(history))  # of instants: a blow is none of the mesh
        if least <= 0.0:
            notes.append(f"span {name} goes slack: down to {least:.3g} N in its middle")
        if tension is not None and tension.mean > 0.0 and window.belt is not None and way:
            span = Span(params.belt, tension.mean, window.belt.flow)
            row["lateral"] = span.string_frequency(row["length"])
        if history is not None and tension is not None:
            row |= line_of(window, history, MIN_AMPLITUDE * abs(tension.mean))
        if "frequency" in row:
            row["link_passing"] = _of_links(found, window.t, row["frequency"])
        rows.append(SpanRow(**row, tension=tension))
    if not not_even and any(row.tension and row.frequency is None for row in rows):
        notes.append(
            f"lines of the spans below {LEAST / window.lasts:.3g} Hz, of which the window does not "
            f"hold {LEAST} periods; above, a span without a line has none that stands out"
        )
    return rows


def _without(window: Window, k: int, absent: NDArray[np.bool_]) -> str:
    """Describe in how many samples of the run a span has no tension, and why."""
    run, names = window.run, window.params.pulley_names
    why = "no link is free between its pulleys"
    if run._has("contact.pulley"):
        touched = run.contact.pulley[absent]
        for one in (k, (k + 1) % len(names)):
            if not (touched == one).any(axis=1).all():
                why = f"no link touches {names[one]}"
    return (
        f"{why} in {np.count_nonzero(absent)} of {absent.size} samples of the run; its tension is "
        "not known there (NaN), and does not count"
    )


def uneven(window: Window) -> str:
    """Describe why a window has no spectra; "" if its samples are evenly spaced."""
    steps = np.diff(window.t)
    if steps.size < 2 or np.ptp(steps) <= EVEN * steps.mean():
        return ""
    return "the samples are not even in time; give simulate an even t_eval"


def _of_links(found: tuple[Source, ...], t: Array, frequency: float) -> bool | None:
    """Whether a line is a harmonic of link passing, or an alias of one; None: not known."""
    # Not known where the window is too short to separate it from other lines, something else has a
    # harmonic there, or the speed changes so much that links pass at this frequency for a while.
    resolution = 1.5 / float(t[-1] - t[0])
    limit = 0.5 * (t.size - 1) / float(t[-1] - t[0])
    names = lines_at(found, frequency, resolution, limit)
    of_links = ["link passing" in name for name in names]
    if any(of_links):
        sure = all(name.startswith("link passing") for name in names)
        return True if sure else None
    for one in found:
        if one.kind == "link" and one.sharp == 0 and np.isfinite(one.spread):
            low, high = (one.frequency * (1.0 + side * one.spread) for side in (-0.5, 0.5))
            if low <= frequency + resolution and frequency - resolution <= 2.0 * high:
                return None
    return False
