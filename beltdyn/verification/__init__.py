"""How far off a run is, from other runs; and what those will cost."""
