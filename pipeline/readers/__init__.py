"""Readers of capture formats. In: a file, or the folder of a depth recording. Out: a `Clip` in SI units with
z up, exactly as recorded (nothing filled or filtered), with the defects that were found while reading.
`recognise.read` picks the reader from the content.
"""
