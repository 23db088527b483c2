"""Whether a pose can be trusted, and why."""
