"""What a designer sets: the light ``l`` of ``B = T·l``.

A ``rig`` holds everything a designer sets (``rig_file``: what may stand in its file). An ``environment`` (a radiance
map around the scene: turned, scaled, tinted, blended, painted, resampled to a cube map, with ``disc`` lights in front)
rests on ``opening`` and ``layouts`` (which pixel of which file looks where), ``radiance_map`` (the checked pixels),
``resampling`` with its compiled loops ``scattering`` and ``overlapping`` (no light is lost), ``lookup`` (radiance along
directions), ``regions`` with ``cap_kernels`` and ``window_kernels`` (what discs and paint cover), ``quantities``
(numbers and directions, checked), and ``sky`` (environments of our own, painted with the pieces of ``painting``).

May import ``images``, ``bases``, ``files``, ``arrays`` and ``errors``; never scenes, rays or transport.
Read ``environment.py`` first, then ``layouts.py``.
"""
