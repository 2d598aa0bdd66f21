"""The command line: one file a command; parse, call, print. ``main`` maps errors to exit codes."""
