"""GLB files, read with NumPy: the container's chunks, a checked document, its nodes, its numbers.

May import `scene.mesh`, `scene.normals` and what they rest on. Read `reading` first.
"""
