"""Running: settling, simulating, writing as one goes, going on."""
