"""What all readers share. In: the path of a capture file. Out: a bounded `Source` with the file's content,
tables of numbers or JSON values parsed from it, and a `Clip` built from a reader's arrays. Every problem is a
`CaptureError` that names the file and the line.
"""
