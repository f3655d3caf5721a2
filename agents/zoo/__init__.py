"""Other people's driving systems, small, on one data set: a folder each; see `docs/zoo.md`.

system.py      what a system says of itself: what it sees and is to learn, its network, its driver
registry.py    systems by the names that the table of agents has for them
inputs.py      from what an environment shows to what a network takes
raster.py      the true view from above, for teachers
eyes.py        cameras, and a LiDAR, to a map of the ground, and what is remembered of it
told.py        the prompt's components as tokens
commands.py    three commands of a prompt's six
errors.py      terms of losses that several systems share
loading.py     the driver of whichever system a folder holds
driving.py     the agent that drives with any of them, and what it says of itself when explained
controls.py    the published controller, and what stands in for it without rules
two_heads.py   how those drive that say waypoints and an action
weights.py     systems on disk
NAME/          a system: config.py, model.py, agent.py and a card
"""
