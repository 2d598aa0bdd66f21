"""The studio: a page in the browser that shows a bake and sets its light.

Imports relighting, drawing, lighting and storage, beside ``checking``; never the renderer. Read ``protocol``
(every message), then ``rig_state`` (what all see), ``session`` (the one thread that relights), ``door`` (who may
come in) and ``server``. The page itself is in ``web/``: TypeScript in ``source``, what browsers load in ``built``.
"""
