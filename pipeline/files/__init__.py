"""Reading and writing files: bounded, atomic, versioned and hashed.

In: paths from the user, and clips, tables or JSON values to write. Out: checked values, or an error of one
line that names the file. Every file that we write has a schema number; older ones are upgraded on reading.
What is read is checked in `validation`.
"""
