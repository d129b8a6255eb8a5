"""Parameter objects: every rule of the table, geometry, printing, copying."""

from __future__ import annotations

import copy
import math
import pickle
import re
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from laws import EXAMPLES, STRIBECK, scaled, typical, with_laws

import beltdyn as bd
from beltdyn import _core
from beltdyn import parameters as names
from beltdyn.friction import LAWS

CLASSES: dict[str, Any] = {
    "belt": bd.Belt,
    "pulley": bd.Pulley,
    "drag": bd.Drag,
    "arm": bd.Arm,
    "slider": bd.Slider,
    "contact": bd.Contact,
    **LAWS,
}
GOOD: dict[str, dict[str, Any]] = {
    "belt": {
        "length": 1.2,
        "n_bodies": 60,
        "linear_density": 0.1,
        "axial_stiffness": 70e3,
        "axial_damping": 1.4,
        "bending_stiffness": 0.01,
        "bending_damping": 1e-6,
    },
    "pulley": {"center": (0.0, 0.0), "radius": 0.1, "inertia": 0.01},
    "drag": {"coulomb": 0.2, "viscous": 1e-3, "quadratic": 1e-5},
    "arm": {"pivot": (0.1, 0.0), "inertia": 2e-3},
    "slider": {"direction": (1.0, 0.0), "mass": 3.0},
    "contact": {"quadratic": 5e10, "linear": 2.5e7, "damping": 1e3, "compensate": True},
    **{name: attrs.asdict(law) for name, law in EXAMPLES.items()},
}
PAIRS = ("center", "pivot", "direction")
#: Of mounts the core has numbers that stand together in one field, `stops`.
STOPS = ("lowest", "highest")
ROWS = [(row[0], row[1], row[2]) for row in _core.PARAMETERS if row[1] not in STOPS]
NUMBERS = [(group, name) for group, name, rule in ROWS if rule not in ("LINKS", "FLAG")]
KINDS = {"LINKS": "an integer", "FLAG": "a bool"}


def build(group: str, **changes: Any) -> Any:
    return CLASSES[group](**(GOOD[group] | changes))


def as_value(group: str, name: str, value: Any) -> Any:
    """As the value of a parameter: of a list, in the place of its first."""
    good = GOOD[group].get(name)
    return (value, *good[1:]) if isinstance(good, tuple) and name not in PAIRS else value


@pytest.fixture
def params() -> bd.Params:
    return drives.plain()


def with_pulleys(params: bd.Params, *pulleys: tuple[float, float, float], **belt: Any) -> bd.Params:
    """Change the pulleys to these (x, y, radius)."""
    return attrs.evolve(
        params,
        pulleys=[bd.Pulley(center=(x, y), radius=r, inertia=0.01) for x, y, r in pulleys],
        belt=attrs.evolve(params.belt, **belt),
    )


def test_classes_have_exactly_the_rows_of_the_table_in_their_order() -> None:
    for group, kind in CLASSES.items():
        rows = [name for g, name, _ in ROWS if g == group]
        parts = {"center", "drag", "friction", "mesh", "model", "mount", "name", "preload", "side"}
        parts |= {"pivot", "direction", "free_angle", "free_travel", "stops"}
        fields = [field.name for field in attrs.fields(kind)]
        assert [name for name in fields if name in rows or name not in parts] == rows
    assert {group for group, _, _ in ROWS} == set(CLASSES)


@pytest.mark.parametrize(("group", "name"), NUMBERS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 10**400])
def test_not_finite_is_refused(group: str, name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"^{group}\.{name}(\[0\])? must be finite"):
        build(group, **{name: as_value(group, name, value)})


@pytest.mark.parametrize(("group", "name", "rule"), ROWS)
@pytest.mark.parametrize("value", ["1.2", True, None, 1j, [1.0], np.bool_(True), np.array([1.0])])
def test_wrong_kind_is_refused(group: str, name: str, rule: str, value: Any) -> None:
    left_open = value is None and attrs.fields_dict(CLASSES[group])[name].default is None
    if left_open or (rule == "FLAG" and isinstance(value, (bool, np.bool_))):
        # a preload decides the length, and another field of a mount the preload; what else is left
        # open is chosen: of mounts by the core
        stays = name == "length" or group in ("arm", "slider")
        assert (getattr(build(group, **{name: value}), name) is None) == stays
        return
    kind = KINDS.get(rule, "a real number")
    with pytest.raises(TypeError, match=rf"^{group}\.{name}(\[0\])? must be {kind}.*, got "):
        build(group, **{name: as_value(group, name, value)})


def test_messages_name_field_unit_rule_and_value() -> None:
    with pytest.raises(TypeError, match=r"^belt\.length must be a real number \(m\), got '1\.2'$"):
        build("belt", length="1.2")
    expected = (
        r"^belt\.length must be > 0 \(stress-free length of the closed belt, L\), got -1\.2 m$"
    )
    with pytest.raises(ValueError, match=expected):
        build("belt", length=-1.2)


@pytest.mark.parametrize(("group", "name", "rule"), ROWS)
def test_bounds(group: str, name: str, rule: str) -> None:
    if rule == "LINKS":
        with pytest.raises(
            ValueError, match=r"^belt\.n_bodies must be an integer from 3 to 1000000, got 2$"
        ):
            build(group, **{name: 2})
        assert getattr(build(group, **{name: 3}), name) == 3
        return
    if rule == "FLAG":
        for value in (-1, 0, 1, 2):  # of the core; Python's class takes no numbers
            if value in (0, 1):
                _core.check_parameter(group, name, group, value)
            else:
                with pytest.raises(ValueError, match=rf"^{group}\.{name} must be 0 or 1 .*, got "):
                    _core.check_parameter(group, name, group, value)
        return
    if rule == "FINITE":
        assert getattr(build(group, **{name: -1}), name) == -1.0
        return
    with pytest.raises(ValueError, match=rf"^{group}\.{name} must be >=? 0 .*, got -1"):
        build(group, **{name: as_value(group, name, -1)})
    if rule in ("POSITIVE", "POSITIVES"):
        for zero in (0, 0.0, -0.0):
            with pytest.raises(ValueError, match=rf"^{group}\.{name} must be > 0 .*, got -?0"):
                build(group, **{name: as_value(group, name, zero)})
    else:
        assert getattr(build(group, **{name: 0}), name) == 0.0


def test_lists_of_a_law_have_one_number_for_each_element() -> None:
    good = GOOD["maxwell_slip"]
    for name, count in (("stiffness", 2), ("damping", 4)):
        message = rf"^maxwell_slip\.{name} must have one number for each .*, 3 as .*, got {count}"
        with pytest.raises(ValueError, match=message):
            build("maxwell_slip", **{name: (1.0,) * count})
    for bad, kind in (((), ValueError), (1.0, TypeError), ("12", TypeError), (None, TypeError)):
        with pytest.raises(kind, match=r"^maxwell_slip\.mu must "):
            build("maxwell_slip", mu=bad)
    most = {name: (1.0,) * 64 for name in ("mu", "stiffness", "damping")}
    assert bd.MaxwellSlip(**most).n_states == 64
    with pytest.raises(ValueError, match=r"must have 1 to 64 numbers, got 65"):
        bd.MaxwellSlip(**{name: (1.0,) * 65 for name in most})
    for same in (list(good["mu"]), np.array(good["mu"])):
        assert build("maxwell_slip", mu=same) == bd.MaxwellSlip(**good)


@pytest.mark.parametrize("name", STRIBECK)
def test_a_stribeck_curve_has_two_numbers(name: str) -> None:
    law = STRIBECK[name]
    for missing, other in (("mu_s", "v_stribeck"), ("v_stribeck", "mu_s")):
        if attrs.fields_dict(type(law))[missing].default == 0.0:
            message = rf"^{name}\.{missing} must be > 0, too: a Stribeck curve needs mu_s and "
            with pytest.raises(ValueError, match=message):
                attrs.evolve(law, **{missing: 0.0})
            rows = str(attrs.evolve(law, **{missing: 0.0, other: 0.0}))
            assert "mu_s" not in rows and "v_stribeck" not in rows
    assert "mu_s" in str(law) and "v_stribeck" in str(law)


def test_one_pulley_of_a_drive_without_friction(params: bd.Params) -> None:
    """Its links have no friction, and the drive is that with laws on the others alone."""
    law = EXAMPLES["dahl"]
    one, other = params.pulleys[0], attrs.evolve(params.pulleys[1], friction=bd.Frictionless())
    shared = attrs.evolve(params, friction=law, pulleys=(one, other))
    assert shared.friction_on(0) == law and shared.friction_on(1) is None
    assert shared._model.friction == with_laws(params, law, None)._model.friction
    nowhere = attrs.evolve(params, friction=bd.Frictionless())
    assert not nowhere.has_friction and nowhere.info["n_slots"] == 0
    assert bd.Params.from_toml(shared.to_toml()) == shared
    assert str(bd.Frictionless()).split() == ["Frictionless", "law", "none"]
    assert bd.Frictionless().n_states == 0 and bd.Frictionless().creep(0.5) == 0.0


@pytest.mark.parametrize("value", [60.0, np.float64(60.0), "60", math.nan])
def test_number_of_links_must_be_an_integer(value: Any) -> None:
    with pytest.raises(
        TypeError, match=r"^belt\.n_bodies must be an integer from 3 to 1000000, got "
    ):
        build("belt", n_bodies=value)


def test_numbers_become_plain() -> None:
    belt = build("belt", n_bodies=np.int64(60), length=np.float32(1.25), axial_stiffness=70000)
    assert type(belt.n_bodies) is int and type(belt.length) is float
    assert type(belt.axial_stiffness) is float
    assert belt.length == 1.25
    pulley = build("pulley", center=np.array([1, 2]))
    assert pulley.center == (1.0, 2.0) and {type(c) for c in pulley.center} == {float}


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("axis", [0, 1])
def test_centre_and_gravity_must_be_finite(params: bd.Params, axis: int, bad: float) -> None:
    pair = [0.0, 0.0]
    pair[axis] = bad
    with pytest.raises(ValueError, match=rf"^pulley\.center\[{axis}\] must be finite \(m\)"):
        build("pulley", center=pair)
    with pytest.raises(ValueError, match=rf"^gravity\[{axis}\] must be finite \(m/s\^2\)"):
        attrs.evolve(params, gravity=pair)


@pytest.mark.parametrize("bad", ["ab", 1.0, (1.0,), (1.0, 2.0, 3.0), None, {0: 1.0, 1: 2.0}])
def test_centre_and_gravity_must_be_pairs(params: bd.Params, bad: Any) -> None:
    with pytest.raises(TypeError, match=r"^pulley\.center must be a pair of real numbers \(m\)"):
        build("pulley", center=bad)
    with pytest.raises(TypeError, match=r"^gravity must be a pair of real numbers"):
        attrs.evolve(params, gravity=bad)
    with pytest.raises(TypeError, match=r"^pulley\.center\[1\] must be a real number"):
        build("pulley", center=(0.0, "0"))


def test_missing_and_unknown_fields() -> None:
    with pytest.raises(TypeError, match="linear_density"):
        bd.Belt(**{k: v for k, v in GOOD["belt"].items() if k != "linear_density"})
    with pytest.raises(TypeError, match="radus"):
        build("pulley", radus=0.1)


def test_only_what_has_a_natural_zero_has_a_default(params: bd.Params) -> None:
    belt = bd.Belt(length=1.2, n_bodies=60, linear_density=0.1, axial_stiffness=70e3)
    assert (belt.axial_damping, belt.bending_stiffness, belt.bending_damping) == (0.0, 0.0, 0.0)
    assert bd.Contact(linear=1e7) == bd.Contact(quadratic=0.0, linear=1e7, damping=0.0)
    bare = bd.Params(belt=belt, pulleys=params.pulleys, contact=params.contact)
    assert bare.friction is None and bare.gravity == (0.0, 0.0)
    assert all(pulley.friction is None for pulley in bare.pulleys)
    lugre = bd.LuGre(mu_k=0.6, mu_s=0.9, v_stribeck=0.01, sigma=1e4)
    assert (lugre.damping, lugre.viscous) == (0.0, 0.0)
    for name, law in EXAMPLES.items():
        for field in attrs.fields(type(law)):
            if field.default is attrs.NOTHING:
                given = {k: v for k, v in GOOD[name].items() if k != field.name}
                with pytest.raises(TypeError, match=field.name):
                    LAWS[name](**given)


def test_fields_are_of_their_class(params: bd.Params) -> None:
    pulley = params.pulleys[0]
    for change, message in [
        ({"belt": GOOD["belt"]}, "belt must be a Belt, got dict"),
        ({"contact": None}, "contact must be a Contact, got NoneType"),
        (
            {"friction": 1.0},
            "friction must be a friction law (Dahl, LuGre, ElasticPlastic, Coulomb, CreepRate, "
            "Threlfall, MaxwellSlip, Frictionless) or None, got float",
        ),
        ({"pulleys": [pulley, GOOD["pulley"]]}, "pulleys[1] must be a Pulley, got dict"),
        ({"pulleys": pulley}, "pulleys must be a sequence of Pulley, got Pulley"),
        ({"pulleys": None}, "pulleys must be a sequence of Pulley, got NoneType"),
    ]:
        with pytest.raises(TypeError, match=f"^{re.escape(message)}$"):
            attrs.evolve(params, **change)
    with pytest.raises(ValueError, match="pulleys must hold at least one"):
        attrs.evolve(params, pulleys=[])


def test_friction_of_a_pulley_is_a_law(params: bd.Params) -> None:
    pulley = params.pulleys[0]
    classes = ", ".join(law.__name__ for law in (*LAWS.values(), bd.Frictionless))
    for bad, kind in ((1.0, "float"), ("dahl", "str"), (GOOD["dahl"], "dict"), (bd.Dahl, "type")):
        message = rf"friction must be a friction law \({classes}\) or None, got {kind}$"
        with pytest.raises(TypeError, match="^pulley." + message):
            attrs.evolve(pulley, friction=bad)
        with pytest.raises(TypeError, match="^" + message):
            attrs.evolve(params, friction=bad)


@pytest.mark.parametrize("name", EXAMPLES)
def test_laws_are_values(params: bd.Params, name: str) -> None:
    """Frozen, equal by their numbers, hashable, copied whole; of one pulley and of the drive."""
    law = EXAMPLES[name]
    again = LAWS[name](**GOOD[name])
    assert law == again and hash(law) == hash(again)
    assert eval(repr(law), vars(bd)) == law
    first = next(iter(GOOD[name]))
    assert law != scaled(law, 2.0)
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        setattr(law, first, 1.0)
    for drive in (attrs.evolve(params, friction=law), with_laws(params, None, law)):
        assert drive != params or law == params.friction
        for other in (pickle.loads(pickle.dumps(drive)), copy.deepcopy(drive)):
            assert other == drive and other._model.friction == drive._model.friction
        assert eval(repr(drive), vars(bd)) == drive
    assert with_laws(params, None, law).friction_on(0) is None
    assert with_laws(params, None, law).friction_on(1) == law
    assert attrs.evolve(params, friction=law).friction_on(1) == law


@pytest.mark.parametrize("name", EXAMPLES)
def test_laws_are_printed_with_their_units(params: bd.Params, name: str) -> None:
    law = EXAMPLES[name]
    text = str(law)
    assert text.splitlines()[0] == type(law).__name__
    on_pulley, of_drive = str(with_laws(params, None, law)), str(attrs.evolve(params, friction=law))
    for group, field, _, unit, meaning in _core.PARAMETERS:
        if group == name:
            value = getattr(law, field)
            if field in ("mu_s", "v_stribeck") and value == 0.0:
                continue
            several = isinstance(value, tuple)
            number = (
                f"({', '.join(f'{one:.10g}' for one in value)})" if several else f"{value:.10g}"
            )
            quantity = number + ("" if unit == "1" else f" {unit}")
            for lines, label in (
                (text, field),
                (on_pulley, f"pulleys[1].friction.{field}"),
                (of_drive, f"friction.{field}"),
            ):
                (line,) = (one for one in lines.splitlines() if one.split()[:1] == [label])
                assert quantity in line and line.endswith(meaning)
    assert "friction.law" in of_drive and name in of_drive
    assert "pulleys[0].friction" not in on_pulley


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_law_is_made_of_typical_numbers(params: bd.Params, name: str) -> None:
    """As the example is of a law that has none of its own: it settles, and holds the belt if it
    has a state to hold it by.
    """
    friction = attrs.evolve(params, friction=typical(name))
    settled = bd.settle(friction, friction=True, tolerance=1e-3)
    assert settled.mu.any() == (EXAMPLES[name].n_states > 0)


@pytest.mark.parametrize("name", EXAMPLES)
def test_numbers_of_laws_have_names(params: bd.Params, name: str) -> None:
    """What `identify` may look for, of the drive's law and of a pulley's."""
    own = attrs.evolve(with_laws(params, None, EXAMPLES[name]), friction=EXAMPLES[name])
    numbers = attrs.asdict(EXAMPLES[name])
    fields = [
        f"{field}[{e}]" if isinstance(value, tuple) else field
        for field, value in numbers.items()
        for e in range(len(value) if isinstance(value, tuple) else 1)
        if value
    ]
    for label in [f"{part}.{field}" for part in ("friction", "pulleys[1].friction")
                  for field in fields]:  # fmt: skip
        assert label in names.numbers(own)
        (value,) = names.read(own, label)
        changed = names.assign(own, [(names.parse(label), 1.5 * value)])
        assert names.read(changed, label) == [1.5 * value]
        assert changed != own
        rule = names.rule_of(own, label)
        assert rule is not None and f"friction.{rule.name}" in label
    assert not any(label.startswith("pulleys[0].friction") for label in names.numbers(own))
    with pytest.raises(ValueError, match=r"this drive has no pulleys\[0\]\.friction$"):
        names.read(own, f"pulleys[0].friction.{fields[0]}")


def test_pulleys_from_any_sequence(params: bd.Params) -> None:
    for pulleys in (list(params.pulleys), iter(params.pulleys), np.array(params.pulleys, object)):
        assert attrs.evolve(params, pulleys=pulleys) == params


def test_overlapping_pulleys(params: bd.Params) -> None:
    with pytest.raises(ValueError, match=r"pulleys\[0\] and pulleys\[1\] overlap"):
        with_pulleys(params, (0.0, 0.0, 0.1), (0.199, 0.0, 0.1))


def test_belt_too_short_and_slack(params: bd.Params) -> None:
    with pytest.raises(ValueError, match=r"belt\.length.*too short"):
        attrs.evolve(params, belt=attrs.evolve(params.belt, length=0.9))
    with pytest.raises(ValueError, match=r"belt\.length.*too long.*slack"):
        attrs.evolve(params, belt=attrs.evolve(params.belt, length=1.25))


def test_a_pulley_the_belt_cannot_reach(params: bd.Params) -> None:
    with pytest.raises(ValueError, match=r"pulleys\[1\] cannot be reached"):
        with_pulleys(params, (0.0, 0.0, 0.1), (0.3, 0.0, 0.02), (0.6, 0.0, 0.1), length=1.8)


def test_a_mesh_too_coarse_for_its_pulleys(params: bd.Params) -> None:
    with pytest.raises(ValueError, match=r"belt\.n_bodies is too small for its pulleys: 6 links"):
        attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=6))


def test_a_contact_that_holds_nothing(params: bd.Params) -> None:
    with pytest.raises(ValueError, match=r"contact\.linear and contact\.quadratic must not both"):
        attrs.evolve(params, contact=bd.Contact(linear=0.0, damping=1.0))


def test_derived_values(params: bd.Params) -> None:
    info = params.info
    path = 2 * 0.29 + 2 * math.pi * 0.1
    assert info["link_length"] == pytest.approx(0.02, rel=1e-15)
    assert info["link_mass"] == pytest.approx(0.1 * 0.02, rel=1e-14)
    assert info["joint_stiffness"] == pytest.approx(70e3 / 0.02, rel=1e-14)
    assert info["path_length"] == pytest.approx(path, rel=1e-14)
    assert info["strain_tension"] == pytest.approx(70e3 * (path / 1.2 - 1), rel=1e-12)
    with pytest.raises(TypeError):
        info["strain"] = 0.0  # type: ignore[index]


def test_refining_the_mesh_keeps_the_belt(params: bd.Params) -> None:
    fine = attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=240))
    assert fine.info["joint_stiffness"] == pytest.approx(4 * params.info["joint_stiffness"])
    assert fine.info["strain_tension"] == params.info["strain_tension"]


def test_frozen_equal_and_hashable(params: bd.Params) -> None:
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        params.belt.length = 1.0  # type: ignore[misc]
    again = drives.plain()
    assert params == again and hash(params) == hash(again)
    assert params != attrs.evolve(params, friction=None)


@pytest.mark.parametrize(
    "clone", [copy.copy, copy.deepcopy, lambda p: pickle.loads(pickle.dumps(p))]
)
def test_copies_are_whole(params: bd.Params, clone: Any) -> None:
    other = clone(params)
    assert other == params
    assert other.info == params.info
    assert bd.settle(other, tolerance=1e-3).n_bodies == 60


def test_repr_can_be_evaluated(params: bd.Params) -> None:
    assert eval(repr(params), vars(bd)) == params


def test_printing_shows_every_field_with_its_unit(params: bd.Params) -> None:
    text = str(params)
    for line in ("belt.length", "1.2 m", "pulleys[1].center", "(0.29, 0) m", "friction.sigma"):
        assert line in text
    assert "0.693 %, tension at rest " in text
    assert "friction" in str(attrs.evolve(params, friction=None))
    assert str(params.belt).splitlines()[1].split()[:3] == ["length", "1.2", "m"]
