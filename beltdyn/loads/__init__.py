"""Torques, loads of single pulleys, prescribed motions."""
