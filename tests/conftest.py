"""Tests run against the installed package, not the checkout that happens to lie beside them."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import tiers

WRONG = pytest.StashKey[str]()
ROOT = Path(__file__).resolve().parent.parent
# Tests run side by side: threads of BLAS, which it starts for small matrices too, only get in their
# way. Before anything imports NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Without one chosen, looking at matplotlib's settings imports pyplot, which then keeps all figures.
os.environ.setdefault("MPLBACKEND", "agg")
sys.path[:] = [entry for entry in sys.path if Path(entry or ".").resolve() != ROOT]


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """With -s no workers: what tests print would be lost in theirs."""
    return 0 if config.getoption("capture") == "no" else None


@pytest.hookimpl(tryfirst=True)  # before -m takes tests away
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Refuse marks of tiers without a guard; tests outside the default tier may take long."""
    tiers.deal(items)
    whole = not any("::" in argument for argument in config.args) and not config.getoption("lf", 0)
    if whole and tiers.are_all(items):
        config.stash[tiers.ALL] = list(items)
    if wrong := tiers.faults_of_marks(items, whole):
        if not hasattr(config, "workerinput"):
            raise pytest.UsageError("\n".join(wrong))
        config.stash[WRONG] = "\n".join(wrong)  # in a worker, pytest would not say what is wrong
    for item in items:
        if not tiers.is_default(item) and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(1800))


def pytest_runtest_setup(item: pytest.Item) -> None:
    if wrong := item.config.stash.get(WRONG, ""):
        pytest.fail(wrong, pytrace=False)


@pytest.fixture
def handlers() -> Iterator[None]:
    """Let a test set signal handlers; SIGINT is Python's own, whatever the shell has set."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGUSR1)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(params=["paper", "joint", "string"], scope="module")
def mesh(request: pytest.FixtureRequest) -> str:
    """Each discretisation in space (MODEL sections 2 and 3), as `drives.on_mesh` takes it."""
    return str(request.param)


# Fixtures of the tests of the binding. They import late: not before sys.path is as above.


@pytest.fixture(scope="module")
def model():
    from module_common import make_model

    return make_model()


@pytest.fixture(scope="module")
def rest(model):
    from module_common import INF

    from beltdyn import _core

    settling = _core.Simulation.settle(model, tolerance=1e-5)
    assert settling.advance(INF) is True
    return settling.state()


@pytest.fixture(scope="module")
def driven(model, rest):
    """Return the final state of a run under TORQUE."""
    from module_common import run

    return run(model, rest)[1]
