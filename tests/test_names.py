"""Pulleys by name: what names there may be, where they are kept, accepted and shown.

Messages are provoked twice, by a drive without names and by the same one with them: the second must
be the first with names in the place of numbers.
"""

from __future__ import annotations

import copy
import itertools
import math
import pickle
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from module_common import make_model

import beltdyn as bd
from beltdyn.base import run_warnings
from beltdyn.drive import sanity

NAMES = ("crank", "Spannrolle 2 ö", "alternator")
SPANS = [f"{NAMES[k]} to {NAMES[(k + 1) % 3]}" for k in range(3)]

#: Gives the pulleys names, or leaves them as they are.
Dress = Callable[[Any], Any]


def named(what: Any, names: tuple[str | None, ...] = NAMES) -> Any:
    """The same drive, or the same pulleys, with names."""
    if isinstance(what, bd.Params):
        return attrs.evolve(what, pulleys=named(what.pulleys, names))
    return tuple(attrs.evolve(pulley, name=names[k % len(names)]) for k, pulley in enumerate(what))


def as_it_is(what: Any) -> Any:
    return what


def with_names(text: str) -> str:
    """What a message about a drive without names must be with them."""
    text = re.sub(r"pulleys (\d) and (\d)", r"pulley \1 and pulley \2", text)
    return re.sub(r"pulleys?[ \[](\d)\]?", lambda k: f'pulley "{NAMES[int(k[1])]}"', text)


def pulley(name: Any = None, **changes: Any) -> bd.Pulley:
    given = {"center": (0.0, 0.0), "radius": 0.1, "inertia": 0.01, "name": name}
    return bd.Pulley(**(given | changes))


def test_good_names() -> None:
    for name in ["crank", "A/C", "Öl-Pumpe", "ポンプ", "_x", 'a "b"', "1.5", "$x$", "x" * 31]:
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
    ("names", "rule"),
    [
        ((1, 1.5, b"crank", True, ("a",)), f"{TEXT} of 1 to 31 bytes"),
        (("", "x" * 32, "ö" * 16), f"{TEXT} of 1 to 31 bytes of UTF-8"),
        (("a\nb", "a\0", "\ud800"), TEXT),
        ((" crank", "crank "), "not begin or end with a space"),
        (("1", "pulley 3"), "not be a number, alone or after the word pulley"),
    ],
    ids=["kind", "length", "print", "space", "number"],
)
def test_bad_names(names: tuple[Any, ...], rule: str) -> None:
    for name in names:
        error = ValueError if isinstance(name, str) else TypeError
        with pytest.raises(error, match=rf"^pulley\.name must {rule}"):
            pulley(name)


def test_two_of_the_same_name() -> None:
    one, other = drives.plain().pulleys
    three = named((one, other, attrs.evolve(other, center=(0.15, 0.4))), ("crank", None, "crank"))
    message = r'^pulleys\[0\]\.name and pulleys\[2\]\.name must differ, both are "crank"$'
    for use in (bd.route, bd.plot.layout, lambda p: attrs.evolve(drives.plain(), pulleys=p)):
        with pytest.raises(ValueError, match=message):
            use(three)


def test_the_core_has_the_same_rules() -> None:
    """It stands alone, and so checks again."""
    for good in (None, [None, None], ["crank", None], ("ö" * 15, "x" * 31)):
        make_model(names=good).check_geometry()
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
            make_model(names=names)


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
def runs() -> tuple[bd.Result, bd.Result]:
    """One run with names, and the same without."""
    params, *others = bd.scenes.three_pulleys()._replace(t_end=0.02)
    times = np.linspace(0.0, 0.02, 41)
    named_one, other = (bd.simulate(one, *others, t_eval=times) for one in (named(params), params))
    return named_one, other


def test_results_keep_names_which_change_no_number(
    runs: tuple[bd.Result, bd.Result], tmp_path: Path
) -> None:
    result, unnamed = runs
    for group in ("pulleys", "belt", "joints", "contact", "energy"):
        one, other = getattr(result, group).arrays(), getattr(unnamed, group).arrays()
        for name, values in one.items():
            assert np.array_equal(values, other[name]), name
    result.save(tmp_path / "run.npz")
    kept = bd.Result.load(tmp_path / "run.npz")
    for run in (result, kept, pickle.loads(pickle.dumps(result))):
        assert run.params.pulley_names == run.pulleys.names == NAMES
    assert unnamed.pulleys.names == ("pulley 0", "pulley 1", "pulley 2")


def test_summaries_say_whose(runs: tuple[bd.Result, bd.Result]) -> None:
    rows, plain = (dict(one.summary()) for one in runs)
    for label, of_number, unit, names in (
        ("pulley speeds", "pulley speeds", "rad/s", NAMES),
        ("span tensions", "span tensions", "N", SPANS),
        ("speed lost against crank", "speed lost against pulley 0", "%", NAMES[1:]),
    ):
        values = plain[f"  {of_number}"].removesuffix(f" {unit}").split(", ")
        expected = ", ".join(f"{name}: {v}" for name, v in zip(names, values, strict=True))
        assert rows[f"  {label}"] == f"{expected} {unit}"


def test_motion_and_speed_by_name() -> None:
    params = named(drives.plain(), ("crank", "alternator"))
    ramp = bd.PiecewiseLinear([0.0, 0.02], [0.0, 5.0])
    load = bd.Viscous([0.0, 0.04])
    rest = bd.settle(params)
    one, other = (
        bd.simulate(params, load, 0.02, {key: ramp}, initial=rest, t_eval=[0.02])
        for key in (0, "crank")
    )
    assert np.array_equal(one.pulleys.torque, other.pulleys.torque)
    assert other.pulleys.omega[0, 0] == pytest.approx(5.0)
    for key in ("alternator", "crank"):
        by_name, by_index = (rest.at_speed(params, {k: 10.0}) for k in (key, 1))
        assert np.array_equal(by_name.vx, by_index.vx)
    bad: list[tuple[dict[Any, Any], dict[Any, Any], type[Exception], str]] = [
        ({"crnk": ramp}, {"pump": 1.0}, ValueError, r"no pulley is called '(crnk' \(did you mean "
         r"'crank'\?\)|pump'); there are crank, alternator$"),
        ({"crank": 3.0}, {"crank": "1"}, TypeError, r"\['crank'\] must be a (Piecewise|real num)"),
        ({0: ramp, "crank": ramp}, {0: 2.0, "crank": 2.0}, ValueError,
         'has pulley "crank" twice, by name and by index'),
        ({0.0: ramp}, {0.0: 1.0}, TypeError, r"index must be an integer from 0 to 1, got 0\.0"),
    ]  # fmt: skip
    for motion, speed, error, message in bad:
        with pytest.raises(error, match=f"^motion(: | |){message}"):
            bd.simulate(params, load, 0.02, motion, initial=rest)
        with pytest.raises(error, match=f"^omega(: | |){message}"):
            rest.at_speed(params, speed)
    with pytest.raises(ValueError, match=r'^the rims of pulley "crank" and pulley "alternator" m'):
        rest.at_speed(params, {0: 2.0, "alternator": 1.0})


def test_offset_by_name() -> None:
    alone = bd.Tensioning(friction=True, offset={"alternator": (-6e-4, 0.0)})
    moved = 'pulley "alternator" moved to its place'
    assert f"{moved} from an offset of (-0.0006, 0) m" in str(alone)
    assert attrs.evolve(alone, friction=False).offset == alone.offset
    assert hash(alone) == hash(attrs.evolve(alone)) and pickle.loads(pickle.dumps(alone)) == alone
    params = named(drives.plain(), ("crank", "alternator"))
    given = attrs.evolve(params, tensioning=alone)
    assert given.tensioning.offset == ((0.0, 0.0), (-6e-4, 0.0))
    assert given == attrs.evolve(params, tensioning=attrs.evolve(alone, offset={1: (-6e-4, 0.0)}))
    assert f"with friction, pulleys held, {moved}" in str(given)
    assert bd.Params.from_toml(given.to_toml()) == given
    settled = bd.settle(params, friction=True, offset={"alternator": (-6e-4, 0.0)})
    assert np.array_equal(bd.settle(given).x, settled.x)
    mixed = bd.Tensioning(offset={"alternator": (1e-4, 0.0), 0: (0.0, 2e-4)})
    assert attrs.evolve(params, tensioning=mixed).tensioning.offset == ((0.0, 2e-4), (1e-4, 0.0))
    bad: list[tuple[Any, str]] = [
        ({"pump": (0.0, 0.0)}, r"^offset: no pulley is called 'pump'; there are crank, alternator"),
        ({"crank": (0.0, 0.0), 0: (0.0, 0.0)}, r'^offset has pulley "crank" twice'),
        ({"crank": (0.0, 0.0), 2: (0.0, 0.0)}, r"^offset index must be an integer from 0 to 1"),
    ]
    for offset, message in bad:
        for use in (lambda p, o: attrs.evolve(p, tensioning=bd.Tensioning(offset=o)),
                    lambda p, o: bd.settle(p, offset=o)):  # fmt: skip
            with pytest.raises(ValueError, match=message):
                use(params, offset)
    with pytest.raises(TypeError, match=r"^offset\['crank'\] must be a pair of real numbers"):
        bd.Tensioning(offset={"crank": 1.0})
    with pytest.raises(TypeError, match=r"^offset\[0\]\[0\] must be a real number"):
        bd.Tensioning(offset=(("crank", 1.0),))  # type: ignore[arg-type]


def test_names_in_tables_of_toml() -> None:
    base = named(drives.plain(), ("crank", "alternator"))
    motion = {"alternator": bd.PiecewiseLinear([0.0, 0.3], [0.0, -60.0])}
    scene = bd.Scene(base, bd.Viscous([1.0, 0.0]), 0.5, motion)
    text = scene.to_toml()
    assert 'pulley = "alternator"' in text and bd.Scene.from_toml(text).motion == motion
    for one in (scene, scene._replace(motion={1: motion["alternator"]})):
        assert '\n  motion of pulley "alternator": piecewise linear' in str(one)
    offset = text.replace("[belt]", "[tensioning]\noffset = { alternator = [1e-4, 0.0] }\n\n[belt]")
    assert bd.Scene.from_toml(offset).params.tensioning.offset == ((0.0, 0.0), (1e-4, 0.0))
    for given, old, new, what in (
        (text, '"alternator"\nkind', '"pump"\nkind', "motion"),
        (offset, "{ alternator", "{ pump", "offset"),
    ):
        assert old in given
        with pytest.raises(ValueError, match=f"^{what}: no pulley is called 'pump'; there are cra"):
            bd.Scene.from_toml(given.replace(old, new))
    with pytest.raises(TypeError, match=r"^motion\['crank'\] must be a speed that is a Piecewise"):
        scene._replace(motion={"crank": math.sin}).to_toml()


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


def legend(ax: Axes) -> list[str]:
    shown = ax.get_legend()
    assert shown is not None
    return [text.get_text() for text in shown.get_texts()]


def test_legends(runs: tuple[bd.Result, bd.Result]) -> None:
    """matplotlib sets what is between dollars as a formula, and hides labels that begin with _."""
    result, _ = runs
    for draw in (bd.plot.speeds, bd.plot.torques):
        assert legend(draw(result)) == list(NAMES)
        assert legend(draw(result, pulleys=["alternator", 0])) == ["alternator", "crank"]
        assert legend(draw(result, pulleys="alternator")) == ["alternator"]
        assert legend(draw(result, pulleys="crank", label="measured")) == ["measured"]
        for wrong in ("pump", ["crank", "pump"]):
            with pytest.raises(ValueError, match=r"^pulleys.*: no pulley is called 'pump'; there"):
                draw(result, pulleys=wrong)
    assert legend(bd.plot.span_tensions(result)) == SPANS
    some = attrs.evolve(result, params=named(result.params, ("crank", None, None)))
    assert legend(bd.plot.speeds(some)) == ["crank", "pulley 1", "pulley 2"]
    spans = ["crank to pulley 1", "pulley 1 to pulley 2", "pulley 2 to crank"]
    assert legend(bd.plot.span_tensions(some)) == spans
    assert legend(bd.plot.speeds(some, pulleys=["pulley 2"])) == ["pulley 2"]
    odd = attrs.evolve(result, params=named(result.params, (r"$\foo$", "_idler", "50 $")))
    assert legend(bd.plot.speeds(odd)) == [r"\$\foo\$", "pulley _idler", r"50 \$"]
    figure = Figure()
    bd.plot.drive(odd, ax=figure.add_subplot())
    figure.draw_without_rendering()  # a formula with \foo would be an error


def dressed(dress: Dress, params: bd.Params, **changes: Any) -> bd.Params:
    """The drive with some of its fields changed; one that is refused is so with its names."""
    changes = {"pulleys": params.pulleys} | changes
    return attrs.evolve(params, **(changes | {"pulleys": dress(changes["pulleys"])}))


def close_pulleys(dress: Dress) -> object:
    """Two that one joint of the belt could touch at once."""
    base = drives.on_mesh(drives.plain(), "joint")
    pulleys = [pulley(center=(x, 0.0), radius=0.03) for x in (0.0, 0.07)]
    length = (2 * 0.07 + 2 * math.pi * 0.03) / 1.01
    belt = attrs.evolve(base.belt, length=length, n_bodies=11, bending_stiffness=0.0)
    return dressed(dress, base, belt=belt, pulleys=pulleys)


@cache
def at_rest() -> bd.State:
    return bd.settle(drives.plain())


def plain(dress: Dress) -> tuple[bd.Params, bd.State]:
    return dressed(dress, drives.plain()), at_rest()


def changed(**changes: Any) -> Callable[[Dress], bd.Params]:
    return lambda dress: dressed(dress, drives.plain(), **changes)


def running(
    torque: Any = None,
    t_end: float = 0.1,
    motion: Any = None,
    *,
    make: Callable[[], Any] | None = None,
    initial: Any = None,
    **options: Any,
) -> Callable[[Dress], Any]:
    """A run of the plain drive from rest, or from what is made of that."""

    def run(dress: Dress) -> Any:
        params, rest = plain(dress)
        start = rest if initial is None else attrs.evolve(rest, **initial(rest))
        used = make() if make else torque or bd.Viscous([0, 1])
        return bd.simulate(params, used, t_end, motion, initial=start, **options)

    return run


def turned(rest: bd.State) -> dict[str, Any]:
    return {"x": -rest.y, "y": rest.x, "phi": rest.phi + math.pi / 2}


def link_far_inside(dress: Dress) -> object:
    """All links thrown to the right, at 0.3 of the speed of stretch waves."""
    params = changed(contact=bd.Contact(linear=2e5, damping=100.0))(dress)
    wave = math.sqrt(params.belt.axial_stiffness / params.belt.linear_density)
    rest = bd.settle(params)
    start = attrs.evolve(rest, vx=rest.vx + 0.3 * wave)
    return bd.simulate(params, bd.Viscous([0, 1]), 0.05, initial=start)


JUMP = bd.PiecewiseLinear([0.0, 1.0], [-50.0, -50.0])
FIXED: dict[str, Any] = {"method": "rk4", "step": 5e-5}


def routed(x: float, y: float, radius: float, side: str = "outside") -> Callable[[Dress], object]:
    """A route that there is not, past this pulley between two others."""
    middle = pulley(center=(x, y), radius=radius, side=side)
    three = (pulley(radius=0.08), middle, pulley(center=(0.30, 0.02)))
    return lambda dress: bd.route(dress(three))


def noise() -> Callable[..., list[float]]:
    """A torque that no step can follow, the same numbers for each run."""
    draw = np.random.default_rng(1)
    return lambda *_: [0.0, 2000.0 * float(draw.standard_normal())]


def flicker() -> Callable[..., list[float]]:
    """A torque that flickers faster than any step can follow."""
    torques = itertools.cycle([[0.0, -1e13], [0.0, 1e13]])
    return lambda *_: next(torques)


REFUSED: dict[str, Callable[[Dress], object]] = {
    "overlap": routed(0.10, 0.02, 0.04),
    "passed by": routed(0.15, 0.05, 0.02, "inside"),
    "its other side": routed(0.12, 0.30, 0.04),
    "through": routed(0.6, 0.0, 0.05),
    "outside": lambda dress: bd.route(dress((pulley(side="outside"), pulley(center=(0.3, 0.0))))),
    "close pulleys": close_pulleys,
    "sinking": changed(contact=bd.Contact(linear=1e5, compensate=True)),
    "overlapping start": lambda dress: bd.settle(plain(dress)[0], offset={1: (-0.2, 0.0)}),
    "missed pulley": lambda dress: bd.settle(dressed(dress, drives.small_idler(0.02, 20))),
    "state beside": running(initial=turned),
    "motion that jumps": running(bd.Viscous([0, 0]), motion={1: JUMP}),
    "motion not finite": running(motion={0: lambda t: math.nan if t > 1e-3 else 0.0}),
    "motion of another kind": running(motion={0: lambda t: None}),
    "motion of a state": lambda dress: at_rest().at_speed(plain(dress)[0], {0: 1.0, 1: 2.0}),
    "torque not finite": running(lambda t, *_: [0.0, math.nan if t > 1e-3 else 0.0]),
    "torque not finite at once": running(lambda *_: [math.inf, 0.0]),
    "fixed step too long": running(
        bd.Viscous([1e3, 0.0]), 0.01, initial=lambda _: {"omega": np.array([1.0, 0.0])}, **FIXED
    ),
    "link far inside": link_far_inside,
    "torque that stalls": running(make=noise, t_end=3.0, method="tsit5", rtol=1e-10),
    "step floor": running(
        make=flicker, t_end=1e3 + 1e-3, initial=lambda _: {"t": 1e3}, method="tsit5"
    ),
}


@pytest.mark.parametrize("provoke", REFUSED.values(), ids=REFUSED.keys())
def test_errors_use_names(provoke: Callable[[Dress], object]) -> None:
    errors: list[Any] = []
    for dress in (as_it_is, named):
        with run_warnings.silenced(), pytest.raises(Exception) as caught:
            provoke(dress)
        errors.append(caught.value)
    plain, other = errors
    assert str(other) == with_names(str(plain)) != str(plain)
    assert type(plain) is type(other)
    if isinstance(other, bd.SimulationError):
        k = other.pulley
        assert k == plain.pulley >= 0
        assert (plain.pulley_name, other.pulley_name) == (f"pulley {k}", NAMES[k])
        again = pickle.loads(pickle.dumps(other.with_traceback(None)))
        assert again.pulley_name == NAMES[k]


def test_an_error_of_no_pulley_names_none() -> None:
    with run_warnings.silenced(), pytest.raises(bd.SimulationError) as caught:
        running(max_steps=3)(named)
    assert caught.value.pulley == -1 and caught.value.pulley_name == ""


def in_millimetres(dress: Dress) -> bd.Params:
    params = drives.plain()
    pulleys = [
        attrs.evolve(p, center=(1e3 * p.center[0], 0.0), radius=1e3 * p.radius + j)
        for j, p in enumerate(params.pulleys)
    ]
    belt = attrs.evolve(params.belt, length=bd.route(pulleys).length / 1.007)
    return dressed(dress, params, pulleys=pulleys, belt=belt)


def with_second(**changes: Any) -> Callable[[Dress], bd.Params]:
    first, second = drives.plain().pulleys
    return changed(pulleys=(first, attrs.evolve(second, **changes)))


def pulse(height: float) -> Callable[..., list[float]]:
    return lambda t, *_: [-height if 0.02 < t < 0.02002 else 0.0, 0.0]


def without_friction(dress: Dress) -> bd.Result:
    return bd.simulate(changed(friction=None)(dress), constant(0.0, 1.0), 0.01)


def pulled(rest: bd.State) -> dict[str, Any]:
    """Into a longer loop, and back."""
    return {"vy": rest.vy + 836.0 * np.sign(rest.y)}


COARSE: dict[str, Any] = {
    "method": "rodas4",
    "rtol": 1e-2,
    "torque_interval": 0.01,
    "t_eval": np.linspace(0.0, 0.03, 3001),
}


def constant(*torques: float) -> bd.Torque:
    return bd.PiecewiseLinear([0.0], [torques])


#: Of a drive, or of a run.
WARNED: dict[str, tuple[str, Callable[[Dress], Any]]] = {
    "compliance": ("compliance", changed(contact=bd.Contact(linear=2e5, damping=100.0))),
    "long links": ("long_links", lambda dress: dressed(dress, drives.small_idler(0.02, 30))),
    "large": ("units", in_millimetres),
    "light": ("units", with_second(inertia=1e-10)),
    "percent": ("units", with_second(friction=bd.Dahl(mu_k=30.0, sigma=1e4))),
    "no friction": ("no_friction", without_friction),
    "torque in N mm": ("units", running(constant(0.0, -5e4), 1e-3)),
    "full slip": ("full_slip", running(constant(-300.0, 300.0), 0.02)),
    "slack span": ("slack_span", running(t_end=0.003, initial=pulled)),
    "torque between steps": ("torque", running(pulse(100.0), 0.03, **COARSE)),
    # ten times what would be let pass
    "faint torque between steps": ("torque", running(pulse(0.1), 0.03, **COARSE)),
    "torque that jumps": (
        "rough_torque",
        running(lambda t, *_: [0.0, -100.0 * math.sin(3e5 * t)], 0.03, **COARSE),
    ),
    "torque without effect": (
        "torque_ignored",
        running(t_end=0.01, motion={1: bd.PiecewiseLinear([0.0, 1.0], [0.0, 9.0])}),
    ),
}


@pytest.mark.parametrize(("code", "provoke"), WARNED.values(), ids=WARNED.keys())
def test_warnings_use_names(code: str, provoke: Callable[[Dress], Any]) -> None:
    found = []
    for dress in (as_it_is, named):
        with run_warnings.silenced():
            what = provoke(dress)
        warned = sanity.check(what) if isinstance(what, bd.Params) else what.warnings
        found.append([one for one in warned if one.code == code])
    assert found[0]
    for one, other in zip(*found, strict=True):
        assert other.text == with_names(one.text)
        assert code == "units" or other.text != one.text  # of percent only the place has a name
        k = int(one.where[-1])
        span = f"span {NAMES[1 - k]} to {NAMES[k]}"
        assert other.where == (span if code == "slack_span" else with_names(one.where)) != one.where
