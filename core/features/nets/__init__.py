"""Networks run in a process of their own: their files, their input, and what is said to that process."""
