"""Friction laws between belt and pulleys: their parameters, checked and printed.

With v the slip velocity, N the normal force and F the friction force of a link:

================  ======  ========================================  ================================
law               states  friction                                  what it is for
================  ======  ========================================  ================================
None              0       F = 0                                     a belt that slides freely
Coulomb           0       F/N = mu v / sqrt(v^2 + v_reg^2)          full slip, brakes; creeps
CreepRate         0       F/N = mu v / v_critical, at most mu       steady drives; creeps
Threlfall         0       F/N = +-mu (1 - exp(-3 abs(v) / v_reg))   comparison with other codes
Dahl              1       F/N = z, a bristle that yields smoothly   the paper's law; that of TOML
ElasticPlastic    1       a spring and damper that slip at mu N     belts with shear stiffness
MaxwellSlip       any     several such elements side by side        measured hysteresis loops
LuGre             1       Dahl with Stribeck curve and damping      stick-slip
================  ======  ========================================  ================================

Laws with states depend on the sliding distance since contact began, and stick: a belt under load
that does not slip stands still on its pulley. Laws without a state, functions of v alone, carry a
load only while they slip; ``creep`` gives that slip velocity. They need no state; but where v_reg
is small, explicit methods need very short steps, because the slope ``mu N / v_reg`` acts as a
damper between belt and pulley.
``notebooks/10-friction-laws-compared.ipynb`` has them all on the same drives, and what they cost.

Dahl, ElasticPlastic, MaxwellSlip, Coulomb and LuGre take a Stribeck curve: with ``mu_s`` and
``v_stribeck``, the kinetic coefficient ``mu`` (``mu_k``) becomes

    mu + (mu_s - mu) exp(-(v / v_stribeck)^2)

at the slip velocity v. Without (both 0) no exponential is computed.

``Params.friction`` is the law of all pulleys, ``Pulley.friction`` that of one. With
``friction=None`` in both there is none; a drive whose ``Params.friction`` is None has friction on
those pulleys alone that have their own, and :class:`Frictionless` takes one pulley out of the
drive's.

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

from .. import _core
from ..base.checks import Array, positive, real, real_array
from .rules import Printable, from_table, rules_of

TINY = float(np.finfo(float).tiny)

__all__ = [
    "LAWS",
    "Coulomb",
    "CreepRate",
    "Dahl",
    "ElasticPlastic",
    "Friction",
    "Frictionless",
    "LuGre",
    "MaxwellSlip",
    "Threlfall",
    "law_or_none",
]


class Friction(Printable):
    """Base of the friction laws, MODEL section 4."""

    __slots__ = ()

    #: Name of the law in the core's table, and in TOML.
    law: ClassVar[str]

    def __attrs_post_init__(self) -> None:
        _core.friction_states(self._to_core())  # checks what takes several fields

    @property
    def n_states(self) -> int:
        """Number of states of a link in contact, 0 for a function of its slip velocity alone."""
        return _core.friction_states(self._to_core())

    def _at(
        self, element: int, state: ArrayLike, speed: ArrayLike, normal: ArrayLike
    ) -> dict[str, Array]:
        """Evaluate one element for a metre of belt: force, rate and their derivatives."""
        return _core.friction_law(self._to_core(), 1.0, state, speed, normal, element)

    def coefficient(self, slip: ArrayLike, *, velocity: float, normal: float) -> Array:
        """Compute the friction coefficient along a path of slip, as a test bench measures it.

        A piece of belt under a constant normal force is drawn from point to point at constant
        speed, beginning without friction. Each move is taken with the rate of the state and its
        derivative where it begins: exact for laws linear in their state at constant velocity, such
        as Dahl and LuGre; elastic/plastic friction begins to slip at the next point.

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
        states = np.zeros(max(self.n_states, 1))

        def at(element: int, v: float) -> dict[str, float]:
            point = self._at(element, [states[element]], [v], [pressed])
            return {name: float(value[0]) for name, value in point.items()}

        for k in range(1, points.size):
            move = float(points[k] - points[k - 1])
            coefficients[k] = coefficients[k - 1]
            if move == 0.0:
                continue
            v, duration = math.copysign(speed, move), abs(move) / speed
            force = 0.0
            for e in range(states.size):
                begin = at(e, v)
                growth = begin["rate_by_state"] * duration
                mean = math.expm1(growth) / growth if growth else 1.0
                states[e] += begin["rate"] * duration * mean
                force += at(e, v)["force"]
            coefficients[k] = force / pressed
        return coefficients

    def _in_slip(self, speed: Array, kinetic: float) -> Array:
        """Compute friction coefficients in steady slip, as the core has them."""
        # Of laws with states where their rates are 0, by Newton's method from far beyond full slip:
        # one step for laws that are linear in their state there.
        pressed = np.ones_like(speed)  # [N/m]
        none = np.zeros_like(speed)
        if not self.n_states:
            return np.asarray(self._at(0, none, speed, pressed)["force"])
        force = none
        for e in range(self.n_states):
            most = max(kinetic, getattr(self, "mu_s", 0.0))
            state = 1e3 * most * pressed / self._at(e, none, none, pressed)["by_state"]
            for _ in range(100):
                point = self._at(e, state, speed, pressed)
                falls = point["rate_by_state"]  # 0: it sticks, by a rounding below its limit
                change = np.where(falls < 0.0, point["rate"] / np.minimum(falls, -TINY), 0.0)
                state = state - change
                if np.all(np.abs(change) <= 1e-12 * np.abs(state)):
                    break
            force = force + self._at(e, state, speed, pressed)["force"]
        return np.asarray(force / pressed)

    def creep(self, share: float) -> float:
        """Return the slip velocity at which friction is a share of its full force [m/s].

        A law without a state carries a load only while it slips. Where a wrap as a whole carries
        the torque fraction q, ``ln(T_tight / T_slack) / (mu * wrap)``, an inextensible belt slips
        everywhere at ``creep(q)``. A belt that stretches also creeps by its elongation; the speed
        lost by both is less than their sum, as slip by elongation carries load, too.

        Args:
            share: Share of the full force, in [0, 1).

        Returns:
            The velocity; 0 for laws that stick.

        Raises:
            TypeError, ValueError: Not a number in [0, 1).
        """
        part = real("share", share)
        if not 0.0 <= part < 1.0:
            raise ValueError(f"share must lie in [0, 1), got {part:g}")
        return self._creep(part)

    def _creep(self, _share: float) -> float:
        return 0.0

    def _rows(self) -> list[tuple[str, str, str]]:
        half = self.creep(0.5)
        creep = [("creep", f"{half:.4g} m/s", "slip velocity at half the friction")] if half else []
        rows = super()._rows()
        if getattr(self, "mu_s", 0.0) == 0.0:
            rows = [row for row in rows if row[0] not in ("mu_s", "v_stribeck")]
        return [("kind", self.law, ""), *rows, *creep]


@attrs.frozen(kw_only=True)
class Frictionless(Friction):
    """No friction on one pulley of a drive that has a law; in TOML ``kind = "none"``.

    A drive without any friction has ``Params.friction=None``.
    """

    law = _group = "none"

    def coefficient(self, slip: ArrayLike, *, velocity: float, normal: float) -> Array:
        """Return zeros, after the same checks."""
        positive("velocity", velocity, "m/s"), positive("normal", normal, "N/m")
        return np.zeros(real_array("slip", slip, ndim=1).size)


@attrs.frozen(kw_only=True, field_transformer=from_table("dahl"))
class Dahl(Friction):
    """Dahl friction between belt and pulley, (2.9) and (2.10) of Kubas' paper.

    The state of a link in contact is its friction coefficient mu. Its rate at the slip velocity v
    is ``sigma (v - |v| mu / g)``, with g = mu_k or, with a Stribeck curve, ``g = mu_k + (mu_s -
    mu_k) exp(-(v / v_stribeck)^2)``.
    """

    law = "dahl"

    mu_k: float
    sigma: float
    mu_s: float = 0.0
    v_stribeck: float = 0.0


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
    """

    law = "elastic_plastic"

    mu: float
    stiffness: float
    damping: float
    mu_s: float = 0.0
    v_stribeck: float = 0.0


@attrs.frozen(kw_only=True, field_transformer=from_table("maxwell_slip"))
class MaxwellSlip(Friction):
    """Generalised Maxwell slip: elements of elastic/perfectly plastic friction side by side.

    Each element is an :class:`ElasticPlastic` law with a stretch of its own, and the friction is
    the sum of theirs: ``mu``, ``stiffness`` and ``damping`` have a number for each (n_elements,),
    up to 64. Elements that slip one after the other give a hysteresis loop of straight pieces with
    the memory of every reversal (Masing's rules), which fits measured loops as finely as there are
    elements. One element is ElasticPlastic.

    On the first loading, at a slip s under the normal force N' per metre of belt, the friction
    coefficient is the sum of ``min(stiffness s / N', mu)`` over the elements; after a reversal the
    curve is the same, twice as wide and high. The Stribeck curve is that of the sum: ``mu_s``
    stands for ``sum(mu)`` at low slip velocity, and each element takes its share. Slipping elements
    stay at their limits; that they approach them with a delay, as in the second source, is left
    out.

    Sources: W. D. Iwan, "A distributed-element model for hysteresis and its steady-state dynamic
    response", Journal of Applied Mechanics 33 (1966) 893-900; F. Al-Bender, V. Lampaert, J.
    Swevers, "The generalized Maxwell-slip model: a novel model for friction simulation and
    compensation", IEEE Transactions on Automatic Control 50 (2005) 1883-1887.
    """

    law = "maxwell_slip"

    mu: tuple[float, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    mu_s: float = 0.0
    v_stribeck: float = 0.0


@attrs.frozen(kw_only=True, field_transformer=from_table("coulomb"))
class Coulomb(Friction):
    """Coulomb friction, regularised: ``mu v / sqrt(v^2 + v_reg^2)`` times the normal force.

    The step of Coulomb's law at v = 0 is made smooth by a function without corners, whose slope
    ``mu / v_reg`` is largest at v = 0, and which needs no exponential. The law has no state, so it
    does not stick: to carry the share q of its full force it slips at

        creep(q) = v_reg q / sqrt(1 - q^2),

    0.58 v_reg at half of it. A wrap that sticks in reality creeps at that velocity here, and the
    loss of speed is that over the belt's speed; make v_reg small against both the belt's speed and
    its elastic creep, as far as the steps allow. Towards v_reg = 0 it becomes Coulomb's law. With a
    Stribeck curve mu depends on v, the slope may be largest elsewhere, and ``creep`` is the lowest
    of the velocities.
    """

    law = "coulomb"

    mu: float
    v_reg: float
    mu_s: float = 0.0
    v_stribeck: float = 0.0

    def _creep(self, share: float) -> float:
        plain = self.v_reg * share / math.sqrt(1.0 - share * share)
        if self.mu_s == 0.0:
            return plain

        def above(v: Array) -> Any:
            none = np.zeros_like(v)
            return self._at(0, none, v, none + 1.0)["force"] >= share * self.mu

        # From rest on, as the curve may fall and rise again: in steps far finer than both speeds.
        fine = 1e-3 * min(self.v_reg, self.v_stribeck)
        speeds = np.concatenate([np.arange(8e3) * fine, np.geomspace(8e3 * fine, 1e9 * fine, 2000)])
        first = int(np.argmax(above(speeds)))
        if first == 0:
            return 0.0 if share == 0.0 else float(max(plain, speeds[-1]))
        low, high = float(speeds[first - 1]), float(speeds[first])
        while low < (middle := 0.5 * (low + high)) < high:
            low, high = (low, middle) if above(np.array([middle]))[0] else (middle, high)
        return high


@attrs.frozen(kw_only=True, field_transformer=from_table("creep_rate"))
class CreepRate(Friction):
    """Creep-rate-dependent friction, trilinear in the slip velocity.

    The coefficient grows in proportion to the slip velocity v, by ``mu v / v_critical``, until it
    is mu at v_critical, and stays there, to either side. The law has no state: the whole wrap
    creeps, and to carry the share q of its full force the belt slips at ``creep(q) = q
    v_critical``. Towards v_critical = 0 it becomes Coulomb's law.

    Source: M. J. Leamy, T. M. Wasfy, "Analysis of belt-drive mechanics using a creep-rate-dependent
    friction law", Journal of Applied Mechanics 69 (2002) 763-771.
    """

    law = "creep_rate"

    mu: float
    v_critical: float

    def _creep(self, share: float) -> float:
        return self.v_critical * share


@attrs.frozen(kw_only=True, field_transformer=from_table("threlfall"))
class Threlfall(Friction):
    """Threlfall's form of Coulomb friction: ``mu (1 - exp(-3 |v| / v_reg))`` against the slip.

    At v_reg it is 1 - exp(-3) = 0.95 of the full force. The source uses it up to v_reg and a
    constant 0.95 mu beyond, with a jump of the slope; here it goes on to mu. The law has no state:
    to carry the share q of its full force it slips at ``creep(q) = -v_reg ln(1 - q) / 3``, 0.23
    v_reg at half of it. Towards v_reg = 0 it becomes Coulomb's law.

    Source: D. C. Threlfall, "The inclusion of Coulomb friction in mechanisms programs with
    particular reference to DRAM", Mechanism and Machine Theory 13 (1978) 475-483.
    """

    law = "threlfall"

    mu: float
    v_reg: float

    def _creep(self, share: float) -> float:
        return -self.v_reg * math.log1p(-share) / 3.0


def law_or_none(name: str) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    """Return the validator of a field that holds a friction law or None."""

    def check(_self: Any, _field: attrs.Attribute[Any], value: Any) -> None:
        if value is not None and not isinstance(value, Friction):
            classes = ", ".join(law.__name__ for law in (*LAWS.values(), Frictionless))
            raise TypeError(
                f"{name} must be a friction law ({classes}) or None, got {type(value).__name__}"
            )

    return check


def _made_from(name: str, class_name: str, text: str) -> type[Friction]:
    """Make the class of a law from its row and the rows of its parameters."""
    body: dict[str, Any] = {
        "law": name,
        "__doc__": f"{text} friction.",
        "__module__": __name__,
        "__annotations__": {
            rule.name: "tuple[float, ...]" if rule.rule == "POSITIVES" else "float"
            for rule in rules_of(name).values()
        },
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
