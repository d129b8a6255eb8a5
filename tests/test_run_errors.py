"""What every error of a run says, a case each; and states that no drive can have, which end a run.

The second kind is made by changing numbers in the restart record of a run, since no run has them.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from typing import Any

import attrs
import drives
import mounted_drives as mounted
import numpy as np
import pytest
from test_record import fnv

import beltdyn as bd
from beltdyn import _core

pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

PLAIN = drives.plain()
RAMP = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-100.0, 0.0]]) + bd.Viscous([0.0, 15.9])
#: With links in its spans that are on no pulley's list.
LONG = attrs.evolve(
    PLAIN,
    belt=attrs.evolve(PLAIN.belt, length=2.61),
    pulleys=[PLAIN.pulleys[0], attrs.evolve(PLAIN.pulleys[1], center=(1.0, 0.0))],
)
WAVE = math.sqrt(70e3 / 0.1)  # m/s, of stretch along the belt
#: After where the check sum of a record's content stands (csrc/run/record.c).
HEAD = struct.Struct("<8sIIQQQ")


@pytest.fixture(scope="module")
def rest() -> bd.State:
    return bd.settle(PLAIN)


def flickering() -> Callable[..., list[float]]:
    flips = [0]

    def flicker(*_: Any) -> list[float]:
        flips[0] += 1
        return [1e13 * (-1) ** flips[0], 0.0]

    return flicker


def run(rest: bd.State, *, moved: dict[str, Any] | None = None, **given: Any) -> bd.Result:
    options: dict[str, Any] = {"params": PLAIN, "torque_fn": RAMP, "t_end": 0.05, **given}
    return bd.simulate(initial=attrs.evolve(rest, **(moved or {})), **options)


def off_the_pulley(_: bd.State) -> bd.Result:
    small = drives.small_idler(0.005, 60)
    start = bd.settle(small)
    thrown = attrs.evolve(start, vy=start.vy - 20.0)
    return bd.simulate(small, bd.Viscous([0.0, 0.0, 0.0]), 0.01, initial=thrown)


def tampered(
    params: bd.Params = LONG,
    start: bd.State | None = None,
    t_end: float = 1e-3,
    **numbers: float,
) -> bd.Result:
    """A run whose record is changed after its first steps."""
    start = start or bd.settle(params)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_core, "Simulation", of_record(numbers))
        torque = bd.PiecewiseLinear([0.0], [[0.0] * len(params.pulleys)])
        return bd.simulate(params, torque, t_end, initial=start, method="tsit5")


def of_record(numbers: dict[str, Any]) -> Any:
    """Return what stands in for a simulation that goes on from another one's record, changed.

    Numbers are added to ``mu`` and ``slip`` of a link in the middle of a span, to
    ``mount_friction`` of the first mount, as ``mu_on_pulley`` to the state of the outermost link,
    to the works ``joint_loss`` and so on.
    """
    original = _core.Simulation

    class Tampered:
        def __init__(self, *args: Any, **options: Any) -> None:
            self.sim = original(*args, **options)
            self.other: Any = original(*args, **options)

        def advance(self, *args: Any) -> Any:
            if self.other is not None:
                self.other.advance(0.0)
                self.sim.import_record(self.changed())
                self.other = None
            return self.sim.advance(*args)

        def __getattr__(self, name: str) -> Any:
            return getattr(self.sim, name)

        def changed(self) -> bytes:
            record, state = bytearray(self.other.export_record()), self.other.state()
            free = int(np.argmin(np.abs(state["x"] - 0.5)))
            works = [name for name, kind, _ in _core.ENERGY_TERMS if kind in ("SUPPLIED", "LOST")]
            for name, value in numbers.items():
                if name in works:  # behind the speeds of the pulleys
                    at, place = found(record, state["omega"]), 2 + works.index(name)
                elif name == "mu_on_pulley":
                    at, place = found(record, state["mu"]), int(np.argmin(state["x"]))
                else:
                    at, place = found(record, state[name]), free * (len(state[name]) > 1)
                old = struct.unpack_from("<d", record, at + 8 * place)[0]
                struct.pack_into("<d", record, at + 8 * place, old + value)
            head = [*HEAD.unpack_from(record)]
            head[-1] = fnv(record[HEAD.size :])
            HEAD.pack_into(record, 0, *head)
            return bytes(record)

    return Tampered


def found(record: bytearray, values: np.ndarray) -> int:
    assert record.count(values.tobytes()) >= 1
    return record.index(values.tobytes())


#: By symbol: a run that ends so; what is at fault, -1 where it is none in particular; advice.
ERRORS: dict[str, tuple[Callable[[bd.State], Any], str, str]] = {
    "BD_ERR_TORQUE_VALUE": (
        lambda rest: run(rest, torque_fn=lambda t, *_: [math.nan if t > 1e-3 else 0.0, 0.0]),
        "pulley 0", "must return finite values",
    ),
    "BD_ERR_STEP_FLOOR": (
        lambda rest: run(rest, moved={"t": 1e3}, torque_fn=flickering(), t_end=1e3 + 1e-3),
        "pulley 0", "loosen rtol",
    ),
    "BD_ERR_NOT_FINITE": (
        lambda rest: run(rest, moved={"vx": np.full(60, 1e160)}, method="tsit5"),
        "link 0", "look for parameters",
    ),
    "BD_ERR_PASSED_THROUGH": (
        lambda rest: run(rest, moved={"vx": rest.vx - 200.0},
                         params=attrs.evolve(PLAIN, contact=bd.Contact(linear=2e5))),
        "link 21 .*pulley 1", "raise contact.linear",
    ),
    "BD_ERR_OFF_PULLEY": (off_the_pulley, "pulley 1", "raise belt.n_bodies"),
    "BD_ERR_JOINT_GAP": (
        lambda rest: run(rest, moved={"vy": rest.vy + 1.2 * WAVE}), "link 24", "look for a torque",
    ),
    "BD_ERR_BALANCE": (
        lambda rest: run(rest, method="lbdf2", step=1e-3, moved={"vy": rest.vy + 0.5 * WAVE}),
        "", "take a shorter",
    ),
    "BD_ERR_STALLED": (
        lambda rest: run(rest, max_step=1e-13), "", "set max_steps to go on",
    ),
    "BD_ERR_FIXED_STEP": (
        lambda rest: run(rest, method="rk4", step=1e-4), r"most in \w+ of link \d+",
        "take a shorter step",
    ),
    "BD_ERR_MAX_STEPS": (lambda rest: run(rest, max_steps=5), "", "raise max_steps"),
    "BD_ERR_INVARIANT": (lambda _: tampered(slip=1e-6), "link", "please report it"),
    "BD_ERR_NOT_SETTLED": (
        lambda _: bd.settle(PLAIN, max_time=1e-4), "", "call settle",
    ),
}  # fmt: skip


@pytest.mark.parametrize("symbol", [row[0] for row in _core.ERRORS if row[2] == "RUN"])
def test_every_error_of_a_run_says_when_where_why_and_what_to_try(
    symbol: str, rest: bd.State
) -> None:
    """With what was computed up to there, which is finite; settling has nothing to give."""
    make, where, advice = ERRORS[symbol]
    with pytest.raises(bd.SimulationError) as caught:
        make(rest)
    error, said = caught.value, str(caught.value)
    assert error.symbol == symbol and error.field
    assert re.search(where, said) and advice in said
    assert (error.body >= 0) == ("link" in where) and (error.pulley >= 0) == ("pulley" in where)
    assert error.pulley_name == (f"pulley {error.pulley}" if error.pulley >= 0 else "")
    if symbol == "BD_ERR_NOT_SETTLED":
        assert error.t == 1e-4 and "within 0.0001 s" in said and error.result is None
        return
    told = re.search(r"t = ([-+.\de]+) s", said)
    assert told and float(told[1]) == pytest.approx(error.t, rel=1e-8)
    done = error.result
    assert done is not None and not done.success and done.message == said
    assert done.final_state.t <= error.t and np.all(np.isfinite(done.final_state.x))
    assert np.all(np.isfinite(done.joints.force[-1]))
    if symbol == "BD_ERR_FIXED_STEP":  # its last step may err by 20 times the stretch at rest
        assert np.max(np.abs(done.joints.force[-1])) <= 21.0 * PLAIN.info["strain_tension"]


@pytest.mark.parametrize("method", ["lie", "lbdf2"])
def test_steps_in_place_of_a_fixed_one_are_controlled(rest: bd.State, method: str) -> None:
    """They stay short while the waves of a belt thrown sideways last, after the steps that failed:
    steps as long as asked, and some within those that failed, would be 100 and a handful.
    """
    result = run(rest, method=method, step=2e-4, t_end=0.02, moved={"vy": rest.vy + 0.02 * WAVE})
    assert result.stats.rejected > 0 and result.stats.steps > 200
    assert "fixed_step" in [warning.code for warning in result.warnings]


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"mu": 0.5}, "the friction state of link \\d+ is 0.5, where 0 is most"),
        ({"joint_loss": -9.0, "friction_loss": 9.0}, "dampers of the joints have given"),
        ({"contact_loss": -9.0, "friction_loss": 9.0}, "dampers of the contact have given"),
    ],
)
def test_what_no_drive_has_ends_a_run(numbers: dict[str, float], message: str) -> None:
    with pytest.raises(bd.SimulationError, match=message):
        tampered(**numbers)


def test_forces_add_up_to_rounding() -> None:
    """And are looked at: a share of the bound, which is far above what rounding mostly makes."""
    assert 0.0 < tampered().stats.invariant < 0.1


def test_friction_beyond_its_bound_is_brought_within() -> None:
    """Of a link and of a mount, on the side where it was."""
    given = tampered(t_end=1e-4, mu_on_pulley=-1.9).final_state
    assert -1.0 <= given.mu[np.argmin(given.x)] < -0.3
    params = mounted.tensioner()
    start = attrs.evolve(bd.settle(params), mount_friction=np.array([-0.987654]))
    end = tampered(params, start, mount_friction=-0.5).final_state
    assert -1.0 <= end.mount_friction[0] < -0.9


@pytest.mark.parametrize(("method", "rtol"), [("rodas4", 1e-3), ("lbdf2", 1e-2), ("lbdf2", 1e-3)])
def test_steps_find_their_length_behind_a_jump(method: str, rtol: float, rest: bd.State) -> None:
    """Of the torque, within the tolerance and by few tries: a jump costs about a dozen, and control
    that aims at nine tenths of what is allowed rejects one step in ten or so.
    """
    jump = bd.PiecewiseLinear([0.0, 0.01, 0.01, 0.02], [[0, 0], [0, 0], [-100, 0], [-100, 0]])
    given: dict[str, Any] = {"torque_fn": jump, "t_end": 0.02, "t_eval": np.linspace(0, 0.02, 101)}
    found, exact = run(rest, method=method, rtol=rtol, **given), run(rest, rtol=1e-6, **given)
    difference = found.joints.force - exact.joints.force
    assert np.sqrt(np.mean(difference**2)) <= rtol * np.mean(exact.joints.force)
    assert found.stats.local_error is not None and found.stats.local_error <= rtol
    assert found.stats.rejected < 0.25 * found.stats.steps
