"""The subcommands of the engine's command line, one per file: `add_parser` declares its arguments, `run` does it."""
