"""Pictures and maps, in and out: file formats, colour, tone mapping and error figures.

Rests on ``arrays``, ``errors`` and ``files`` only; NumPy, with Numba for run lengths and OpenEXR in a
process of its own. Read ``formats`` first (what can be read and written), then ``tonemap`` (linear
radiance to a display), ``metrics`` (two pictures compared).
"""
