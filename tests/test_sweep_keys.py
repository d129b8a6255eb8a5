"""Keys of runs: any one number changes them, and nothing else does, in any process."""

from __future__ import annotations

import functools
import importlib
import linecache
import subprocess
import sys
import threading
import types
from itertools import permutations, product
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import pytest
import sweep_runs

import beltdyn as bd
from beltdyn import _core
from beltdyn.drive.parameters import numbers
from beltdyn.many import content
from beltdyn.many.content import Contents
from beltdyn.many.identity import NoKeyError, token
from beltdyn.sweeping.names import OPTIONS, changed, place

GAIN = 3.0


def contents(scene: bd.Scene, *names: str, **options: Any) -> Contents:
    places = [place(scene, name) for name in names]
    return Contents(scene, {**OPTIONS, **options}, places, "measured")


def key(scene: bd.Scene, **options: Any) -> str:
    return contents(scene, **options).key(())


def swept(scene: bd.Scene, values: dict[str, Any], **options: Any) -> str:
    return contents(scene, *values, **options).key(tuple(values.values()))


def scenes() -> dict[str, bd.Scene]:
    named = {name: bd.scenes.get(name) for name in ("serpentine", "three-pulleys", "kubas-case-1")}
    return {**named, "moved": sweep_runs.moved(), "mounted": sweep_runs.mounted()}


@pytest.mark.parametrize("name", ["serpentine", "kubas-case-1", "mounted"])
def test_any_one_number_changes_the_key(name: str) -> None:
    """By the name as swept, and put into the scene before: the same key, another for each."""
    scene = scenes()[name]
    found = {key(scene): "the scene"}
    # by Python's own rules for such names
    values = {one: eval(f"node.{one}", {"node": scene.params}) for one in numbers(scene.params)}
    for one, value in values.items():
        new = np.nextafter(value, np.inf)
        of_sweep = swept(scene, {one: new})
        assert of_sweep not in found, (one, found[of_sweep])
        found[of_sweep] = one
        assert swept(scene, {one: value}) == key(scene), one
        try:
            there = changed(scene, {}, {one: new})[0]
        except (TypeError, ValueError):
            continue  # such a drive cannot be
        if one != "contact.hunt_crossley":  # with it the contact's other damping is chosen anew
            assert key(there) == of_sweep, one
    assert len(found) == len(values) + 1 > 20
    # changed in pairs they do not make up for each other
    names = tuple(values)[:4]
    of_all = contents(scene, *names, "torque.scale", "t_end", "rtol")
    start = [values[one] for one in names]
    keys = {of_all.key((*start, *more)) for more in product((0.1, 0.2, 0.3), repeat=3)}
    keys |= {of_all.key((*swap, 0.1, 0.1, 0.1)) for swap in permutations((0.1, 0.2, 0.3, 0.4))}
    assert len(keys) == 27 + 24


def test_the_run_that_a_run_goes_on_from_changes_the_key() -> None:
    of_run = contents(sweep_runs.plain())
    assert len({of_run.key((), before) for before in ("", "a", "b")}) == 3


def test_the_same_scene_built_in_another_way() -> None:
    scene = bd.scenes.get("serpentine")
    again = bd.Scene.from_toml(scene.to_toml())
    assert key(again) == key(scene)
    assert key(scene, rtol=1e-4, method="auto", t_eval=None) == key(scene)
    assert key(scene, t_eval=[0, 0.5]) == key(scene, t_eval=np.array([0.0, 0.5]))
    whole = attrs.evolve(scene.params, gravity=(0, scene.params.gravity[1]))
    assert key(scene._replace(params=whole)) == key(scene)
    assert key(scene._replace(t_end=1)) == key(scene._replace(t_end=1.0))
    # an index or the name of a pulley: in loads, in motions, in what is swept
    names = scene.params.pulley_names
    speed = bd.PiecewiseLinear([0.0, 1.0], [0.0, 10.0])
    (load, motion, inertia), by_index = (
        (
            key(scene._replace(torque_fn=bd.Load(pulley=one, quadratic=1e-4))),
            key(scene._replace(motion={one: speed})),
            swept(scene, {f"pulleys[{one}].inertia": 0.5}),
        )
        for one in (names[1], 1)
    )
    assert by_index == (load, motion, inertia) and key(scene) not in by_index
    # of all, and of each
    each = {f"pulleys[{k}].inertia": 0.5 for k in range(len(names))}
    assert swept(scene, {"pulleys[*].inertia": 0.5}) == swept(scene, each)
    # one thing after the other
    both = {"friction.mu_k": 0.7, "belt.axial_damping": 2.0}
    plain = sweep_runs.plain()
    assert swept(plain, both) == swept(plain, dict(reversed(both.items())))
    # Functions of the angle and of time, cranks, and what overlaps as well
    scene, moved = sweep_runs.plain(), sweep_runs.moved()
    torque = bd.Viscous([0.0, 2.0])
    loads: dict[str, Any] = {"torque": torque, "torque[0].values[1]": [0.0, 1.0]}
    factors = ("torque.scale", "torque[0].scale", "torque[1].scale", "torque[1].coefficients[1]")
    loads |= dict.fromkeys(factors, 2.0)
    loads |= {"t_end": 1.0, "rtol": 1e-3, "t_eval": [1e-3], "max_step": 1e-3, "ledger": False}
    keys = [key(scene), key(moved), *(swept(scene, {name: loads[name]}) for name in loads)]
    keys += [swept(moved, {"motion.scale": 2.0}), swept(moved, {"motion[0].values[1]": [2.0]})]
    # what is swept as a whole does not hide what is swept of it, nor the order
    keys += [swept(scene, {"torque.scale": scale, "torque": torque}) for scale in (2.0, 3.0)]
    keys += [swept(scene, {"torque": torque, "torque[0].scale": scale}) for scale in (2.0, 3.0)]
    crank: dict[str, Any] = {"speed": 10.0, "orders": [1.0], "amplitudes": [0.1]}
    changes: list[dict[str, Any]] = [{}, {"amplitudes": [0.2]}, {"orders": [2.0]}, {"speed": 11.0}]
    motions: list[Any] = [bd.CrankMotion(**{**crank, **change}) for change in changes]
    motions += [bd.Motion(**{what: lambda t: 2.0 * t}) for what in ("angle", "speed")]
    keys += [key(scene._replace(motion={0: motion})) for motion in motions]
    # results call a pulley by its name
    pulleys = [attrs.evolve(scene.params.pulleys[0], name="crank"), scene.params.pulleys[1]]
    keys.append(key(scene._replace(params=attrs.evolve(scene.params, pulleys=pulleys))))
    assert len(set(keys)) == len(keys)
    assert swept(scene, {"torque.scale": 1}) == key(scene)
    assert swept(scene, {"torque.scale": 1.0, "torque": torque}) == swept(scene, {"torque": torque})


def some() -> list[str]:
    """Keys of everything whose order or address may differ between processes."""
    kinds = {"a", "b", "c", "d"}

    def torque(t: float, _theta: Any, omega: Any) -> list[float]:
        return [GAIN * t, omega[1]] if "a" in kinds and t not in {1.0, 2.0, 3.0} else [0.0, 0.0]

    scene = sweep_runs.plain()._replace(torque_fn=torque)
    values = {"friction.mu_k": 0.7}
    of_functions = [token(one) for one in (torque, Load(2.0), Load(2.0).call, kinds)]
    return [*map(key, scenes().values()), swept(scene, values), *of_functions]


@pytest.mark.ci(guard="test_sweep_keys.py::test_what_does_the_same_has_the_same_token")
def test_in_any_process(monkeypatch: pytest.MonkeyPatch) -> None:
    code = sweep_runs.PATH + "import test_sweep_keys as of; print(*of.some())"
    for seed in ("1", "2"):
        monkeypatch.setenv("PYTHONHASHSEED", seed)
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert said.returncode == 0, said.stderr
        assert said.stdout.split() == some()


class Load:
    """A torque that is an object."""

    def __init__(self, gain: float) -> None:
        self.gain = gain

    def call(self) -> float:
        return self.gain

    def __call__(self, _t: float, _theta: Any, _omega: Any) -> list[float]:
        return [self.call(), 0.0]


def of_code(text: str) -> Any:
    """What a script or notebook with this text, kept as IPython keeps it, defines as f."""
    module, file = types.ModuleType("__main__"), f"<cell {hash(text)}>"
    linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
    exec(compile(text, file, "exec", dont_inherit=True), module.__dict__)
    return module.__dict__["f"]


OBJECT = "class G:\n  def __call__(self, t): return {}\nf = G()"
CALLS = "class B:\n  g = lambda self: {}\nclass G(B):\n  def __call__(self, t): self.g()\nf = G()"
SLOTS = "class G:\n  __slots__ = ('k',)\n  def __call__(self, t): return self.k\nf = G(); f.k = {}"
ATTRS = (
    "import attrs\n@attrs.frozen\nclass G:\n  k: int\n  def __call__(self, t): return {}\nf = G({})"
)
DATA = "import dataclasses\n@dataclasses.dataclass\n" + ATTRS.split("\n", 2)[2]
TUPLE = ATTRS.replace(
    "import attrs\n@attrs.frozen\nclass G", "import typing\nclass G(typing.NamedTuple)"
)
WRAPS = (
    "import functools\ndef g(t): return t\nclass G:\n"
    "  def __init__(self, k):\n    self.k = k\n    functools.update_wrapper(self, g)\n"
    "  def __call__(self, t): return self.k * g(t)\nf = G({})"
)
#: Texts of which no two do the same, with what stands at their {}.
DIFFERENT = [
    ("def f(t): return {} * t", "1.0", "2.0"),
    ("def f(t, k={}): return k * t", "2.0", "3.0"),
    ("def f(t, *, k={}): return k * t", "3.0"),
    ("GAIN = {}\ndef f(t): return GAIN * t", "1.0", "2.0"),
    ("def g(t): return {}\ndef f(t): return g(t)", "t", "-t", "f(t)"),
    ("def h(t): return {}\ndef g(t): return h(t)\ndef f(t): return g(t)", "1", "2"),
    ("def g(k):\n  def f(t): return k * t\n  return f\nf = g({})", "1", "2", "1.0"),
    ("f = lambda t: [t for _ in range({})]", "3", "4"),
    ("import math\nf = lambda t: math.{}(t)", "sin", "cos"),
    ("def f(t):\n  try: return 1 / t\n  except {}: return 0.0", "ValueError", "OverflowError"),
    (OBJECT, "1", "2"),
    ("class G:\n  k = {}\n  def __call__(self, t): return self.k\nf = G()", "1", "2"),
    (CALLS, "1", "2"),
    (SLOTS, "1", "2"),
    (ATTRS.format("self.k", "{}"), "1", "2"),
    (ATTRS.format("5", "{}"), "2"),
    ("import functools\nf = functools.partial(lambda k, t: k * t, {})", "2"),
    ("import functools\nf = functools.partial(lambda k, t: {}, 1)", "k * t", "k + t"),
    ("import functools\nf = functools.lru_cache(lambda t: {})", "t", "-t"),
    ("import numpy as np\nf = np.{}", "sin", "cos"),
    ("import numpy as np\nK = np.array({})\nf = lambda t: K * t", "[1., 2.]", "[1., 3.]", "[1, 2]"),
    ("def f(t): return f(t - 1) if t > 0 else {}", "1", "2"),
    ("def f(t): return f.k\nf.k = {}", "1", "2"),
    (WRAPS, "1", "2"),
    ("import numpy as np\nK = np.ma.array([1., 2.], mask={})\nf = lambda t: K", "[0, 0]", "[1, 1]"),
    ("import numpy as np\nK = np.zeros(2, [({}, 'i4')])\nf = lambda t: K", "'a'", "'b'"),
    ("f = [lambda t: t, lambda t: -t][{}]", "0", "1"),
    ("class G:\n  def put(self, k): {}\n  k = property(None, put)\n  del put\nf = G()", "1", "2"),
    ("import numpy, functools\n@functools.wraps(numpy.linalg.norm)\ndef f(t): return {}", "1", "2"),
    (DATA.format("self.k", "{}"), "1", "2"),
    (DATA.format("5", "{}"), "2"),
    (TUPLE.format("self.k", "{}"), "1", "2"),
    (TUPLE.format("5", "{}"), "2"),
]  # fmt: skip


def test_what_does_the_same_has_the_same_token() -> None:
    """Where it stands, what it says in comments, what it does not use, the order of a set."""
    one = of_code("UNUSED = 1\ndef f(time):\n    # why\n    return 2.0 * time")
    assert token(one) == token(of_code("\n\nUNUSED = 2\ndef f(time): return 2.0 * time"))
    sets = {0, 8}, {8, 0}  # which lie in memory as they were put in, as in another process
    assert [*sets[0]] != [*sets[1]] and token(sets[0]) == token(sets[1]) != token({0, 9})
    assert some() == some()
    # what does something else has another token
    texts = [text.format(what) for text, *some in DIFFERENT for what in some]
    tokens = [token(of_code(text)) for text in texts]
    assert len({*tokens}) == len(texts), [t for k, t in enumerate(texts) if tokens[k] in tokens[:k]]
    assert tokens == [token(of_code(text)) for text in texts]
    # what cannot be known is said
    for one in (sweep_runs.compiled, threading.Lock(), (k for k in range(3))):
        for what in (one, functools.partial(print, one)):
            with pytest.raises(NoKeyError, match="cannot be known"):
                token(what)
    scene = sweep_runs.plain()._replace(torque_fn=sweep_runs.compiled)
    with pytest.raises(ValueError, match="leave store out, or give key="):
        sweep_runs.do(scene, {"t_end": [1e-3]}, store="never made", executor="threads")


def test_the_source_is_that_of_the_function(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A module edited after its import gives no key, nor does a function without a source; one
    moved by an edit is told from what stands in its place.
    """
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    file, text = tmp_path / "edited_later.py", "def g(t):\n    return 2.0 * t\n"
    file.write_text(text)
    importlib.invalidate_caches()
    function = importlib.import_module("edited_later").g
    before = token(function)
    for edited in (text.replace("2.0", "3.0"), f"def h(t): ...\n{text}", "def g(", ""):
        file.write_text(edited)
        with pytest.raises(NoKeyError, match=r"as its source (has changed|is not at hand)"):
            token(function)
        assert token(function, "a") != token(function, "b")
    file.write_text(f"{text}\n# and more\n")
    assert token(function) == before
    monkeypatch.delitem(sys.modules, "edited_later")
    made: dict[str, Any] = {}
    exec("f = lambda t: t", made)
    with pytest.raises(NoKeyError, match="as its source is not at hand"):
        token(made["f"])


def test_a_key_stands_for_nothing_that_is_known() -> None:
    """What is used by something unknown is told where it is used again."""
    text = (
        "import threading\ndef g(t): return {}\n"
        "def h(t, lock=threading.Lock()): return g(t)\ndef f(t): return h(t) + g(t)"
    )
    assert token(of_code(text.format(1)), "a") != token(of_code(text.format(2)), "a")


#: Functions that import `mine`, or `ours.mine`, when they are called.
IMPORTS = [
    "def f(t):\n  from mine import g\n  return g(t)",
    "def f(t):\n  import mine\n  return mine.g(t)",
    "def f(t):\n  import mine as m\n  return [m.g(one) for one in t]",
    "def f(t):\n  from ours.mine import g as h\n  return h(t)",
    "def f(t):\n  import ours.mine\n  return ours.mine.g(t)",
    "def f(t):\n  from ours import mine\n  return mine.g(t)",
    "__package__ = 'ours'\ndef f(t):\n  from . import mine\n  return mine.g(t)",
    "__package__ = 'ours'\ndef f(t):\n  from .mine import g\n  return g(t)",
    "def h(t):\n  from mine import g\n  return g(t)\ndef f(t): return lambda: h(t)",
]


def test_what_imports_modules_when_it_is_called_needs_a_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the user's own, which the token would have to follow; also what is compiled. The key is
    part of the token, as are names and what else is known.
    """
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "ours").mkdir()
    for folder in (tmp_path, tmp_path / "ours"):
        (folder / "mine.py").write_text("def g(t): return t\n")
    importlib.invalidate_caches()
    by_text = [
        "import importlib\ndef f(t): return importlib.import_module('mine')",
        "def f(t): return __import__('mine').g(t)",
    ]
    for text in (*IMPORTS, *by_text):
        with pytest.raises(NoKeyError, match="cannot be known, as it imports a module"):
            token(of_code(text))
        assert token(of_code(text), "a") != token(of_code(text), "b"), text
        assert token(of_code(text), "a") == token(of_code(text), "a"), text
    for text in (
        "def f(t):\n  import math, numpy\n  return math.sin(t)",
        "def f(t):\n  from scipy.stats import norm\n  return norm",
        "def f(t):\n  import not_there",
        "import mine\ndef f(t): return mine.g(t)",
    ):
        assert token(of_code(text)) == token(of_code(text), "a"), text
    for text in (  # modules that are handed on
        "import mine\ndef f(t, m=mine): return m.g(t)",
        "import mine\ndef h(m): return m.g(1)\ndef f(t): return h(mine)",
        "import mine\ndef h(m): return lambda t: m.g(t)\nf = h(mine)",
        "import numpy as np\nf = np.frompyfunc(lambda t: 1.0, 1, 1)",
    ):
        with pytest.raises(NoKeyError, match="cannot be known"):
            token(of_code(text))
    monkeypatch.delitem(sys.modules, "mine")
    scene = sweep_runs.plain()._replace(torque_fn=sweep_runs.compiled)
    given: dict[str, Any] = {"store": tmp_path / "store", "executor": "threads"}
    for key_given, stored in (("a", 0), ("a", 1), ("b", 0)):
        swept = sweep_runs.do(scene, {"t_end": [1e-3]}, key=key_given, **given)
        assert (swept.stored, swept.computed) == (stored, 1 - stored)
    over = {"torque": [sweep_runs.compiled]}
    with pytest.raises(ValueError, match="cannot be known"):  # values that differ need content
        sweep_runs.do(sweep_runs.plain(), over, key="a", **given)


def test_another_build_has_other_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the same version, whose core differs in one byte."""
    scene = sweep_runs.plain()
    before = key(scene)
    core = bytearray(Path(_core.__file__).read_bytes())
    core[len(core) // 2] ^= 1
    (tmp_path / "core").write_bytes(core)
    for file, same in ((str(tmp_path / "core"), False), (_core.__file__, True)):
        monkeypatch.setattr(_core, "__file__", file)
        content._build.cache_clear()
        assert (key(scene) == before) == same
