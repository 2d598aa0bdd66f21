"""The studio: a page in the browser that shows a bake and sets its light.

Imports relighting, drawing, lighting and storage, beside ``checking``; never the renderer. Read ``protocol``
(every message), then ``rig_state`` (what all see), ``history`` (undo and looks), ``session`` (the one thread that
relights), ``light`` and ``whole_light`` (what it lights), ``door`` (who may come in) and ``server``. The page itself
is in ``web/``: TypeScript in ``source``, what browsers load in ``built``.
"""
