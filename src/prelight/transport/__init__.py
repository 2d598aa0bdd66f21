"""Rays to T: who sees which light, and how much of it arrives. Takes directions and arrays, never lights.

``ordering`` puts receivers so that neighbours trace alike, ``visibility`` traces tiles of receivers ×
directions, ``direct`` makes transfer vectors of what was seen, ``exact`` integrates without clusters.
"""
