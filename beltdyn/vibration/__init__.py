"""Small vibrations of a drive about a state: modes. Needs SciPy."""

from .modes import Modes, Shapes, modes
from .participation import Participation

__all__ = ["Modes", "Participation", "Shapes", "modes"]
