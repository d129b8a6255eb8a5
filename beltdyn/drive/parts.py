"""Parts of a belt drive: objects that check their values and print themselves.

Rules, units and meanings of the numbers are those of :mod:`beltdyn.drive.rules`. Data of the belt
are per unit length, so ``n_bodies`` refines the mesh of the same belt.

Source of the model: K. Kubas, "A model for the dynamic analysis of a belt transmission using the
Dahl friction model", equations (2.1)-(2.13).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import attrs

from .. import _core
from ..base.naming import as_name, names_of
from .couplings import Coupling, TorsionalDamper
from .friction import Friction, law_or_none
from .mounts import Mount
from .rules import (
    Printable,
    Rule,
    from_table,
    instance_of,
    rules_of,
    with_choice,
)

_PRELOAD = Rule("belt", "preload", "POSITIVE", "N", "mean tension of the belt at rest")
_CENTER = Rule("pulley", "center", "PAIR", "m", "position (x, y) of the axis")

#: Belt models by name.
BELTS = {row["name"]: row for row in _core.BELTS}
MESHES = tuple(dict.fromkeys(row["mesh"] for row in _core.BELTS))
BELT_MODELS = ("auto", *dict.fromkeys(row["model"] for row in _core.BELTS))
#: Meshes that choose how many cells they have.
CHOOSE = tuple(row["mesh"] for row in _core.BELTS if row["flows"])
SIDES = ("inside", "outside")


@attrs.frozen(kw_only=True, field_transformer=from_table("belt", _PRELOAD))
class Belt(Printable):
    """A closed belt, per metre of its stress-free length.

    Its length is given, or its preload, from which ``params.effective_belt`` finds the length; or
    neither, where springs and weights of mounts set the tension: the belt then gets the length that
    puts their pulleys in their places in the drive. To keep that belt while something else is
    changed: ``attrs.evolve(params, belt=params.effective_belt, pulleys=...)``.
    ``notebooks/8-choosing-parameters.ipynb`` goes from data sheets to these numbers, with ranges.

    Attributes:
        length: Stress-free length of the closed belt, L [m], > 0; None: found for the preload.
        preload: Mean tension of the belt at rest [N], > 0: that of the settled belt to 0.1 %,
            whatever the mesh, contact and friction; None: it follows from length or mounts.
        n_bodies: Number of rigid links, n_b, an integer >= 3. Links of stress-free length L / n_b
            are joined by the springs and dampers of (2.2). For an ALE belt, about the number of
            cells; None (ALE belts only): chosen, cells of some 12 mm on the pulleys, of half of
            that where a friction law has no state. ``params.n_bodies`` is the actual number.
        linear_density: Mass per length, rho A [kg/m], > 0.
        axial_stiffness: EA [N], > 0.
        axial_damping: eta A [N s], >= 0.
        bending_stiffness: EI [N m^2], >= 0.
        bending_damping: eta I [N m^2 s], >= 0; the paper has none.
        mesh: How the belt meets the pulleys, MODEL section 3: "joint", along the links, with
            friction at their joints and their mass at their ends: mean tensions are accurate to
            some 1 % with 60 links (``print(params)`` estimates it), creep less so; "paper", at the
            links' centres, the paper's own, which needs eight to sixteen times as many links; or
            "ale" (arbitrary Lagrangian-Eulerian): the belt flows through cells that stand where the
            pulleys are. No links land, so step sizes do not depend on the speed: use it for fast
            belts, long runs, spectra and creep. A span is one cell, which vibrates in its lowest
            sine modes (``result.spans.deflection``), and along itself in one where its mass counts
            against the inertia of its pulleys; an arc has some ten cells. Quantities that follow a
            point of the belt, such as ``contact.slip``, are not available; ``belt.passed`` is how
            far the belt has run. Not for slack spans, for wraps and spans hardly longer than
            sqrt(EI/T), over which bending decays, nor for belts as fast as their waves: these are
            refused, or end the run with a message; use "joint" there.
        model: What the belt is made of, MODEL section 2: "links", rigid ones; "string", point
            masses joined by bars that stretch, which resist no bending (EI = 0, mesh "joint"): two
            degrees of freedom each for three, and a step that costs about half; or "auto", the
            string wherever there is no bending, else links. ``params.belt_model`` says which it is.
            For a string ``n_bodies`` counts masses; data of link i are those of mass i, data of
            joint i those of the bar before it.

    Raises:
        TypeError, ValueError: A field breaks its rule, or both length and preload are given.
    """

    length: float | None = None
    preload: float | None = None
    n_bodies: int | None = None
    linear_density: float
    axial_stiffness: float
    axial_damping: float = 0.0
    bending_stiffness: float = 0.0
    bending_damping: float = 0.0
    mesh: str = attrs.field(default="joint", validator=with_choice("belt.mesh", MESHES))
    model: str = attrs.field(default="auto", validator=with_choice("belt.model", BELT_MODELS))

    def __attrs_post_init__(self) -> None:
        if self.n_bodies is None and self.mesh not in CHOOSE:
            wording = rules_of("belt")["n_bodies"].wording
            raise TypeError(
                f"belt.n_bodies must be {wording}, got None: it is the number of links, which must "
                "be given, mostly 60 to 240 (each a fifth of the smallest pulley's radius long, or "
                f'shorter); Belt(mesh="{CHOOSE[0]}") chooses its own cells'
            )
        if self.length is not None and self.preload is not None:
            raise ValueError(
                "belt.preload must not be given together with belt.length, which decides the "
                f"tension: got {self.length:.10g} m and {self.preload:.10g} N"
            )

    def _rows(self) -> list[tuple[str, str, str]]:
        given = super()._rows()
        return [row for row in given if getattr(self, row[0]) is not None]


@attrs.frozen(kw_only=True, field_transformer=from_table("drag"))
class Drag(Printable):
    """Drag of a pulley's bearings, seals and fan: a torque against its rotation.

    At the speed omega it is ``coulomb s + viscous omega + quadratic omega |omega|`` (MODEL section
    5). s is the sign of omega, made smooth: omega / sqrt(omega^2 + omega_0^2), where omega_0 times
    the radius is ``params.info["drag_speed"]``, 0.1 mm/s in the paper's drive. So a pulley under
    a torque M below the Coulomb torque C is not locked but creeps, at omega_0 M / sqrt(C^2 - M^2),
    and no higher torque is needed to set it in motion. Drag does not act while a belt settles; it
    vanishes at rest.
    """

    coulomb: float = 0.0
    viscous: float = 0.0
    quadratic: float = 0.0


@attrs.frozen(kw_only=True, field_transformer=from_table("pulley", _CENTER))
class Pulley(Printable):
    """A pulley that turns about its axis (2.12), which is fixed or has a mount.

    Attributes:
        center: Position of the axis (x, y) [m].
        radius: Radius of the circle on which the mass centres of the links run, r_p [m], > 0.
        inertia: Moment of inertia about the axis [kg m^2], > 0; with an isolator or a clutch that
            of the rim alone.
        side: Side of the belt on which it lies: "inside" its loop, or "outside", on its back, as a
            back-side idler. Of two pulleys, one of them outside, the belt is crossed. The first
            pulley is inside.
        drag: Drag of its bearings, None for none.
        friction: Friction law between the belt and this pulley; None: that of the whole drive,
            ``Params.friction``, and none where that is None.
        name: What messages and figures call it, and how it can be named wherever a pulley is named
            by its index; None: "pulley 3" and the like. 1 to 31 bytes of UTF-8, printable, no
            number, without spaces at its ends, unique in the drive.
        mount: Mount that lets the axis move: :class:`Arm`, :class:`Slider` or :class:`Path`; None:
            it is fixed. Needs ``Belt(mesh="joint")`` or ``"ale"``.
        coupling: Coupling of its rim to its shaft, on which torques, drag and prescribed motions
            act: :class:`Isolator` or :class:`OverrunningClutch`; or a free ring on it,
            :class:`TorsionalDamper`; None: it is one rigid body.
    """

    center: tuple[float, float]
    radius: float
    inertia: float
    side: str = attrs.field(default="inside", validator=with_choice("pulley.side", SIDES))
    drag: Drag | None = attrs.field(
        default=None, validator=attrs.validators.optional(instance_of("pulley.drag", Drag))
    )
    friction: Friction | None = attrs.field(default=None, validator=law_or_none("pulley.friction"))
    name: str | None = attrs.field(default=None, converter=as_name)
    mount: Mount | None = attrs.field(
        default=None, validator=instance_of("pulley.mount", Mount | None)
    )
    coupling: Coupling | None = attrs.field(
        default=None, validator=instance_of("pulley.coupling", Coupling | None)
    )

    @property
    def has_rim(self) -> bool:
        """Whether the belt runs on a rim that a coupling joins to the shaft."""
        return self.coupling is not None and not isinstance(self.coupling, TorsionalDamper)

    @property
    def shaft_inertia(self) -> float:
        """Inertia of the shaft, on which torques act [kg m^2]: with a rim that of its hub."""
        if self.coupling is not None and self.has_rim:
            return self.coupling.inertia
        return self.inertia

    @property
    def coupled_inertia(self) -> float:
        """Inertia beyond a coupling [kg m^2]: of the rim, or of a damper's ring; 0: none."""
        if self.coupling is None:
            return 0.0
        return self.inertia if self.has_rim else self.coupling.inertia


def as_pulleys(value: Iterable[Pulley]) -> tuple[Pulley, ...]:
    """Check the pulleys of a drive."""
    try:
        pulleys = tuple(value)
    except TypeError:
        raise TypeError(
            f"pulleys must be a sequence of Pulley, got {type(value).__name__}"
        ) from None
    if not pulleys:
        raise ValueError("pulleys must hold at least one Pulley")
    for k, pulley in enumerate(pulleys):
        if not isinstance(pulley, Pulley):
            raise TypeError(f"pulleys[{k}] must be a Pulley, got {type(pulley).__name__}")
    names_of(pulley.name for pulley in pulleys)
    return pulleys


@attrs.frozen(kw_only=True, field_transformer=from_table("contact"))
class Contact(Printable):
    """Normal force between belt and pulley (2.8), per metre of belt.

    A link of length l0 that penetrates by p is pushed out by
    ``max(0, (e (1 + hunt_crossley dp/dt) + damping dp/dt) l0)`` with
    ``e = quadratic p^2 + linear p``. ``damping`` is the paper's and acts at once where contact
    begins. That of K. H. Hunt and F. R. E. Crossley ("Coefficient of restitution interpreted as
    damping in vibroimpact", J. Appl. Mech. 42, 1975, 440-445), ``hunt_crossley``, grows
    with the force, so that there is no jump; a link that meets a pulley at the speed v rebounds
    with 1 - 2/3 hunt_crossley v of it, if little is lost. On an ALE belt they act at the ends of
    wraps, where the belt sinks in as it runs on and as waves roll it on and off, and along arcs.

    Without a stiffness, ``Contact()``, one is chosen with which the contact yields by a hundredth
    of the stretch of the belt: ``linear`` 100 EA / R^2 of the smallest pulley, so that tension and
    creep are those of rigid pulleys to 1 %, ``damping`` half of critical, compensated;
    ``params.effective_contact`` has the numbers. Choose your own where they are data of the belt.
    ``notebooks/8-choosing-parameters.ipynb`` derives them from hardness and thickness of the
    rubber.

    Attributes:
        quadratic: c1' [N/m^3], >= 0.
        linear: c2' [N/m^2], >= 0; None: 0 if ``quadratic`` is given, else chosen.
        damping: b' [N s/m^2], >= 0; None: 0 if a stiffness or ``hunt_crossley`` is given, else
            chosen.
        compensate: Whether the contact begins outside of the pulleys' radii by as much as the belt
            sinks in at the preload, MODEL section 3, so that it then runs on these radii and has
            the tension of its strain round them; None: where the stiffness is chosen. Without it
            the belt runs on a circle that is smaller by the depth.
        hunt_crossley: d [s/m], >= 0: damping in proportion to the elastic force; 0: none.
    """

    quadratic: float = 0.0
    linear: float | None = None
    damping: float | None = None
    compensate: bool | None = None
    hunt_crossley: float = 0.0

    def __attrs_post_init__(self) -> None:
        given = self.linear is not None or self.quadratic > 0.0
        defaults = {"linear": 0.0, "damping": 0.0, "compensate": False}
        chosen: dict[str, Any] = {"compensate": True}
        if self.hunt_crossley > 0.0:
            chosen["damping"] = 0.0
        for name, value in (defaults if given else chosen).items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
