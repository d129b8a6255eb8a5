"""Pulleys by name: what names there may be, where they are kept and accepted, where they are shown.

What messages make of them is in test_named_messages.py.
"""

from __future__ import annotations

import copy
import math
import pickle
import re
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from named import NAMES, named, pulley, with_names
from tiers import first

import beltdyn as bd
from beltdyn import _core

SPANS = [f"{NAMES[k]} to {NAMES[(k + 1) % 3]}" for k in range(3)]

# ------------------------------------------------------------------- names that there may be


def test_good_names() -> None:
    good = ["crank", "A/C", "a", "Öl-Pumpe", "ポンプ", "idler 2", "_x", 'a "b"', "1.5", "$x$"]
    for name in [*good, "x" * 31]:
        assert pulley(name).name == name
        assert re.search(rf"\n  name +{re.escape(name)}$", str(pulley(name)))
        params = named(drives.plain(), (name, None))
        assert params.pulley_names == (name, "pulley 1")
        assert (params.label(0), params.label(1)) == (f'pulley "{name}"', "pulley 1")
        assert params.pulley_index(name) == 0 and params.pulley_index("pulley 1") == 1
        assert params.pulley_index(1) == 1
        assert "pulleys[0].name" in str(params) and "pulleys[1].name" not in str(params)
    assert type(pulley(np.str_("crank")).name) is str
    assert pulley().name is None and "name" not in str(pulley())
    assert drives.plain().pulley_names == ("pulley 0", "pulley 1")


TEXT = "be a printable text"


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        *((no_text, f"{TEXT} of 1 to 31 bytes") for no_text in (1, 1.5, b"crank", True, ("a",))),
        (["crank"], f"{TEXT} of 1 to 31 bytes"),
        ("", f"{TEXT} of 1 to 31 bytes of UTF-8"),
        ("x" * 32, f"{TEXT} of 1 to 31 bytes of UTF-8"),
        ("ö" * 16, f"{TEXT} of 1 to 31 bytes of UTF-8"),
        ("a\nb", TEXT),
        ("a\0", TEXT),
        ("\ud800", TEXT),
        (" crank", "not begin or end with a space"),
        ("crank ", "not begin or end with a space"),
        ("1", "not be a number"),
        ("pulley 3", "not be a number, alone or after the word pulley"),
    ],
)
def test_bad_names(name: Any, rule: str) -> None:
    error = ValueError if isinstance(name, str) else TypeError
    with pytest.raises(error, match=rf"^pulley\.name must {rule}"):
        pulley(name)


def test_two_of_the_same_name() -> None:
    first, second = drives.plain().pulleys
    three = named(
        (first, second, attrs.evolve(second, center=(0.15, 0.4))), ("crank", None, "crank")
    )
    message = r'^pulleys\[0\]\.name and pulleys\[2\]\.name must differ, both are "crank"$'
    for use in (bd.route, bd.plot.layout, lambda p: attrs.evolve(drives.plain(), pulleys=p)):
        with pytest.raises(ValueError, match=message):
            use(three)


def test_the_core_has_the_same_rules() -> None:
    """It stands alone, and so checks again."""
    params = drives.plain()
    centers, radii = [p.center for p in params.pulleys], [p.radius for p in params.pulleys]

    def model(names: Any) -> _core.Model:
        return _core.Model(
            (1.2, 60, 0.1, 70e3, 1.4, 0.0, 0.0), centers, radii, [0.01, 0.01],
            (0.0, 2.5e7, 1e3, 0, 0.0), None, (0.0, 0.0), names=names,
        )  # fmt: skip

    for good in (None, [None, None], ["crank", None], ("ö" * 15, "x" * 31)):
        model(good).check_geometry()
    bad: list[tuple[Any, type[Exception], str]] = [
        (["", None], ValueError, r"pulleys\[0\]\.name must not be empty"),
        ([None, "x" * 32], ValueError, r"pulleys\[1\]\.name is too long"),
        (["ö" * 16, None], ValueError, r"pulleys\[0\]\.name is too long"),
        (["a\nb", None], ValueError, r"pulleys\[0\]\.name must be printable"),
        (["a\0b", None], ValueError, r"pulleys\[0\]\.name must be printable"),
        (["a", "a"], ValueError, r"pulleys\[0\]\.name and pulleys\[1\]\.name must differ, both"),
        ([1, None], TypeError, r"pulleys\[0\]\.name must be a str, got int"),
        (["a"], ValueError, "name must have one entry for each of 2 pulleys, got 1"),
        (3, TypeError, "name must be a sequence"),
    ]
    for names, error, message in bad:
        with pytest.raises(error, match=f"^{message}"):
            model(names)


# ------------------------------------------------------------------- kept


def test_copies_and_toml_keep_names() -> None:
    params = named(drives.plain())
    for other in (pickle.loads(pickle.dumps(params)), copy.deepcopy(params)):
        assert other == params and other.pulley_names == params.pulley_names
    assert params != drives.plain()
    params = named(drives.plain(), (NAMES[1], None))
    text = params.to_toml()
    assert text.count("name = ") == 1 and f'name = "{NAMES[1]}"' in text
    assert bd.Params.from_toml(text) == params
    assert "name" not in drives.plain().to_toml()
    for name, message in (
        ("3", r"pulleys[0].name must be a printable text of 1 to 31 bytes of UTF-8, got 3"),
        ('""', r"pulleys[0].name must be a printable text"),
        ('"7"', r"pulleys[0].name must not be a number"),
    ):
        with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
            bd.Params.from_toml(text.replace(f'"{NAMES[1]}"', name))


@pytest.fixture(scope="module")
def scene() -> bd.Scene:
    return bd.scenes.three_pulleys()._replace(t_end=0.02)


@pytest.fixture(scope="module")
def result(scene: bd.Scene) -> bd.Result:
    return bd.simulate(named(scene.params), *scene[1:], t_eval=np.linspace(0.0, 0.02, 41))


@pytest.fixture(scope="module")
def unnamed(scene: bd.Scene) -> bd.Result:
    return bd.simulate(*scene, t_eval=np.linspace(0.0, 0.02, 41))


def test_names_change_no_number(result: bd.Result, unnamed: bd.Result) -> None:
    for group in ("pulleys", "belt", "joints", "contact", "energy"):
        one, other = getattr(result, group).arrays(), getattr(unnamed, group).arrays()
        for name, values in one.items():
            assert np.array_equal(values, other[name]), name


def test_results_keep_names(result: bd.Result, unnamed: bd.Result, tmp_path: Path) -> None:
    result.save(tmp_path / "run.npz")
    kept = bd.Result.load(tmp_path / "run.npz")
    for one in (result, kept, pickle.loads(pickle.dumps(result)), attrs.evolve(result, t=result.t)):
        assert one.params.pulley_names == one.pulleys.names == NAMES
    assert unnamed.pulleys.names == ("pulley 0", "pulley 1", "pulley 2")
    assert list(result.pulleys.arrays()) == ["theta", "omega", "torque", "load"]


def test_summaries_say_whose(result: bd.Result, unnamed: bd.Result) -> None:
    rows, plain = dict(result.summary()), dict(unnamed.summary())
    for label, of_number, unit, names in (
        ("pulley speeds", "pulley speeds", "rad/s", NAMES),
        ("span tensions", "span tensions", "N", SPANS),
        ("speed lost against crank", "speed lost against pulley 0", "%", NAMES[1:]),
    ):
        values = plain[f"  {of_number}"].removesuffix(f" {unit}").split(", ")
        expected = ", ".join(f"{name}: {v}" for name, v in zip(names, values, strict=True))
        assert rows[f"  {label}"] == f"{expected} {unit}"


# ------------------------------------------------------------------- accepted


def test_motion_by_name(scene: bd.Scene) -> None:
    params = named(scene.params)
    ramp = bd.PiecewiseLinear([0.0, 0.02], [0.0, 5.0])
    load = bd.Viscous([0.0, 0.04, 0.1])
    runs = [bd.simulate(params, load, 0.02, {key: ramp}, t_eval=[0.02]) for key in (0, "crank")]
    assert np.array_equal(runs[0].pulleys.torque, runs[1].pulleys.torque)
    assert runs[1].pulleys.omega[0, 0] == pytest.approx(5.0)
    with pytest.raises(ValueError) as caught:
        bd.simulate(params, load, 0.02, {"crnk": ramp})
    there = ", ".join(NAMES)
    message = f"motion: no pulley is called 'crnk' (did you mean 'crank'?); there are {there}"
    assert str(caught.value) == message
    with pytest.raises(ValueError, match=r'^motion has pulley "crank" twice, by name and by index'):
        bd.simulate(params, load, 0.02, {0: ramp, "crank": ramp})
    with pytest.raises(TypeError, match=r"^motion\['crank'\] must be a PiecewiseLinear"):
        bd.simulate(params, load, 0.02, {"crank": 3.0})  # type: ignore[dict-item]
    with pytest.raises(TypeError, match=r"^motion index must be an integer from 0 to 2, got 0\.0"):
        bd.simulate(params, load, 0.02, {0.0: ramp})  # type: ignore[dict-item]


def test_speed_by_name() -> None:
    params = named(drives.plain(), ("crank", "alternator"))
    rest = bd.settle(params)
    for key in ("alternator", "crank"):
        one, other = rest.at_speed(params, {key: 10.0}), rest.at_speed(params, {1: 10.0})
        assert np.array_equal(one.vx, other.vx)
    with pytest.raises(ValueError, match=r"^omega: no pulley is called 'pump'; there are crank, a"):
        rest.at_speed(params, {"pump": 1.0})
    with pytest.raises(TypeError, match=r"^omega\['crank'\] must be a real number"):
        rest.at_speed(params, {"crank": "1"})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match=r'^the rims of pulley "crank" and pulley "alternator" m'):
        rest.at_speed(params, {0: 2.0, "alternator": 1.0})


def test_offset_by_name() -> None:
    alone = bd.Tensioning(friction=True, offset={"alternator": (-6e-4, 0.0)})
    assert 'pulley "alternator" moved to its place from an offset of (-0.0006, 0) m' in str(alone)
    assert attrs.evolve(alone, friction=False).offset == alone.offset
    assert hash(alone) == hash(attrs.evolve(alone)) and pickle.loads(pickle.dumps(alone)) == alone
    params = named(drives.plain(), ("crank", "alternator"))
    given = attrs.evolve(params, tensioning=alone)
    assert given.tensioning.offset == ((0.0, 0.0), (-6e-4, 0.0))
    assert given == attrs.evolve(params, tensioning=attrs.evolve(alone, offset={1: (-6e-4, 0.0)}))
    assert 'with friction, pulleys held, pulley "alternator" moved to its place' in str(given)
    assert bd.Params.from_toml(given.to_toml()) == given
    settled = bd.settle(given)
    assert np.array_equal(
        settled.x, bd.settle(params, friction=True, offset={"alternator": (-6e-4, 0.0)}).x
    )
    mixed = bd.Tensioning(offset={"alternator": (1e-4, 0.0), 0: (0.0, 2e-4)})
    assert attrs.evolve(params, tensioning=mixed).tensioning.offset == ((0.0, 2e-4), (1e-4, 0.0))
    bad: list[tuple[Any, str]] = [
        ({"pump": (0.0, 0.0)}, r"^offset: no pulley is called 'pump'; there are crank, alternator"),
        ({"crank": (0.0, 0.0), 0: (0.0, 0.0)}, r'^offset has pulley "crank" twice'),
        ({"crank": (0.0, 0.0), 2: (0.0, 0.0)}, r"^offset index must be an integer from 0 to 1"),
    ]
    for offset, message in bad:
        with pytest.raises(ValueError, match=message):
            attrs.evolve(params, tensioning=bd.Tensioning(offset=offset))
        with pytest.raises(ValueError, match=message):
            bd.settle(params, offset=offset)
    with pytest.raises(TypeError, match=r"^offset\['crank'\] must be a pair of real numbers"):
        bd.Tensioning(offset={"crank": 1.0})
    with pytest.raises(TypeError, match=r"^offset\[0\]\[0\] must be a real number"):
        bd.Tensioning(offset=(("crank", 1.0),))  # type: ignore[arg-type]


def test_names_in_tables_of_toml() -> None:
    base = named(drives.plain(), ("crank", "alternator"))
    motion = {"alternator": bd.PiecewiseLinear([0.0, 0.3], [0.0, -60.0])}
    scene = bd.Scene(base, bd.Viscous([1.0, 0.0]), 0.5, motion)
    text = scene.to_toml()
    assert 'pulley = "alternator"' in text
    assert bd.Scene.from_toml(text).motion == motion
    assert '\n  motion of pulley "alternator": piecewise linear' in str(scene)
    assert '\n  motion of pulley "alternator": ' in str(
        scene._replace(motion={1: motion["alternator"]})
    )
    offset = text.replace("[belt]", "[tensioning]\noffset = { alternator = [1e-4, 0.0] }\n\n[belt]")
    assert bd.Scene.from_toml(offset).params.tensioning.offset == ((0.0, 0.0), (1e-4, 0.0))
    wrong = [
        (text, '"alternator"\nkind', '"pump"\nkind', r"^motion: no pulley is called 'pump'; there"),
        (offset, "{ alternator", "{ pump", r"^offset: no pulley is called 'pump'; there are crank"),
    ]
    for given, old, new, message in wrong:
        assert old in given
        with pytest.raises(ValueError, match=message):
            bd.Scene.from_toml(given.replace(old, new))
    function = scene._replace(motion={"crank": math.sin})
    with pytest.raises(TypeError, match=r"^motion\['crank'\] must be a speed that is a Piecewise"):
        function.to_toml()


# ------------------------------------------------------------------- printed text


def test_printed_text_uses_names() -> None:
    params = drives.plain()
    text = str(named(params))
    assert f'on pulley "{NAMES[0]}" (' in text and "on pulley 0" not in text
    rows = [line.split() for line in text.splitlines() if ".name" in line]
    assert rows == [[f"pulleys[{k}].name", *NAMES[k].split()] for k in range(2)]
    route = named(params).route
    assert route.names == NAMES[:2]
    assert str(route) == with_names(str(params.route)) != str(params.route)
    assert str(bd.route(named(params.pulleys))) == str(route)


# ------------------------------------------------------------------- figures


def legend(ax: Axes) -> list[str]:
    shown = ax.get_legend()
    assert shown is not None
    return [text.get_text() for text in shown.get_texts()]


def test_legends(result: bd.Result) -> None:
    for draw in (bd.plot.speeds, bd.plot.torques):
        assert legend(draw(result)) == list(NAMES)
        assert legend(draw(result, pulleys=["alternator", 0])) == ["alternator", "crank"]
        assert legend(draw(result, pulleys="alternator")) == ["alternator"]
        assert legend(draw(result, pulleys="crank", label="measured")) == ["measured"]
        for wrong in ("pump", ["crank", "pump"]):
            with pytest.raises(
                ValueError, match=r"^pulleys.*: no pulley is called 'pump'; there are"
            ):
                draw(result, pulleys=wrong)
    assert legend(bd.plot.span_tensions(result)) == SPANS
    some = attrs.evolve(result, params=named(result.params, ("crank", None, None)))
    assert legend(bd.plot.speeds(some)) == ["crank", "pulley 1", "pulley 2"]
    spans = ["crank to pulley 1", "span 1 to 2", "pulley 2 to crank"]
    assert legend(bd.plot.span_tensions(some)) == spans
    assert legend(bd.plot.speeds(some, pulleys=["pulley 2"])) == ["pulley 2"]


@pytest.mark.ci(guard="test_picture_room.py::test_no_text_covers_another")
def test_pictures(result: bd.Result, unnamed: bd.Result) -> None:
    def texts(ax: Axes) -> list[str]:
        return [text.get_text() for text in ax.texts]

    assert sorted(texts(bd.plot.force_along_belt(result))) == sorted(NAMES)
    lines = {name.replace(" ", "\n") for name in NAMES}  # of a name, a word a line
    assert lines <= set(texts(bd.plot.drive(result)))
    assert {"0", "1", "2"} <= set(texts(bd.plot.drive(unnamed)))
    shown, plain = texts(bd.plot.layout(result.params)), texts(bd.plot.layout(unnamed.params))
    wraps = [text.rsplit("\n", 1) for text in shown if "\n" in text]
    assert [name.replace("\n", " ") for name, _ in wraps] == list(NAMES)
    assert [wrap for _, wrap in wraps] == [t.split("\n")[1] for t in plain if "\n" in t]


def test_names_are_no_formulas_and_not_left_out(result: bd.Result) -> None:
    """matplotlib sets what is between dollars as a formula, and hides labels that begin with _."""
    odd = attrs.evolve(result, params=named(result.params, (r"$\foo$", "_idler", "50 $")))
    figure = Figure()
    ax = bd.plot.speeds(odd, ax=figure.add_subplot(1, 2, 1))
    bd.plot.drive(odd, ax=figure.add_subplot(1, 2, 2))
    figure.draw_without_rendering()  # a formula with \foo would be an error
    assert legend(ax) == [r"\$\foo\$", "pulley _idler", r"50 \$"]


@pytest.mark.ci(guard="test_picture_room.py::test_no_text_covers_another")
@pytest.mark.parametrize(
    ("panel", "names"), first(1, [("tensions", SPANS), ("speeds", list(NAMES))])
)
def test_animations(panel: str, names: list[str], result: bd.Result) -> None:
    film: Any = bd.plot.animate(result, panel=panel, duration=0.1)
    film._draw_was_started = True  # not to be shown
    drive, below = film._fig.axes[:2]
    assert legend(below) == names
    assert set(NAMES) <= {text.get_text().replace("\n", " ") for text in drive.texts}
