"""Where many runs are done."""
