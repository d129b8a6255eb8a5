"""Scenes that are TOML files, in the folder ``drives`` beside this module."""

from __future__ import annotations

from pathlib import Path

import attrs

from ..drive.scene import Scene

__all__ = ["kept"]

_FOLDER = Path(__file__).with_name("drives")


def kept(name: str, n_bodies: int | None = None) -> Scene:
    """Read the scene in a file, its belt of that many links; None: of as many as it has there."""
    scene = Scene.from_toml(_FOLDER / f"{name}.toml")
    if n_bodies is None:
        return scene
    params = scene.params
    belt = attrs.evolve(params.belt, n_bodies=n_bodies)
    return scene._replace(params=attrs.evolve(params, belt=belt))
