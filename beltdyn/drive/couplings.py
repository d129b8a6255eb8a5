"""Couplings of a pulley's shaft and rim: isolators, overrunning clutches; torsional dampers.

Equations in MODEL section 5. With an isolator or a clutch the belt runs on the rim, of the inertia
that the pulley has, and everything else acts on the hub: torques and loads, bearing drag and
prescribed motions. ``result.pulleys`` (``theta``, ``omega``, ``torque``) and the arguments of
torque functions are the hub's; ``result.couplings`` has the rim's, the windup and the torque
between the two. Powers are those of shafts; speed ratios and creep are of rims. With a torsional
damper belt and torques act on the pulley itself, and a ring hangs free on it.
"""

from __future__ import annotations

from typing import TypeAlias

import attrs

from .rules import Printable, from_table


class _Joined(Printable):
    """Base of the couplings; the part that turns beside the shaft is the rim or a ring."""

    __slots__ = ()
    _part = "rim"


@attrs.frozen(kw_only=True, field_transformer=from_table("isolator"))
class Isolator(_Joined):
    """A spring and damper between hub and rim, acting both ways: torsional isolator, soft coupling.

    The pulley's own inertia is then that of the rim. Where the belt runs on the ring of a torsional
    vibration damper, carried by rubber, the pulley's inertia is that of the ring and ``inertia``
    that of hub and shaft; the crank's motion or torque acts on the hub. Where the ring hangs free
    and the belt runs on the hub, use :class:`TorsionalDamper`.
    """

    inertia: float
    stiffness: float
    damping: float = 0.0


@attrs.frozen(kw_only=True, field_transformer=from_table("clutch"))
class OverrunningClutch(_Joined):
    """A one-way clutch between rim and hub: the belt drives the rotor, which may run ahead.

    While the rim turns faster than the hub in the running direction, it winds up the spring by z
    and drives the hub by stiffness z + damping dz/dt. It never holds the hub back: when that torque
    would be negative the rollers come free, the hub overruns, and the clutch engages again at
    whatever angle it has when the rim catches up. With a soft spring this is an overrunning
    alternator decoupler (OAD); without, an overrunning alternator pulley (OAP), whose rollers have
    a stiffness that is chosen.

    Attributes:
        inertia: Inertia of the hub with shaft and rotor [kg m^2], > 0; the pulley's own is then
            that of the rim.
        stiffness: Stiffness of the spring [N m/rad], >= 0; None or 0: no spring, rollers on which
            the hub alone would swing at 300 Hz.
        damping: Damping beside the spring [N m s/rad], >= 0; None or 0: 5 % of critical, of the hub
            on its spring. Rollers that come free unwind at the rate stiffness / damping.
        clockwise: Whether the rim drives the hub clockwise, as where the rim turns clockwise in
            service; by default it drives it counter-clockwise, the sense in which angles are
            positive. The wrong way round the rotor is not driven at all.
    """

    inertia: float
    stiffness: float | None = None
    damping: float | None = None
    clockwise: bool = False


@attrs.frozen(kw_only=True, field_transformer=from_table("damper"))
class TorsionalDamper(_Joined):
    """A free ring on a pulley, held by a spring and a damper: a torsional vibration damper.

    Without a spring it is a viscous (Houdaille) damper. Belt and torques act on the pulley, whose
    own inertia is that of all but the ring. On a pulley whose motion is prescribed it only changes
    the torque that this motion needs: drive the crank by a torque, or put the damper on another
    pulley. ``result.couplings`` has the ring as rim.
    """

    inertia: float
    stiffness: float
    damping: float = 0.0
    _part = "ring"


Coupling: TypeAlias = Isolator | OverrunningClutch | TorsionalDamper
