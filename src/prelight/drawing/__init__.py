"""From the radiance of receivers to pictures, without a renderer.

May import ``camera``, ``material``, ``files``, ``images``, the layouts of ``lighting`` and what these rest on; needs no
Mitsuba. Read ``view.py`` first: what a camera sees, kept so that relighting a picture is only interpolation.
``raster.py`` holds its kernels, ``surface.py`` textures at the pixel, ``pixels.py`` receivers that are pixels,
``picture.py`` what comes out; ``figures.py``, ``plots.py`` and ``unfolded.py`` draw what documents show.
"""
