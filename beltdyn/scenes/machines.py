"""Built-in scenes: the paper's drive, small ones, those of machines, and those of other authors.

Their numbers are TOML files, in the folder ``drives`` beside this module. But for the paper's and
the published ones they are of the size that such drives have, rounded.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..drive.couplings import OverrunningClutch
from ..drive.parameters import changed
from ..drive.scene import Scene
from ..loads.torques import PiecewiseLinear

_FOLDER = Path(__file__).with_name("drives")


def _kept(name: str, n_bodies: int | None = None) -> Scene:
    """Read the scene in a file, its belt of that many links; None: of as many as it has there."""
    scene = Scene.from_toml(_FOLDER / f"{name}.toml")
    if n_bodies is None:
        return scene
    return scene._replace(params=changed(scene.params, {"belt.n_bodies": n_bodies}))


def kubas_case_1() -> Scene:
    """Run the paper's drive up to 2 pi rad/s against a viscous load: case 1.

    From the paper: two pulleys of radius 0.1 m, 0.290 m apart, L = 1.2 m, n_b = 60, sigma = 1e4
    1/m, the load (2.13), which resists. The driving torque goes from 0 to -100 N m over 0.3 s and
    stays. The paper calls it 100 N m in the heading of case 1 and -50 N m in its text; its joint
    forces of about 120 and 1120 N and the load 100/(2 pi) N m s/rad at 2 pi rad/s need 100 N m.

    Not in the paper: EA, rho A, eta A, EI, contact, mu_k, inertia, gravity (none here) and how the
    belt was stabilised. They were identified from the numbers the paper states for both cases, in
    ``notebooks/2-identification.ipynb``: the belt is laid round held pulleys at the strain of the
    belt line, with friction on, and the pulleys are released at t = 0, when each carries 0.13 N m.
    EA, together with the contact, is determined to 3 %, mu_k to 7 %; EI and the contact within a
    factor; the dampings not at all, mass and inertia only together with the phase of the speeds'
    oscillation. The notebook has the intervals, where the paper's numbers contradict each other,
    and which number a drive that rests without holding its pulleys would miss (row 11).

    The mesh is the paper's, whose straight links raise the tension by a quarter at rest, that of
    the spans under this load by 9 %: they have 122 and 1118 N. The drive's own numbers, with
    ``Belt(mesh="joint")``, are 69 and 1069 N.
    """
    return _kept("kubas_case_1")


def kubas_case_2(sigma: float = 1e4) -> Scene:
    """Load the paper's drive both ways, opposite on the two pulleys: case 2.

    The drive is that of :func:`kubas_case_1`, which explains the origin of every number. The
    driving torque is piecewise linear, 0, -100, +100, 0 N m at 0, 0.25, 0.75, 1 s; the paper's
    text has 50, its joint forces from 100 to 1110 N need 100.

    Args:
        sigma: Stiffness of the friction joint [1/m]; the paper compares 1e4 and 5e3.
    """
    drive = [0.0, -100.0, 100.0, 0.0]
    torque = PiecewiseLinear([0.0, 0.25, 0.75, 1.0], [[value, -value] for value in drive])
    return Scene(changed(kubas_case_1().params, {"friction.sigma": sigma}), torque, 1.0)


def three_pulleys() -> Scene:
    """Drive an alternator and a pump from a crank pulley, with gravity.

    Not from the paper: numbers of the size found on a small engine, a belt strained by 0.7 %. The
    crank torque ramps up in 0.05 s; at 0.25 s the alternator is loaded within 1 ms. With 120 links
    mean tensions are right to 0.4 %; the third span swings by 11 N over the last 0.1 s, where 960
    links have 9.
    """
    return _kept("three_pulleys")


def unequal_pulleys() -> Scene:
    """Step the torque on a reduction 1:2 with a stiff belt.

    Not from the paper. The step, at 0.05 s, is a jump, on which the integrator stops; the bending
    stiffness is large enough to lift the belt where it runs on to and off the small pulley.
    """
    return _kept("unequal_pulleys")


def flywheel_start() -> Scene:
    """Start a flywheel through a belt that slips fully, then sticks again.

    Not from the paper. For 0.1 s the driving torque is above what friction can transmit and the
    driving pulley slips; then the torque drops and the belt sticks again.
    """
    return _kept("flywheel_start")


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
    scene = _kept("serpentine", n_bodies)
    if not decoupler:
        return scene
    hub = OverrunningClutch(inertia=0.0026, stiffness=20.0, damping=0.02, clockwise=True)
    changes = {"pulleys[alternator].inertia": 0.0004, "pulleys[alternator].coupling": hub}
    return scene._replace(params=changed(scene.params, changes))


def tensioned_alternator(n_bodies: int = 120) -> Scene:
    """Step the load of an alternator whose slack span a tensioner holds.

    Three pulleys, the tensioner on the back of the belt. The crank runs up clockwise within 0.1 s
    and the alternator is loaded at 0.2 s. The arm gives way by 1.5 degrees: the slack span, between
    tensioner and crank, loses 18 N, as its spring does, while the tight span gains 124 N. Without
    the arm (``mount=None`` and a ``preload``) the slack span loses what the tight one gains, 70 N.

    Args:
        n_bodies: Number of links.
    """
    return _kept("tensioned_alternator", n_bodies)


def crossed_belt(n_bodies: int = 120) -> Scene:
    """Turn a drum the other way round with a crossed flat belt, 1:2.

    The motor's torque rises to 10 N m, the drum is braked in proportion to its speed. Drum and
    motor turn in opposite senses, at half the speed less the creep of 0.3 %; the crossed belt has
    the same wrap of 224 degrees on both, more than an open one, and so more to spare before it
    slips.

    Args:
        n_bodies: Number of links.
    """
    return _kept("crossed_belt", n_bodies)


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
    return _kept("conveyor", n_bodies)


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
    return _kept("flat_belt_axis", n_bodies)


def ntarladima_2023(n_bodies: int = 240) -> Scene:
    """Run the two-pulley benchmark of Ntarladima et al. up to 12 rad/s, then load it.

    Two pulleys of radius 0.1 m, 0.1 pi m apart, turn counter-clockwise, with gravity. From a
    preload of 400 N without friction, at rest, pulley 0 is brought to 12 rad/s between 0.05 and
    0.60 s; pulley 1 has a drag of 2 N m s/rad and, from 1 to 1.5 s, a load that rises to 25 N m.
    The upper span is the tight one, ``span_tension[:, 0]``.

    The article gives everything per metre of the reference length 0.4 pi m, the belt line, to which
    the belt is stretched by a twentieth: its tension is 8000 N (e + 0.05), with the strain e of
    that length. Here all is per metre of the stress-free length 0.38 pi m, so that EA is 7600 N.
    The belt is 0.08 m wide; contact and friction are given per area. The load, 12.5 N m (1 -
    cos(2 pi (t - 1))), is a harmonic of the angle of pulley 0, which is 12 (t - 0.325) rad by then.

    At 2.45 s, mean of the last 0.05 s, 240 links give 11.306 rad/s of pulley 1, spans of 664.4 and
    186.4 N and a driving torque of 47.64 N m. Quasi-static creep theory without gravity has 11.308
    rad/s, 663.2 and 186.9 N, 47.62 N m; the authors' finest run, of 480 ANCF elements, 11.325
    rad/s, 664.5 and 186.3 N, 47.65 N m.

    Source: K. Ntarladima, M. Pieber, J. Gerstmayr, "A model for contact and friction between beams
    under large deformation and sheaves", Nonlinear Dynamics (2023), doi:10.1007/s11071-023-08973-y.

    Args:
        n_bodies: Number of links.
    """
    return _kept("ntarladima_2023", n_bodies)


#: By name, in the order in which they are listed.
SCENES: dict[str, Callable[[], Scene]] = {
    scene.__name__.replace("_", "-"): scene
    for scene in (
        kubas_case_1,
        kubas_case_2,
        three_pulleys,
        unequal_pulleys,
        flywheel_start,
        ntarladima_2023,
        serpentine,
        tensioned_alternator,
        crossed_belt,
        conveyor,
        flat_belt_axis,
    )
}
