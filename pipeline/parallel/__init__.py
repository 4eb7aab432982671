"""Worker processes: a function mapped over tasks, tasks isolated from each other, and deferred Ctrl-C.

In: functions and tasks that can be pickled. Out: their results, or an error that describes how a process
died.
"""
