from .hard_scene import Entry
SCENES: dict[str, Entry] = {}
