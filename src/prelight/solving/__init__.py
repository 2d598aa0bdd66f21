"""Light from a wanted picture: l from B. It may import what relights, never the renderer.

Read first: ``picture_target.py`` (a picture becomes a few small matrices), then ``search.py``.
"""
