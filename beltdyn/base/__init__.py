"""What all rooms use: checks, names of pulleys, files, texts, warnings."""
