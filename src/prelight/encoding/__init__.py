"""T in few bytes. Imports arrays and errors; encodings do not know each other's users.

``quantization`` makes one byte of an element, ``sparse_tiles`` drops the zeros in blocks.
"""
