"""What a run was called with, as bytes: enough to call it again in another process."""

from __future__ import annotations

import json
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base import npz, plain
from ..base.checks import Array, real, sample_times
from ..base.naming import ByPulley
from ..base.run_options import USUAL, Options
from ..drive.scene import Scene
from ..loads.motions import MotionLike
from ..loads.torques import TorqueLike, Viscous
from ..outputs.accuracy_report import WORDS, Expected
from ..outputs.selection import chosen
from ..outputs.state import SIZES, State

#: Those in text; times are an array.
_OPTIONS = {name: row for name, row in Options.rows().items() if row.kind is not np.ndarray}
_KIND: dict[str, Any] = {
    "version": str,
    "kernels": str,
    "torque": bool,
    "motion": bool | None,
    "t_end": float,
    **{
        name: row.kind if getattr(USUAL, name) is not None else row.kind | None
        for name, row in _OPTIONS.items()
    },
    "expected": list | None,
    "outputs": tuple[str, ...] | None,
    "settle_time": float,
    "every": float,
    "t": float,
    "residual": float | None,
}
_INITIAL = {f"initial.{name}": name for name in SIZES}
_NAMES = {"meta.json", "scene.toml", "t_eval", "breakpoints", *_INITIAL}


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
    initial = start.initial
    assert initial is not None  # a run has been settled before it is written
    meta = {
        "version": _core.__version__,
        "kernels": start.kernels,
        "torque": torque,
        "motion": motion,
        "t_end": float(start.scene.t_end),
        **{name: getattr(start.options, name) for name in _OPTIONS},
        "expected": start.expected and attrs.astuple(start.expected),
        "outputs": start.outputs,
        "settle_time": start.settle_time,
        "every": every,
        "t": initial.t,
        "residual": initial.residual,
    }
    values = {
        "meta.json": json.dumps(meta),
        "scene.toml": text,
        "t_eval": start.t_eval,
        "breakpoints": start.options.breakpoints,
        **{saved: getattr(initial, name) for saved, name in _INITIAL.items()},
    }
    return npz.pack(values)


def unpack(content: bytes) -> tuple[Start, float]:
    """Read what :func:`pack` gave."""
    arrays = npz.unpack(content, _NAMES)
    for name in _NAMES - set(arrays):
        raise ValueError(f"{name} is missing")
    meta = _meta(arrays["meta.json"])
    # With a line break it is always read as text, never as the path of another file.
    scene = Scene.from_toml(npz.text("scene.toml", arrays["scene.toml"]) + "\n")
    numbers = {
        name: npz.number_array(name, arrays[name], np.float64, (arrays[name].size,))
        for name in ("t_eval", "breakpoints")
    }
    initial = State._of_file(arrays, "initial.", t=meta["t"], residual=meta["residual"])
    initial.check_fits(scene.params)
    begin, end = span(initial, meta["t_end"])
    start = Start(
        scene=Scene(
            scene.params,
            scene.torque_fn if meta["torque"] else None,
            end,
            scene.motion if meta["motion"] else None,
        ),
        initial=initial,
        t_eval=sample_times("t_eval", numbers["t_eval"], begin, end),
        outputs=chosen(meta["outputs"], meta["ledger"]),
        options=Options(
            **{name: meta[name] for name in _OPTIONS}, breakpoints=numbers["breakpoints"]
        ),
        expected=meta["expected"],
        settle_time=meta["settle_time"],
        kernels=meta["kernels"],
        has_motion=meta["motion"] is not None,
    )
    return start, meta["every"]


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


def _meta(content: NDArray[Any]) -> dict[str, Any]:
    found = plain.parse("meta.json", content)
    version = found.get("version")
    if version != _core.__version__ and isinstance(version, str):
        raise ValueError(
            f"it was written by beltdyn {version:.40}, and this is {_core.__version__}: a run goes "
            "on in the version that began it"
        )
    meta: dict[str, Any] = plain.table(_KIND, "meta.json", found, prefix="")
    if (expected := meta["expected"]) is not None:
        if [type(one) for one in expected] != [str, float, float] or expected[0] not in WORDS:
            raise ValueError("meta.json: expected is of another kind than it should be")
        meta["expected"] = Expected(quantity=expected[0], space=expected[1], time=expected[2])
    return meta
