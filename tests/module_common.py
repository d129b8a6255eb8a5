"""What the tests of the binding share: one small drive, ways to run it, things to feed it."""

import math
import re

import numpy as np
import pytest

from beltdyn import _core

N_B, N_P = 24, 2
SCENE = {
    "belt": (1.2, N_B, 0.1, 70e3, 1.4, 0.01, 0.0),
    "centers": [(0.0, 0.0), (0.29, 0.0)],
    "radii": [0.1, 0.1],
    "inertias": [0.01, 0.01],
    "contact": (5e10, 2.5e7, 1e3, 0, 0.0),
    "friction": ("dahl", (1.0, 1e4, 0.0, 0.0)),
    "gravity": (0.0, 0.0),
}
TORQUE = [("piecewise", [0.0, 0.02], [[0.0, 0.0], [-50.0, 0.0]]), ("viscous", [0.0, 16.0])]
INF = math.inf


def make_model(n_b=N_B, **changes):
    belt = (SCENE["belt"][0], n_b, *SCENE["belt"][2:])
    return _core.Model(**{**SCENE, "belt": belt, **changes})


def make_simulation(model, rest, torque=TORQUE, t_end=0.02, **options):
    return _core.Simulation(model, rest, torque, t_end, **options)


def drive(t, theta, omega):
    """Return the torques of TORQUE; to the last bit it is not, being summed otherwise."""
    return [-50.0 * t / 0.02, -16.0 * omega[1]]


def run(model, state, torque=TORQUE, t_end=0.02):
    """Run to the end: the samples and the final state."""
    simulation = _core.Simulation(model, state, torque, t_end)
    samples = simulation.sample(np.linspace(0.0, t_end, 5))
    assert simulation.advance(INF) is True
    return samples, simulation.state()


def refused(kind, message):
    """pytest.raises with the whole message as it stands, or its beginning before three dots."""
    begin = message.removesuffix("...")
    return pytest.raises(kind, match=f"^{re.escape(begin)}{'$' * (begin == message)}")


def same_bits(one, other):
    """Compare two dicts of arrays to the last bit."""
    return one.keys() == other.keys() and all(
        np.asarray(one[name]).tobytes() == np.asarray(other[name]).tobytes() for name in one
    )


def kind_of(value):
    """Name a value's type as messages do."""
    kind = type(value)
    return kind.__name__ if kind.__module__ == "builtins" else f"{kind.__module__}.{kind.__name__}"


def strange_layouts(values):
    """Lay the same numbers out in every way NumPy knows, by name."""
    values = np.asarray(values, dtype=float)
    padded = np.zeros((*values.shape[:-1], 2 * values.shape[-1]))
    padded[..., ::2] = values
    unaligned = np.zeros(values.nbytes + 1, np.uint8)[1:].view(float).reshape(values.shape)
    unaligned[...] = values
    read_only = values.copy()
    read_only.flags.writeable = False
    return {
        "non-contiguous": padded[..., ::2],
        "reversed": np.ascontiguousarray(values[::-1])[::-1],
        "big-endian": values.astype(">f8"),
        "Fortran order": np.asfortranarray(values),
        "unaligned": unaligned,
        "read-only": read_only,
        "list": values.tolist(),
    }


LAYOUTS = list(strange_layouts([0.0]))


class Broken:
    """Neither a number nor an array, whatever it is asked for."""

    def __float__(self):
        raise ZeroDivisionError("mine")

    def __array__(self, *args, **kwargs):
        raise ZeroDivisionError("mine")
