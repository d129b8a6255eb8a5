"""Scenes of real drives: an engine's accessories, tensioners, a conveyor, an axis.

Not from the paper: numbers of the size that such drives have, rounded.
"""

from __future__ import annotations

import attrs

from ..drive.couplings import OverrunningClutch
from ..drive.scene import Scene
from .from_file import kept

__all__ = ["conveyor", "crossed_belt", "flat_belt_axis", "serpentine", "tensioned_alternator"]


def serpentine(n_bodies: int = 200, decoupler: bool = False) -> Scene:
    """Run the accessories of an engine at 3000 1/min: seven pulleys, one on a tensioner arm.

    A six-ribbed belt drives compressor, alternator, steering pump and water pump; idler and
    tensioner run on its back. The crank turns clockwise at 314 rad/s, from the start on, with the
    second and fourth order of a four-cylinder engine fading in during the first revolution; at 0.06
    s the alternator takes three times its torque within 2 ms. Watch the tensioner
    (``bd.plot.travel``): it swings by nearly a degree with the firing, by half as much again
    without the dry friction of its pivot, and gives way by another half a degree when the load
    comes, so that the slack span between crank and tensioner keeps its 380 N while the tight span
    at the compressor rises from 610 to 690 N.

    With a decoupler the alternator's rotor hangs on its pulley by an overrunning clutch and a soft
    spring, on which it swings at 14 Hz, far below the firing at 100 Hz: there its speed fluctuates
    by 0.2 instead of 2.3 rad/s, the span before it by 26 instead of 100 N, the tensioner by 0.28
    instead of 0.40 degrees; the span behind the crank, though, by 135 instead of 75 N (amplitudes
    after 0.3 s, 120 links). It takes some 0.2 s until the spring has wound up to its 9 degrees.

    Args:
        n_bodies: Number of links.
        decoupler: Whether the alternator has an overrunning decoupler.
    """
    scene = kept("serpentine", n_bodies)
    if not decoupler:
        return scene
    hub = OverrunningClutch(inertia=0.0026, stiffness=20.0, damping=0.02, clockwise=True)
    pulleys = [
        attrs.evolve(pulley, inertia=0.0004, coupling=hub)
        if pulley.name == "alternator"
        else pulley
        for pulley in scene.params.pulleys
    ]
    return scene._replace(params=attrs.evolve(scene.params, pulleys=pulleys))


def tensioned_alternator(n_bodies: int = 120) -> Scene:
    """Step the load of an alternator whose slack span a tensioner holds.

    Three pulleys, the tensioner on the back of the belt. The crank runs up clockwise within 0.1 s
    and the alternator is loaded at 0.2 s. The arm gives way by 1.5 degrees: the slack span, between
    tensioner and crank, loses 18 N, as its spring does, while the tight span gains 124 N. Without
    the arm (``mount=None`` and a ``preload``) the slack span loses what the tight one gains, 70 N.

    Args:
        n_bodies: Number of links.
    """
    return kept("tensioned_alternator", n_bodies)


def crossed_belt(n_bodies: int = 120) -> Scene:
    """Turn a drum the other way round with a crossed flat belt, 1:2.

    The motor's torque rises to 10 N m, the drum is braked in proportion to its speed. Drum and
    motor turn in opposite senses, at half the speed less the creep of 0.3 %; the crossed belt has
    the same wrap of 224 degrees on both, more than an open one, and so more to spare before it
    slips.

    Args:
        n_bodies: Number of links.
    """
    return kept("crossed_belt", n_bodies)


def conveyor(n_bodies: int = 360) -> Scene:
    """Start a belt conveyor of 12 m whose tension a weight of 900 kg keeps.

    The take-up hangs in a loop of the return strand between two bend pulleys: it holds 4.4 kN there
    whatever the load, where a belt between fixed axes would lose 1 kN on the return side as the
    drive pulls the carrying strand. The head is driven up to 2 m/s within 3 s against the material,
    which resists as a torque on the tail drum. The carrying strand goes from 4.4 to 6.9 kN and the
    weight sinks by a centimetre, which takes up its stretch; it swings on the belt's elasticity
    when the ramp begins and ends, and the friction of its guide calms it.

    Args:
        n_bodies: Number of links.
    """
    return kept("conveyor", n_bodies)


def flat_belt_axis(n_bodies: int = 120) -> Scene:
    """Lift and lower a hanging carriage through a flat belt 4:1: up, a pause, and back.

    The motor's motion is prescribed: up to 60 rad/s within 0.1 s, constant, down again, and the
    same back, so that it ends exactly where it began. The drum, on which the carriage pulls with 3
    N m, lags while it is accelerated, swings when the motor stops, and does not come back to its
    place: elastic creep, on both ways in the sense of the load, has let it sink by 0.42 degrees,
    which no encoder on the motor sees.

    Args:
        n_bodies: Number of links.
    """
    return kept("flat_belt_axis", n_bodies)
