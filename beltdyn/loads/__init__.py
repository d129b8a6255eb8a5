"""What drives a drive: torques, loads of single pulleys, prescribed motions."""
