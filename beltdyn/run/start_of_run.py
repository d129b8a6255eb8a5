"""What a run was called with, as bytes: enough to call it again in another process."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from .. import _core
from ..base import plain
from ..base.checks import Array, real, sample_times
from ..base.naming import ByPulley
from ..base.run_options import Options
from ..drive.scene import Scene
from ..loads.motions import MotionLike
from ..loads.torques import TorqueLike, Viscous
from ..outputs.accuracy_report import WORDS, Expected
from ..outputs.selection import chosen
from ..outputs.state import State

#: What a file has of a start: by itself, and as it stands there.
_OWN: dict[str, Any] = {
    "version": str,
    "every": float,
    "scene": str,
    "torque": bool,
    "motion": bool | None,
    "t_end": float,
    "expected": list | None,
}
_OF_START: dict[str, Any] = {
    "options": Options,
    "t_eval": Array,
    "initial": State,
    "outputs": tuple[str, ...] | None,
    "settle_time": float,
    "kernels": str,
}


@attrs.frozen(kw_only=True)
class Start:
    """How a run begins, all checked; of one read from a file loads that were functions are None."""

    scene: Scene
    options: Options
    t_eval: Array
    initial: State | None = None  # None: at rest, or settled at the speeds of its motions
    outputs: tuple[str, ...] | None = None  # as of ``chosen``
    expected: Expected | None = None
    settle_time: float = 0.0  # wall time [s]
    kernels: str = attrs.field(factory=_core.kernel_level)
    has_motion: bool = attrs.field()

    @has_motion.default
    def _has_motion(self) -> bool:
        return bool(self.scene.motion)


def span(initial: State | None, t_end: float) -> tuple[float, float]:
    """Return the times at which a run begins and ends, checked."""
    start = 0.0 if initial is None else initial.t
    end = real("t_end", t_end, "s")
    if end <= start:
        raise ValueError(f"t_end must be > initial.t ({start:g} s), got {end:g} s")
    return start, end


def pack(start: Start, every: float) -> bytes:
    """Return the bytes of how a run began, and how often it is to be written."""
    text, torque, motion = _texts(start.scene)
    own = {
        "version": _core.__version__,
        "every": every,
        "scene": text,
        "torque": torque,
        "motion": motion,
        "t_end": float(start.scene.t_end),
        "expected": start.expected and attrs.astuple(start.expected),
    }
    return plain.written(own | {name: getattr(start, name) for name in _OF_START}).encode()


def unpack(content: bytes) -> tuple[Start, float]:
    """Read what :func:`pack` gave."""
    found = plain.parse("its beginning", content)
    version = found.get("version")
    if version != _core.__version__ and isinstance(version, str):
        raise ValueError(
            f"it was written by beltdyn {version:.40}, and this is {_core.__version__}: a run goes "
            "on in the version that began it"
        )
    given: dict[str, Any] = plain.table(_OWN | _OF_START, "its beginning", found, prefix="")
    if (expected := given["expected"]) is not None:
        if [type(one) for one in expected] != [str, float, float] or expected[0] not in WORDS:
            raise ValueError("expected is of another kind than it should be")
        expected = Expected(quantity=expected[0], space=expected[1], time=expected[2])
    # With a line break it is always read as text, never as the path of another file.
    scene = Scene.from_toml(given["scene"] + "\n")
    given["initial"].check_fits(scene.params)
    begin, end = span(given["initial"], given["t_end"])
    own = {name: given.pop(name) for name in _OWN}
    given["t_eval"] = sample_times("t_eval", given["t_eval"], begin, end)
    given["outputs"] = chosen(given["outputs"], given["options"].ledger)
    scene = Scene(
        scene.params,
        scene.torque_fn if own["torque"] else None,
        end,
        scene.motion if own["motion"] else None,
    )
    has_motion = own["motion"] is not None
    return Start(scene=scene, expected=expected, has_motion=has_motion, **given), own["every"]


def _texts(scene: Scene) -> tuple[str, bool, bool | None]:
    """Return a scene as TOML; whether its torque is in it, and its motions (None: it has none)."""

    def text(torque: TorqueLike, motion: ByPulley[MotionLike] | None) -> str | None:
        try:
            # the end of a scene is beyond 0, that of a run need not be
            return Scene(scene.params, torque, 1.0, motion).to_toml()
        except TypeError:  # a function, or a class of the user's own
            return None

    nothing = Viscous(np.zeros(len(scene.params.pulleys)))
    torque = text(scene.torque_fn, None) is not None
    motion = text(nothing, scene.motion) is not None if scene.motion else None
    whole = text(scene.torque_fn if torque else nothing, scene.motion if motion else None)
    assert whole is not None
    return whole, torque, motion
