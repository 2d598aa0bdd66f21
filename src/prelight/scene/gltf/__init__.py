"""glTF files, read with NumPy: container and buffers, a checked document, its nodes, numbers and materials.

May import `scene.mesh`, `images.textures` and what they rest on. Read `reading` first.
"""
