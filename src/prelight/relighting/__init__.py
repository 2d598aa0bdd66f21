"""B = T·l, live: one file for each kind of layer, kernels in Numba.

Imports drawing, lighting, encoding, bases and storage; never a scene, rays or transport: a bake is
relit on a machine without a renderer. Read ``relighter``, then ``environment``, then
``layer`` (what is on disk), ``light_tree`` (the light of clusters), ``disc_lights``, ``tile_kernels``.
For lamps that are steered: ``steerable_bake``, ``steerable``, ``plane_kernels``.
"""
