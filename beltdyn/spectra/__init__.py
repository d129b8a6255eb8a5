"""Spectra of sampled outputs, and the frequencies that a drive excites itself: orders.

An amplitude spectrum shows a sine of amplitude A as a peak of height A. A pulley that turns at f
excites at f and its multiples, its orders; a place on the belt comes round at the **belt passing**
frequency v / L; and a belt of links, unlike a real one, also excites at the **link passing**
frequency v / l0 = n_b v / L, with which its links arrive at the pulleys. A line there is an
artefact of the mesh: it moves when ``n_bodies`` does.

Needs SciPy, imported when it is used.
"""

from __future__ import annotations

from ..base.described import describe_all
from ..outputs.orders import Source, belt_rate, folded, sources
from .fourier import amplitude_spectrum, even_step, spectrogram
from .signals import Signal, signal
from .spectrum import Line, Spectrogram, Spectrum, spectrum, speed_spectra

__all__ = [
    "Line",
    "Signal",
    "Source",
    "Spectrogram",
    "Spectrum",
    "amplitude_spectrum",
    "belt_rate",
    "even_step",
    "folded",
    "signal",
    "sources",
    "spectrogram",
    "spectrum",
    "speed_spectra",
]

describe_all(map(globals().__getitem__, __all__))
