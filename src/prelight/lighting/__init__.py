"""What a designer sets: the light ``l`` of ``B = T·l``.

``environment`` (a radiance map around the scene, turned, scaled, tinted, and resampled to a cube map) rests on
``layouts`` (where each pixel of a map points), ``resampling`` (the compiled loops that keep the energy) and
``stock`` (environments of our own, painted by the pieces of ``sky``).

May import ``images``, ``bases``, ``arrays`` and ``errors``; never scenes, rays or transport.
Read ``environment.py`` first, then ``layouts.py``.
"""
