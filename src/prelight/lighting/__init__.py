"""What a designer sets: the light ``l`` of ``B = T·l``.

A ``rig`` holds everything a designer sets. An ``environment`` (a radiance map around the scene: turned, scaled,
tinted, resampled to a cube map) rests on ``layouts`` (which pixel of a map looks where), ``resampling`` with its
compiled loops ``scattering`` and ``overlapping`` (no light is lost), ``lookup`` (radiance along directions), and
``sky`` (environments of our own, painted with the pieces of ``painting``).

May import ``images``, ``bases``, ``files``, ``arrays`` and ``errors``; never scenes, rays or transport.
Read ``environment.py`` first, then ``layouts.py``.
"""
