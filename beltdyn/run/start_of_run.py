"""What a run was called with, as bytes: enough to call it again in another process."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..base import npz
from ..base.checks import Array, real, sample_times
from ..base.naming import ByPulley
from ..base.run_options import USUAL, Options
from ..drive.params import Params
from ..drive.scene import Scene
from ..loads.motions import MotionLike
from ..loads.torques import TorqueLike, Viscous
from ..outputs.accuracy_report import WORDS, Expected
from ..outputs.selection import chosen
from ..outputs.state import SIZES, State, from_file

__all__ = ["Start", "pack", "span", "unpack"]

#: Those in text; times are an array.
_OPTIONS = {name: row for name, row in Options.rows().items() if row.kind is not np.ndarray}
_KIND: dict[str, tuple[type, ...]] = {
    "version": (str,),
    "kernels": (str,),
    "torque": (bool,),
    "motion": (bool, type(None)),
    "t_end": (float,),
    **{
        name: (row.kind,) if getattr(USUAL, name) is not None else (row.kind, type(None))
        for name, row in _OPTIONS.items()
    },
    "expected": (list, type(None)),
    "outputs": (list, type(None)),
    "settle_time": (float,),
    "every": (float,),
    "t": (float,),
    "residual": (float, type(None)),
}
_INITIAL = {f"initial.{name}": name for name, *_ in _core.STATE_FIELDS}
_NAMES = {"meta.json", "scene.toml", "t_eval", "breakpoints", *_INITIAL}


@attrs.frozen(kw_only=True)
class Start:
    """How a run began.

    Attributes:
        scene: Drive, torque, end and motions. As read from a file, ``torque_fn`` and ``motion`` are
            None where the file could not hold them, because they are functions.
        initial: The state it began from.
        t_eval: Sample times (n_t,) [s].
        outputs: What is kept, as :func:`beltdyn.outputs.selection.chosen` returns it.
        options: How it is integrated.
        expected: Errors that pilot runs have shown.
        settle_time: Wall time of settling before it [s].
        kernels: Instruction level of the core.
        has_motion: Whether motions are prescribed.
    """

    scene: Scene
    initial: State
    t_eval: Array
    outputs: tuple[str, ...] | None
    options: Options
    expected: Expected | None
    settle_time: float
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
        "t": start.initial.t,
        "residual": start.initial.residual,
    }
    values = {
        "meta.json": json.dumps(meta),
        "scene.toml": text,
        "t_eval": start.t_eval,
        "breakpoints": start.options.breakpoints,
        **{saved: getattr(start.initial, name) for saved, name in _INITIAL.items()},
    }
    return npz.pack(values)


def unpack(content: bytes) -> tuple[Start, float]:
    """Read what :func:`pack` gave."""
    arrays = npz.unpack(content, _NAMES)
    for name in _NAMES - set(arrays):
        raise ValueError(f"{name} is missing")
    meta = _meta(npz.text("meta.json", arrays["meta.json"]))
    # With a line break it is always read as text, never as the path of another file.
    scene = Scene.from_toml(npz.text("scene.toml", arrays["scene.toml"]) + "\n")
    numbers = {
        name: npz.number_array(name, arrays[name], np.float64, (arrays[name].size,))
        for name in ("t_eval", "breakpoints")
    }
    initial = _initial(arrays, meta, scene.params)
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
        expected=_expected(meta["expected"]),
        settle_time=meta["settle_time"],
        kernels=meta["kernels"],
        has_motion=meta["motion"] is not None,
    )
    return start, meta["every"]


def _texts(scene: Scene) -> tuple[str, bool, bool | None]:
    """Return a scene as TOML, with what can be written of its loads.

    Also whether the torque is in it, and the motions, None if there are none. In the text the run
    ends at 1 s, since those of other scenes may not end before 0.
    """

    def text(torque: TorqueLike, motion: ByPulley[MotionLike] | None) -> str | None:
        try:
            return Scene(scene.params, torque, 1.0, motion).to_toml()
        except (KeyError, TypeError):  # a function, or a class of the user's own
            return None

    nothing = Viscous(np.zeros(len(scene.params.pulleys)))
    torque = text(scene.torque_fn, None) is not None
    motion = text(nothing, scene.motion) is not None if scene.motion else None
    whole = text(scene.torque_fn if torque else nothing, scene.motion if motion else None)
    assert whole is not None
    return whole, torque, motion


def _meta(content: str) -> dict[str, Any]:
    try:
        table = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"meta.json is not valid JSON: {error}") from None
    version = table.get("version") if isinstance(table, dict) else None
    if version != _core.__version__ and isinstance(version, str):
        raise ValueError(
            f"it was written by beltdyn {version:.40}, and this is {_core.__version__}: a run goes "
            "on in the version that began it"
        )
    if not isinstance(table, dict) or set(table) != set(_KIND):
        raise ValueError("meta.json does not hold what it should")
    for name, kinds in _KIND.items():
        if type(table[name]) not in kinds:
            raise ValueError(f"meta.json: {name} is of another kind than it should be")
    return table


def _expected(values: list[Any] | None) -> Expected | None:
    if values is None:
        return None
    if [type(one) for one in values] != [str, float, float] or values[0] not in WORDS:
        raise ValueError("meta.json: expected is of another kind than it should be")
    return Expected(quantity=values[0], space=values[1], time=values[2])


def _initial(arrays: Mapping[str, NDArray[Any]], meta: Mapping[str, Any], params: Params) -> State:
    fields = {
        name: from_file(saved, SIZES[name], arrays[saved]) for saved, name in _INITIAL.items()
    }
    state = State(**fields, t=meta["t"], residual=meta["residual"])
    state.check_fits(params)
    return state
