"""Friction laws between belt and pulleys: their parameters, checked and printed.

The laws are rows of ``csrc/friction/laws.h``, with a header each; the classes here have the
parameters of the same names. A law of the table without a class here gets one made from its row,
which :mod:`beltdyn` has by its name as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import attrs
import numpy as np
from numpy.typing import ArrayLike

from . import _core
from .checks import Array, positive, real_array
from .rules import Printable, from_table, rules_of

__all__ = ["LAWS", "Dahl", "ElasticPlastic", "Friction", "LuGre", "law_or_none"]


class Friction(Printable):
    """Base of the friction laws, MODEL section 4."""

    __slots__ = ()

    #: Name of the law in the core's table, and in TOML.
    law: ClassVar[str]

    def coefficient(self, slip: ArrayLike, *, velocity: float, normal: float) -> Array:
        """Compute the friction coefficient along a path of slip, as a test bench measures it.

        A piece of belt under a constant normal force is drawn from point to point at constant
        speed, beginning without friction. Each move is taken with the rate of the state and its
        derivative where it begins: exact for laws linear in their state at constant velocity, such
        as Dahl and LuGre; elastic/plastic friction notices at the next point that it slips.

        Args:
            slip: Slip displacement at each point (n,) [m].
            velocity: Speed between points [m/s], > 0.
            normal: Normal force per metre of belt: its tension over the radius [N/m], > 0.

        Returns:
            Friction force over normal force (n,) on arrival at each point; 0 at the first.

        Raises:
            TypeError, ValueError: An argument breaks its rule.
        """
        points = real_array("slip", slip, ndim=1)
        speed = positive("velocity", velocity, "m/s")
        pressed = positive("normal", normal, "N/m")
        coefficients = np.zeros(points.size)
        state = 0.0

        def at(v: float) -> dict[str, float]:
            point = _core.friction_law(self._to_core(), 1.0, [state], [v], [pressed])
            return {name: float(value[0]) for name, value in point.items()}

        for k in range(1, points.size):
            move = float(points[k] - points[k - 1])
            coefficients[k] = coefficients[k - 1]
            if move != 0.0:
                v, duration = math.copysign(speed, move), abs(move) / speed
                begin = at(v)
                growth = begin["rate_by_state"] * duration
                state += begin["rate"] * duration * (math.expm1(growth) / growth if growth else 1.0)
                coefficients[k] = at(v)["force"] / pressed
        return coefficients

    def _in_slip(self, speed: Array, kinetic: float) -> Array:
        """Compute friction coefficients in steady slip, as the core has them.

        The state at which its rate is 0, by Newton's method from twice the state of full slip:
        one step for laws that are linear in their state there.

        Args:
            speed: Slip velocities (n,) [m/s], > 0.
            kinetic: Coefficient in full slip, as of the core [1].
        """
        pressed = np.ones_like(speed)  # [N/m]
        none = np.zeros_like(speed)
        point = _core.friction_law(self._to_core(), 1.0, none, none, pressed)
        state = 2.0 * kinetic * pressed / point["by_state"]
        for _ in range(100):
            point = _core.friction_law(self._to_core(), 1.0, state, speed, pressed)
            change = point["rate"] / point["rate_by_state"]
            state = state - change
            if np.all(np.abs(change) <= 1e-12 * np.abs(state)):
                break
        point = _core.friction_law(self._to_core(), 1.0, state, speed, pressed)
        return np.asarray(point["force"] / pressed)

    def _rows(self) -> list[tuple[str, str, str]]:
        return [("law", self.law, ""), *super()._rows()]

    def _to_core(self) -> tuple[str, tuple[float, ...]]:
        return self.law, tuple(getattr(self, name) for name in rules_of(self.law))


@attrs.frozen(kw_only=True, field_transformer=from_table("dahl"))
class Dahl(Friction):
    """Dahl friction between belt and pulley (2.9), (2.10).

    The state of a link in contact is its friction coefficient mu; it changes with the slip
    velocity v by ``sigma (v - |v| mu / mu_k)``.

    Attributes:
        mu_k: Kinetic friction coefficient [1], > 0.
        sigma: Stiffness of the friction joint at rest [1/m], > 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    law = "dahl"

    mu_k: float
    sigma: float


@attrs.frozen(kw_only=True, field_transformer=from_table("lugre"))
class LuGre(Friction):
    """LuGre friction: Dahl's bristles with a Stribeck curve, damping and a viscous part.

    With the slip velocity v, the state z of a link in contact and ``g = mu_k + (mu_s - mu_k)
    exp(-(v / v_stribeck)^2)``, z changes by ``sigma h``, ``h = v - |v| z / g``, and the friction
    coefficient is ``z + damping h + viscous v``. With mu_s = mu_k and neither damping nor viscous
    part it is :class:`Dahl`. In the article's symbols, per normal force: sigma_0 is ``sigma``,
    sigma_1 ``damping``, sigma_2 ``viscous``.

    Friction that falls with speed excites vibration (stick-slip). Damping of the bristles, some
    ``sqrt(sigma m / N)`` for a link of mass m under a normal force N, keeps it steady while it
    sticks.

    Source: C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of
    systems with friction", IEEE Transactions on Automatic Control 40 (1995) 419-425.

    Attributes:
        mu_k: Kinetic friction coefficient [1], > 0.
        mu_s: Static friction coefficient, that of slip velocity 0 [1], > 0; usually above mu_k.
        v_stribeck: Slip velocity over which friction goes from mu_s to mu_k [m/s], > 0.
        sigma: Stiffness of the bristles at rest [1/m], > 0.
        damping: Damping of the bristles, over the normal force [s/m], >= 0.
        viscous: Viscous friction, over the normal force [s/m], >= 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    law = "lugre"

    mu_k: float
    mu_s: float
    v_stribeck: float
    sigma: float
    damping: float = 0.0
    viscous: float = 0.0


@attrs.frozen(kw_only=True, field_transformer=from_table("elastic_plastic"))
class ElasticPlastic(Friction):
    """Elastic/perfectly plastic friction: a spring and a damper, per metre of belt, that slip.

    A link sticks, held by spring and damper, until their force reaches mu times the normal force;
    then it slips under just that force. The state is the spring's stretch [m]. While the link
    slips, the spring adapts to the normal force within some ``damping / stiffness`` seconds; the
    damping must therefore be > 0. Without measurements, ``damping = 1e-5 s * stiffness`` is little.

    Attributes:
        mu: Friction coefficient [1], > 0.
        stiffness: Of the spring, per metre of belt [N/m^2], > 0.
        damping: Of the damper, per metre of belt [N s/m^2], > 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    law = "elastic_plastic"

    mu: float
    stiffness: float
    damping: float


def law_or_none(name: str) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    """Give the validator of a field that holds a friction law or None."""

    def check(_self: Any, _field: attrs.Attribute[Any], value: Any) -> None:
        if value is not None and not isinstance(value, Friction):
            classes = ", ".join(law.__name__ for law in LAWS.values())
            raise TypeError(
                f"{name} must be a friction law ({classes}) or None, got {type(value).__name__}"
            )

    return check


def _made_from(name: str, class_name: str, text: str) -> type[Friction]:
    """Make the class of a law from its row and the rows of its parameters."""
    rules = rules_of(name)
    fields = "".join(
        f"        {rule.name}: {rule.text} [{rule.unit}], {rule.wording}.\n"
        for rule in rules.values()
    )
    body: dict[str, Any] = {
        "law": name,
        "__doc__": f"{text} friction.\n\n    Attributes:\n{fields}",
        "__module__": __name__,
        "__annotations__": dict.fromkeys(rules, "float"),
    }
    cls = type(class_name, (Friction,), body)
    return attrs.frozen(kw_only=True, field_transformer=from_table(name))(cls)


#: The classes of all friction laws, by their names in the core's table and in TOML.
LAWS: dict[str, type[Friction]] = {
    name: globals().get(class_name) or _made_from(name, class_name, text)
    for name, class_name, text in _core.LAWS
}
# Those that were made can be imported from here, and so pickled.
globals().update({law.__name__: law for law in LAWS.values()})
