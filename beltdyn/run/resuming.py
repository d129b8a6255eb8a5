"""Going on with a run that was stopped, from the file that it was written to as it went."""

from __future__ import annotations

import os

import attrs

from ..base.checks import flag
from ..base.described import suggesting
from ..base.naming import ByPulley
from ..loads.motions import MotionLike
from ..loads.torques import TorqueLike
from ..result.result import Result
from .checkpoints import Continued
from .run import once


@suggesting
def resume(
    path: str | os.PathLike[str],
    torque_fn: TorqueLike | None = None,
    motion: ByPulley[MotionLike] | None = None,
    *,
    max_steps: int | None = None,
    progress: bool = False,
    checkpoint: bool = True,
    every: float | None = None,
) -> Result:
    """Go on with a run of ``simulate(..., checkpoint=path)``, however it was stopped.

    The result is that of the whole run, and the same bit for bit as without the stop: samples,
    final state, counters and warnings. Only times differ: those of ``result.stats`` are the sums
    over all parts. For a run that had finished, the result is returned again. What was computed
    after the last write that is whole is computed again. A write that was cut off has a journal
    beside the file (``path`` with "-journal"): keep the two together.

    The same bits need the same version of beltdyn, compiler and instruction level of the C core;
    otherwise it is refused. On a processor that has more, set ``BELTDYN_KERNELS`` to the level that
    the run began with (``result.stats.kernels``); one that is to move to any processor is begun
    with ``BELTDYN_KERNELS=baseline``.

    Args:
        path: The file.
        torque_fn: The torque, if it was a function, which a file cannot hold: the same one again.
            That it is the same cannot be checked of functions; of torque objects it is.
        motion: All prescribed motions, if one of them was a function.
        max_steps: A limit other than that of the run, which may have ended by it.
        progress: Whether to show a progress bar on stderr (needs ``rich``).
        checkpoint: Whether to go on writing to the file; False: it is only read, and may be
            read-only.
        every: Wall time between two writes [s]; None: as before.

    Raises:
        OSError: The file cannot be read, or not written with ``checkpoint``; it need not be
            damaged then. BlockingIOError: another run is writing to it.
        ValueError: It is not such a file, it is damaged, of another version
            or instruction level, or of another run than the torque or motion given; or these are
            needed. One line says which.
        Exception: What :func:`beltdyn.simulate` raises, with the result up to there.
    """
    with Continued(path, flag("checkpoint", checkpoint), every) as recorder:
        start = recorder.start
        torque = start.scene.torque_fn if torque_fn is None else torque_fn
        motions = start.scene.motion if motion is None else motion
        for name, value, given in (
            ("torque_fn", torque, True),
            ("motion", motions, start.has_motion),
        ):
            if given and value is None:
                raise ValueError(
                    f"the run in {recorder.path} had a function as {name}, which a file cannot "
                    f"hold: give the same one again, in Python, beltdyn.resume({recorder.path!r}, "
                    f"{name}=...)"
                )
        options = start.options
        if max_steps is not None:
            options = attrs.evolve(options, max_steps=max_steps)
        scene = start.scene._replace(torque_fn=torque, motion=motions)
        start = attrs.evolve(start, scene=scene, options=options)
        return once(start, progress=flag("progress", progress), recorder=recorder)[0]
