"""The error of a run, from other runs; and what those will cost."""
