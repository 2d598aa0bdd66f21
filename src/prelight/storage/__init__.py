"""The bake on disk: a folder of Zarr v3 arrays and a manifest that knows every chunk of them.

Imports arrays, files and errors, receivers and camera; never a renderer. Read ``manifest`` first
(what a bake says of itself), then ``chunks`` (one array piece, one file), ``journal`` (how a killed
bake goes on) and ``bake`` (opening one). The format is specified in docs/bake-format.md.
"""
