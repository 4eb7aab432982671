"""The command line and what every command shares: options, progress bars, tables, and parts of HTML reports.

In: the arguments of `kinemimic`. Out: the status of the command, whose module is imported only when it runs.
"""
