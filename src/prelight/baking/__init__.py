"""From a scene to a bake: one file for each kind, reading like its paper.

Imports transport, encoding, bases and storage; bakers do not know each other. Read ``environment``;
``clustering`` is its section 4.
"""
