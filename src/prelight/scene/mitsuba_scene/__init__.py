"""Mitsuba scenes that the user trusts: XML files, dictionaries, loaded ``mi.Scene`` objects.

Mitsuba itself parses them and loads shapes; nothing here may see a file whose author is not trusted, for such
files name plug-ins and other files. Start at `reading`; `tree` and `objects` tell what is there as `node`s,
`shapes` and `tessellation` make triangles of it, `surfaces`, `albedo` and `pictures` materials, `sensors` cameras.
"""
