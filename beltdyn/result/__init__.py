"""The result of a run: with its files, as a labelled table, in an error."""
