"""Scenes of our own, made by formula when asked for: no files, no rights of others.

`catalogue` lists them. `sculpture`, `cornell` and `still_life` compose one each; `parts` holds what every scene is put
together from, and `band`, `revolved`, `cloth`, `plinth`, `ground` and `floor_plots` are such parts; `patterns` draws
textures. May import what `scene` may. Read `catalogue` first.
"""
