"""Scenes of real drives: an engine's accessories, tensioners, a conveyor, an axis.

Not from the paper: numbers of the size that such drives have, rounded.
"""

from __future__ import annotations

from ..drive.couplings import OverrunningClutch
from ..drive.friction import Dahl, ElasticPlastic
from ..drive.mounts import Arm, Slider
from ..drive.params import Params
from ..drive.parts import Belt, Contact, Drag, Pulley
from ..drive.scene import Scene
from ..loads.loads import Load, SpeedTable
from ..loads.motions import CrankMotion
from ..loads.torques import PiecewiseLinear

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
    hub = OverrunningClutch(inertia=0.0026, stiffness=20.0, damping=0.02, clockwise=True)
    params = Params(
        belt=Belt(
            n_bodies=n_bodies,
            linear_density=0.11,
            axial_stiffness=70e3,
            axial_damping=2.0,
            bending_stiffness=0.01,
        ),
        pulleys=[
            Pulley(name="crank", center=(0.0, 0.0), radius=0.080, inertia=0.030),
            Pulley(name="compressor", center=(0.265, 0.010), radius=0.060, inertia=0.0035),
            Pulley(
                name="alternator",
                center=(0.275, 0.205),
                radius=0.028,
                inertia=0.0004 if decoupler else 0.0030,
                coupling=hub if decoupler else None,
            ),
            Pulley(
                name="idler",
                center=(0.160, 0.190),
                radius=0.035,
                inertia=2.5e-4,
                side="outside",
                drag=Drag(coulomb=0.03, viscous=2e-5),
            ),
            Pulley(name="steering pump", center=(0.070, 0.335), radius=0.065, inertia=0.0025),
            Pulley(name="water pump", center=(-0.105, 0.275), radius=0.060, inertia=0.0030),
            Pulley(
                name="tensioner",
                center=(-0.085, 0.130),
                radius=0.035,
                inertia=2.5e-4,
                side="outside",
                drag=Drag(coulomb=0.03, viscous=2e-5),
                mount=Arm(
                    pivot=(-0.145, 0.185),
                    inertia=2.5e-3,
                    mass=0.15,
                    stiffness=28.0,
                    preload=25.0,
                    damping=0.15,
                    friction=3.0,
                    stops=(-0.35, 0.5),
                ),
            ),
        ],
        friction=Dahl(mu_k=1.0, sigma=1e4),
        gravity=(0.0, -9.81),
    )
    alternator = SpeedTable("alternator", [0.0, 200.0, 500.0, 1000.0], [0.0, 0.6, 1.2, 1.0])
    loads = (
        SpeedTable("compressor", [0.0, 100.0, 500.0], [6.0, 7.0, 8.0])
        + alternator
        + SpeedTable(
            "alternator",
            alternator.omega,
            2.0 * alternator.torque,
            factor=PiecewiseLinear([0.06, 0.062], [0.0, 1.0]),
        )
        + Load("steering pump", coulomb=1.5, viscous=3e-3)
        + Load("water pump", quadratic=8e-6)
    )
    crank = CrankMotion(-314.16, orders=[2, 4], amplitudes=[5e-3, 1e-3], fade=(0.0, 0.02))
    return Scene(params, loads, 0.12, {"crank": crank})


def tensioned_alternator(n_bodies: int = 120) -> Scene:
    """Step the load of an alternator whose slack span a tensioner holds.

    Three pulleys, the tensioner on the back of the belt. The crank runs up clockwise within 0.1 s
    and the alternator is loaded at 0.2 s. The arm gives way by 1.5 degrees: the slack span, between
    tensioner and crank, loses 18 N, as its spring does, while the tight span gains 124 N. Without
    the arm (``mount=None`` and a ``preload``) the slack span loses what the tight one gains, 70 N.

    Args:
        n_bodies: Number of links.
    """
    params = Params(
        belt=Belt(
            n_bodies=n_bodies,
            linear_density=0.10,
            axial_stiffness=80e3,
            axial_damping=1.5,
            bending_stiffness=0.01,
        ),
        pulleys=[
            Pulley(name="crank", center=(0.0, 0.0), radius=0.080, inertia=0.030),
            Pulley(name="alternator", center=(0.300, 0.120), radius=0.035, inertia=0.003),
            Pulley(
                name="tensioner",
                center=(0.170, 0.035),
                radius=0.035,
                inertia=3e-4,
                side="outside",
                mount=Arm(
                    pivot=(0.250, -0.020),
                    inertia=2e-3,
                    stiffness=25.0,
                    preload=-15.0,
                    damping=0.1,
                    friction=1.5,
                ),
            ),
        ],
        friction=Dahl(mu_k=0.9, sigma=1e4),
    )
    load = Load("alternator", coulomb=5.0, factor=PiecewiseLinear([0.2, 0.201], [0.0, 1.0]))
    run_up = PiecewiseLinear([0.0, 0.1], [0.0, 100.0])
    return Scene(params, load + Load("alternator", viscous=2e-3), 0.4, {"crank": run_up})


def crossed_belt(n_bodies: int = 120) -> Scene:
    """Turn a drum the other way round with a crossed flat belt, 1:2.

    The motor's torque rises to 10 N m, the drum is braked in proportion to its speed. Drum and
    motor turn in opposite senses, at half the speed less the creep of 0.3 %; the crossed belt has
    the same wrap of 224 degrees on both, more than an open one, and so more to spare before it
    slips.

    Args:
        n_bodies: Number of links.
    """
    params = Params(
        belt=Belt(
            preload=300.0,
            n_bodies=n_bodies,
            linear_density=0.15,
            axial_stiffness=60e3,
            axial_damping=1.5,
            bending_stiffness=0.01,
        ),
        pulleys=[
            Pulley(name="motor", center=(0.0, 0.0), radius=0.05, inertia=0.004),
            Pulley(name="drum", center=(0.4, 0.0), radius=0.10, inertia=0.05, side="outside"),
        ],
        friction=Dahl(mu_k=0.6, sigma=1e4),
    )
    motor = PiecewiseLinear([0.0, 0.1], [0.0, -10.0], "motor")
    return Scene(params, motor + Load("drum", viscous=0.3), 0.5)


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
    params = Params(
        belt=Belt(
            n_bodies=n_bodies,
            linear_density=9.0,
            axial_stiffness=1.6e6,
            axial_damping=4e3,
            bending_stiffness=40.0,
            bending_damping=0.5,
        ),
        pulleys=[
            Pulley(name="head", center=(12.0, 0.0), radius=0.40, inertia=60.0),
            Pulley(
                name="first bend", center=(8.0, -0.75), radius=0.30, inertia=8.0, side="outside"
            ),
            Pulley(
                name="take-up",
                center=(7.3, -2.3),
                radius=0.35,
                inertia=12.0,
                mount=Slider(
                    direction=(0.0, -1.0),
                    mass=180.0,
                    weight=900.0,
                    friction=300.0,
                    friction_stiffness=3e5,
                ),
            ),
            Pulley(
                name="second bend", center=(6.6, -0.75), radius=0.30, inertia=8.0, side="outside"
            ),
            Pulley(name="tail", center=(0.0, 0.0), radius=0.40, inertia=40.0),
        ],
        contact=Contact(linear=5e7, damping=2.5e4, compensate=True),
        friction=Dahl(mu_k=0.35, sigma=300.0),
    )
    # Rims of 0.4 m: 5 rad/s are 2 m/s; 900 N m on the tail are 2.25 kN of resistance.
    speed = PiecewiseLinear([0.0, 0.5, 2.5, 3.0], [0.0, -0.5, -4.5, -5.0])
    material = Load("tail", coulomb=500.0, viscous=80.0)
    return Scene(params, material, 5.0, {"head": speed})


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
    params = Params(
        belt=Belt(
            preload=250.0,
            n_bodies=n_bodies,
            linear_density=0.04,
            axial_stiffness=40e3,
            axial_damping=6.0,
            bending_stiffness=0.002,
        ),
        pulleys=[
            Pulley(name="motor", center=(0.0, 0.0), radius=0.03, inertia=2e-4),
            Pulley(
                name="drum",
                center=(0.3, 0.0),
                radius=0.12,
                inertia=0.05,
                drag=Drag(coulomb=0.1, viscous=0.01),
            ),
        ],
        friction=ElasticPlastic(mu=0.5, stiffness=1e8, damping=1e3),
    )
    # The carriage: 5 kg on a radius of 60 mm, taken up by the drum before the motor starts.
    carriage = PiecewiseLinear([0.0, 0.05], [0.0, -3.0], "drum")
    speed = PiecewiseLinear(
        [0.1, 0.2, 0.5, 0.6, 0.8, 0.9, 1.2, 1.3], [0, 60, 60, 0, 0, -60, -60, 0]
    )
    return Scene(params, carriage, 1.5, {"motor": speed})
