"""Random drives: a run is right, warns by name, or fails by name; in small what
`benchmarks/claims.py` asks at large.

A run without a warning of its accuracy may be off its claim by FIVE: an estimate made from the run
alone is worth its order of magnitude, and it is a mean that is compared, over samples, of errors
that come in bursts.
"""

from __future__ import annotations

import functools
from itertools import product
from typing import Any

import attrs
import drives
import judged
import pytest
import random_drives

OFF = 5.0
#: Where neither an estimate nor a tolerance claims anything, as for fixed steps of "rk4": without a
#: word they are to be good for a tenth.
UNCLAIMED = 0.1 / OFF
#: Cheap ones of the sample, with each method and with fixed steps; the sample; and the rest.
DEFAULT = {"any": (0, 2, 4, 6, 13, 16, 17, 18, 19), "calm": (2, 5, 6, 13, 15, 16, 17, 19)}
LONG_ONES = (10, 14)
ANY, CALM = range(40), range(20)
#: Runs of a quarter of the benchmark's length, and references of at most so many steps.
RADIANS, MAX_REFERENCE_STEPS = 0.25 * random_drives.RADIANS, 30_000

IN_CI = pytest.mark.ci(guard="other cases")
EXTENDED = pytest.mark.extended(guard="other cases")


@functools.cache
def record(seed: int, kind: str) -> dict[str, Any]:
    return judged.judge(seed, kind, MAX_REFERENCE_STEPS, RADIANS)


def warned_or_accurate(run: dict[str, Any]) -> bool:
    claim = UNCLAIMED if run["claim"] is None else run["claim"]
    warned = run["outcome"] in ("failed", "settle") or run["accuracy"]
    return bool(warned or run["error"] <= OFF * claim)


def cases() -> list[Any]:
    def marks(seed: int, kind: str) -> Any:
        if seed in DEFAULT[kind]:
            return ()
        return EXTENDED if seed not in CALM or (kind == "any" and seed in LONG_ONES) else IN_CI

    drives = [*product(ANY, ["any"]), *product(CALM, ["calm"])]
    return [pytest.param(*drive, marks=marks(*drive)) for drive in drives]


@pytest.mark.one_in(2)
@pytest.mark.parametrize(("seed", "kind"), cases())
def test_a_random_drive_is_right_or_says_so(seed: int, kind: str) -> None:
    """A quiet run keeps its claim, no pulley is lost unsaid, and no run goes beyond its budget of
    steps.
    """
    run = record(seed, kind)
    unknown = run["outcome"] in ("no_reference", "doubtful")
    assert unknown or warned_or_accurate(run), f"{run['method']}: {run['error']}, {run['claim']}"
    assert not run["lost"] or run["warnings"], f"the belt left {run['lost']}"
    assert not run["over"]


@pytest.mark.parametrize(
    ("seed", "kind", "length"),
    [
        *((seed, "any", ()) for seed in (183, 198)),
        *(pytest.param(seed, "any", (), marks=EXTENDED) for seed in (21, 57, 78, 86, 113, 171)),
        (1302, "any", (MAX_REFERENCE_STEPS, RADIANS)),
        *(
            pytest.param(seed, "any", (MAX_REFERENCE_STEPS, RADIANS), marks=IN_CI)
            for seed in (1174, 1687)
        ),
        (
            534268,
            "varied",
            (MAX_REFERENCE_STEPS, 0.02 * random_drives.RADIANS),
        ),  # 1.4 rounds of a wave
        (
            726200,
            "varied",
            (MAX_REFERENCE_STEPS, 0.16 * random_drives.RADIANS),
        ),  # links land, in two rounds of 59
        (
            727815,
            "varied",
            (MAX_REFERENCE_STEPS, 0.16 * random_drives.RADIANS),
        ),  # a belt sticks, and lets go
        pytest.param(
            727399, "varied", (MAX_REFERENCE_STEPS, 0.16 * random_drives.RADIANS), marks=IN_CI
        ),
    ],
)
def test_drives_that_were_off_unsaid(seed: int, kind: str, length: tuple[float, ...]) -> None:
    """Found by the benchmark, at its length of run or with `--short`: quietly off by more than five
    claims once; what grew, grew towards the end, or within a round or two of a wave.
    """
    assert warned_or_accurate(judged.judge(seed, kind, *length, many=kind == "varied"))


@pytest.mark.parametrize("seeds", [DEFAULT["calm"], pytest.param(CALM, marks=IN_CI)])
def test_calm_drives_run_and_are_not_warned_about(seeds: tuple[int, ...]) -> None:
    """One in twenty at most: a warning that comes too often is not read. None fails."""
    runs = [record(seed, "calm") for seed in seeds]
    assert not [run["symbol"] for run in runs if run["symbol"]]
    warned = [run["warnings"] for run in runs if set(run["warnings"]) - {"mesh"}]
    assert len(warned) <= 0.05 * len(runs), warned


@pytest.mark.extended(guard="test_claims.py::test_a_random_drive_is_right_or_says_so")
def test_most_are_judged() -> None:
    """What has no reference, or none that is known well enough, is not held to anything: at most
    a fifth.
    """
    runs = [record(seed, "any") for seed in ANY] + [record(seed, "calm") for seed in CALM]
    unknown = [run for run in runs if run["outcome"] in ("no_reference", "doubtful")]
    assert len(unknown) <= 0.2 * len(runs)


def test_a_belt_that_left_a_pulley_is_told() -> None:
    result = judged.quiet(*drives.plain_scene()[:2], 1e-3, t_eval=[0.0, 1e-3])
    end = result.final_state
    final = attrs.evolve(end, x=end.x + 0.25 * (end.x < 0.1))  # past pulley 0
    assert (judged.lost(result), judged.lost(attrs.evolve(result, final_state=final))) == ([], [0])
