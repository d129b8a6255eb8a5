"""Frequency responses against runs, which know nothing of the linearisation.

A torque on the alternator, small beside what friction holds, sweeps over two resonances; when it
has ended the drive rings down. The whole record is transformed, so there is no window and no
leakage: the ratio of the transforms is the response at every line of the band. What is lightly
damped and would not ring down, the lateral modes of the spans from 106 Hz on, lies above the band.
"""

from __future__ import annotations

import numpy as np
import pytest
from drives import sprung_alternator
from numpy.typing import NDArray
from test_modes import two_pulleys

import beltdyn as bd

Array = NDArray[np.float64]
pytestmark = pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")

#: Sweep [Hz, s], its end with the ringing down [s], samples per second, band compared [Hz].
FIRST, LAST, SWEEP, END, SAMPLES = 5.0, 130.0, 1.6, 2.2, 1000.0
BAND = (10.0, 98.0)
RESIST = 0.02


def sweep(t: Array) -> Array:
    """A sine whose frequency rises linearly, faded in and out over 0.1 s; 0 after it."""
    size = np.clip(np.minimum(t, SWEEP - t) / 0.1, 0.0, 1.0)
    phase = FIRST * t + 0.5 * (LAST - FIRST) / SWEEP * t**2
    return np.asarray(size**2 * (3.0 - 2.0 * size) * np.sin(2.0 * np.pi * phase))


@pytest.mark.ci(guard="test_modes_swept.py::test_response_to_a_motion")
def test_swept_torque() -> None:
    """At rest, at each line, amplitude and phase, over resonances and their minima.

    What is off grows with the amplitude of the torque, for the drive is not linear: 0.07 % of the
    largest response at 0.01 N m, 0.27 % at 0.05, 1 % at 0.2 N m, the same at rtol 1e-6 and 1e-7. So
    0.1 % of the largest, and 1 % of the response itself, which falls to a hundredth of the largest
    and less between the resonances.
    """
    params, amplitude = sprung_alternator(0.1), 0.01
    state = bd.settle(params)
    t = np.arange(round(END * SAMPLES) + 1) / SAMPLES

    knots = np.arange(0.0, SWEEP, 1e-4)  # linear between them: 0.02 % less at 90 Hz
    pushing = bd.PiecewiseLinear(knots, amplitude * sweep(knots), pulley="alternator")
    resisting = bd.Viscous([0.0, RESIST, 0.0])
    result = bd.simulate(
        params,
        pushing + resisting,
        t[-1],
        motion={"crank": bd.PiecewiseLinear([0.0], [0.0])},
        initial=state,
        t_eval=t,
        rtol=1e-6,
        outputs=("pulleys.theta", "mounts.travel", "span_tension"),
    )
    frequency: Array = np.arange(t.size // 2 + 1) * (SAMPLES / t.size)
    within = (frequency > BAND[0]) & (frequency < BAND[1])
    pushed = np.fft.rfft(amplitude * sweep(t))[within]

    response = bd.frequency_response(
        params,
        state,
        frequency[within],
        torque="alternator",
        motion={"crank": 0.0},
        loads=resisting,
    )
    for name, history, expected in (
        ("alternator", result.pulleys.theta[:, 1], response.theta[:, 1]),
        ("tensioner", result.pulleys.theta[:, 2], response.theta[:, 2]),
        ("travel", result.mounts.travel[:, 0], response.travel[:, 0]),
        ("span 0", result.span_tension[:, 0], response.span_tension[:, 0]),
        ("span 1", result.span_tension[:, 1], response.span_tension[:, 1]),
    ):
        moved = history - history[0]
        # rung down: what is cut off at the end is no more than that of the largest motion
        assert np.abs(moved[-50:]).max() < 2e-3 * np.abs(moved).max()
        seen = np.fft.rfft(moved, axis=0)[within] / pushed
        off, size = abs(seen - expected), abs(expected)
        assert (off < 1e-3 * size.max()).all(), name
        assert (off < 1e-2 * size).all(), name
    # two resonances are in the band, and it is not they that make it easy
    assert np.count_nonzero(within) > 150
    tops = abs(response.theta[:, 2])
    inner = (tops[1:-1] > tops[:-2]) & (tops[1:-1] > tops[2:])
    assert np.allclose(frequency[within][1:-1][inner], [30.4, 86.5], atol=0.5)
    alternator = abs(response.theta[:, 1])
    assert alternator.max() > 10.0 * alternator.min()


def running_drive() -> bd.Params:
    """Two pulleys, friction a spring with a damper until it slips; a rotation and no arm."""
    return two_pulleys(
        n=160,
        belt={"bending_stiffness": 0.0},
        friction=bd.ElasticPlastic(mu=0.8, stiffness=1e8, damping=1e3),
        contact=bd.Contact(linear=1e9, damping=5e3),
    )


@pytest.mark.extended(guard="test_modes_swept.py::test_response_to_a_motion")
def test_swept_torque_running() -> None:
    """At 6 m/s: half the difference of two runs with the torque and its opposite.

    So what links make as they land, the same in both, is not in it. The belt that runs through the
    spans damps the rotation, 5 % in place of 0.4 % at rest, where the same torque turns the fan
    seven times as far. Six phases of the mesh, begun at six places of a run, put that resonance at
    47.3 to 47.6 Hz with a decay of 14.4 to 15.9 1/s (one phase: 47.6 to 48.3 Hz, 11 to 18 1/s), so
    0.4 Hz and a tenth of the damping are the mesh's: that is up to a tenth of the height, and
    2 pi 0.4 / 15 = 0.17 of it across, where the phase turns. Measured 2 % and 18 %. With 80 masses
    in place of 160 the mesh takes all the damping of such runs.
    """
    params, speed, amplitude = running_drive(), -120.0, 0.1
    motion = {"motor": bd.PiecewiseLinear([0.0], [speed])}
    state = bd.settle(params, speed={"motor": speed})
    steady = bd.PiecewiseLinear([0.0], [0.02 * float(state.omega[1])], pulley="fan")
    load = steady + bd.Viscous([0.0, 0.02])
    start = bd.simulate(params, load, 0.2, motion=motion, initial=state, rtol=1e-5).final_state
    t = np.arange(round(1.1 * SAMPLES) + 1) / SAMPLES
    size = np.clip(np.minimum(t, 0.6 - t) / 0.1, 0.0, 1.0)
    pushed = amplitude * size**2 * (3.0 - 2.0 * size) * np.sin(2.0 * np.pi * (15.0 + 50.0 * t) * t)
    runs = []
    for turn in (1.0, -1.0):
        push = bd.PiecewiseLinear(start.t + t, turn * pushed, pulley="fan")
        runs.append(
            bd.simulate(
                params,
                load + push,
                start.t + t[-1],
                motion=motion,
                initial=start,
                t_eval=start.t + t,
                rtol=1e-5,
                outputs=("pulleys.theta", "span_tension"),
            )
        )
    turned = 0.5 * (runs[0].pulleys.theta - runs[1].pulleys.theta)[:, 1]
    tension = 0.5 * (runs[0].span_tension - runs[1].span_tension)[:, 0]
    frequency: Array = np.arange(t.size // 2 + 1) * (SAMPLES / t.size)
    within = np.flatnonzero((frequency > 30.0) & (frequency < 65.0))[::2]
    # the torque is linear between samples, which the transform of samples takes for more
    given = np.fft.rfft(pushed)[within] * np.sinc(frequency[within] / SAMPLES) ** 2
    arguments = {"torque": "fan", "motion": {"motor": 0.0}, "loads": load}
    response = bd.frequency_response(params, start, frequency[within], phases=6, **arguments)
    assert response.phases == 6
    for history, expected in (
        (turned, response.theta[:, 1]),
        (tension, response.span_tension[:, 0]),
    ):
        seen = np.fft.rfft(history)[within] / given
        largest = abs(expected).max()
        assert abs(seen).max() == pytest.approx(largest, rel=0.1)
        assert (abs(seen - expected) < 0.2 * largest).all()
        assert np.median(abs(seen - expected) / abs(expected)) < 0.1
    resting = bd.settle(params)
    at_rest = bd.frequency_response(params, resting, frequency[within], **arguments)
    assert abs(at_rest.theta[:, 1]).max() > 3.0 * abs(response.theta[:, 1]).max()


def test_response_to_a_motion() -> None:
    """Two sines at once on the crank, when what they began with has decayed: amplitude and phase.

    The arm is damped so strongly that this takes 0.25 s; a span's tension and the pulleys' angles.
    """
    params, resisting = sprung_alternator(0.6), bd.Viscous([0.0, 0.02, 0.0])
    state, w, end, amplitude = bd.settle(params), 2.0 * np.pi * np.array([20.0, 60.0]), 0.5, 2e-4
    response = bd.frequency_response(
        params, state, w / (2.0 * np.pi), motion="crank", loads=resisting
    )
    assert (response.residual < 1e-7).all()
    turning = 1j * w[:, None] * response.theta
    np.testing.assert_allclose(response.omega, turning, rtol=1e-6, atol=1e-6 * w[0])

    def angle(t: float) -> float:
        """Faded in over 0.1 s."""
        fade = min(t / 0.1, 1.0)
        return amplitude * fade**2 * (3.0 - 2.0 * fade) * float(np.sin(w * t).sum())

    t = np.linspace(end - 0.25, end, 401)
    motion = {"crank": bd.Motion(angle=angle)}
    result = bd.simulate(params, resisting, end, motion, initial=state, t_eval=t, rtol=1e-5)
    basis = np.column_stack([*np.sin(np.outer(w, t)), *np.cos(np.outer(w, t)), np.ones_like(t), t])
    for history, expected in (
        (result.pulleys.theta[:, 1], response.theta[:, 1]),
        (result.pulleys.theta[:, 2], response.theta[:, 2]),
        (result.span_tension[:, 0], response.span_tension[:, 0]),
    ):
        fitted = np.linalg.lstsq(basis, history, rcond=None)[0]
        seen = (fitted[:2] + 1j * fitted[2:4]) / amplitude
        assert (abs(seen - expected) < 0.01 * abs(expected)).all()
