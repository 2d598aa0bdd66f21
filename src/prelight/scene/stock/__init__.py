"""Scenes of our own, made by formula when asked for: no files, no rights of others.

`catalogue` lists them. `sculpture` composes one; `parts` holds what every scene is put together from, and
`band`, `plinth` and `ground` are such parts. May import what `scene` may. Read `catalogue` first.
"""
