"""Parameters of a belt drive: objects that check their values and print themselves.

The rule, unit and meaning of every number are in one table, ``csrc/fields.h``, which the C core
and these classes share. Data of the belt are per unit length, so ``n_bodies`` refines the mesh of
the same belt.

Source of the model: K. Kubas, "A model for the dynamic analysis of a belt transmission using the
Dahl friction model", equations (2.1)-(2.13).
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import attrs

from . import _core, checks, sanity
from .tensioning import Tensioning

__all__ = ["Belt", "Contact", "Dahl", "Params", "Pulley"]


class Rule(NamedTuple):
    """The rule of a field: a row of ``_core.PARAMETERS``, or a PAIR of finite numbers."""

    group: str
    name: str
    rule: str
    unit: str
    text: str

    def check(self, value: object) -> Any:
        """Check a value; give it as plain numbers.

        Raises:
            TypeError: Wrong kind.
            ValueError: Rule broken.
        """
        label = f"{self.group}.{self.name}".lstrip(".")
        if self.rule == "LINKS":
            return checks.integer(label, value, 3, _core.MAX_LINKS)
        if self.rule == "PAIR":
            return checks.pair(label, value, self.unit)
        number = checks.real(label, value, self.unit)
        bound = {"POSITIVE": "> 0", "NONNEGATIVE": ">= 0"}.get(self.rule)
        if bound and (number < 0.0 or (number == 0.0 and bound == "> 0")):
            raise ValueError(f"{label} must be {bound} ({self.text}), got {self.quantity(number)}")
        return number

    def quantity(self, value: Any) -> str:
        """Write a value with its unit."""
        number = f"({value[0]:.10g}, {value[1]:.10g})" if self.rule == "PAIR" else f"{value:.10g}"
        return number if self.unit == "1" else f"{number} {self.unit}"


_CENTER = Rule("pulley", "center", "PAIR", "m", "position (x, y) of the axis")
_GRAVITY = Rule("", "gravity", "PAIR", "m/s^2", "acceleration (x, y)")


def _rules(group: str) -> dict[str, Rule]:
    return {row[1]: Rule(*row) for row in _core.PARAMETERS if row[0] == group}


def _from_table(
    group: str, *others: Rule
) -> Callable[[type, list[attrs.Attribute[Any]]], list[attrs.Attribute[Any]]]:
    """Give every field of a class its rule; a field without one is an error."""
    rules = _rules(group) | {rule.name: rule for rule in others}

    def transform(_cls: type, fields: list[attrs.Attribute[Any]]) -> list[attrs.Attribute[Any]]:
        return [
            field.evolve(converter=rule.check, metadata={"rule": rule})
            for field in fields
            for rule in [rules[field.name]]
        ]

    return transform


class _Printable:
    __slots__ = ()

    def _rows(self) -> list[tuple[str, str, str]]:
        """Name, quantity and meaning of each field."""
        rules: list[Rule] = [
            field.metadata["rule"]
            for field in attrs.fields(type(self))  # type: ignore[arg-type]
        ]
        return [(rule.name, rule.quantity(getattr(self, rule.name)), rule.text) for rule in rules]

    def __str__(self) -> str:
        return "\n".join([type(self).__name__, *_lines(self._rows(), indent="  ")])


def _lines(rows: Sequence[tuple[str, str, str]], indent: str = "") -> list[str]:
    name_width = max((len(name) for name, _, _ in rows), default=0)
    value_width = max((len(value) for _, value, _ in rows), default=0)
    return [
        f"{indent}{name:<{name_width}}  {value:<{value_width}}  {text}".rstrip()
        for name, value, text in rows
    ]


@attrs.frozen(kw_only=True, field_transformer=_from_table("belt"))
class Belt(_Printable):
    """A closed belt, per metre of its stress-free length.

    Attributes:
        length: Stress-free length of the closed belt, L [m], > 0.
        n_bodies: Number of rigid links, n_b, an integer >= 3. Links of stress-free length
            L / n_b are joined by the springs and dampers of (2.2).
        linear_density: Mass per length, rho A [kg/m], > 0.
        axial_stiffness: EA [N], > 0.
        axial_damping: eta A [N s], >= 0.
        bending_stiffness: EI [N m^2], >= 0.
        bending_damping: eta I [N m^2 s], >= 0; the paper has none.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    length: float
    n_bodies: int
    linear_density: float
    axial_stiffness: float
    axial_damping: float = 0.0
    bending_stiffness: float = 0.0
    bending_damping: float = 0.0


@attrs.frozen(kw_only=True, field_transformer=_from_table("pulley", _CENTER))
class Pulley(_Printable):
    """A pulley that turns about a fixed axis (2.12).

    Attributes:
        center: Position of the axis (x, y) [m].
        radius: Radius of the circle on which the mass centres of the links run, r_p [m], > 0.
        inertia: Moment of inertia about the axis [kg m^2], > 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    center: tuple[float, float]
    radius: float
    inertia: float


@attrs.frozen(kw_only=True, field_transformer=_from_table("contact"))
class Contact(_Printable):
    """Normal force between belt and pulley (2.8), per metre of belt.

    A link of length l0 that penetrates by p is pushed out by
    ``max(0, (quadratic p^2 + linear p + damping dp/dt) l0)``.

    Attributes:
        quadratic: c1' [N/m^3], >= 0.
        linear: c2' [N/m^2], >= 0.
        damping: b' [N s/m^2], >= 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    quadratic: float = 0.0
    linear: float
    damping: float = 0.0


@attrs.frozen(kw_only=True, field_transformer=_from_table("dahl"))
class Dahl(_Printable):
    """Dahl friction between belt and pulley (2.9), (2.10).

    Attributes:
        mu_k: Kinetic friction coefficient [1], > 0.
        sigma: Stiffness of the friction joint at rest [1/m], > 0.

    Raises:
        TypeError, ValueError: A field breaks its rule.
    """

    mu_k: float
    sigma: float


def _instance(name: str, kind: type) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    def check(_self: Any, _field: attrs.Attribute[Any], value: Any) -> None:
        if not isinstance(value, kind):
            raise TypeError(f"{name} must be a {kind.__name__}, got {type(value).__name__}")

    return check


def _pulleys(value: Sequence[Pulley]) -> tuple[Pulley, ...]:
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
    return pulleys


def _gravity(value: Sequence[float]) -> tuple[float, float]:
    x, y = _GRAVITY.check(value)
    return x, y


@attrs.frozen(kw_only=True)
class Params:
    """A belt drive: everything but its loads.

    The belt visits the pulleys in the order of the list, all inside its loop, and its links are
    numbered along it; with two pulleys they run clockwise, the upper span first. Change a field
    with ``attrs.evolve(params, gravity=(0, -9.81))``. ``print(params)`` shows the strain and
    tension at rest, how much of it is an error of the mesh, and the warnings of the drive.

    Attributes:
        belt: The belt.
        pulleys: The pulleys, any sequence; kept as a tuple.
        contact: Normal contact between belt and pulleys.
        friction: Friction law between belt and pulleys, or None for none.
        gravity: Acceleration (x, y) [m/s^2].
        tensioning: How the belt is brought under preload before a run.

    Raises:
        TypeError: A field is of the wrong kind.
        ValueError: The belt cannot run on the pulleys: they overlap, one is not reached, the belt
            is slack or stretched too far.
    """

    belt: Belt = attrs.field(validator=_instance("belt", Belt))
    pulleys: tuple[Pulley, ...] = attrs.field(converter=_pulleys)
    contact: Contact = attrs.field(validator=_instance("contact", Contact))
    friction: Dahl | None = attrs.field(
        default=None, validator=attrs.validators.optional(_instance("friction", Dahl))
    )
    gravity: tuple[float, float] = attrs.field(default=(0.0, 0.0), converter=_gravity)
    tensioning: Tensioning = attrs.field(
        factory=Tensioning, validator=_instance("tensioning", Tensioning)
    )
    _model: _core.Model = attrs.field(init=False, repr=False, eq=False)

    def __attrs_post_init__(self) -> None:
        def numbers(group: str, source: object) -> Any:
            return tuple(getattr(source, name) for name in _rules(group))

        model = _core.Model(
            numbers("belt", self.belt),
            [pulley.center for pulley in self.pulleys],
            [pulley.radius for pulley in self.pulleys],
            [pulley.inertia for pulley in self.pulleys],
            numbers("contact", self.contact),
            None if self.friction is None else numbers("dahl", self.friction),
            self.gravity,
        )
        model.check_geometry()
        self.tensioning.check_fits(len(self.pulleys))
        object.__setattr__(self, "_model", model)

    def __reduce__(self) -> tuple[Any, ...]:
        # The C model is derived from the rest: rebuilt, not pickled.
        fields = {name: getattr(self, name) for name in _FIELDS}
        return functools.partial(type(self), **fields), ()

    @property
    def info(self) -> Mapping[str, float | int]:
        """Quantities derived from the parameters (MODEL section 6), SI units.

        Among others ``link_length`` [m], ``path_length`` of the belt line [m], ``strain`` of the
        belt on it, ``mean_tension`` [N], ``mesh_strain`` and ``contact_strain``, which the mesh
        adds and the contact takes off, and ``spectral_bound``, the highest joint frequency [1/s].
        """
        return MappingProxyType(self._model.info)

    def __str__(self) -> str:
        parts: list[tuple[str, _Printable]] = [
            ("belt", self.belt),
            *((f"pulleys[{k}]", pulley) for k, pulley in enumerate(self.pulleys)),
            ("contact", self.contact),
        ]
        if self.friction is not None:
            parts.append(("friction", self.friction))
        rows = [
            (f"{prefix}.{name}", quantity, text)
            for prefix, part in parts
            for name, quantity, text in part._rows()
        ]
        if self.friction is None:
            rows.append(("friction", "none", ""))
        rows.append(("gravity", _GRAVITY.quantity(self.gravity), _GRAVITY.text))
        info = self.info
        return "\n".join(
            [
                f"Belt drive, {self.belt.n_bodies} links on {len(self.pulleys)} pulley(s)",
                *_lines(rows, indent="  "),
                f"  tensioned {self.tensioning}",
                f"  belt line of {info['path_length']:.6g} m: strain {100 * info['strain']:.3g} %, "
                f"tension {info['mean_tension']:.4g} N; straight links add up to "
                f"{100 * info['mesh_strain']:.2g} %, "
                f"{info['mesh_strain'] * self.belt.axial_stiffness:.3g} N; sinking into the "
                f"pulleys takes off {100 * info['contact_strain']:.2g} %, "
                f"{info['contact_strain'] * self.belt.axial_stiffness:.3g} N",
                *(f"  note  {warning}" for warning in sanity.check(self)),
            ]
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
        from . import toml

        return toml.read_params(source)

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """Give the parameters as TOML text, also written to ``path``; exact both ways.

        Raises:
            OSError: The file cannot be written; a file that was there before is unchanged.
        """
        from . import toml

        return toml.write(toml.params_document(self), path)


_FIELDS = tuple(field.name for field in attrs.fields(Params) if field.init)
