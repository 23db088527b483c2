"""What `track` does: one plate, or several after each other."""
