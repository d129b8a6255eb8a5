"""Belt under a tension that runs: a span, or a place on a wrap; numbers or arrays alike.

Lengths are stress-free: c dt of belt passes in dt, of the mass rho A c dt, and runs with the speed
c lambda (MODEL section 2).
"""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from .parts import Belt


@attrs.frozen(eq=False)
class Span:
    """The tension T [N] of a belt, of which the length c passes in a second [m/s]."""

    belt: Belt
    tension: Any
    flow: Any = 0.0

    @classmethod
    def of_pull(cls, belt: Belt, pull: Any, flow: Any) -> Span:
        """Return the span that has this :attr:`pull` [N]."""
        mass = belt.linear_density * flow**2
        return cls(belt, (pull + mass) / (1.0 - mass / belt.axial_stiffness), flow)

    @property
    def stretch(self) -> Any:
        """Length over stress-free length, lambda = 1 + T / EA [1]."""
        return 1.0 + self.tension / self.belt.axial_stiffness

    @property
    def speed(self) -> Any:
        """Speed of the belt along itself, c lambda [m/s]."""
        return self.flow * self.stretch

    @property
    def centrifugal(self) -> Any:
        """Tension that turns the belt's momentum, rho A c^2 lambda [N]."""
        return self.belt.linear_density * self.flow**2 * self.stretch

    @property
    def pull(self) -> Any:
        """Tension less the centrifugal one, which presses on pulleys and friction changes [N]."""
        return self.tension - self.centrifugal

    def string_frequency(self, length: float) -> float:
        """Return the first frequency of a moving string, (w^2 - v^2) / (2 l w), or 0 [Hz]."""
        wave = float(np.sqrt(self.tension / (self.belt.linear_density / self.stretch)))
        return max(0.0, float((wave**2 - self.speed**2) / (2.0 * length * wave)))
