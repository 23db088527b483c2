"""What every other folder may use: files written whole or not at all."""
