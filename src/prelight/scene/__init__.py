"""What is lit: static triangles, one diffuse albedo a vertex, and the door to Mitsuba.

`loading` makes a `geometry.Scene` of a path, a trimesh object or ``stock:NAME``: the readers are the folders
`ply` and `gltf` and the file `trimesh_objects`, and `mesh` checks and completes what any of them found.
`normals` and `floor` are geometry; `llvm` and `variant` start Mitsuba.

May import `arrays`, `errors`, `files`, `camera` and `receivers`; never light, storage or what bakes.
Only `variant` imports Mitsuba, and only when called. Read `geometry` first, then `loading` and `mesh`.
"""
