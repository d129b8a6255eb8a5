"""A drive before it runs: its parts, the way of the belt, its rest, what is implausible in it."""
