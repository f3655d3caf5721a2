"""Studies: an agent driven with and without an edit, over the same worlds, and what that says.

rows      what is edited, by name
driving   drives each row as an ordinary run; goes on where it was stopped
record    study.json: all that tables and figures are drawn from
effects   paired differences, their intervals and verdicts
"""
