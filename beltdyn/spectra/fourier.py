"""Fourier spectra of samples: amplitudes, also over short times."""

from __future__ import annotations

import numpy as np

from ..base.checks import Array, real
from ..base.optional import scipy_module

#: Fewer samples have no spectrum worth the name.
FEWEST = 16
#: Spectra are computed at this many times the points that the samples have, so that the peak of a
#: line between two of them is missed by at most 0.3 % with the window of Hann (15 % without).
_PADDED = 8


def even_step(t: Array) -> float:
    """Return the time between samples (n_t,) [s], which a spectrum needs to be always the same.

    Raises:
        ValueError: It is not, or there are fewer than 16 samples.
    """
    if t.size < FEWEST:
        raise ValueError(
            f"a spectrum needs at least {FEWEST} samples, got {t.size}: give simulate a t_eval "
            "with more, or a larger last"
        )
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / (t.size - 1)
    rounding = 8.0 * np.finfo(float).eps * float(np.abs(t).max())
    if float(np.abs(steps - mean).max()) > 1e-6 * mean + rounding:
        raise ValueError(
            "a spectrum needs samples evenly spaced in time, these are from "
            f"{steps.min():.4g} to {steps.max():.4g} s apart: run simulate with "
            "t_eval=np.linspace(begin, end, n)"
        )
    return mean


def _checked_step(t: Array, values: Array) -> float:
    if not np.isfinite(values).all():
        raise ValueError("a spectrum needs finite values, some are NaN or infinite")
    return even_step(t)


def amplitude_spectrum(
    t: Array, values: Array, *, window: str = "hann"
) -> tuple[Array, Array, float]:
    """Return the amplitude spectrum of samples: a sine of amplitude A shows A, to 0.3 %.

    The straight line through the values, and with it their mean, is taken off first. 2 / sum(w)
    scales the discrete Fourier transform of the values times the window w (Harris, Proc. IEEE 66
    (1978) 51, coherent gain), padded with zeros to eight times the length.

    Args:
        t: Times (n_t,) [s], evenly spaced.
        values: Samples (n_t,).
        window: Of ``scipy.signal.get_window``: "hann", "flattop", "boxcar", ...

    Returns:
        Frequencies (n_f,) [Hz], amplitudes (n_f,) in the unit of the values, and the resolution
        [Hz]: lines closer than that merge. It is the noise bandwidth of the window, for "hann" 1.5
        over the time that the samples span.

    Raises:
        ImportError: SciPy is not there.
        ValueError: Uneven or too few samples, values that are not finite, no such window.
    """
    step = _checked_step(t, values)
    signal_ = scipy_module("signal", "a spectrum")
    weights = signal_.get_window(window, t.size)
    length = int(scipy_module("fft", "a spectrum").next_fast_len(_PADDED * t.size, real=True))
    without = signal_.detrend(values, type="linear")
    amplitude = np.abs(np.fft.rfft(weights * without, length)) * 2.0 / weights.sum()
    bandwidth = float(np.sum(weights**2) / np.sum(weights) ** 2)
    return np.asarray(np.fft.rfftfreq(length, step)), np.asarray(amplitude), bandwidth / step


def spectrogram(t: Array, values: Array, length: float) -> tuple[Array, Array, Array]:
    """Return amplitude spectra over short times, of a signal whose lines move as in a run-up.

    Args:
        t: Times (n_t,) [s], evenly spaced.
        values: Samples (n_t,).
        length: Length of a slice [s]; slices overlap by seven eighths and lie within the samples.

    Returns:
        Middle times of the slices (n_s,) [s], frequencies (n_f,) [Hz], amplitudes (n_s, n_f).

    Raises:
        ImportError: SciPy is not there.
        ValueError: Uneven or too few samples, values that are not finite, slices that are longer
            than the samples or shorter than 16 of them.
    """
    step = _checked_step(t, values)
    count = round(real("window", length, "s") / step)
    if not FEWEST <= count <= t.size:
        raise ValueError(
            f"window must be from {FEWEST} samples to all of them, {FEWEST * step:.3g} to "
            f"{t.size * step:.3g} s, got {length:.3g} s"
        )
    signal_ = scipy_module("signal", "a spectrum")
    short = signal_.ShortTimeFFT(
        signal_.get_window("hann", count),
        hop=max(1, count // 8),
        fs=1.0 / step,
        fft_mode="onesided2X",
        mfft=2 * count,
        scale_to="magnitude",
    )
    # slices that reach beyond the samples would see them end, and are left out
    first, end = short.lower_border_end[1], short.upper_border_begin(t.size)[1]
    first, end = (first, end) if end > first else (first, first + 1)
    found = short.stft_detrend(values, "linear", p0=first, p1=end)
    times = t[0] + np.arange(first, end) * short.delta_t
    return np.asarray(times), np.asarray(short.f), np.asarray(np.abs(found).T)
