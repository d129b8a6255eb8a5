"""Parameters of a belt drive: everything but its loads."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator
from itertools import chain, repeat
from typing import Any

import attrs
import numpy as np

from ..base import tables
from ..base.run_warnings import RunWarning
from . import cells, sanity, toml
from . import compliance as sinking
from .drive import GRAVITY, Drive
from .mounts import Path
from .parts import SIDES, Contact
from .rules import Printable
from .tensioning import Tensioning


@attrs.frozen(kw_only=True)
class Params(Drive):
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
    def compliance(self) -> sinking.Compliance:
        """How far the belt sinks into its pulleys at rest, and what that changes.

        Under load :func:`beltdyn.drive.compliance.compliance` computes it from the tensions of the
        spans.
        """
        return sinking.compliance(self)

    def __str__(self) -> str:
        head, *remarks = self._remarks()
        return "\n".join(
            [head, *tables.columns(self._rows(), "<"), *(f"  {one}" for one in remarks)]
        )

    def _repr_html_(self) -> str:
        head, *remarks = self._remarks()
        return tables.html(
            [head, tables.Table("", ("", "value", "meaning"), self._rows(), remarks)]
        )

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
        rows.append(("gravity", GRAVITY.quantity(self.gravity), GRAVITY.text))
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
