"""What a run is asked for, and what follows from single arrays of it."""
