"""Is it true? Machine speeds, error figures and statistics; may import everything but the command line."""
