"""Parameters and scenes as TOML: exact both ways, and mistakes named by their path."""

from __future__ import annotations

import re
import tomllib
from itertools import cycle
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
import tomli_w
from fuzzed import EXAMPLES, fuzz
from hypothesis import strategies as st
from laws import EXAMPLES as LAWS

import beltdyn as bd
from beltdyn.drive.rules import rules_of

SCENE = """\
t_end = 0.5
gravity = [0, -9.81]

[belt]
length = 1.2
n_bodies = 60
linear_density = 0.1
axial_stiffness = 70e3

[contact]
linear = 2.5e7

[friction]
mu_k = 1
sigma = 1e4

[[pulleys]]
center = [0, 0]
radius = 0.1
inertia = 0.01

[[pulleys]]
center = [0.29, 0.0]
radius = 0.1
inertia = 0.01

[[torque]]
kind = "piecewise_linear"
t = [0, 0.3]
values = [[0, 0], [-100, 0]]

[[torque]]
kind = "viscous"
coefficients = [0, 16]
"""


@pytest.mark.parametrize("name", bd.scenes.names())
def test_every_scene_survives_the_round_trip_exactly(name: str, tmp_path: Path) -> None:
    scene, path = bd.scenes.get(name), tmp_path / "scene.toml"
    text = scene.to_toml(path)
    assert path.read_text(encoding="utf-8") == text
    for source in (text, path, str(path)):
        assert bd.Scene.from_toml(source) == scene


def test_params_survive_the_round_trip_to_the_last_bit(tmp_path: Path) -> None:
    """Numbers that no short text has, also of friction, whose kind is written."""
    params, third = bd.scenes.three_pulleys().params, (0.2 / 3, 1 / 3)
    belt = attrs.evolve(params.belt, length=np.nextafter(1.1945, 2), axial_damping=1 / 3)
    one, *others = params.pulleys
    law = bd.MaxwellSlip(mu=third, stiffness=(1e8 / 3, 1e8), damping=third)
    pulleys = [attrs.evolve(one, friction=law), *others]
    params = attrs.evolve(params, belt=belt, gravity=(5e-324, -1e22), pulleys=pulleys)
    for shared in (None, bd.Dahl(mu_k=0.7 / 3, sigma=1e4 / 3)):
        params = attrs.evolve(params, friction=shared)
        text = params.to_toml(tmp_path / "drive.toml")
        for source in (text, tmp_path / "drive.toml"):
            again = bd.Params.from_toml(source)
            assert again == params and again.to_toml() == text
            assert again._model.friction == params._model.friction
        document = tomllib.loads(text)
        assert ("friction" in document) == (shared is not None)
        kinds = [table.get("friction", {}).get("kind") for table in document["pulleys"]]
        assert kinds == ["maxwell_slip", None, None]


def test_a_scene_written_by_hand() -> None:
    """One torque is itself, and friction may be absent; a notebook's file is its scene."""
    scene = bd.Scene.from_toml(SCENE)
    assert scene.t_end == 0.5
    assert scene.params.gravity == (0.0, -9.81)
    assert scene.params.friction == bd.Dahl(mu_k=1.0, sigma=1e4), "dahl is the default"
    assert scene.params.pulleys[1].center == (0.29, 0.0)
    ramp, load = bd.PiecewiseLinear([0, 0.3], [[0, 0], [-100, 0]]), bd.Viscous([0, 16])
    assert scene.torque_fn == ramp + load
    text = SCENE.replace("[friction]\nmu_k = 1\nsigma = 1e4\n", "").split("[[torque]]")
    scene = bd.Scene.from_toml(text[0] + "[[torque]]" + text[2])
    assert scene.params.friction is None and scene.torque_fn == load
    assert bd.Scene.from_toml(scene.to_toml()) == scene
    # with comments: the file that notebooks/README.md runs
    path = Path(__file__).resolve().parent.parent / "notebooks" / "serpentine.toml"
    read, scene = bd.Scene.from_toml(path), bd.scenes.serpentine()
    assert read == scene and read.to_toml() == scene.to_toml()
    assert "#" in path.read_text(encoding="utf-8")


def test_text_is_readable() -> None:
    text = drives.plain_scene().to_toml()
    for line in ("center = [0.29, 0.0]", "    [-100.0, 0.0],\n", 'kind = "dahl"'):
        assert line in text
    tables = {"t_end", "gravity", "belt", "pulleys", "contact", "friction", "torque"}
    assert set(tomllib.loads(text)) == tables


BELT = SCENE[SCENE.index("[belt]") : SCENE.index("[contact]")]
GRAVITY = "gravity = [0, -9.81]"
LINKS = "belt.n_bodies must be an integer from 3 to 1000000, got"
LENGTH = "belt.length must be"
COEFFICIENTS = "torque[1].coefficients must"
LAW = "friction.kind must be one of none"
DEEP, HUGE = "not valid TOML for a drive: nested too deeply", "0x" + "f" * 5000


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius = 0.1", "radus = 0.1", "pulleys[0].radus: unknown field (did you mean 'radius'?)"),
        ("t_end = 0.5", "t_end = 0.5\nspeed = 1", "speed: unknown field"),
        ("length = 1.2\n", "", "belt.length or belt.preload must be given"),
        (BELT, "", "belt: missing"),
        ("[contact]", "[contat]", "contat: unknown field (did you mean 'contact'?)"),
        ("linear = 2.5e7", "compensate = 1", "contact.compensate must be a bool, got 1"),
        ("t_end = 0.5\n", "", "t_end: missing; a drive alone is read by Params.from_toml"),
        (f"t_end = 0.5\n{GRAVITY}", "gravity = 1", "gravity must be a pair"),
        ("coefficients = [0, 16]", "", "torque[1].coefficients: missing"),
        ('kind = "viscous"\n', "", "torque[1].kind must be one of piecewise_linear, viscous, "),
        ("mu_k = 1\nsigma = 1e4", "mu = [0.5]\nstiffness = [1e7]\ndamping = [100.0]",
         f"{LAW}, dahl, lugre, elastic_plastic, coulomb, creep_rate, threlfall, maxwell_slip, it is"
         " missing"),
        ("length = 1.2", 'length = "1.2"', f"{LENGTH} a real number (m), got '1.2'"),
        ("n_bodies = 60", "n_bodies = 60.0", f"{LINKS} 60.0"),
        ("center = [0.29, 0.0]", "center = [0.29]",
         "pulleys[1].center must be a pair of real numbers (m), got [0.29]"),
        ("center = [0.29, 0.0]\nradius = 0.1", "center = [0.29, 0.0]\nradius = -0.1",
         "pulleys[1].radius must be > 0 (radius on which the belt runs, r_p), got -0.1 m"),
        ("mu_k = 1", "mu_k = nan", "friction.mu_k must be finite, got nan"),
        (GRAVITY, "gravity = [0, inf]", "gravity[1] must be finite (m/s^2), got inf"),
        ("t_end = 0.5", "t_end = 0", "t_end must be > 0 s, got 0 s"),
        ("t = [0, 0.3]", "t = [0.3, 0]", "torque[0].t must be non-decreasing"),
        ("[0, 16]", "[0, 16, 1]", "torque[1] must be for 2 pulley(s)"),
        ("n_bodies = 60", "n_bodies = 60\nlength = 1", "not valid TOML: "),
        ("[belt]", "[belt", "not valid TOML: "),
        ("length = 1.2", "length = 1.3", "belt.length is too long for its pulleys"),
        # hostile
        ("1.2", "[" * 5000 + "]" * 5000, DEEP),
        ("1.2", "[" * 200 + "]" * 200, f"{LENGTH} a real number (m), got [[[[[["),
        ("1.2", "{a=" * 5000 + "1" + "}" * 5000, DEEP),
        ("[belt]", "a" + ".a" * 500 + " = 1\n[belt]", "a: unknown field"),
        ("n_bodies = 60", "n_bodies = " + "9" * 5000, "not valid TOML: Exceeds the limit"),
        ("n_bodies = 60", f"n_bodies = {HUGE}", f"{LINKS} int too long to print"),
        ("1.2", HUGE, f"{LENGTH} finite (m), got int too long to print"),
        ("[0, 16]", f"[0, {HUGE}]", f"{COEFFICIENTS} hold real numbers"),
        ("1.2", "1e999", f"{LENGTH} finite (m), got inf"),
        ("1.2", "1979-05-27", f"{LENGTH} a real number (m), got datetime.date"),
        ("[0, 16]", "[1979-05-27]", f"{COEFFICIENTS} hold real numbers"),
        ("[0, 16]", "[0, nan]", f"{COEFFICIENTS} be finite, got nan at [1]"),
        ('kind = "viscous"', "kind = [1]", "torque[1].kind must be one of"),
        ('kind = "viscous"', f"kind = {HUGE}", "torque[1].kind must be one of"),
        ("mu_k = 1", "kind = {a = 1}", LAW),
        (GRAVITY, "tensioning = {pulleys = []}", "tensioning: pulleys must be one of held, free"),
        (GRAVITY, f"tensioning = {HUGE}", "tensioning: must be a table, got"),
        (GRAVITY, "tensioning = {offset = {" + "9" * 5000 + " = [0, 0]}}",
         "tensioning: offset index must be an integer from 0 to 9999, got '9999"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line_that_names_the_path(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    text = SCENE.replace(old, new, 1)
    assert text != SCENE
    path = tmp_path / "scene.toml"
    path.write_text(text)
    for source, prefix in ((text, ""), (path, f"{path}: ")):
        with pytest.raises(ValueError) as caught:
            bd.Scene.from_toml(source)
        assert type(caught.value) is ValueError
        assert str(caught.value).startswith(prefix + message)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


PATHS = zip(LAWS, cycle(["friction", "pulleys[1].friction"]), strict=False)


@pytest.mark.parametrize(("name", "path"), [*PATHS, ("dahl", "pulleys[1].friction")])
def test_mistakes_in_friction_name_the_path(name: str, path: str) -> None:
    """Of every law, each of its parameters: missing, misspelt, of another kind, out of bounds."""
    law = LAWS[name]
    table = {"kind": law.law, **attrs.asdict(law)}

    def refused(table: Any, message: str) -> None:
        document = tomllib.loads(SCENE)
        (document if path == "friction" else document["pulleys"][1])["friction"] = table
        with pytest.raises(ValueError) as caught:
            bd.Scene.from_toml(tomli_w.dumps(document))
        assert str(caught.value).startswith(path + message) and "\n" not in str(caught.value)

    kinds = f".kind must be one of {', '.join(['none', *LAWS])}, got "
    for kind in ("glue", "Dahl", "", 1, ["dahl"]):
        refused({**table, "kind": kind}, kinds)
    for wrong in (3, [table], "dahl"):
        refused(wrong, ": must be a table, got ")
    for field, rule in rules_of(name).items():
        good = {**table}
        value = good.pop(field)
        if attrs.fields_dict(type(law))[field].default is attrs.NOTHING:
            refused(good, f".{field}: missing")
        refused({**good, f"{field}x": value}, f".{field}x: unknown field (did you mean {field!r}?)")
        real, several = "a real number", isinstance(value, tuple)
        for bad, what in (("1", real), (True, real), (float("nan"), "finite")):
            given = [bad, *value[1:]] if several else bad
            refused({**good, field: given}, f".{field}{'[0]' * several} must be {what}")
        bound = ">= 0" if rule.rule == "NONNEGATIVE" else "> 0"
        given = [-1.0, *value[1:]] if several else -1.0
        refused({**good, field: given}, f".{field} must be {bound} (")


def test_what_is_no_scene_and_no_drive(tmp_path: Path) -> None:
    good = tomllib.loads(SCENE)
    for change, message in (
        ({"belt": 1}, "belt: must be a table, got 1"),
        ({"belt": [1, 2]}, "belt: must be a table, got [1, 2]"),
        ({"pulleys": 3}, "pulleys: must be an array of tables, [[pulleys]]"),
        ({"pulleys": [3]}, "pulleys[0]: must be a table, got 3"),
        ({"friction": 3}, "friction: must be a table, got 3"),
        ({"pulleys": {"radius": 1}}, "pulleys: must be an array of tables, [[pulleys]]"),
    ):
        document = {"belt": good["belt"], "contact": good["contact"], "pulleys": good["pulleys"]}
        with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
            bd.Params.from_toml(tomli_w.dumps(document | change))
    with pytest.raises(ValueError, match=r"^this is a scene, .* read it with Scene\.from_toml"):
        bd.Params.from_toml(SCENE)
    with pytest.raises(FileNotFoundError):
        bd.Scene.from_toml(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="not a text file in UTF-8"):
        bd.Scene.from_toml(tmp_path / "binary.toml")
    scene = bd.scenes.kubas_case_1()._replace(torque_fn=lambda t, theta, omega: [0.0, 0.0])
    with pytest.raises(TypeError, match=r"^torque_fn must be made of torque objects"):
        scene.to_toml()
    own = type("Fan", (bd.Load,), {})
    with pytest.raises(TypeError, match=r"^Fan is no class that TOML files know"):
        scene._replace(torque_fn=own(0)).to_toml()


PLAIN = st.floats() | st.integers() | st.booleans() | st.text(max_size=4)
PLAIN |= st.dates() | st.datetimes() | st.integers(20_000, 20_010).map(lambda bits: 1 << bits)
VALUES = st.recursive(
    PLAIN,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)


def only_documented(text: str) -> None:
    for kind in (bd.Scene, bd.Params):
        try:
            kind.from_toml(text + "\n")
        except ValueError as error:
            assert type(error) is ValueError


@EXAMPLES
def test_any_text(examples: int) -> None:
    fuzz(examples, only_documented, st.text(st.characters(codec="utf-8"), max_size=60))

    def within_a_scene(data: st.DataObject) -> None:
        text = SCENE
        for _ in range(data.draw(st.integers(1, 3))):
            at, cut = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 5))
            new = data.draw(st.text("[]{}=.,\"'#0 1e-\n", max_size=5))
            text = text[:at] + new + text[at + cut :]
        only_documented(text)

    fuzz(examples, within_a_scene, st.data())


@EXAMPLES
def test_any_value_anywhere(examples: int) -> None:
    def check(data: st.DataObject) -> None:
        document: Any = tomllib.loads(SCENE)
        table, inner = document, document
        while isinstance(inner, (dict, list)) and (inner is document or data.draw(st.booleans())):
            table = inner
            keys = table if isinstance(table, dict) else range(len(table))
            key = data.draw(st.sampled_from([*keys]))
            inner = table[key]
        if isinstance(table, dict) and data.draw(st.booleans()):
            key = data.draw(st.text(max_size=4))
        table[key] = data.draw(VALUES)
        try:
            text = tomli_w.dumps(document)
        except ValueError:  # an integer too long to be written
            return
        only_documented(text)

    fuzz(examples, check, st.data())
