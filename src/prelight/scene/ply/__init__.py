"""PLY files, read with NumPy: the header's tables, then its columns, then a mesh.

May import `scene.mesh` and what that rests on. Read `reading` first; `walking` holds the Numba kernels
for records of varying length and is imported only for files that have them.
"""
