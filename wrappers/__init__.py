"""Edits of what an agent sees, as Gymnasium wrappers: the world below stays untouched.

None are here yet. A wrapper with memory that should be saved and branched with its environment in
its own way defines `save_state() -> value` and `restore_state(value)`; see `di_envs.saving`.
"""
