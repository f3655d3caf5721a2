"""The commands of `driveinsight`, a module each: its arguments, its help, and what it does.

A command is a frozen dataclass with a method `run() -> exit code` and a help text beside it; its
line in `cli.Command` gives it its name. Nothing slow is imported before `run` needs it.
"""
