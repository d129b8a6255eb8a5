"""Stored runs of the oracle are what the oracle gives today, and say so when they are not."""

from __future__ import annotations

import dataclasses

import attrs
import numpy as np
import pytest
import reference_run
import stored_runs
from stored_runs import Case, Runs, Stored

import beltdyn as bd

OF_TESTS = stored_runs.all_runs()
ALL = [(runs, name) for runs in OF_TESTS for name in runs.cases]
IDS = [f"{runs.module}/{runs.slugs[name]}" for runs, name in ALL]
#: The cheapest there is.
SMALL = ALL[IDS.index("test_oracle/string-case-1-from-rest")]


def change_of(stored: Stored, case: Case, samples: int | None) -> float:
    """How far a run is from the stored one, over ten times the tolerance: other versions of SciPy
    and NumPy round differently. Slip and ledger are quadratures, to 1e-6 of the largest.
    """
    model, again = stored.oracle, case.integrate(stored.start, samples).y
    tol = 10 * case.tol * np.sqrt(model.size)
    weights = reference_run.error_weights(model, model.pack(stored.start), tol)
    change = np.abs(again - stored.y[:samples])
    of_rest = [
        np.max(np.abs(part(again) - part(stored.y)[:samples]))
        / (np.max(np.abs(part(stored.y))) or 1.0)  # without friction nothing slips
        for part in (lambda y: model.memory(y)[:, -1], model.ledger)
    ]
    return max(float(np.max(change / weights)), max(of_rest) / 1e-6)


def test_the_oracle_gives_the_first_sample_of_a_run_again() -> None:
    """And an oracle that differs by a millionth of its axial stiffness does not."""
    stored = SMALL[0][SMALL[1]]
    assert change_of(stored, stored.case, 1) <= 1.0
    stiffness = stored.oracle.axial_stiffness * (1 + 1e-6)
    other = dataclasses.replace(stored.oracle, axial_stiffness=stiffness)
    assert change_of(stored, attrs.evolve(stored.case, oracle=other), 1) > 1.0


@pytest.mark.extended(
    guard="test_stored_runs.py::test_the_oracle_gives_the_first_sample_of_a_run_again"
)
@pytest.mark.parametrize(("runs", "name"), ALL, ids=IDS)
def test_the_oracle_gives_a_stored_run_again(runs: Runs, name: str) -> None:
    stored = runs[name]
    assert change_of(stored, stored.case, None) <= 1.0


def test_a_file_for_each_run_and_small() -> None:
    files = list(stored_runs.DIRECTORY.rglob("*.*"))
    assert set(files) == {runs.path(name) for runs, name in ALL}
    assert sum(path.stat().st_size for path in files) < 3_000_000


def test_stale_and_missing_files_are_named_with_the_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    runs, name = SMALL
    case = runs[name].case
    message = rf"tests/data/{runs.module}/{runs.slugs[name]}\.npz %s; if the change was "
    message += r"meant: python tests/stored_runs\.py --stale$"
    other = bd.PiecewiseLinear([0.0], [[1.0, -2.0]])
    for change, what in (
        ({"torque": other}, r"is of other inputs \(stops, torque\)"),
        ({"tol": 2e-9, "after": case.after[:2]}, r"is of other inputs \(after, tol\)"),
    ):
        changed = Runs(runs.module, {name: lambda: attrs.evolve(case, **change)})  # noqa: B023
        with pytest.raises(pytest.fail.Exception, match=message % what):
            changed[name]
    monkeypatch.setattr(stored_runs, "hash_of_oracle", lambda: "another")
    with pytest.raises(pytest.fail.Exception, match=message % "is of an oracle that has changed"):
        runs[name]
    monkeypatch.setattr(stored_runs, "DIRECTORY", stored_runs.DIRECTORY / "nowhere")
    with pytest.raises(pytest.fail.Exception, match=message % "is missing"):
        runs[name]


def test_the_command_wants_to_know_which_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["stored_runs.py"])
    with pytest.raises(SystemExit) as ended:
        stored_runs.main()
    assert ended.value.code == 2 and "usage" in capsys.readouterr().err
