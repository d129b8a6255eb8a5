"""Spectra of the outputs of a run, over all of a window or over short times, and their lines."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from ..base.checks import Array, integer, positive, share_of_run
from ..base.naming import index_of
from ..base.optional import scipy_module
from ..base.rounding import percent
from ..outputs.orders import HARMONICS, NEAR, Source, belt_turning, folded, lines_at, sources
from ..result.result import Result
from .fourier import FEWEST, amplitude_spectrum, even_step, spectrogram
from .signals import signal

#: Least height of a peak that is listed, as a share of the largest.
_FAINT = 0.02


@attrs.frozen(kw_only=True)
class Line:
    """A peak of a spectrum.

    Side bands of a harmonic of the link passing, as far from it as the frequency of a line that is
    named after a pulley or the belt, are named "link passing x1 - crank x2": that vibration
    modulates the passing. At other distances lines are not named so.

    Attributes:
        frequency: Its frequency [Hz].
        amplitude: Its height, in the unit of the signal.
        names: Sources with a harmonic there, such as "link passing x1" or "crank x2"; several if
            the window is too short to tell them apart, none if nothing has; "may be link passing
            x1" if it is too short to tell that from other lines.
    """

    frequency: float
    amplitude: float
    names: tuple[str, ...]

    @property
    def from_mesh(self) -> bool:
        """Whether the passing of links, and nothing else, has a harmonic there."""
        of_links = [name.startswith("link passing") for name in self.names]
        return bool(of_links) and all(of_links)


@attrs.frozen(eq=False, kw_only=True)
class Spectrum:
    """The amplitude spectrum of an output, and what may have made its lines.

    Attributes:
        label: Name of the output, such as "tension of span crank to compressor".
        unit: Unit of the amplitudes.
        frequency: (n_f,) [Hz].
        amplitude: (n_f,); a sine of amplitude A shows A.
        resolution: Lines closer than this merge [Hz].
        limit: Half the rate of sampling [Hz]; what is faster appears mirrored below it.
        begin, end: The window in time [s].
        sources: Periodic sources, the links of the belt first.
    """

    label: str
    unit: str
    frequency: Array
    amplitude: Array
    resolution: float
    limit: float
    begin: float
    end: float
    sources: tuple[Source, ...]

    def lines(self, count: int = 5) -> tuple[Line, ...]:
        """Return the largest peaks, largest first; none below 2 % of the largest.

        Each stands out of its surroundings by half its height at least, and is farther than a
        resolution from any larger one, so that sidelobes are no lines.

        Raises:
            TypeError, ValueError: ``count`` is no integer >= 0.
        """
        if integer("count", count, 0) == 0:
            return ()
        peaks, _ = scipy_module("signal", "a spectrum").find_peaks(
            self.amplitude, prominence=0.5 * self.amplitude, height=np.finfo(float).tiny
        )
        found: list[int] = []
        for k in peaks[np.argsort(-self.amplitude[peaks])]:
            apart = np.abs(self.frequency[found] - self.frequency[k]) > 1.5 * self.resolution
            if self.frequency[k] > self.resolution and apart.all():
                found.append(int(k))
            if len(found) == count:
                break
        faint = _FAINT * self.amplitude[found[0]] if found else 0.0
        lines = [
            Line(frequency=at, amplitude=float(self.amplitude[k]), names=self.names(at))
            for k in found
            if self.amplitude[k] >= faint
            for at in [self._top(k)]
        ]
        mesh = ("link passing", "may be ")
        known = [one for one in lines if one.names and not one.names[0].startswith(mesh)]
        return tuple(
            one if one.names else attrs.evolve(one, names=self._sidebands(one.frequency, known))
            for one in lines
        )

    def _sidebands(self, frequency: float, known: list[Line]) -> tuple[str, ...]:
        """Name side bands of the link passing, as far from its harmonics as a known line."""
        return tuple(
            f"{source.name} x{k} {'+' if sign > 0 else '-'} {line.names[0]}"
            for source in self.sources
            if source.kind == "link"
            for k in range(1, self.harmonics(source) + 1)
            for line in known
            for sign in (-1.0, 1.0)
            for at in [k * source.frequency + sign * line.frequency]
            if abs(float(folded(at, 2.0 * self.limit)) - frequency)
            <= NEAR * self.resolution + abs(at) * source.known
        )[:1]

    def harmonics(self, source: Source) -> int:
        """Return the highest harmonic of a source after which lines are named; 0: none.

        None of one whose harmonics are closer than the resolution, and none that its changes of
        speed smear (:attr:`Source.sharp`); :meth:`notes` says so.
        """
        return source.sharp if source.frequency >= self.resolution else 0

    def _top(self, k: int) -> float:
        """Return the frequency of a peak: of the parabola through three points."""
        before, top, after = self.amplitude[k - 1 : k + 2]
        shift = 0.5 * (before - after) / (before - 2.0 * top + after)
        return float(self.frequency[k] + shift * (self.frequency[1] - self.frequency[0]))

    def names(self, frequency: float) -> tuple[str, ...]:
        """Name the harmonics that lie where a line is [Hz], the closest first, folded ones last.

        Those of links, of pulleys (up to the twelfth order) and of the belt (up to the third), as
        "crank x2"; folded ones, of a frequency above :attr:`limit`, say so. Not of a source
        whose harmonics are closer than the resolution: any line would be one of them; nor
        harmonics that changes of the speed smear.
        """
        return lines_at(self.sources, frequency, self.resolution, self.limit)

    def notes(self) -> tuple[str, ...]:
        """Describe how far the spectrum can be trusted, a sentence each."""
        rate = 2.0 * self.limit
        said = [
            f"window {self.begin:.4g} to {self.end:.4g} s: lines closer than "
            f"{self.resolution:.3g} Hz merge; {rate:.4g} samples a second show up to "
            f"{self.limit:.4g} Hz"
        ]
        for source in self.sources:
            if source.kind == "link" and source.frequency > self.limit and source.sharp:
                at = float(folded(source.frequency, rate))
                need = math.ceil(2.5 * source.frequency * (self.end - self.begin)) + 1
                said.append(
                    f"link passing at {source.frequency:.4g} Hz is above that and appears at "
                    f"{at:.4g} Hz, where nothing happens: {need} samples in the window show it in "
                    "its place"
                )
        for sharp in sorted({one.sharp for one in self.sources}):
            some = [one for one in self.sources if one.sharp == sharp]
            if sharp:
                some = [one for one in some if 0 < self.harmonics(one) < HARMONICS[one.kind]]
            if some:
                said.append(_smeared(some, sharp))
        few = [one.name for one in self.sources if one.sharp and one.frequency < self.resolution]
        if few:
            said.append(f"the window holds too few turns to name lines after {', '.join(few)}")
        return tuple(said)


def _smeared(some: list[Source], sharp: int) -> str:
    """Describe how the rates of some sources change, by how much where that is notable."""
    first, *others = (one.name for one in some)
    so = f", so do those of {', '.join(others)}" if others else ""
    spreads = sorted(one.spread for one in some if one.spread < 1.0)
    ends = dict.fromkeys(percent(spread) for spread in spreads[:1] + spreads[-1:])
    by = f", by {' to '.join(ends)}" if ends else ""
    after = f"named after {'them' if others else 'it'}"
    changes, named = "changes too much", f"no line is {after}"
    if sharp:
        changes, named = "changes", f"lines are {after} up to x{sharp} only"
    return f"the rate of {first} {changes} in the window{by}{so}: {named}"


@attrs.frozen(eq=False, kw_only=True)
class Spectrogram:
    """Amplitude spectra over short times of a run, with the speed that a pulley had in each.

    Attributes:
        label, unit: Of the output.
        t: Middle times of the slices (n_s,) [s].
        speed: Speed of the pulley, absolute, a mean over each slice (n_s,) [rad/s].
        frequency: (n_f,) [Hz].
        amplitude: (n_s, n_f).
        resolution: Lines closer than this merge [Hz].
        limit: Half the rate of sampling [Hz].
        belt: Belt passing frequency in each slice (n_s,) [Hz], NaN if the run did not keep what it
            is found from.
        n_bodies: Number of links, so many link passings to a revolution of the belt; 0 of an ALE
            belt, of which none pass.
    """

    label: str
    unit: str
    t: Array
    speed: Array
    frequency: Array
    amplitude: Array
    resolution: float
    limit: float
    belt: Array
    n_bodies: int


def spectrum(
    result: Result,
    output: str = "span_tension",
    *,
    last: float = 0.5,
    window: str = "hann",
    **where: Any,
) -> Spectrum:
    """Compute the amplitude spectrum of an output of a run, with the sources of its lines.

    Args:
        result: A run with samples evenly spaced in time (``t_eval=np.linspace(0, T, n)``, the
            default); their number sets how high the spectrum reaches.
        output: "span_tension", or an array such as "pulleys.omega", "pulleys.torque",
            "joints.force", "mounts.travel".
        last: The part of the run, counted from its end, as a share of it, 0 < last <= 1: steady
            running. Its length in time sets the resolution.
        window: Of ``scipy.signal.get_window``; "flattop" for heights right to 0.02 %, at a
            resolution two and a half times coarser.
        **where: ``span`` (by its name, or the name or index of the pulley before it), ``pulley``,
            ``joint``, ``link`` or ``mount``; left out: the one that fluctuates most.

    Raises:
        ImportError: SciPy is not there.
        TypeError, ValueError: An argument breaks its rule; uneven or too few samples; values that
            are not finite.
        AttributeError: The run was not asked for this output.
    """
    share = share_of_run("last", last)
    begin = result.t[-1] - share * (result.t[-1] - result.t[0]) if result.t.size else 0.0
    rows = slice(int(np.searchsorted(result.t, begin - 1e-9 * abs(begin))), None)
    t = result.t[rows]
    step = even_step(t)
    found = signal(result, output, rows, **where)
    frequency, amplitude, resolution = amplitude_spectrum(t, found.values, window=window)
    return Spectrum(
        label=found.label,
        unit=found.unit,
        frequency=frequency,
        amplitude=amplitude,
        resolution=resolution,
        limit=0.5 / step,
        begin=float(t[0]),
        end=float(t[-1]),
        sources=sources(result, rows),
    )


def speed_spectra(
    result: Result,
    output: str = "span_tension",
    *,
    over: int | str = 0,
    window: float | None = None,
    **where: Any,
) -> Spectrogram:
    """Compute spectra over short times of a run-up or run-down, with the speed in each.

    Args:
        result: A run with samples evenly spaced in time.
        output: As in :func:`spectrum`.
        over: The pulley whose speed counts, by name or index.
        window: Length of a slice [s]. None: as long as the fourth order of the pulley takes to
            cross the resolution of the slice, which shows the sharpest lines; no more than a
            quarter of the samples.
        **where: As in :func:`spectrum`.

    Raises:
        ImportError: SciPy is not there.
        TypeError, ValueError: An argument breaks its rule; uneven or too few samples; values that
            are not finite.
        AttributeError: The run was not asked for this output, or not for "pulleys.omega".
    """
    step = even_step(result.t)
    pulley = index_of("over", over, result.params.pulley_names)
    speed = np.abs(result.pulleys.omega[:, pulley])
    found = signal(result, output, **where)
    span = float(result.t[-1] - result.t[0])
    if window is None:
        rate = 4.0 * float(np.ptp(speed)) / (2.0 * np.pi) / span  # of the fourth order [Hz/s]
        length = math.sqrt(1.5 / rate) if rate > 0.0 else span
        length = max(min(length, span / 4.0), FEWEST * step)
    else:
        length = positive("window", window, "s")
    t, frequency, amplitude = spectrogram(result.t, found.values, length)
    half = 0.5 * length
    belt = belt_turning(result)

    def means(values: Array) -> Array:
        near = [np.abs(result.t - at) <= half for at in t]
        return np.array([values[rows].mean() for rows in near])

    return Spectrogram(
        label=found.label,
        unit=found.unit,
        t=t,
        speed=means(speed),
        frequency=frequency,
        amplitude=amplitude,
        resolution=1.5 / length,
        limit=0.5 / step,
        belt=np.full(t.size, np.nan) if belt is None else np.abs(means(belt)),
        n_bodies=0 if result.params._flows else result.params.n_bodies,
    )
