"""From a scene to a bake: one file for each kind, reading like its paper.

Imports transport, encoding, bases and storage; bakers do not know each other. Read ``environment``;
``clustering`` is its section 4. Then ``steerable``; ``carrying_out`` is what both kinds of bake do
around their work.
"""
