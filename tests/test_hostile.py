"""Whatever drive, layout, loads and start are asked for: a finite result or a named error.

The same with the guidance of coverage: `tests/fuzz/` (CONTRIBUTING, Tests).
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import attrs
import numpy as np
import pytest
import random_drives
from fuzzed import fuzz
from hypothesis import strategies as st
from tiers import first

import beltdyn as bd

#: What is multiplied: mostly of the drive's own order, at times far from it, 0 or not a number.
FACTORS = st.one_of(
    st.floats(-2.0, 2.0).map(lambda power: 10.0**power),
    st.floats(-9.0, 9.0).map(lambda power: 10.0**power),
    st.sampled_from([0.0, -1.0, 1e-300, 1e300, math.nan, math.inf]),
)
PARTS = ["belt", "contact", "friction", *(f"pulleys[{k}]" for k in range(5))]


def changed(part: Any, data: st.DataObject) -> Any:
    """A number of a part, or of a pair in it, multiplied."""
    numbers = [
        name
        for name, value in attrs.asdict(part, recurse=False).items()
        if isinstance(value, (float, tuple)) and name in {f.alias for f in attrs.fields(type(part))}
    ]
    name, factor = data.draw(st.sampled_from(numbers)), data.draw(FACTORS)
    value = getattr(part, name)
    if isinstance(value, tuple):
        value = (value[0], *(factor * one for one in value[1:]))
    else:
        value *= factor
    return attrs.evolve(part, **{name: value})


def any_drive(data: st.DataObject) -> tuple[bd.Params, bd.TorqueLike, dict[str, Any]]:
    """One that somebody could mean, with up to three of its numbers changed."""
    kind = data.draw(st.sampled_from(random_drives.KINDS))
    params, torque, _, drawn = random_drives.draw(data.draw(st.integers(0, 10**6)), kind, 200.0)
    for _ in range(data.draw(st.integers(0, 3))):
        name = data.draw(st.sampled_from(PARTS))
        if name.startswith("pulleys"):
            pulleys = list(params.pulleys)
            k = int(name[-2]) % len(pulleys)
            pulleys[k] = changed(pulleys[k], data)
            params = attrs.evolve(params, pulleys=pulleys)
        elif getattr(params, name) is not None:
            params = attrs.evolve(params, **{name: changed(getattr(params, name), data)})
    return params, torque, drawn


def finite_or_named(data: st.DataObject) -> None:
    options = {
        "method": data.draw(st.sampled_from(["auto", "tsit5", "rk4", "rodas4", "lbdf2", "lie"])),
        "rtol": 10.0 ** data.draw(st.floats(-8.0, -1.0)),
        "max_steps": 40,
        "t_eval": [0.0],
    }
    try:
        params, torque, drawn = any_drive(data)
        start = random_drives.start(params, drawn)
        if data.draw(st.booleans()):
            name = data.draw(st.sampled_from(["x", "phi", "vy", "vphi", "omega", "mu"]))
            field = np.array(getattr(start, name))
            if field.size:
                field.flat[data.draw(st.integers(0, field.size - 1))] *= data.draw(FACTORS)
            start = attrs.evolve(start, **{name: field})
        if data.draw(st.booleans()):
            level = data.draw(FACTORS)
            torque = bd.PiecewiseLinear(
                [0.0, 1e-4], [[0.0] * len(params.pulleys), [level] * len(params.pulleys)]
            )
        result = bd.simulate(params, torque, drawn["t_end"], initial=start, **options)
    except bd.SimulationError as error:
        assert error.symbol.startswith("BD_ERR_") and str(error)
        if (partial := error.result) is None:
            return
        result = partial
    except ValueError as error:
        assert type(error) is ValueError and str(error)
        return
    state = result.final_state
    for name in ("x", "y", "phi", "vx", "vy", "vphi", "theta", "omega"):
        assert np.isfinite(getattr(state, name)).all(), name
    assert math.isfinite(state.t) and np.isfinite(result.belt.x).all()


@pytest.mark.parametrize("examples", first(1, [12, 1000]))
def test_any_drive_gives_a_finite_result_or_a_named_error(examples: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        fuzz(examples, finite_or_named, st.data())
