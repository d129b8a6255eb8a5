"""Shared by all rooms: checks, names of pulleys, files, texts, warnings."""
