"""Outputs of a run, and what follows from single arrays of them."""
