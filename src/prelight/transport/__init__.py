"""Rays to T: who sees which light, and how much of it arrives. Takes directions and arrays, never lights.

``ordering`` puts receivers so that neighbours trace alike, ``visibility`` traces tiles of receivers ×
directions, ``direct`` makes transfer vectors of what was seen. ``eye`` finds what a camera sees and ``viewed``
makes transfer vectors toward it, of any BSDF; both answer to ``transfer``. ``exact`` integrates without
clusters, and ``path_tracing`` is the reference that is none of ours.

``gathering`` is one bounce between all vertices as a sparse matrix and ``bounces`` all of them; ``vantage`` says
where a vertex's rays begin and ``mesh_fitness`` whether a mesh holds its light.
"""
