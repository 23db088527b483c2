"""Processes of our own: how one is started, spoken to and ended."""
