"""A drive as its model needs it, and what follows from that: tension at rest, route, parts."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base import naming
from ..base.checks import Array
from . import balance, preload
from .friction import Friction, Frictionless, law_or_none
from .mounts import Sprung
from .parts import BELTS, Belt, Contact, Pulley, as_pulleys
from .route import Route, route, route_at
from .rules import Rule, instance_of, numbers_of
from .tensioning import Tensioning

#: Of a chosen contact, EA / (c2' R^2) on the smallest pulley: what the contact adds to creep. The
#: stiffness of a belt is known to 2 % at best.
YIELD = 0.01
#: Its damping as a share of critical, for the mass on its spring, link by link or metre by metre
#: alike: what rings after a link has landed is down to 1/38 within one period, and the contact
#: still follows a link that leaves, which from critical damping on it no longer does.
DAMPING = 0.5
#: Length of a cell on a pulley, and cells on half a turn of the largest one, from which on they are
#: longer: a sixth of the half wave of a torsional vibration of 500 Hz, and creep right to 0.02 %.
CELL, HALF_TURN = 0.0125, 30
#: Radius [m] of which smaller pulleys have the cells: 10 on half a turn, tensions beside one that
#: takes up all of them right to 0.2 %.
SMALL = 0.04
#: So many times as many where a law has no state: friction follows slip at once, and sets in within
#: a cell. Of seven random drives (benchmarks/ale.py) errors of histories fall to a fifth to a half.
ABRUPT = 2.0

GRAVITY = Rule("", "gravity", "PAIR", "m/s^2", "acceleration (x, y)")


def _gravity(value: Sequence[float]) -> tuple[float, float]:
    x, y = GRAVITY.check(value)
    return x, y


# Not slotted: what is computed once stands in the instance, so that an error there is the only one.
@attrs.frozen(kw_only=True, slots=False)
class Drive:
    """What all modules that ask something of a drive know of :class:`beltdyn.Params`."""

    belt: Belt = attrs.field(validator=instance_of("belt", Belt))
    pulleys: tuple[Pulley, ...] = attrs.field(converter=as_pulleys)
    contact: Contact = attrs.field(factory=Contact, validator=instance_of("contact", Contact))
    friction: Friction | None = attrs.field(default=None, validator=law_or_none("friction"))
    gravity: tuple[float, float] = attrs.field(default=(0.0, 0.0), converter=_gravity)
    tensioning: Tensioning = attrs.field(
        factory=Tensioning, validator=instance_of("tensioning", Tensioning)
    )
    _scene: preload.Scene = attrs.field(init=False, repr=False, eq=False)

    def __attrs_post_init__(self) -> None:
        def parts(pulleys: tuple[Pulley, ...], name: str) -> tuple[Any, ...]:
            found = [getattr(pulley, name) for pulley in pulleys]
            return tuple(None if part is None else part._to_core() for part in found)

        _, *belt = numbers_of("belt", self.belt)
        belt[0] = belt[0] or self._usual_cells(route(self.pulleys))
        scene = (
            tuple(belt),
            tuple(pulley.center for pulley in self.pulleys),
            tuple(pulley.radius for pulley in self.pulleys),
            tuple(pulley.inertia for pulley in self.pulleys),
            numbers_of("contact", self.effective_contact),
            None if self.friction is None else self.friction._to_core(),
            self.gravity,
            tuple(part and part[1] for part in parts(self.pulleys, "drag")),
            parts(self.pulleys, "friction"),
            self.belt.mesh,
            tuple(pulley.side == "outside" for pulley in self.pulleys),
            tuple(pulley.name for pulley in self.pulleys),
            parts(self.effective_pulleys, "mount") if self.mounted else None,
            self.belt.model,
            parts(self.pulleys, "coupling") if self.coupled else None,
        )
        object.__setattr__(self, "_scene", scene)
        # Whatever is wrong is said now; a length that takes settling is found when it is needed.
        route(self.pulleys)
        self._laid.check_geometry()
        object.__setattr__(self, "tensioning", self.tensioning.fitted(self.pulley_names))
        for k, offset in enumerate(self.tensioning.offset):
            if k in self.mounted and offset != (0.0, 0.0):
                raise ValueError(
                    f"tensioning.offset of {self.label(k)} must be (0, 0): its mount moves it"
                )

    @property
    def _laid(self) -> _core.Model:
        """The core's model, with the length that needs no settling."""
        return preload.model_of(self._scene, self._first_length)

    @property
    def _tensioned(self) -> Tensioning:
        """How the belt is tensioned: as asked, or freely where its model allows nothing else."""
        return Tensioning() if self._flows else self.tensioning

    @property
    def _first_length(self) -> float:
        """The length given, or for a preload the one that the closed form finds [m]."""
        if self.belt.length is not None:
            return self.belt.length
        try:
            return preload.first_length(*self._in_place, self._preload)
        except ValueError as error:
            if self.belt.preload is not None or not str(error).startswith("belt.preload"):
                raise
            raise ValueError(
                f"the mounts hold {self._preload:.4g} N in their places: {error}"
            ) from None

    @functools.cached_property
    def _preload(self) -> float:
        """The preload given, or the tension that the mounts hold in their places [N]."""
        held = balance.tension_held(
            self.effective_pulleys, self.gravity, self.belt.bending_stiffness
        )
        if held is None:
            if self.belt.preload is None:
                raise ValueError(
                    "belt.length or belt.preload must be given: nothing else decides the tension"
                )
            return self.belt.preload
        if self.belt.preload is not None:
            raise ValueError(
                f"belt.preload must be left out: the springs and weights of the mounts decide the "
                f"tension, {held:.5g} N in their places; change them, or give belt.length"
            )
        return held

    @property
    def _in_place(self) -> tuple[preload.Scene, float]:
        """The drive with its pulleys fixed in their places, and the belt line round them [m]."""
        return preload.in_place(self._scene), route(self.pulleys).length

    @functools.cached_property
    def _model(self) -> _core.Model:
        """The core's model of the drive; with a preload, that with the length found for it."""
        length = self.belt.length
        if length is None and self.belt.preload is None:
            line = self._in_place[1]
            length = preload.find_length_in_place(self._scene, line, self._preload, self.tensioning)
        elif length is None:
            length = preload.find_length(*self._in_place, self._preload, self.tensioning)
        return preload.model_of(self._scene, length)

    @functools.cached_property
    def _rest_tension(self) -> float:
        """Mean tension of the settled belt, or of the closed form where it does not settle [N]."""
        length = float(self._model.info["length"])
        try:
            return preload.rest_tension(self._scene, length, self.tensioning)
        except (RuntimeError, ValueError):  # or the scales of the drive are too far apart for it
            return float(self._model.info["mean_tension"])

    @property
    def info(self) -> Mapping[str, float | int]:
        """Quantities derived from the parameters (MODEL section 6), SI units.

        Among others ``length`` of the belt [m], as given or as found for its preload,
        ``link_length`` [m], ``path_length`` of the belt line [m], ``strain`` of the belt on it and
        ``strain_tension`` [N], EA times that, the scale of forces; ``mesh_strain`` and
        ``contact_strain``, which the mesh adds and the contact takes off; ``spectral_bound``, the
        highest frequency of joints that touch nothing [1/s] (stiff contact raises it on pulleys as
        small as links: step limits count that); and ``mean_tension`` [N], that of the settled belt.
        The belt is settled for it when it is first asked for, as ``tensioning`` says; if it does
        not come to rest, the closed form stands there.
        """
        return preload.Info(self._model.info, lambda: self._rest_tension)

    @functools.cached_property
    def _radii(self) -> Array:
        """Radii of the pulleys (n_p,) [m]."""
        radii = np.array([pulley.radius for pulley in self.pulleys])
        radii.setflags(write=False)
        return radii

    @functools.cached_property
    def _rolling(self) -> Array:
        """Way of the belt by a turn of 1 rad of each pulley (n_p,) [m]: its radius, signed."""
        return self.route.senses * self._radii

    @property
    def _wave_speed(self) -> float:
        """Speed of waves across the belt at rest, by its stress-free length a second [m/s]."""
        return math.sqrt(float(self.info["mean_tension"]) / self.belt.linear_density)

    @property
    def n_bodies(self) -> int:
        """Number of links, masses or cells of the belt; cells are chosen if not given."""
        return int(self._model.info["n_bodies"])

    def _usual_cells(self, line: Route) -> int:
        """Return the number of cells to ask for where it is not given."""
        length = max(CELL, math.pi * float(self._radii.max()) / HALF_TURN)
        arcs = float(line.wraps @ np.maximum(self._radii, SMALL))
        laws = map(self.friction_on, range(len(self.pulleys)))
        finer = ABRUPT if any(law is not None and law.n_states == 0 for law in laws) else 1.0
        return 2 * len(self.pulleys) + math.ceil(finer * arcs / length)

    @functools.cached_property
    def _cells(self) -> NDArray[np.int32]:
        """The pulley of each cell of an ALE belt (n_b,), -1 in spans."""
        cells = self._model.cells
        assert cells is not None
        return cells

    @property
    def belt_model(self) -> str:
        """What the belt is made of: "links" or, without bending, "string" (``belt.model``).

        "cells" for an ALE belt, which flows through them.
        """
        return "cells" if self._flows else self._belt_facts["model"]

    @property
    def _belt_facts(self) -> _core.BeltFacts:
        """Facts of its belt model."""
        return BELTS[self._model.belt]

    @property
    def _flows(self) -> bool:
        """Whether the belt flows through cells that stand still."""
        return bool(self._belt_facts["flows"])

    @property
    def effective_belt(self) -> Belt:
        """The belt with its length: the one given, or the one found for its preload.

        Found anew for every mesh, because the mesh affects the tension. The belt is settled for it
        two or three times, when it is first needed.
        """
        if self.belt.length is not None:
            return self.belt
        return attrs.evolve(self.belt, length=self.info["length"], preload=None)

    @functools.cached_property
    def effective_contact(self) -> Contact:
        """The contact with all its numbers, given or chosen."""
        belt, contact = self.belt, self.contact
        if contact.linear is not None and contact.damping is not None:
            return contact
        gives = YIELD * min(pulley.radius for pulley in self.pulleys) ** 2
        linear = belt.axial_stiffness / gives if gives > 0.0 else math.inf  # which is refused
        critical = 2.0 * math.sqrt(linear * belt.linear_density)
        damping = DAMPING * critical if contact.damping is None else contact.damping
        return attrs.evolve(contact, linear=linear, damping=damping)

    @functools.cached_property
    def effective_pulleys(self) -> tuple[Pulley, ...]:
        """The pulleys with the preload of each arm and slider: given, or found for its tension."""
        return balance.preloaded(self.pulleys, self.gravity, self.belt.bending_stiffness)

    @functools.cached_property
    def pulley_names(self) -> tuple[str, ...]:
        """The name of each pulley, "pulley 3" if it has none."""
        return naming.names_of(pulley.name for pulley in self.pulleys)

    def pulley_index(self, pulley: int | str) -> int:
        """Find a pulley by its name or its index.

        Raises:
            TypeError: Neither a name nor an index.
            ValueError: There is no such pulley; of a name, the message lists those there are.
        """
        return naming.index_of("pulley", pulley, self.pulley_names)

    def label(self, pulley: int) -> str:
        """Return a pulley's name in texts: ``pulley "crank"``, or ``pulley 3`` without a name."""
        return naming.label(pulley, self.pulley_names)

    @functools.cached_property
    def route(self) -> Route:
        """The way of the belt round the pulleys: tangent points, wraps, spans, length.

        Pulleys on mounts are where these rest, in equilibrium with the belt.
        """
        return route_at(self.pulleys, self.centers()) if self.mounted else route(self.pulleys)

    def centers(self, travel: ArrayLike | None = None) -> Array:
        """Return the positions of the axes of the pulleys.

        Args:
            travel: Travels of the mounts (n_m,), such as ``state.travel`` or a row of
                ``result.mounts.travel``; None: where they rest, in equilibrium with the belt.

        Returns:
            Axes (n_p, 2) [m].

        Raises:
            TypeError, ValueError: Not one finite travel for each mount.
        """
        return self._model.centers(self._model.rest if travel is None else travel)

    @property
    def mounted(self) -> tuple[int, ...]:
        """Indices of the pulleys with a mount, in the order of ``State.travel``."""
        return tuple(k for k, pulley in enumerate(self.pulleys) if pulley.mount is not None)

    @property
    def _moving(self) -> tuple[tuple[int, int, Sprung], ...]:
        """Mounts that move under forces: index, index of the pulley, mount."""
        pulleys = self.effective_pulleys
        mounts = [(m, k, pulleys[k].mount) for m, k in enumerate(self.mounted)]
        return tuple((m, k, mount) for m, k, mount in mounts if isinstance(mount, Sprung))

    @property
    def coupled(self) -> tuple[int, ...]:
        """Indices of the pulleys with a coupling, in the order of ``State.rim_speed``."""
        return tuple(k for k, pulley in enumerate(self.pulleys) if pulley.coupling is not None)

    @functools.cached_property
    def _having(self) -> dict[str, tuple[int, ...]]:
        """Indices of the pulleys counted by each size of the core's tables, by size."""
        every = tuple(range(len(self.pulleys)))
        return {"PULLEYS": every, "PLANE": every, "MOUNTS": self.mounted, "COUPLINGS": self.coupled}

    @property
    def shaft_inertias(self) -> Array:
        """Inertias of the shafts (n_p,) [kg m^2], whose speeds are ``result.pulleys.omega``."""
        return np.array([pulley.shaft_inertia for pulley in self.pulleys])

    @property
    def coupled_inertias(self) -> Array:
        """Inertias beyond the couplings (n_c,) [kg m^2]: of rims, and of the rings of dampers."""
        return np.array([self.pulleys[k].coupled_inertia for k in self.coupled])

    @property
    def has_friction(self) -> bool:
        """Whether there is friction on any pulley."""
        return any(self.friction_on(k) is not None for k in range(len(self.pulleys)))

    def friction_on(self, pulley: int) -> Friction | None:
        """Return the friction law of a pulley: its own, or that of the drive."""
        own = self.pulleys[pulley].friction
        law = self.friction if own is None else own
        return None if isinstance(law, Frictionless) else law

    @property
    def _slip_limits(self) -> tuple[Array, Array]:
        """Friction coefficients in full slip [1], slip in which friction develops [m], (n_p,)."""
        rows = self._model.friction
        return np.array([row[1] for row in rows]), np.array([row[2] for row in rows])
