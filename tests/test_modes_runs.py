"""Modes and frequency responses against runs in time, which know nothing of the linearisation."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from drives import sprung_alternator
from numpy.typing import NDArray
from test_modes_serpentine import settled

import beltdyn as bd

Array = NDArray[np.float64]
pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")


def peak(t: Array, signal: Array) -> float:
    """Frequency of the largest line [Hz]: Hann window, a parabola through the padded transform."""
    window = np.hanning(t.size)
    n = 16 * t.size
    amplitude = np.abs(np.fft.rfft(window * (signal - signal.mean()), n))
    k = int(np.argmax(amplitude[1:-1])) + 1
    a, b, c = np.log(amplitude[k - 1 : k + 2])
    return float((k + 0.5 * (a - c) / (a - 2 * b + c)) / (n * (t[1] - t[0])))


@pytest.mark.slow
def test_ring_down() -> None:
    """Displaced by the sum of the eight modes, the drive rings with their frequencies.

    Displacements are projected on the shape of each mode; within 0.5 %, as the frequencies of modes
    are against the linear model (test_modes_serpentine.py).
    """
    params, state = settled(240)
    modes = bd.modes(params, state, motion={"crank": 0.0})
    shapes, size = modes.shapes, 2e-6
    start = attrs.evolve(
        state,
        **{
            name: getattr(state, name) + size * getattr(shapes, name).real.sum(axis=0)
            for name in ("x", "y", "theta", "travel")
        },
    )
    t = np.linspace(0.0, 0.5, 2001)
    result = bd.simulate(
        params,
        bd.Viscous([0.0, 0.0, 0.0]),
        t[-1],
        motion={"crank": bd.PiecewiseLinear([0.0], [0.0])},
        initial=start,
        t_eval=t,
        rtol=1e-6,
        outputs=("belt.x", "belt.y", "pulleys.theta"),
    )
    moved = np.array([result.belt.x - state.x, result.belt.y - state.y])
    turned = 0.05 * (result.pulleys.theta - state.theta)
    for k in range(8):
        on_shape = moved[0] @ shapes.x[k].real + moved[1] @ shapes.y[k].real
        on_shape += turned @ (0.05 * shapes.theta[k].real) * 240 * 0.1
        near = peak(t, on_shape)
        assert near == pytest.approx(modes.frequency[k], rel=5e-3), k


@pytest.mark.parametrize("excited", ["torque", "motion"])
def test_frequency_response(excited: str) -> None:
    """A sinusoidal torque or motion, when what it began with has decayed: amplitude and phase.

    The arm is damped so strongly that this takes 0.25 s; a span's tension and the pulleys' angles.
    """
    params = sprung_alternator(0.6)
    state = bd.settle(params)
    loads = bd.Viscous([0.0, 0.02, 0.0])
    for frequency in (20.0, 60.0):
        w, amplitude = 2.0 * np.pi * frequency, 0.05 if excited == "torque" else 2e-4
        if excited == "torque":
            response = bd.frequency_response(
                params, state, [frequency], torque="alternator", motion={"crank": 0.0}, loads=loads
            )
            speed = bd.Motion(angle=lambda t: 0.0)
        else:
            response = bd.frequency_response(
                params, state, [frequency], motion="crank", loads=loads
            )
            # from rest: A sin(w t) faded in over 0.1 s
            fade = lambda t: min(t / 0.1, 1.0) ** 2 * (3.0 - 2.0 * min(t / 0.1, 1.0))  # noqa: E731
            speed = bd.Motion(angle=lambda t, w=w, f=fade, a=amplitude: a * f(t) * np.sin(w * t))
        push = amplitude if excited == "torque" else 0.0

        def torque(t: float, theta: Array, omega: Array, push: float = push, w: float = w) -> Array:
            return np.array([0.0, push * np.sin(w * t) - 0.02 * omega[1], 0.0])

        end, n = 0.5, 5
        t = np.linspace(end - n / frequency, end, 401)
        result = bd.simulate(
            params, torque, end, motion={"crank": speed}, initial=state, t_eval=t, rtol=1e-5
        )
        basis = np.column_stack([np.sin(w * t), np.cos(w * t), np.ones_like(t), t])

        def seen(history: Array, basis: Array = basis, amplitude: float = amplitude) -> complex:
            sine, cosine, *_ = np.linalg.lstsq(basis, history, rcond=None)[0]
            return complex(sine, cosine) / amplitude

        assert response.residual[0] < 1e-7
        for k in (1, 2):
            expected = response.theta[0, k]
            assert abs(seen(result.pulleys.theta[:, k]) - expected) < 0.01 * abs(expected), k
        expected = response.span_tension[0, 0]
        assert abs(seen(result.span_tension[:, 0]) - expected) < 0.01 * abs(expected)
