"""The runs that the paper shows, and the elements it shows them on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import beltdyn as bd

from .paper_numbers import Links

__all__ = ["LINKS", "RAMP_END", "REVERSALS", "SOFT_SIGMA", "Runs", "runs"]

#: End of the ramp of the driving torque in case 1, its two reversals in case 2 [s].
RAMP_END, REVERSALS = 0.3, (0.25, 0.75)

#: Samples of a run, 0.5 ms apart: :func:`beltdyn_kubas.paper_numbers.read` needs 2 ms.
_SAMPLES = 2001
#: The smaller of the two values of sigma that the paper compares [1/m].
SOFT_SIGMA = 5e3
#: The chosen elements, indices from 0; the paper shows them in a drawing only, its Fig. 5.
LINKS = Links(case_1=9, case_2=15)


class Runs(NamedTuple):
    """The paper's three runs.

    Attributes:
        case_1: Driven up to 2 pi rad/s.
        case_2: Loaded both ways.
        case_2_soft: Case 2 with sigma = 5e3 1/m instead of 1e4.
    """

    case_1: bd.Result
    case_2: bd.Result
    case_2_soft: bd.Result


def runs(*, progress: bool = False) -> Runs:
    """Simulate case 1, case 2 and case 2 with the smaller sigma, 2001 samples each.

    Args:
        progress: Whether to show progress bars on stderr.

    Raises:
        SimulationError: A run cannot go on.
        Interrupted: Ctrl-C.
        BeltdynWarning: Not raised but issued: the paper's 60 links.
    """

    def run(scene: bd.Scene) -> bd.Result:
        t_eval = np.linspace(0.0, scene.t_end, _SAMPLES)
        return bd.simulate(*scene, t_eval=t_eval, progress=progress)

    return Runs(
        run(bd.scenes.kubas_case_1()),
        run(bd.scenes.kubas_case_2()),
        run(bd.scenes.kubas_case_2(sigma=SOFT_SIGMA)),
    )
