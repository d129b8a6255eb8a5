"""Scenes by name: built-in ones, hard ones and TOML files."""

from __future__ import annotations

import os
from pathlib import Path

from ..base.checks import close_to
from ..drive.scene import Scene
from .hard_scenes import SCENES as hard
from .machines import SCENES


def names() -> tuple[str, ...]:
    """List the names :func:`get` knows."""
    return tuple(SCENES)


def describe(name: str) -> str:
    """Return the first line of a scene's description."""
    return (SCENES[name].__doc__ or "").partition("\n")[0]


def get(name: str) -> Scene:
    """Look up a scene by name, with hyphens or underscores; hard ones as "hard/NAME".

    Raises:
        ValueError: There is none; the message lists the names.
    """
    key = name.replace("_", "-").lower()
    family, _, of_hard = key.partition("/")
    if family == "hard":
        if not of_hard:
            raise ValueError("hard scenes are called hard/NAME; `beltdyn scenes --hard` lists them")
        if of_hard not in hard:
            raise ValueError(
                f"no hard scene is called {of_hard!r}{close_to(of_hard, hard)}; "
                "`beltdyn scenes --hard` lists them"
            )
        return hard[of_hard]
    if key not in SCENES:
        known = [*SCENES, *(f"hard/{one}" for one in hard)]
        raise ValueError(
            f"no scene is called {name!r}{close_to(key, known)}; there are "
            f"{', '.join(SCENES)}, and the hard ones that `beltdyn scenes --hard` lists"
        )
    return SCENES[key]()


def find(scene: str | os.PathLike[str]) -> Scene:
    """Return a scene by its name, or from a TOML file."""
    if os.path.isdir(scene):
        raise ValueError(f"{os.fspath(scene)} is a folder, not a scene")
    path = os.fspath(scene)
    if path.endswith(".toml") or os.path.isfile(path):
        return Scene.from_toml(Path(path))
    folder, ending = Path(path).parent, Path(path).suffix
    if ending and folder.is_dir() and not path.startswith("hard/"):
        near = close_to(Path(path).name, [one.name for one in folder.glob("*.toml")])
        raise ValueError(f"there is no file {path}{near}, and scenes in files end with .toml")
    return get(path)
