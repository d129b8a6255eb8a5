"""Modes and frequency responses against the dense Jacobian, closed forms and runs.

The dense Jacobian (tests/dense.py) is that of the core's solver; it is itself held to differences
of the oracle's equations by test_jacobian.py. Its eigenvalues come from LAPACK, all of them.
"""

from __future__ import annotations

import sys
import warnings
from functools import cache
from typing import Any

import dense
import numpy as np
import pytest
from bridge import oracle_of
from tiers import extended_if
from two_pulleys import open_drive

import beltdyn as bd
from beltdyn.vibration.count import count
from beltdyn.vibration.linear import linearise
from beltdyn.vibration.search import search

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def two_pulleys(mesh: str = "joint", n: int = 40, **changes: Any) -> bd.Params:
    belt = {"preload": 300.0, "n_bodies": n, "linear_density": 0.1, "mesh": mesh}
    belt |= {"axial_stiffness": 6e4, "axial_damping": 1.0, "bending_stiffness": 0.01}
    return bd.Params(
        belt=bd.Belt(**(belt | changes.pop("belt", {}))),
        pulleys=[
            bd.Pulley(name="motor", center=(0.0, 0.0), radius=0.05, inertia=2e-3),
            bd.Pulley(name="fan", center=(0.35, 0.02), radius=0.08, inertia=2e-2),
        ],
        **({"friction": bd.Dahl(mu_k=0.8, sigma=1e4)} | changes),
    )


LAWS = {
    "dahl": bd.Dahl(mu_k=0.8, sigma=1e4),
    "elastic-plastic": bd.ElasticPlastic(mu=0.5, stiffness=1e8, damping=1e2),
    "coulomb": bd.Coulomb(mu=0.5, v_reg=0.05),
    "maxwell": bd.MaxwellSlip(mu=(0.3, 0.3), stiffness=(1e8, 2e7), damping=(1e3, 1e3)),
}
DRIVES = {
    "paper": lambda: two_pulleys("paper", 72),
    "string": lambda: two_pulleys(belt={"bending_stiffness": 0.0}),
    "tensioner": lambda: bd.scenes.tensioned_alternator(48).params,
    "crossed": lambda: bd.scenes.crossed_belt(40).params,
} | {name: (lambda law=law: two_pulleys(friction=law)) for name, law in LAWS.items()}


@cache
def at_rest(name: str) -> tuple[bd.Params, bd.State]:
    params = DRIVES[name]()
    return params, bd.settle(params)


@cache
def running(name: str) -> tuple[bd.Params, bd.State]:
    """Just set going: a state at which nothing but the speeds is different."""
    params, state = at_rest(name)
    first = params.pulley_names[0]
    return params, state.at_speed(params, {first: -40.0 if name != "tensioner" else -25.0})


def dense_jacobian(params: bd.Params, state: bd.State) -> tuple[Any, Any, Any, Any]:
    """J in SI units with the field and the place of each unknown."""
    oracle, core = oracle_of(params), state._to_core(params)
    layout = dense.Layout.of(oracle, core)
    fastest = 2.0 * np.sqrt(oracle.c_tra * (0.5 * oracle.l0) ** 2 / oracle.inertia)
    j = dense.jacobian_of_solver(params._model, layout, core, 0.01 / fastest)
    names = np.concatenate([np.full(n, name) for name, n in layout.sizes.items()])
    index = np.concatenate([np.arange(n) for n in layout.sizes.values()])
    return j, layout.scale, names, index


#: Each drive running; what is the same at rest but for friction, in two of them.
STATES = [(running, name) for name in DRIVES] + [(at_rest, name) for name in DRIVES]
SHORT = (*STATES[: len(DRIVES)], (at_rest, "paper"), (at_rest, "tensioner"))
COUNTED = (at_rest, "paper"), (running, "dahl")


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("state_of", "name"), extended_if(lambda case: case not in SHORT, STATES))
def test_sparse_jacobian(state_of: Any, name: str) -> None:
    """Every entry; that of a running belt in the coordinates of its links."""
    params, state = state_of(name)
    linear = linearise(params, state, places=False)
    j, scale, names, index = dense_jacobian(params, state)
    where = {key: k for k, key in enumerate(zip(names.tolist(), index.tolist(), strict=True))}
    rows = [where[key] for key in zip(linear.names.tolist(), linear.index.tolist(), strict=True)]
    units = scale[rows]
    sparse = linear.matrix.toarray() / units[:, None] * units
    # inverse of a dense matrix: rounding times the ratio of its fastest to its shortest rates
    rounding = 1e-11 * np.abs(j).max()
    assert np.max(np.abs(sparse - j[np.ix_(rows, rows)])) < rounding
    # what is left out has no effect on what is kept
    left_out = np.setdiff1d(np.arange(len(j)), rows)
    assert {"slip", "mu"} >= {str(names[k]) for k in left_out}
    assert np.abs(j[np.ix_(rows, left_out)]).max(initial=0.0) < rounding


def assert_all_found(modes: bd.Modes, values: Any, tolerance: float) -> None:
    """The modes are all those, and none else, of these eigenvalues in the band."""
    low, high = 2.0 * np.pi * np.array(modes.band)
    expected = values[(values.imag > 0) & (-values.real < 0.25 * abs(values))]
    expected = expected[(abs(expected) > low) & (abs(expected) < high * (1 + 1e-6))]
    if modes.turning is not None:
        expected = expected[abs(expected - modes.turning) > 1e-2 * abs(modes.turning)]
    found = modes.eigenvalue[modes.damping < 0.25]
    assert len(expected) == len(found)
    assert abs(found[:, None] - expected).min(axis=0).max() < tolerance


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    "name", extended_if(lambda name: name in ("elastic-plastic", "maxwell"), DRIVES)
)
def test_eigenvalues_at_rest(name: str) -> None:
    params, state = at_rest(name)
    modes = bd.modes(params, state)
    assert len(modes) == 8
    assert modes.residual.max() < 1e-7
    j, *_ = dense_jacobian(params, state)
    # rounding of J, of the size of its fastest rate, in the square of a slow one
    largest = np.abs(modes.eigenvalue[modes.damping < 0.25]).max()
    assert_all_found(modes, np.linalg.eigvals(j), 1e-5 * largest)


@pytest.mark.one_in(2)
@pytest.mark.parametrize("name", ["paper", "dahl", "tensioner", "string"])
def test_eigenvalues_running(name: str) -> None:
    """The search finds all of the matrix in places fixed in space, which LAPACK has."""
    params, state = running(name)
    modes = bd.modes(params, state)
    assert modes.damping.max() < 0.25
    values = np.linalg.eigvals(linearise(params, state).matrix.toarray())
    assert_all_found(modes, values, 1e-5 * 2.0 * np.pi * modes.band[1])


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("state_of", "name"),
    extended_if(
        lambda case: case not in COUNTED,
        [case for case in STATES if case[1] == "dahl" or case[1] not in LAWS],
    ),
)
def test_count(state_of: Any, name: str) -> None:
    """As many eigenvalues in parts of the plane as LAPACK finds there."""
    linear = linearise(*state_of(name))
    values = np.linalg.eigvals(linear.matrix.toarray())
    values = values[values.imag > 0.0]
    for damping in (0.1, 0.25):
        slight = np.sort(abs(values[abs(values.real) < damping * abs(values)]))
        slight = slight[slight > 10.0]
        high = float(np.sqrt(slight[8] * slight[9]))
        inside = (abs(values) > 10.0) & (abs(values) < high)
        inside &= abs(values.real) < damping * abs(values)
        assert count(linear, 10.0, high, damping, 50) == np.count_nonzero(inside)


def test_a_mode_that_the_search_misses_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a warning the numbers agree; a search that loses one of a pair is found out."""
    params, state = at_rest("string")
    with warnings.catch_warnings():
        warnings.simplefilter("error", bd.BeltdynWarning)
        bd.modes(params, state, count=True)
    whole = search

    def losing(*args: Any) -> Any:
        (values, vectors), *rest = whole(*args)
        keep = np.arange(len(values)) != 3
        return (values[keep], vectors[:, keep]), *rest

    monkeypatch.setattr(sys.modules["beltdyn.vibration.modes"], "search", losing)
    with pytest.warns(bd.BeltdynWarning, match=r"modes_missing: (\d+) .* counted"):
        bd.modes(params, state, count=True)


def moving_string(n: int, share: float, phases: int) -> tuple[Any, Any]:
    """Lowest lateral frequencies [Hz] of a belt at a share of its wave speed, and in closed form.

    The latter are (k / 2 L)(c^2 - v^2) / c of a string that runs between its ends, c^2 = T / rho
    with the tension T that the running belt has in its spans, rho v^2 included. The pulleys' speeds
    are prescribed; there are two equal spans, so pairs.
    """
    belt = {"preload": 300.0, "n_bodies": n, "axial_stiffness": 2e5}
    law = bd.Dahl(mu_k=0.8, sigma=1e4)
    params = open_drive((0.05, 0.05), 0.5, (1.0, 1.0), friction=law, **belt)
    state = bd.settle(params, speed={0: -share * np.sqrt(300.0 / 0.1) / 0.05})
    modes = bd.modes(params, state, motion={0: 0.0, 1: 0.0}, phases=phases)
    v, wave = modes.speed, np.sqrt(state.tension(params).mean / 0.1)
    assert abs(v) / wave == pytest.approx(share, rel=0.1)
    # what friction in the wraps makes of the belt's passage decays within a period
    swings = (modes.participation.spans.sum(axis=1) > 0.5) & (modes.damping < 0.05)
    lateral = modes.frequency[swings][:8].reshape(-1, 2)
    expected = np.arange(1, 5) / (2.0 * 0.5) * (wave**2 - v**2) / wave
    return lateral, expected[: len(lateral), None]


@pytest.mark.ci(guard="test_modes.py::test_eigenvalues_running")
@pytest.mark.parametrize("phases", [1, 6])
def test_moving_string(phases: int) -> None:
    """Within 0.5 %: a span begins and ends where the links lift off, sqrt(T / c2') away."""
    lateral, expected = moving_string(200 if phases > 1 else 400, 0.3, phases)
    assert len(lateral) == 4
    assert np.allclose(lateral, expected, rtol=5e-3)


@pytest.mark.extended(guard="test_modes.py::test_eigenvalues_running")
def test_moving_string_at_half_its_wave_speed() -> None:
    """At 0.55 of it, where joints a link apart tell: six phases converge to the closed form.

    One phase of 200 masses is 1.0 to 1.5 % low, of 400 by chance within 0.1 %. Six phases are 0.4
    to 0.9 % low and 0.2 to 0.3 %: less than half, the error of the mesh and of the mean tension
    falling with its square.
    """
    one, expected = moving_string(200, 0.55, 1)
    assert abs(one / expected - 1.0).max() > 0.01
    coarse, expected = moving_string(200, 0.55, 6)
    fine, limit = moving_string(400, 0.55, 6)
    assert np.allclose(fine, limit, rtol=4e-3)
    off = abs(coarse / expected - 1.0)
    assert (off < abs(one / expected - 1.0)).all()
    assert (abs(fine / limit - 1.0) < 0.6 * off).all()
