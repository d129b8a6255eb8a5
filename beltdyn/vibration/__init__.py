"""Small vibrations of a drive about a state: modes, frequency responses. Needs SciPy."""

from ..base.described import describe_all
from .mode_set import Modes, Shapes
from .modes import modes
from .participation import Participation
from .response import FrequencyResponse, frequency_response

__all__ = [
    "FrequencyResponse",
    "Modes",
    "Participation",
    "Shapes",
    "frequency_response",
    "modes",
]

describe_all(map(globals().__getitem__, __all__))
