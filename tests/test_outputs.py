"""Outputs on demand: what is not asked for is not computed or kept; what is asked, is the same."""

from __future__ import annotations

import copy
import json
import pickle
import re
from pathlib import Path
from typing import Any

import attrs
import drives
import mounted_drives
import numpy as np
import pytest
from numpy.typing import NDArray

import beltdyn as bd
from beltdyn import _core
from beltdyn.base.checks import Array
from beltdyn.outputs import selection as outputs
from beltdyn.run import memory

T = np.linspace(0.0, 4e-3, 9)

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


PLAIN = drives.plain_scene()
PLAIN = PLAIN._replace(params=drives.on_mesh(PLAIN.params, "joint"), t_end=T[-1])
FREE = PLAIN._replace(params=attrs.evolve(PLAIN.params, friction=None))
#: On mounts, and with its driver's speed prescribed, whose torque follows from contact.
MOTION = {0: bd.PiecewiseLinear([0.0, 1e-2], [0.0, 1.0])}
MOUNTS = bd.Scene(mounted_drives.both(), bd.Viscous([0.0] * 4), T[-1], MOTION)
SCENES = {"plain": PLAIN, "mounts": MOUNTS}


def run(scene: bd.Scene, **options: Any) -> bd.Result:
    return bd.simulate(*scene, t_eval=T, **options)


@pytest.fixture(scope="module", params=SCENES)
def pair(request: pytest.FixtureRequest) -> tuple[bd.Scene, bd.State, bd.Result]:
    """A scene, the settled state with which it begins, and its run with everything."""
    scene = SCENES[request.param]
    start = bd.settle(scene.params)
    return scene, start, run(scene, initial=start)


@pytest.fixture(scope="module")
def rest() -> bd.State:
    return bd.settle(PLAIN.params)


def held(result: bd.Result) -> dict[str, NDArray[Any]]:
    """All arrays of a result, by dotted name."""
    found = {}
    for group in outputs.array_names():
        part = getattr(result, group, None)
        if part is not None and group != outputs.SPANS:
            found |= {f"{group}.{name}": array for name, array in part.arrays().items()}
    return found


def test_each_output_alone_is_that_of_the_whole_run(pair: Any) -> None:
    """To the bit: what is sampled feeds nothing back. The ledger is another variant of the kernels,
    which the compiler may sum in another order, so it is compared with itself.
    """
    scene, initial, full = pair
    known = outputs.array_names()
    without = run(scene, initial=initial, ledger=False)
    lacks = outputs.lacking(full.params)
    for group, names in known.items():
        if group in ("mounts", "couplings") and getattr(full, group) is None:
            continue
        for name in names:
            if name in lacks:
                continue
            reference = full if name == "energy" else without
            alone = run(scene, initial=initial, outputs=(name,))
            assert alone.outputs == (name,) and alone.stats.steps == reference.stats.steps
            assert alone.final_state == reference.final_state
            if name == "span_tension":
                assert held(alone) == {}
                np.testing.assert_array_equal(alone.span_tension, reference.span_tension)
                continue
            arrays = held(alone)
            expected = {one for one in held(full) if one == name or name == one.partition(".")[0]}
            assert set(arrays) == expected, name
            for one, array in arrays.items():
                np.testing.assert_array_equal(array, held(reference)[one], err_msg=one)


def test_a_group_is_its_arrays_and_order_does_not_matter(rest: bd.State) -> None:
    names = ("joints", "pulleys.omega", "span_tension")
    expected = ("pulleys.omega", "joints.deformation", "joints.force", "span_tension")
    for given in (names, names[::-1], list(names), set(names), frozenset(names)):
        result = run(PLAIN, initial=rest, outputs=given)
        assert result.outputs == expected
        assert [*held(result), "span_tension"] == [*expected]


def test_nothing_asked_for_runs_all_the_same(rest: bd.State) -> None:
    nothing = run(PLAIN, outputs=(), initial=rest)
    assert nothing.success and held(nothing) == {} and nothing.t.size == T.size
    assert nothing.final_state == run(PLAIN, ledger=False, initial=rest).final_state
    assert "not asked for" in repr(nothing.belt) and "links" in repr(nothing)
    # the balance of energy is looked at all the same, more coarsely
    assert nothing.stats.balance != 0.0
    without = run(FREE, outputs=("mounts", "contact.friction"))
    assert without.mounts is None
    assert without.contact.friction.shape == (T.size, 60) and not without.contact.friction.any()


def test_an_array_that_was_not_asked_for_says_so(rest: bd.State) -> None:
    names = ("pulleys.omega", "span_tension")
    result = run(PLAIN, outputs=names, initial=rest)
    for read, name in (
        (lambda: result.joints.force, "joints.force"),
        (lambda: result.pulleys.theta, "pulleys.theta"),
        (lambda: result.contact.pulley, "contact.pulley"),
        (lambda: bd.plot.joint_force(result, [0]), "joints.force"),
        (lambda: bd.plot.torques(result), "pulleys.torque"),
    ):
        with pytest.raises(AttributeError) as caught:
            read()
        assert str(caught.value) == (
            f"{name} was not asked for: run simulate with outputs=(..., '{name}'), or without "
            "outputs for all that its belt has"
        )
    for name in ("residual", "total", "losses", "mount"):
        with pytest.raises(AttributeError, match=r"^energy\.\w+ was not asked .* 'energy'\), or"):
            getattr(result.energy, name)
    with pytest.raises(AttributeError, match=r"^energy\."):
        bd.plot.energy(result)
    assert not hasattr(result.belt, "x") and getattr(result.belt, "y", None) is None
    with pytest.raises(AttributeError, match=r"^'BeltHistory' object has no attribute 'speed'$"):
        _ = result.belt.speed  # type: ignore[attr-defined]
    of_slip = run(PLAIN, outputs=("joints",), initial=rest)
    with pytest.raises(AttributeError, match=r"^span_tension was not asked .* 'span_tension'\)"):
        _ = of_slip.span_tension
    with pytest.raises(AttributeError, match=r"^pulleys\.omega was not asked for"):
        _ = of_slip.slip


def test_what_a_belt_lacks_is_absent_by_name(rest: bd.State) -> None:
    """Neither as zeros nor in files, whether cells have no slip or links no flow; asked for alone,
    it is refused.
    """
    cells = attrs.evolve(PLAIN.params.belt, mesh="ale", model="auto", n_bodies=None)
    run_of_cells = run(PLAIN._replace(params=attrs.evolve(PLAIN.params, belt=cells)))
    whole = run(PLAIN, initial=rest)
    for result, lacks, mesh in (
        (run_of_cells, ("contact.slip", "belt.phi", "belt.vphi"), "ale"),
        (whole, ("belt.flow", "belt.passed", "spans.deflection"), "joint"),
    ):
        assert result.outputs is None and not set(lacks) & set(result._arrays())
        for name in lacks:
            group, _, field = name.partition(".")
            with pytest.raises(AttributeError, match=rf'^{name} was not .* mesh "{mesh}".* none$'):
                getattr(getattr(result, group), field)
            with pytest.raises(ValueError, match=f"^outputs: '{name}' is nothing that this belt"):
                run(PLAIN._replace(params=result.params), outputs=(name,))
        of_group = run(PLAIN._replace(params=result.params), outputs=("belt",))
        assert set(held(of_group)) == {one for one in held(result) if one.startswith("belt.")}


def test_names_are_checked_before_anything_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any, **__: Any) -> Any:
        raise AssertionError("it ran")

    monkeypatch.setattr("beltdyn.run.run.settle", never)
    monkeypatch.setattr("beltdyn._core.Simulation", never)
    wrong: list[tuple[Any, type[Exception], str]] = [
        ("pulleys", TypeError, r"^outputs must be a tuple .* write \('pulleys',\)$"),
        (3, TypeError, "^outputs must be a tuple of names or None, got int$"),
        ((3,), TypeError, "^outputs must be names, got 3$"),
        (("joint",), ValueError, r"no 'joint' \(did you mean 'joints'\?\), there .*joints.*force"),
        (("joints.mu",), ValueError, "^outputs: there is no 'joints.mu'.*, there are "),
        (("omega",), ValueError, r"no 'omega' \(did you mean 'pulleys.omega'\?\), there are "),
        (("energy.drive",), ValueError, "there is no 'energy.drive' .*, .*\"energy\";"),
        (("energy",), ValueError, '^outputs asks for "energy", .* ledger=False'),
    ]
    for names, error, words in wrong:
        with pytest.raises(error, match=words):
            run(PLAIN, outputs=names, ledger=names != ("energy",))


def test_bytes_are_those_of_what_was_asked_for(pair: Any) -> None:
    """Of the arrays that the core fills, and of what is counted as needed before the run.

    Besides what every run is told by: speed and torque of each pulley, how links are shaken.
    """
    params, initial, n_t = pair[0].params, pair[1], T.size
    n_b, n_p, n_m = params.belt.n_bodies, len(params.pulleys), len(params.mounted)
    every = 8 * (2 * n_p + 1)
    for names, width in (
        (("span_tension",), 8 * n_p),
        (("pulleys", "span_tension"), 8 * 4 * n_p),
        (("joints.force",), 8 * n_b),
        (("contact.pulley", "contact.mu"), 12 * n_b),
        (("mounts.travel",), 8 * n_m),
        ((), 0),
    ):
        of_core = outputs.of_core(outputs.chosen(names, True), ledger=False)
        state = initial._to_core(params)
        sim = _core.Simulation(params._model, state, [], 1.0, ledger=False, motion=[])
        assert sum(one.nbytes for one in sim.sample(T, of_core).values()) == n_t * (width + every)
        needed = memory.check_samples(n_t, params._model.sizes, of_core, ledger=False)
        assert needed == n_t * (width + every)


def test_what_cannot_be_looked_for_is_listed(rest: bd.State) -> None:
    result = run(PLAIN, outputs=("span_tension",), initial=rest)
    assert result.unchecked == ("units", "full_slip")
    assert re.search(r"not looked for +units, full_slip, for want of outputs\n", str(result))
    slip = ("contact.pulley", "contact.normal", "contact.friction", "contact.velocity")
    for names, missing in (
        ((*slip, "pulleys.torque"), "slack_span"),
        (("joints.force", "contact.pulley", "pulleys.torque"), "full_slip"),
    ):
        assert run(PLAIN, outputs=names, initial=rest).unchecked == (missing,)
    assert run(FREE, outputs=("span_tension",)).unchecked == ("no_friction", "units")
    for one in (run(PLAIN, initial=rest), run(FREE)):
        assert one.unchecked == () and "not looked for" not in str(one)


def test_a_slack_span_is_seen_in_the_tension_of_spans_alone() -> None:
    """Pulleys are jerked against each other, which a belt stretched by 0.05 % does not bear; the
    estimate of the error does not hold then.
    """
    belt = attrs.evolve(PLAIN.params.belt, length=1.2077)
    params = attrs.evolve(PLAIN.params, belt=belt, friction=bd.Dahl(mu_k=3.0, sigma=1e4))
    torque = bd.PiecewiseLinear([0.0, 1e-3], [[0.0, 0.0], [-60.0, 60.0]])
    options: dict[str, Any] = {"t_eval": np.linspace(0.0, 0.05, 501), "rtol": 1e-3}
    full = bd.simulate(params, torque, 0.05, ledger=False, **options)
    alone = bd.simulate(params, torque, 0.05, outputs=("span_tension",), **options)
    of_spans = [one for one in full.warnings if one.code == "slack_span"]
    assert of_spans and full.stats.error is None and alone.stats.error is None
    assert [one for one in alone.warnings if one.code == "slack_span"] == of_spans


@pytest.mark.parametrize("names", [("pulleys", "span_tension"), ("energy", "belt.x"), ()])
def test_files_and_copies_hold_what_was_asked_for(tmp_path: Path, names: tuple[str, ...]) -> None:
    result, path = run(SCENES["mounts"], outputs=names), tmp_path / "run.npz"
    result.save(path)
    copies = (copy.copy(result), copy.deepcopy(result), pickle.loads(pickle.dumps(result)))
    for again in (bd.Result.load(path), *copies):
        assert again.outputs == result.outputs and again.unchecked == result.unchecked
        assert set(held(again)) == set(held(result)) and str(again) == str(result)
        for name, array in held(result).items():
            np.testing.assert_array_equal(held(again)[name], array)
        if "span_tension" in names:
            np.testing.assert_array_equal(again.span_tension, result.span_tension)
        with pytest.raises(AttributeError, match=r"belt\.vx was not asked for"):
            _ = again.belt.vx
    with np.load(path) as file:
        whole = dict(file)
    assert ("span_tension" in whole) == ("span_tension" in names)
    # without what says so, the file is refused as one that lacks arrays, and so is one with more
    meta = json.loads(str(whole["meta.json"]))
    damages: list[tuple[str, Any, str]] = [
        ("meta.json", {"outputs": None}, "is missing"),
        ("meta.json", {"outputs": ["belt.z"]}, "there is no 'belt.z'"),
        ("meta.json", {"outputs": ["belt.y", "belt.x"]}, "names of arrays in order"),
        ("belt.vx", np.zeros((T.size, 60)), "belt.vx does not belong there"),
    ]
    for name, value, words in damages:
        damage = json.dumps(meta | value) if name == "meta.json" else value
        with open(path, "wb") as file:
            np.savez(file, **whole | {name: damage})
        with pytest.raises(ValueError, match=words):
            bd.Result.load(path)


def test_a_record_is_that_of_any_outputs(rest: bd.State) -> None:
    """A run that goes on from a restart record may sample something else."""
    params, times = PLAIN.params, np.linspace(0.0, 0.05, 500)
    terms = PLAIN.torque_fn.terms()  # type: ignore[union-attr]
    first, whole, second = (
        _core.Simulation(params._model, rest._to_core(params), terms, 0.05) for _ in range(3)
    )
    first.sample(times, ["span_tension"])
    expected = whole.sample(times)["force"]
    while not first.samples > 3:
        first.advance(0.0)
    force = second.sample(times, ["force"])["force"]
    second.import_record(first.export_record())
    assert second.advance(np.inf) and whole.advance(np.inf)
    left_out = np.isnan(force).all(axis=1)
    assert 3 < np.count_nonzero(left_out) < times.size
    np.testing.assert_array_equal(force[~left_out], expected[~left_out])


def test_verified_and_budgeted_runs_keep_what_was_asked_for() -> None:
    scene = bd.scenes.kubas_case_1()._replace(t_end=0.005)
    names = ("span_tension", "pulleys.omega", "energy")
    result = bd.simulate(*scene, verify=True, rtol=1e-2, outputs=names)
    assert set(result.outputs or ()) == set(names)
    assert {name.partition(".")[0] for name in held(result)} == {"pulleys", "energy"}
    assert result.accuracy["tension"].space is not None and result.span_tension.shape == (1001, 2)
    assert result.unchecked == ("full_slip",)
    budgeted = bd.simulate(*scene, budget=0.5, outputs=("span_tension",))
    assert budgeted.outputs == ("span_tension",) and held(budgeted) == {}


def spans_by_hand(touched: NDArray[np.int32], force: Array, n_p: int) -> Array:
    """Look both ways from every joint for the next link on a pulley."""
    n_b = touched.size
    found: list[list[float]] = [[] for _ in range(n_p)]
    single: list[list[float]] = [[] for _ in range(n_p)]  # before single free links
    for i in range(n_b):
        if touched[i] >= 0:
            continue
        back = next((k for k in range(1, n_b) if touched[(i - k) % n_b] >= 0), None)
        on = next((k for k in range(n_b) if touched[(i + k) % n_b] >= 0), None)
        if back is None or on is None:
            continue
        before, after = touched[(i - back) % n_b], touched[(i + on) % n_b]
        if (before != after or n_p == 1) and back > 1:
            found[before].append(float(force[i]))
        elif (before != after or n_p == 1) and on == 1:
            single[before].append(float(force[i]))
    each = zip(found, single, strict=True)
    return np.array([np.mean(some or one) if some or one else np.nan for some, one in each])


@pytest.mark.parametrize("n_p", [1, 2, 3, 5])
def test_spans_against_a_search_from_every_joint(n_p: int) -> None:
    """Links on pulleys at random, and so wraps with links lifted off, spans without joints, pulleys
    not touched and rings on which nothing is touched; sums of a few numbers of one sign differ by
    rounding alone.
    """
    random = np.random.default_rng(5)
    n_b = 12
    touched = random.integers(-1, n_p, (400, n_b)).astype(np.int32)
    touched[random.random(touched.shape) < 0.6] = -1
    force = random.uniform(1.0, 2.0, touched.shape)
    found = _core.span_tension(touched, force, n_p)
    expected = [spans_by_hand(a, b, n_p) for a, b in zip(touched, force, strict=True)]
    assert np.isnan(expected).any() and not np.isnan(expected).all()
    np.testing.assert_allclose(found, expected, rtol=1e-15 * n_b)


def test_what_the_core_refuses(rest: bd.State) -> None:
    """Rows that are none of links, and names that it does not know."""
    one, three = np.zeros((1, 3)), np.zeros((1, 3), dtype=np.int32)
    for touched, force, n_p in (
        (three[0], one[0], 2), (three[0, 0], one[0, 0], 2), (three, one[:, :2], 2), (three, one, 0)
    ):  # fmt: skip
        with pytest.raises(ValueError, match="must have one shape"):
            _core.span_tension(touched, force, n_p)
    with pytest.raises(TypeError):
        _core.span_tension(three, one, None)  # type: ignore[arg-type]
    assert np.isinf(_core.span_tension(np.array([[0, -1, -1]], np.int32), one + np.inf, 1)).all()
    sim = _core.Simulation(PLAIN.params._model, rest._to_core(PLAIN.params), [], 1.0)
    for names, error in (("force", TypeError), (["belt.x"], ValueError), ([3], ValueError)):
        with pytest.raises(error, match="outputs"):
            sim.sample(T, names)
    with pytest.raises(TypeError):
        sim.sample(T, 3)  # type: ignore[arg-type]
    assert set(sim.sample(T, ["force", "pulley", "force"])) == {"force", "pulley"}
