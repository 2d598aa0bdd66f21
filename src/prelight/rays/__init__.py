"""One small door for rays; it knows triangles and surfaces, not lights.

``mitsuba`` hands triangles to the renderer, ``surfaces`` materials too; ``plain`` traces shadow rays without it, for
where only a finished bake is at hand.
"""
