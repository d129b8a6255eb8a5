"""Implausible data of a drive, found before it runs.

Every limit below stands with the argument for it. They lead to warnings only; nothing is refused
or changed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array
from ..base.rounding import percent
from ..base.run_warnings import RunWarning
from ..loads.motions import CrankMotion
from . import cells, compliance
from .drive import Drive
from .friction import Friction
from .preload import solve
from .rules import rules_of

# --- accuracy and plausibility of the drive ---

#: Error of the mesh in the mean tension, as a share of it: 2 %, the best accuracy to which the
#: stiffness of a belt is known.
MESH = 0.02
#: What is suggested instead of a coarser mesh of joints: 1 %.
FINE_MESH = 0.01
#: Errors of a mesh of joints in histories of span tensions (root mean square) and in their means,
#: as shares of what straight links would add at rest: the medians of 144 meshes of 24 random drives
#: at speeds that do not matter (below), eight in ten within factors of 2.2 and 3.3 of them.
JOINT_ERRORS = {"tension": 1.0 / 15.0, "span_mean": 1.0 / 30.0}
#: How much of what bending takes off the blows of links that land, per EI / (T l0^2): measured, on
#: the drives of benchmarks/mesh_estimate.py.
BENDING = 12.0
#: Reinforced belts are installed at 0.1 to 2 %; from about 3 % on EA is not constant.
STRAIN = 0.03
#: Share of the radius by which the contact may shrink the circle on which the belt runs: half the
#: speed that a well loaded drive loses to creep, some 1 %.
COMPLIANCE = 0.005
#: Links longer than this part of the radius turn by more than 29 degrees each on the pulley.
LONG_LINK = 0.5
#: Links that should lie on a wrap at least.
FEW_LINKS = 1.5

# --- units: values that no belt drive has, by a wide margin ---

#: Wheels of cable cars and mine hoists, the largest there are, have radii of 2 to 4 m [m].
RADIUS = 5.0
#: I of a disc is pi/2 rho h R^4: here of water (1000 kg/m^3), 1 um thick [kg/m^2]. Lengths in mm
#: make I/R^4 1e12 times too small; a "massless" pulley stays well above.
DISC = 0.5 * math.pi * 1000.0 * 1e-6
#: I / (2 T R^2) is the time in which all that the belt transmits gives a pulley 1 m/s at its rim:
#: 0.0004 to 0.08 s of machines with their flywheels; a quarter of an hour to 10 m/s is no drive. In
#: kg mm^2 inertias are a million times too large. Beyond ten days they are taken as the wish that a
#: pulley keeps its speed whatever happens [s^2/m].
HEAVY = (100.0, 1e6)
#: A span of 1 m sags under its weight by g/(8 v^2), v^2 = tension/density, here by 5 %: it is
#: slack rather than tight. Belts, ropes and tapes have v of 10 to 150 m/s; EA in kN or density in
#: g/m divide it by 32 [m/s].
WAVE_LOW = 5.0
#: Longitudinal waves sqrt(EA/rho A): steel 5000 m/s, carbon fibre 18 000 m/s [m/s].
WAVE_HIGH = 20e3
#: Earth has 9.81; in mm/s^2 that is 9810. A hundred times Earth's is no machine [m/s^2].
GRAVITY = 1000.0
#: Friction develops over slips of a few mu_k/sigma (1/sigma where a huge mu_k is to prevent all
#: slip); no belt creeps on its wrap by most of a radius. Measured: micrometres on metal, a
#: millimetre on rubber [radii].
BRISTLE = 0.25
#: Belts have friction coefficients of 0.15 to 1.5 (V-belts three times that, at most 5), which are
#: 15 to 500 in percent. With 15 a wrap of half a turn could already carry any torque (e^(15 pi)).
#: Values above 500 are taken as the wish that nothing slips [1].
PERCENT = (15.0, 500.0)


def check(params: Drive) -> tuple[RunWarning, ...]:
    """Return the warnings of the parameters alone: mesh, strain, compliance, long_links, units."""
    return tuple(_of_belt(params)) + tuple(_of_pulleys(params)) + tuple(_of_units(params))


def mesh_share(params: Drive) -> float:
    """Return the tension that straight links add at rest, over that without them [1]."""
    info = params.info
    return float(info["mesh_strain"] / info["strain"])


def mesh_error(params: Drive, shaking: float = 0.0, pull: float = 0.0) -> dict[str, float]:
    """Estimate the errors of the mesh in "tension" and "span_mean", relative to the mean tension.

    At rest, and what shaking and the pull of a load add (MODEL section 6, "Error of the mesh"):
    right to a factor of three or so, often better on slow drives with much load
    (benchmarks/mesh_estimate.py).
    """
    info = params.info
    if params._flows:
        return cells.errors(params, pull)
    if params._belt_facts["tangents"]:
        found = dict.fromkeys(JOINT_ERRORS, mesh_share(params))
    else:
        polygon = (
            info["link_length"] ** 2
            / (12.0 * info["length"])
            * np.sum(params.route.wraps / params._radii)
        )
        share = float(polygon / info["strain"])
        found = {quantity: part * share for quantity, part in JOINT_ERRORS.items()}
    ends = 0.5 * abs(pull) / info["strain_tension"] * info["link_length"] / info["length"]
    found["tension"] += 2.0 * shaking + ends
    found["span_mean"] += shaking + ends
    return found


def shaken(params: Drive, speed: float) -> float:
    """Estimate the relative rise of the mean tension due to links that land [1] (section 6)."""
    belt, info = params.belt, params.info
    if params._flows:
        return 0.0
    length, tension = info["link_length"], info["strain_tension"]
    slope = belt.linear_density * speed * speed / tension  # inf where speed**2 raises
    slope *= float(np.mean((length / params._radii) ** 2)) / 12.0
    slope /= 1.0 + BENDING * belt.bending_stiffness / (tension * length**2)
    return float(0.5 * slope * np.sum(params.route.spans) / info["length"] / info["strain"])


def shaking_seen(params: Drive, speed: float, across: float, time: float) -> float:
    """Estimate the same from a run, from velocities of links across their spans (section 6)."""
    belt, info = params.belt, params.info
    if params._flows:
        return 0.0
    tension, density = info["strain_tension"], belt.linear_density
    strain = 0.5 * across / (tension / density + speed * speed)
    landed = 0.5 * density * abs(speed) ** 3 * time
    landed *= float(np.sum((info["link_length"] / params._radii) ** 2))
    return float(min(strain, 0.5 * landed / (tension * info["length"])) / info["strain"])


def mesh_loss(params: Drive, contact: float, friction: float) -> float:
    """Estimate the part of the losses in contact and friction that is due to the mesh [W].

    What dampers of the contact take is nearly all from links that land. Friction is wrong by the
    share of a link in an arc; on the paper's mesh by that of the tension as well.
    """
    if params._flows:
        return abs(friction) * cells.errors(params, float(params.info["strain_tension"]))["tension"]
    lie = params.route.wraps * params._radii / params.info["link_length"]
    raised = mesh_share(params) if params._belt_facts["tangents"] else 0.0
    return abs(contact) + abs(friction) * (1.0 / float(lie.min()) + raised)


def landing_loss(params: Drive, rims: Array) -> Array:
    """Return what landing links lose at the most, and dampers of links that turn (2, n) [W].

    At speeds of the fastest rim (n,) [m/s] (MODEL sections 2, 6); an ALE belt has neither.
    """
    belt, info, radii = params.belt, params.info, params._radii
    landed = 0.5 * belt.linear_density * float(np.sum((info["link_length"] / radii) ** 2))
    along = params._belt_facts["stretches"]  # are damped along themselves: a string
    turned = 0.0 if along else belt.axial_damping
    turned *= info["strain"] ** 2 * float(np.sum(params.route.wraps / radii))
    return np.stack([landed * np.abs(rims) ** 3, turned * rims**2])


def cogging(params: Drive) -> tuple[float, float]:
    """Return the force [N] and energy [J] with which corners of links catch on the pulleys.

    The way of the belt changes by r (a^2 x / 24 - x^3 / 6) as a corner passes the end of a wrap at
    angles x from -a/2 to a/2 of links that turn by a (section 6): its steepest slope, of all ends,
    and its rms, of ends out of step.
    """
    turns = params.info["link_length"] / params._radii
    depth = 0.00575 * math.sqrt(2.0 * float(np.sum((params._radii * turns**3) ** 2)))
    tension = float(params.info["strain_tension"])
    return tension * float(np.sum(turns**2)) / 6.0, tension * depth


def slip_loss(params: Drive, pulls: Array, rims: Array) -> Array:
    """Estimate the most that friction takes from a belt without a mesh (n_t, n_p) [W].

    Of pulleys that hand on the pulls at the speeds of their rims: half of what the belt stretches,
    what friction that develops on the way leaves in bristles, and, from half of what friction can
    hold on, all by which the rims differ.
    """
    kinetic, developed = params._slip_limits
    most, wraps = 2.0 * params.info["strain_tension"], params.route.wraps
    creep = 0.5 / params.belt.axial_stiffness + developed / (most * wraps * params._radii)
    lost = pulls**2 * np.abs(rims) * creep
    # The belt has a speed between theirs, along itself.
    fastest, slowest = rims.max(axis=1, keepdims=True), rims.min(axis=1, keepdims=True)
    slips = np.abs(pulls) * np.maximum(fastest - rims, rims - slowest)
    near = np.abs(pulls) > 0.5 * most * np.tanh(0.5 * kinetic * wraps)
    return np.where(near, np.maximum(lost, slips), lost)


def corners(params: Drive, k: int) -> str:
    """Describe by how much links raise what full slip on a pulley holds, if by 2 % or more.

    From corner to corner of links that turn by a tensions grow by (1 + mu tan a/2) / (1 - mu tan
    a/2) and not by exp(mu a) (section 6).
    """
    mu, turn = params._slip_limits[0][k], params.info["link_length"] / params._radii[k]
    steep = float(mu * np.tan(0.5 * turn))
    if params._flows or steep >= 1.0:  # who asks for so much wants none to slip
        return ""
    wrap = float(params.route.wraps[k])
    raised = math.expm1((2.0 * math.atanh(steep) / turn - mu) * wrap)
    more = raised / -math.expm1(-mu * wrap)  # of the difference, at the slack span's tension
    if more < MESH:
        return ""
    return (
        f"; links that turn by {math.degrees(turn):.2g} deg each on it make friction there up to "
        f"{percent(more)} too high: "
        + _instead(params, math.sqrt(more / FINE_MESH), f"about {percent(FINE_MESH)}")
    )


def _instead(params: Drive, times: float, leaves: str) -> str:
    """Suggest an ALE belt where there can be one, or links so many times as fine."""
    ale = "" if cells.instead(params) is None else 'Belt(mesh="ale") has none of it, '
    return f"{ale}{links(params.info['n_bodies'] * max(1.0, times))} leaves {leaves}"


def bodies(params: Drive) -> str:
    """Describe the number of links or point masses of the belt."""
    return f"{params.info['n_bodies']} {params._belt_facts['nodes']}"


def describe_mesh(params: Drive) -> str:
    """Describe the error of the mesh in one line."""
    if params._flows:
        return cells.describe(params)
    belt, error, n_b = params.belt, mesh_error(params), params.info["n_bodies"]
    # a run knows its speed and load; here, from which speed on landing links are the larger part
    fast = math.sqrt(error["span_mean"] / max(shaken(params, 1.0), 1e-300))
    running = (
        f"links that land add as much at {fast:.2g} m/s, four times that at twice the speed, "
        f"loads up to {percent(1.0 / n_b)}"  # all the tension: mesh_error, pull 2 T
    )
    if params._belt_facts["tangents"]:
        strain = float(params.info["mesh_strain"])
        return (
            f"{n_b} straight links, longer than their arcs, add {percent(strain)} of "
            f"strain, {strain * belt.axial_stiffness:.3g} N ({percent(error['span_mean'])}); "
            f"{running}"
        )
    return (
        f"with {bodies(params)} some {percent(error['span_mean'])} of the mean tension at rest, "
        f"{percent(error['tension'])} of its history, several times that of creep; {running}; "
        "known to a factor of three"
    )


def _stiff_enough(params: Drive, allowed: Array) -> float:
    """Return the least contact.linear at which the belt sinks in no deeper than allowed [N/m^2]."""

    def share(linear: float) -> float:
        contact = attrs.evolve(params.contact, linear=linear)
        stiffer = attrs.evolve(params, contact=contact)
        return float(np.min(allowed / compliance.compliance(stiffer).depth[:, 0]))

    pull = params.info["strain_tension"] * (1.0 + params.info["strain"])
    most = float(np.max(pull / (params._radii * allowed)))
    return solve(share, 1.0, most, 1.0 / most, (0.0, most), 1e-6, 20)[0]


def of_mesh(
    params: Drive, error: float | None = None, landing: float = 0.0, speed: float = 0.0
) -> Iterator[RunWarning]:
    """Warn of a mesh whose error in mean tensions is 2 % or more."""
    rest, facts = mesh_error(params)["span_mean"], params._belt_facts
    when, error = (" at rest", rest) if error is None else ("", error)
    if error < MESH:
        return
    if facts["flows"]:
        yield RunWarning(
            code="mesh",
            text=f"{bodies(params)} are few for this load: the mesh alone may put mean tensions "
            f"off by some {percent(error)}, creep by several times that; "
            f"{cells.finer(params, error, FINE_MESH)} makes tensions right to {percent(FINE_MESH)}",
            accuracy=True,
        )
        return
    ends = max(0.0, error - rest - landing)
    lost = ", creep by several times that"
    if landing >= max(rest, ends):
        why = f"links that land at {speed:.3g} m/s shake the belt"
        lost = ", losses in the contact are of these blows"
    elif ends > rest:
        why = f"{bodies(params)} are few for this load, which takes a part of a link of each arc"
    elif facts["tangents"]:
        why = f"{params.info['n_bodies']} straight links are longer than the arcs they lie on"
    else:
        why = f"{bodies(params)} are few for pulleys as small as these"
    # square / finer^2 + ends / finer = allowed; tan a / a - 1 falls faster: it is enough
    allowed, square = MESH if facts["tangents"] else FINE_MESH, error - ends
    finer = (ends + math.hypot(ends, 2.0 * math.sqrt(square * allowed))) / (2.0 * allowed)
    yield RunWarning(
        code="mesh",
        text=f"{why}: the mesh alone may put mean tensions off by some {percent(error)}{when}"
        f"{lost}; {links(params.info['n_bodies'] * finer)} makes tensions right to about "
        f"{percent(allowed)}{when}" + (f". {facts['note']}" if facts["note"] else ""),
        accuracy=True,
    )


def of_speeds(params: Drive, falls: float, stays: float) -> Iterator[RunWarning]:
    """Warn of links that slow the pulleys down by 2 % or more; a part stays with finer ones."""
    if not falls + stays >= MESH:  # nor if unknown
        return
    if math.isinf(falls):
        text = (
            "the corners of links catch on the pulleys, which turn no further than the belt gives "
            f"way: it takes up to {cogging(params)[0]:.3g} N along the belt to go on, and a belt "
            f"asks for none; {_instead(params, 2.0, 'a quarter of it')}"
        )
    else:
        finer, rest = math.sqrt(falls / FINE_MESH), min(falls, FINE_MESH) + stays
        text = (
            "links that land on pulleys, rub and catch there take energy that a belt keeps: speeds "
            f"may be off, mostly too low, by some {percent(falls + stays)}, the way that pulleys "
            f"have turned with them; {_instead(params, finer, f'about {percent(rest)}')}"
        )
    yield RunWarning(code="mesh_speed", text=text, accuracy=True)


def _of_belt(params: Drive) -> Iterator[RunWarning]:
    belt, info = params.belt, params.info
    yield from of_mesh(params)
    strain = info["strain"]
    if strain > STRAIN:
        path = info["path_length"]
        asked = (
            f"belt.preload = {belt.preload:.4g} N right? With {STRAIN * belt.axial_stiffness:.3g} N"
            if belt.preload is not None
            else f"belt.length = {info['length']:.4g} m right? The belt line is {path:.4g} m long; "
            f"belt.length = {_up(path / (1.0 + STRAIN), 4):.4g}"
        )
        gives = "it would be" if belt.preload is not None else "gives"
        yield RunWarning(
            code="strain",
            text=f"the belt is stretched by {percent(strain)} at rest, to "
            f"{_preload(params):.4g} N, with EA taken as constant: is {asked} {gives} "
            f"{percent(STRAIN)}",
        )


def _of_pulleys(params: Drive) -> Iterator[RunWarning]:
    radii, info = params._radii, params.info
    sunk = compliance.compliance(params)
    depth = sunk.depth[:, 0]
    worst = int(np.argmax(depth / radii))
    if depth[worst] > COMPLIANCE * radii[worst]:
        needed = _stiff_enough(params, COMPLIANCE * radii)
        effect = (
            "which is made up for at rest, but not under load"
            if params.effective_contact.compensate
            else "and runs on a circle smaller by that, which lowers its tension at rest by "
            f"{percent(-sunk.relative_tension_change)}"
        )
        yield RunWarning(
            code="compliance",
            text=f"at the preload the belt sinks {1e3 * depth[worst]:.2g} mm into "
            f"{params.label(worst)}, {percent(depth[worst] / radii[worst])} of its radius, "
            f"{effect}; contact.linear = {_up(needed, 2):.2g} keeps the depth below "
            f"{percent(COMPLIANCE)}",
            where=params.label(worst),
            accuracy=True,
        )
    if params._flows:
        yield from cells.limits(params)
        return
    small = int(np.argmin(radii))
    if info["link_length"] > LONG_LINK * radii[small]:
        yield RunWarning(
            code="long_links",
            text=f"links of {1e3 * info['link_length']:.3g} mm are long for "
            f"{params.label(small)}, whose radius is {1e3 * radii[small]:.3g} mm: "
            "the belt may run over it as over a polygon, or hook on it, by more than the "
            "estimated error of the mesh; "
            f"{links(info['length'] / (LONG_LINK * radii[small]))} makes them short enough",
            where=params.label(small),
            accuracy=True,
        )
        return
    lie = params.route.wraps * radii / info["link_length"]
    short = int(np.argmin(lie))
    if lie[short] < FEW_LINKS:
        yield RunWarning(
            code="long_links",
            text=f"only {lie[short]:.2g} links lie on {params.label(short)}, whose wrap is "
            f"{np.degrees(params.route.wraps[short]):.3g} deg: now and then none touches it, and a "
            f"stiff contact chatters; {links(info['n_bodies'] * FEW_LINKS / lie[short])} or a "
            "longer wrap help, and a softer contact calms it",
            where=params.label(short),
            accuracy=True,
        )


def _preload(params: Drive) -> float:
    """Return the preload given, or that of the belt's length [N]."""
    return float(params.belt.preload or params.info["strain_tension"])


def _of_units(params: Drive) -> Iterator[RunWarning]:
    belt, tension, radii = params.belt, _preload(params), params._radii
    inertias = np.array([pulley.inertia for pulley in params.pulleys])
    large, light = int(np.argmax(radii)), int(np.argmin(inertias / radii**4))
    thickness = inertias[light] / (DISC * radii[light] ** 4)
    if radii[large] > RADIUS:
        yield units(
            f"{params.label(large)} has a radius of {radii[large]:.4g} m: are lengths in mm?",
            params.label(large),
        )
    elif thickness < 1.0:
        yield units(
            f"with {inertias[light]:.3g} kg m^2 at a radius of {radii[light]:.4g} m "
            f"{params.label(light)} is as light as a disc of water {thickness:.2g} um thick: "
            "are lengths in mm?",
            params.label(light),
        )
    slowest = inertias / (2.0 * tension * radii**2)
    heavy = int(np.argmax(slowest))
    if HEAVY[0] < slowest[heavy] < HEAVY[1]:
        yield units(
            f"{params.label(heavy)} has {inertias[heavy]:.3g} kg m^2, to which all "
            f"that a belt of {tension:.4g} N transmits gives 1 m/s in {slowest[heavy]:.3g} s: is "
            "it in kg mm^2? (To hold a speed, prescribe the motion.)",
            params.label(heavy),
        )
    wave = math.sqrt(tension / belt.linear_density)
    if wave < WAVE_LOW:
        yield units(
            f"a preload of {tension:.4g} N is little for a belt of "
            f"{belt.linear_density:.3g} kg/m, whose spans would sag under their weight: is EA in "
            "kN, or linear_density in g/m or kg/m^3 (density times cross-section is needed)?",
            "belt",
        )
    sound = math.sqrt(belt.axial_stiffness / belt.linear_density)
    if sound > WAVE_HIGH:
        yield units(
            f"with EA = {belt.axial_stiffness:.3g} N and {belt.linear_density:.3g} kg/m stretch "
            f"waves run along the belt at {sound:.3g} m/s, in steel at 5000: is EA a modulus in "
            "Pa, or the density in kg/mm or t/m?",
            "belt",
        )
    pull = math.hypot(*params.gravity)
    if pull > GRAVITY:
        yield units(f"gravity is {pull:.4g} m/s^2: is it in mm/s^2?", "gravity")
    yield from _of_friction(params)


def _of_friction(params: Drive) -> Iterator[RunWarning]:
    """Warn of implausible friction of each law once, on the first pulley that has it."""
    kinetic, developed = params._slip_limits
    least = min(pulley.radius for pulley in params.pulleys)
    seen: list[Friction] = []
    for k, pulley in enumerate(params.pulleys):
        friction = params.friction_on(k)
        if friction is None or friction in seen:
            continue
        seen.append(friction)
        where = "friction" if pulley.friction is None else params.label(k)
        if PERCENT[0] <= kinetic[k] <= PERCENT[1]:
            yield units(
                f"a friction coefficient of {_coefficient(friction)} = {kinetic[k]:.4g} is far "
                "above those of belts, 0.15 to 5: is it in percent? (To prevent all slip, take "
                "1e3 or more.)",
                where,
            )
        bristle = developed[k] * min(1.0, 1.0 / kinetic[k])
        if bristle > BRISTLE * least:
            yield units(
                f"{_stiffness(friction)}friction develops over slips of more than "
                f"{1e3 * bristle:.3g} mm, on a pulley radius of {1e3 * least:.3g} mm: "
                "is its stiffness given per mm?",
                where,
            )


def of_motions(params: Drive, motions: Mapping[int, object], t_end: float) -> Iterator[RunWarning]:
    """Warn of cranks whose irregularity turns them back, which that of no machine does."""
    for k, motion in motions.items():
        if not isinstance(motion, CrankMotion) or not motion.speed.values.any():
            continue
        least = motion._slowest
        if least < 0.0 and (motion.fade is None or motion.fade[0] < t_end):
            yield units(
                f"the harmonics of the motion of {params.label(k)} turn it back in each period, to "
                f"{least:.3g} times its mean speed: are amplitudes in degrees, or of the speed? "
                "They are of the angle, in rad",
                params.label(k),
            )


def _coefficient(friction: Friction) -> str:
    """Name the first parameter without a unit."""
    names = (rule.name for rule in rules_of(friction.law).values() if rule.unit == "1")
    return next(names, "mu")


def _stiffness(friction: Friction) -> str:
    """Quote the stiffness, a parameter per metre of slip, if the law has one."""
    for rule in rules_of(friction.law).values():
        if rule.unit in ("1/m", "N/m^2"):
            return f"with {rule.name} = {rule.quantity(getattr(friction, rule.name))} "
    return ""


def units(text: str, where: str, t: float | None = None) -> RunWarning:
    """Return a warning of the code "units"."""
    return RunWarning(code="units", text=text, where=where, t=t)


def _up(value: float, digits: int) -> float:
    """Round up to that many significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return math.ceil(value / unit) * unit


def links(least: float) -> str:
    """Suggest a number of links: the next ten."""
    number = 10 * math.ceil(least / 10.0)
    if number > _core.MAX_LINKS:
        return "no allowed number of links, only more preload,"
    return f"n_bodies = {number}"
