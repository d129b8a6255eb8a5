"""Belt under a tension that runs: what a span knows of itself, and a place on a wrap.

Numbers or arrays alike. By stress-free lengths: of rho A dm pass c dt in dt, so that the belt runs
with v = c lambda and a metre of it in place has the mass rho A / lambda (MODEL sections 2, 6).
"""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from .parts import Belt

__all__ = ["Span"]


@attrs.frozen(eq=False)
class Span:
    """Belt under a tension, a number or an array.

    Attributes:
        belt: The belt.
        tension: T [N].
        flow: Stress-free length that passes in a second, c [m/s].
    """

    belt: Belt
    tension: Any
    flow: Any = 0.0

    @classmethod
    def of_pull(cls, belt: Belt, pull: Any, flow: Any) -> Span:
        """Return the span whose tension less the centrifugal one is ``pull`` [N]."""
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
        """Tension that turns the momentum of the belt, rho A c^2 lambda [N]."""
        return self.belt.linear_density * self.flow**2 * self.stretch

    @property
    def pull(self) -> Any:
        """Tension less the centrifugal one: what presses on pulleys and is handed on [N]."""
        return self.tension - self.centrifugal

    def string_frequency(self, length: float) -> float:
        """Return the first frequency of the span as a string that moves along itself [Hz].

        (w^2 - v^2) / (2 l w), w the speed of its waves; 0 from that speed on.
        """
        wave = float(np.sqrt(self.tension / (self.belt.linear_density / self.stretch)))
        return max(0.0, float((wave**2 - self.speed**2) / (2.0 * length * wave)))
