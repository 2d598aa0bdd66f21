"""From the radiance of receivers to pictures, without a renderer.

May import ``camera``, ``files``, ``images`` and what these rest on; needs no Mitsuba. Read ``view.py``
first: what a camera sees, kept so that relighting a picture is only interpolation; ``raster.py`` holds its
kernels, ``picture.py`` what comes out.
"""
