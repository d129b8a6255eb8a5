"""A drive before it runs: parts, route of the belt, tension at rest, plausibility of its data."""
