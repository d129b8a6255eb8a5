"""Parameters of a belt drive: everything but its loads."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, repeat
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..base import naming, tables
from ..base.checks import Array
from ..base.run_warnings import RunWarning
from . import balance, cells, preload, sanity, toml
from . import compliance as sinking
from .friction import Friction, Frictionless, law_or_none
from .mounts import Path, Sprung
from .parts import BELTS, SIDES, Belt, Contact, Pulley, as_pulleys
from .route import Route, route, route_at
from .rules import Printable, Rule, instance_of, numbers_of
from .tensioning import Tensioning

__all__ = ["FIELDS", "Params"]

_GRAVITY = Rule("", "gravity", "PAIR", "m/s^2", "acceleration (x, y)")


def _gravity(value: Sequence[float]) -> tuple[float, float]:
    x, y = _GRAVITY.check(value)
    return x, y


@attrs.frozen(kw_only=True)
class Params:
    """A belt drive: everything but its loads.

    The belt visits the pulleys in the order of the list, those inside its loop and those on its
    back (``side="outside"``), and its links are numbered along it; with two pulleys they run
    clockwise, the upper span first. ``bd.route(pulleys)`` shows the way without a belt. Change a
    field with ``attrs.evolve(params, gravity=(0, -9.81))``. ``print(params)`` shows the strain and
    tension at rest, the errors to expect of the mesh, and of the contact that lets the belt sink
    into its pulleys, and the warnings of the drive.

    Attributes:
        belt: The belt.
        pulleys: The pulleys, any sequence; kept as a tuple.
        contact: Normal contact between belt and pulleys; by default stiff enough for its errors to
            stay within 1 %, see :class:`Contact`.
        friction: Friction law between belt and pulleys, such as :class:`Dahl`; None for none. A
            pulley may have its own. :mod:`beltdyn.friction` compares the laws.
        gravity: Acceleration (x, y) [m/s^2].
        tensioning: How the belt is brought under preload before a run.

    Raises:
        TypeError: A field is of the wrong kind.
        ValueError: The belt cannot run on the pulleys: they overlap, one is not reached, the belt
            is slack or stretched too far; neither its length nor its preload is given.
    """

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
        belt[0] = belt[0] or cells.chosen(self.pulleys, route(self.pulleys))
        scene = (
            tuple(belt),
            tuple(pulley.center for pulley in self.pulleys),
            tuple(pulley.radius for pulley in self.pulleys),
            tuple(pulley.inertia for pulley in self.pulleys),
            numbers_of("contact", self.effective_contact),
            None if self.friction is None else self.friction._to_core(),
            self.gravity,
            parts(self.pulleys, "drag"),
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
        return Tensioning() if self._belt_facts["flows"] else self.tensioning

    @property
    def _first_length(self) -> float:
        """The length given, or for a preload the one that the closed form finds [m]."""
        if self.belt.length is not None:
            return self.belt.length
        try:
            return preload.first_length(*self._in_place, self._preload).length
        except ValueError as error:
            if self.belt.preload is not None:
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
            length = preload.find_length(*self._in_place, self._preload, self.tensioning).length
        return preload.model_of(self._scene, length)

    @functools.cached_property
    def _rest_tension(self) -> float:
        """Mean tension of the settled belt, or of the closed form where it does not settle [N]."""
        length = float(self._model.info["length"])
        try:
            return preload.rest_tension(self._scene, length, self.tensioning)
        except (RuntimeError, ValueError):  # or the scales of the drive are too far apart for it
            return float(self._model.info["mean_tension"])

    # What every run asks of its drive, computed once for all runs of the same one.

    @functools.cached_property
    def _noticed(self) -> tuple[RunWarning, ...]:
        """The warnings of the drive alone."""
        return sanity.check(self)

    @functools.cached_property
    def _compliance_error(self) -> dict[str, float]:
        """Errors of the compliance of the contact, at rest."""
        return sinking.compliance_error(self)

    def __reduce__(self) -> tuple[Any, ...]:
        # The C model is derived from the rest: rebuilt, not pickled.
        fields = {name: getattr(self, name) for name in FIELDS}
        return functools.partial(type(self), **fields), ()

    @property
    def info(self) -> Mapping[str, float | int]:
        """Quantities derived from the parameters (MODEL section 6), SI units.

        Among others ``length`` of the belt [m], as given or as found for its preload,
        ``link_length`` [m], ``path_length`` of the belt line [m], ``strain`` of the belt on it and
        ``strain_tension`` [N], EA times that, the scale of forces; ``mesh_strain`` and
        ``contact_strain``, which the mesh adds and the contact takes off; ``spectral_bound``, the
        highest joint frequency [1/s]; and ``mean_tension`` [N], that of the settled belt. The belt
        is settled for it when it is first asked for, as ``tensioning`` says; if it does not come to
        rest, the closed form stands there.
        """
        return preload.Info(self._model.info, lambda: self._rest_tension)

    @functools.cached_property
    def _radii(self) -> Array:
        """Radii of the pulleys (n_p,) [m]."""
        radii = np.array([pulley.radius for pulley in self.pulleys])
        radii.setflags(write=False)
        return radii

    @property
    def _wave_speed(self) -> float:
        """Speed of waves across the belt at rest, by its stress-free length a second [m/s]."""
        return math.sqrt(float(self.info["mean_tension"]) / self.belt.linear_density)

    @property
    def n_bodies(self) -> int:
        """Number of links, masses or cells of the belt; cells are chosen if not given."""
        return int(self._model.info["n_bodies"])

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
        return "cells" if self._belt_facts["flows"] else self._belt_facts["model"]

    @property
    def _belt_facts(self) -> _core.BeltFacts:
        """Facts of its belt model."""
        return BELTS[self._model.belt]

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
        return sinking.complete(self.contact, self.belt, self.pulleys)

    @functools.cached_property
    def effective_pulleys(self) -> tuple[Pulley, ...]:
        """The pulleys with the preload of each arm and slider: given, or found for its tension."""
        return balance.preloaded(self.pulleys, self.gravity, self.belt.bending_stiffness)

    @property
    def compliance(self) -> sinking.Compliance:
        """How far the belt sinks into its pulleys at rest, and what that changes.

        Under load :func:`beltdyn.drive.compliance.compliance` computes it from the tensions of the
        spans.
        """
        return sinking.compliance(self)

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

    def __str__(self) -> str:
        head, *remarks = self._remarks()
        return "\n".join(
            [head, *tables.columns(self._rows(), "<"), *(f"  {one}" for one in remarks)]
        )

    def _repr_html_(self) -> str:
        head, *remarks = tables.paragraphs(self._remarks())
        return "\n".join([head, tables.table_of(("", "value", "meaning"), self._rows()), *remarks])

    def _rows(self) -> list[tuple[str, str, str]]:
        """Name, quantity and meaning of every number of the drive."""
        parts: list[tuple[str, Printable]] = [
            *((f"pulleys[{k}]", pulley) for k, pulley in enumerate(self.pulleys)),
            ("contact", self.effective_contact),
        ]
        if self.friction is not None:
            parts.append(("friction", self.friction))
        rows, chosen = self._rows_of_belt(), self._chosen()
        rows += [
            (f"{prefix}.{name}", chosen.get(f"{prefix}.{name}", quantity), text)
            for prefix, part in parts
            for name, quantity, text in part._rows()
        ]
        if self.effective_contact != self.contact:
            rows.append(("contact", "chosen", "it gives by a hundredth of what the belt stretches"))
        if not self.has_friction:
            rows.append(("friction", "none", ""))
        rows.append(("gravity", _GRAVITY.quantity(self.gravity), _GRAVITY.text))
        return rows

    def _remarks(self) -> list[str]:
        """Describe the drive and what follows from its numbers, a line each."""
        info, asked = self.info, self.belt.preload
        found = f"preload {asked:g} N: length {info['length']:.6g} m" if asked else ""
        return [
            f"Belt drive, {sanity.bodies(self)} on {len(self.pulleys)} pulley(s)",
            *([found] if found else []),
            f"tensioned {self._tensioned.describe(self.pulley_names)}",
            *self._mounts_at_rest(),
            *self._paths_beyond(),
            f"belt line of {info['path_length']:.6g} m: strain {100 * info['strain']:.3g} %, "
            f"tension at rest {info['mean_tension']:.4g} N",
            f"error of the mesh: {sanity.describe_mesh(self)}",
            *cells.describe_cheaper(self),
            f"error of the contact: {sinking.describe(self)}",
            "error in time: as rtol asks of a run; simulate(..., verify=True) measures all "
            "three, of creep too",
            *(f"note  {warning}" for warning in sanity.check(self)),
        ]

    def _rows_of_belt(self) -> list[tuple[str, str, str]]:
        """Name, quantity and meaning of its fields, with what "auto" has chosen."""
        of_mesh = attrs.evolve(self.effective_belt, n_bodies=self.n_bodies)
        rows = {name: others for name, *others in of_mesh._rows()}
        if self.belt.model == "auto":
            rows["model"][0] = f"auto ({self.belt_model})"
        if (nodes := self._belt_facts["nodes"]) != "links":
            rows["n_bodies"][1] = f"number of {nodes}, n_b"
        if (asked := self.belt.n_bodies) != self.n_bodies:
            rows["n_bodies"][0] += ", chosen" if asked is None else f", {asked} asked for"
        return [(f"belt.{name}", quantity, text) for name, (quantity, text) in rows.items()]

    def _chosen(self) -> dict[str, str]:
        """Quantities of mounts and couplings that were left open, as they act, by name."""
        of_mounts = zip(repeat("mount"), self.mounted, self._model.mounts)
        of_couplings = zip(repeat("coupling"), self.coupled, self._model.couplings)
        found = {}
        for name, k, acting in chain(of_mounts, of_couplings):
            part = getattr(self.pulleys[k], name)
            for field in attrs.fields(type(part)):
                value = acting.get(field.name)
                if value and not getattr(part, field.name):
                    quantity = field.metadata["rule"].quantity(value)
                    found[f"pulleys[{k}].{name}.{field.name}"] = f"{quantity}, chosen"
        return found

    def _mounts_at_rest(self) -> list[str]:
        travel = self._model.rest
        rest = [
            f"{self.label(k)} {mount._row.travel_text(travel[m])}" for m, k, mount in self._moving
        ]
        return [f"mounts rest at {', '.join(rest)} from their places"] if rest else []

    def _paths_beyond(self) -> Iterator[str]:
        """Describe the overshoot of splines of paths where it is 1 % of the path or more."""
        travel = np.array(self._model.rest)
        for m, k in enumerate(self.mounted):
            if not isinstance(path := self.pulleys[k].mount, Path):
                continue
            n, places = path.t.size, []
            for t in np.interp(np.arange(8 * n - 7) / 8.0, np.arange(n), path.t):
                travel[m] = t
                places.append(self.centers(travel)[k])
            whole, way = np.ptp(places, axis=0), np.ptp(places[::8], axis=0)
            beyond = float(np.max(whole - way))
            if beyond > 0.01 * float(np.max(way)):
                yield (
                    f"path of {self.label(k)}: its spline ranges {1e3 * beyond:.2g} mm further "
                    "than its points: take more of them, to round off what is steep"
                )

    @classmethod
    def from_toml(cls, source: str | os.PathLike[str]) -> Params:
        """Read parameters from TOML.

        Args:
            source: A path; a str with a line break in it is the TOML text itself.

        Raises:
            OSError: The file cannot be read.
            ValueError: Bad TOML, an unknown or missing field, a broken rule; one line that names
                the path of the field, such as ``pulleys[1].radius``.
        """
        return toml.read(source, cls._from_document)

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the parameters as TOML text, also written to ``path``; exact both ways.

        Raises:
            OSError: The file cannot be written; a file that was there before is unchanged.
        """
        return toml.write(self._document(), path)

    @classmethod
    def _from_document(cls, document: dict[str, Any]) -> Params:
        if any(field in document for field in toml.SCENE_ONLY):
            raise ValueError("this is a scene, with torque and t_end: read it with Scene.from_toml")
        params: Params = toml.structure(document, cls)
        return params

    def _document(self) -> dict[str, Any]:
        """Return the tables of TOML; what is at its default may be left out."""
        given = toml.unstructure(self)
        for name, usual in (("tensioning", Tensioning()), ("contact", Contact())):
            if getattr(self, name) == usual:
                del given[name]
        for pulley in given["pulleys"]:
            if pulley["side"] == SIDES[0]:
                del pulley["side"]
        order = ("gravity", "belt", "pulleys", "contact", "tensioning", "friction")
        return {name: given[name] for name in order if name in given}


FIELDS = tuple(field.name for field in attrs.fields(Params) if field.init)
