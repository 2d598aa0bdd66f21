"""One small door for rays. ``mitsuba`` hands triangles to the renderer; it knows scenes, not lights."""
