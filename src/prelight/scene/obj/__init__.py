"""Wavefront OBJ and MTL, read with NumPy: statements, then polygons, then a mesh and its materials.

May import `scene.mesh`, `files` and `images.textures` and what those rest on. Read `reading` first, then
`statements`, which turns the text into arrays; `polygons` cuts faces into triangles; `library` and `surfaces`
read MTL and make materials of it.
"""
