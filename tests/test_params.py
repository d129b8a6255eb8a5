"""Parameter objects: every rule of the table, geometry, printing, copying."""

from __future__ import annotations

import copy
import itertools
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
from beltdyn.drive import parameters as names
from beltdyn.drive.friction import LAWS
from beltdyn.drive.rules import rules_of

CLASSES: dict[str, Any] = {
    **{"belt": bd.Belt, "pulley": bd.Pulley, "drag": bd.Drag, "arm": bd.Arm},
    **{"slider": bd.Slider, "isolator": bd.Isolator, "clutch": bd.OverrunningClutch},
    **{"damper": bd.TorsionalDamper, "contact": bd.Contact, **LAWS},
}
GOOD: dict[str, dict[str, Any]] = {
    "belt": {
        **{"length": 1.2, "n_bodies": 60, "linear_density": 0.1, "axial_stiffness": 70e3},
        **{"axial_damping": 1.4, "bending_stiffness": 0.01, "bending_damping": 1e-6},
    },
    "pulley": {"center": (0.0, 0.0), "radius": 0.1, "inertia": 0.01},
    "drag": {"coulomb": 0.2, "viscous": 1e-3, "quadratic": 1e-5},
    "arm": {"pivot": (0.1, 0.0), "inertia": 2e-3},
    "slider": {"direction": (1.0, 0.0), "mass": 3.0},
    "isolator": {"inertia": 3e-3, "stiffness": 20.0},
    "clutch": {"inertia": 3e-3},
    "damper": {"inertia": 3e-3, "stiffness": 20.0},
    "contact": {"quadratic": 5e10, "linear": 2.5e7, "damping": 1e3, "compensate": True},
    **{name: attrs.asdict(law) for name, law in EXAMPLES.items()},
}
#: Of mounts the core has numbers that stand together in one field, `stops`.
ROWS = [row[:3] for row in _core.PARAMETERS if row[1] not in ("lowest", "highest")]


def build(group: str, **changes: Any) -> Any:
    return CLASSES[group](**(GOOD[group] | changes))


@pytest.fixture
def params() -> bd.Params:
    return drives.plain()


def refused(kind: type[Exception], message: str, group: str, name: str, value: Any) -> None:
    """As the value of a parameter; of a list, in the place of its first."""
    good = GOOD[group].get(name)
    if isinstance(good, tuple) and name not in ("center", "pivot", "direction"):
        value = (value, *good[1:])
    with pytest.raises(kind, match=rf"^{group}\.{name}{message}"):
        build(group, **{name: value})


@pytest.mark.parametrize(("group", "name", "rule"), ROWS)
def test_every_number_is_checked_by_its_rule(group: str, name: str, rule: str) -> None:
    if rule not in ("LINKS", "FLAG"):
        for value in (math.nan, math.inf, -math.inf, 10**400):
            refused(ValueError, r"(\[0\])? must be finite", group, name, value)
    kind = {"LINKS": "an integer", "FLAG": "a bool"}.get(rule, "a real number")
    for value in ("1.2", True, None, 1j, [1.0], np.bool_(True), np.array([1.0])):
        left_open = value is None and attrs.fields_dict(CLASSES[group])[name].default is None
        left_open &= rule != "LINKS"  # of cells alone
        if left_open or (rule == "FLAG" and isinstance(value, (bool, np.bool_))):
            # a preload decides the length, and another field of a mount the preload; what else is
            # left open is chosen: of mounts by the core
            stays = name == "length" or (value is None and group in ("arm", "slider", "clutch"))
            assert (getattr(build(group, **{name: value}), name) is None) == stays
        else:
            refused(TypeError, rf"(\[0\])? must be {kind}.*, got ", group, name, value)
    if rule == "LINKS":
        message = " must be an integer from 3 to 1000000, got "
        refused(ValueError, f"{message}2$", group, name, 2)
        for value in (60.0, np.float64(60.0), math.nan):
            refused(TypeError, message, group, name, value)
        assert getattr(build(group, **{name: 3}), name) == 3
    elif rule == "FLAG":
        for value in (0, 1):  # of the core; Python's class takes no numbers
            _core.check_parameter(group, name, group, value)
        for value in (-1, 2):
            with pytest.raises(ValueError, match=rf"^{group}\.{name} must be 0 or 1 .*, got "):
                _core.check_parameter(group, name, group, value)
    elif rule == "FINITE":
        assert getattr(build(group, **{name: -1}), name) == -1.0
    else:
        refused(ValueError, " must be >=? 0 .*, got -1", group, name, -1)
        if rule == "NONNEGATIVE":
            assert getattr(build(group, **{name: 0}), name) == 0.0
        else:
            for zero in (0, 0.0, -0.0):
                refused(ValueError, " must be > 0 .*, got -?0", group, name, zero)
    if (group, name) == ("belt", "length"):  # whole messages
        refused(TypeError, r" must be a real number \(m\), got '1\.2'$", group, name, "1.2")
        meaning = r"stress-free length of the closed belt, L"
        refused(ValueError, rf" must be > 0 \({meaning}\), got -1\.2 m$", group, name, -1.2)


def test_lists_of_a_law_have_one_number_for_each_element() -> None:
    def law(value: Any, *fields: str) -> bd.MaxwellSlip:
        return build("maxwell_slip", **dict.fromkeys(fields, value))  # type: ignore[no-any-return]

    for name, count in (("stiffness", 2), ("damping", 4)):
        message = rf"^maxwell_slip\.{name} must have one number for each .*, 3 as .*, got {count}"
        with pytest.raises(ValueError, match=message):
            law((1.0,) * count, name)
    for bad, kind in (((), ValueError), (1.0, TypeError), ("12", TypeError), (None, TypeError)):
        with pytest.raises(kind, match=r"^maxwell_slip\.mu must "):
            law(bad, "mu")
    assert law((1.0,) * 64, "mu", "stiffness", "damping").n_states == 64
    with pytest.raises(ValueError, match=r"must have 1 to 64 numbers, got 65"):
        law((1.0,) * 65, "mu", "stiffness", "damping")
    good = GOOD["maxwell_slip"]["mu"]
    for same in (list(good), np.array(good)):
        assert law(same, "mu") == build("maxwell_slip")


def test_a_stribeck_curve_has_two_numbers() -> None:
    for name, law in STRIBECK.items():
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
    assert str(bd.Frictionless()).split() == ["Frictionless", "kind", "none"]
    assert bd.Frictionless().n_states == 0 and bd.Frictionless().creep(0.5) == 0.0


def test_pairs_and_plain_numbers(params: bd.Params) -> None:
    """Centres and gravity are pairs of finite numbers; what is kept is an int or a float."""

    def gravity(pair: Any) -> bd.Params:
        return attrs.evolve(params, gravity=pair)

    def centre(pair: Any) -> bd.Pulley:
        return build("pulley", center=pair)  # type: ignore[no-any-return]

    for make, name, unit in ((centre, r"pulley\.center", "m"), (gravity, "gravity", r"m/s\^2")):
        for bad in (math.nan, math.inf):
            for axis, pair in enumerate(((bad, 0.0), (0.0, bad))):
                with pytest.raises(ValueError, match=rf"^{name}\[{axis}\] must be finite \({unit}"):
                    make(pair)
        for no_pair in ("ab", 1.0, (1.0,), (1.0, 2.0, 3.0), None, {0: 1.0, 1: 2.0}):
            with pytest.raises(TypeError, match=rf"^{name} must be a pair of real numbers"):
                make(no_pair)
        with pytest.raises(TypeError, match=rf"^{name}\[1\] must be a real number"):
            make((0.0, "0"))
    kept = centre(np.array([1, 2])).center
    assert kept == (1.0, 2.0) and {type(c) for c in kept} == {float}
    belt = build("belt", n_bodies=np.int64(60), length=np.float32(1.25), axial_stiffness=70000)
    assert type(belt.n_bodies) is int and type(belt.axial_stiffness) is float
    assert type(belt.length) is float and belt.length == 1.25


def test_missing_and_unknown_fields_and_defaults(params: bd.Params) -> None:
    """Only what has a natural zero has a default."""
    for name in ("belt", *EXAMPLES):
        for field in attrs.fields(CLASSES[name]):
            if field.default is attrs.NOTHING:
                given = {k: v for k, v in GOOD[name].items() if k != field.name}
                with pytest.raises(TypeError, match=field.name):
                    CLASSES[name](**given)
    with pytest.raises(TypeError, match="radus"):
        build("pulley", radus=0.1)
    belt = bd.Belt(length=1.2, n_bodies=60, linear_density=0.1, axial_stiffness=70e3)
    assert (belt.axial_damping, belt.bending_stiffness, belt.bending_damping) == (0.0, 0.0, 0.0)
    assert bd.Contact(linear=1e7) == bd.Contact(quadratic=0.0, linear=1e7, damping=0.0)
    bare = bd.Params(belt=belt, pulleys=params.pulleys, contact=params.contact)
    assert bare.friction is None and bare.gravity == (0.0, 0.0)
    assert all(pulley.friction is None for pulley in bare.pulleys)


def test_fields_are_of_their_class(params: bd.Params) -> None:
    pulley, dahl = params.pulleys[0], GOOD["dahl"]
    laws = ", ".join(law.__name__ for law in (*LAWS.values(), bd.Frictionless))
    law = f"friction must be a friction law ({laws}) or None, got"
    assert laws.startswith("Dahl, LuGre, ElasticPlastic, Coulomb, CreepRate, Threlfall, MaxwellSli")
    for whose, change, message in [
        (params, {"belt": GOOD["belt"]}, "belt must be a Belt, got dict"),
        (params, {"contact": None}, "contact must be a Contact, got NoneType"),
        (params, {"pulleys": [pulley, dahl]}, "pulleys[1] must be a Pulley, got dict"),
        (params, {"pulleys": pulley}, "pulleys must be a sequence of Pulley, got Pulley"),
        (params, {"pulleys": None}, "pulleys must be a sequence of Pulley, got NoneType"),
        (params, {"friction": dahl}, f"{law} dict"),
        (params, {"friction": bd.Dahl}, f"{law} type"),
        (pulley, {"friction": 1.0}, f"pulley.{law} float"),
        (pulley, {"friction": "dahl"}, f"pulley.{law} str"),
    ]:
        with pytest.raises(TypeError, match=f"^{re.escape(message)}$"):
            attrs.evolve(whose, **change)
    with pytest.raises(ValueError, match="pulleys must hold at least one"):
        attrs.evolve(params, pulleys=[])
    for pulleys in (list(params.pulleys), iter(params.pulleys), np.array(params.pulleys, object)):
        assert attrs.evolve(params, pulleys=pulleys) == params


@pytest.mark.parametrize("name", EXAMPLES)
def test_laws_are_values(params: bd.Params, name: str) -> None:
    """Frozen, equal by their numbers, hashable, copied whole; of one pulley and of the drive.

    One of typical numbers settles, and holds the belt if it has a state to hold it by.
    """
    law = EXAMPLES[name]
    again = LAWS[name](**GOOD[name])
    assert law == again and hash(law) == hash(again)
    assert eval(repr(law), vars(bd)) == law
    assert law != scaled(law, 2.0)
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        setattr(law, next(iter(GOOD[name])), 1.0)
    on_one = with_laws(params, None, law)
    for drive in (attrs.evolve(params, friction=law), on_one):
        assert drive != params or law == params.friction
        for other in (pickle.loads(pickle.dumps(drive)), copy.deepcopy(drive)):
            assert other == drive and other._model.friction == drive._model.friction
        assert eval(repr(drive), vars(bd)) == drive
        assert drive.friction_on(1) == law
    assert on_one.friction_on(0) is None
    settled = bd.settle(attrs.evolve(params, friction=typical(name)), friction=True, tolerance=1e-3)
    assert settled.mu.any() == (law.n_states > 0)


@pytest.mark.parametrize("name", EXAMPLES)
def test_laws_are_printed_with_their_units(params: bd.Params, name: str) -> None:
    law = EXAMPLES[name]
    on_pulley, of_drive = str(with_laws(params, None, law)), str(attrs.evolve(params, friction=law))
    for field, rule in rules_of(name).items():
        value = getattr(law, field)
        if field in ("mu_s", "v_stribeck") and value == 0.0:
            continue
        quantity = ", ".join(f"{one:.10g}" for one in np.atleast_1d(value))
        if isinstance(value, tuple):
            quantity = f"({quantity})"
        quantity += "" if rule.unit == "1" else f" {rule.unit}"
        for text, label in (
            (str(law), field),
            (on_pulley, f"pulleys[1].friction.{field}"),
            (of_drive, f"friction.{field}"),
        ):
            (line,) = (one for one in text.splitlines() if one.split()[:1] == [label])
            assert quantity in line and line.endswith(rule.text)
    assert str(law).splitlines()[0] == type(law).__name__
    assert "friction.kind" in of_drive and name in of_drive
    assert "pulleys[0].friction" not in on_pulley


@pytest.mark.parametrize("name", EXAMPLES)
def test_numbers_of_laws_have_names(params: bd.Params, name: str) -> None:
    """What `identify` may look for, of the drive's law and of a pulley's."""
    own = attrs.evolve(with_laws(params, None, EXAMPLES[name]), friction=EXAMPLES[name])
    fields = []
    for field, value in attrs.asdict(EXAMPLES[name]).items():
        if value:
            several = isinstance(value, tuple)
            fields += [f"{field}[{e}]" for e in range(len(value))] if several else [field]
    for part, field in itertools.product(("friction", "pulleys[1].friction"), fields):
        label = f"{part}.{field}"
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


def test_geometry_that_cannot_be(params: bd.Params) -> None:
    def belt(**changes: Any) -> dict[str, Any]:
        return {"belt": attrs.evolve(params.belt, **changes)}

    def pulleys(*places: tuple[float, float]) -> dict[str, Any]:
        return {"pulleys": [build("pulley", center=(x, 0.0), radius=r) for x, r in places]}

    for changes, words in (
        (pulleys((0.0, 0.1), (0.199, 0.1)), r"pulleys\[0\] and pulleys\[1\] overlap"),
        (belt(length=0.9), r"belt\.length.*too short"),
        (belt(length=1.25), r"belt\.length.*too long.*slack"),
        (pulleys((0.0, 0.1), (0.3, 0.02), (0.6, 0.1)) | belt(length=1.8),
         r"pulleys\[1\] cannot be reached"),
        (belt(n_bodies=6), r"belt\.n_bodies is too small for its pulleys: 6 links"),
        ({"contact": bd.Contact(linear=0.0, damping=1.0)},
         r"contact\.linear and contact\.quadratic must not both"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=words):
            attrs.evolve(params, **changes)


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
    fine = attrs.evolve(params, belt=attrs.evolve(params.belt, n_bodies=240)).info
    assert fine["joint_stiffness"] == pytest.approx(4 * info["joint_stiffness"])
    assert fine["strain_tension"] == info["strain_tension"]


def test_frozen_equal_hashable_copied_whole_and_evaluated(params: bd.Params) -> None:
    """And printed, every field with its unit."""
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        params.belt.length = 1.0  # type: ignore[misc]
    again = drives.plain()
    assert params == again and hash(params) == hash(again)
    assert params != attrs.evolve(params, friction=None)
    assert eval(repr(params), vars(bd)) == params
    for other in (copy.copy(params), copy.deepcopy(params), pickle.loads(pickle.dumps(params))):
        assert other == params
        assert other.info == params.info
        assert bd.settle(other, tolerance=1e-3).n_bodies == 60
    text = str(params)
    for line in ("belt.length", "1.2 m", "pulleys[1].center", "(0.29, 0) m", "friction.sigma"):
        assert line in text
    assert "0.693 %, tension at rest " in text
    assert "friction" in str(attrs.evolve(params, friction=None))
    assert str(params.belt).splitlines()[1].split()[:3] == ["length", "1.2", "m"]
