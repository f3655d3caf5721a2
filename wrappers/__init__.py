"""Around an environment: other forms of action, plain vectors, and Stable-Baselines3's interface.

A wrapper with memory that should be saved and branched with its environment in its own way defines
`save_state() -> value` and `restore_state(value)`; see `di_envs.saving`.
"""
