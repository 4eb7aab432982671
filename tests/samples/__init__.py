"""A file of every format, written from one known motion: what readers must give back is known exactly.

A module here is named after the reader in kinemimic.pipeline.readers whose format it writes, and has
`files(frames) -> dict[str, bytes]`: file name -> content, the capture first, then the files that must lie
beside it. The formats' writers live here, because only tests need them.
"""
