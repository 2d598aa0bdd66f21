"""Finite spaces of light: directions, solid angles and trees over them.

Imports only arrays and errors. Read ``cube_map`` first, then ``quadtree``.
"""
