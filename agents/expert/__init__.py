"""The agent `expert`: rules over what is visible from its car, as kernels.

    legs -> base_line, target_speed -> path       the line to drive, made once a route
    crossings                                     the ways that cross it, from the map
    occlusion -> visible                          what is in sight: all that is decided from
    progress                                      where the car is on the path, and its memory
    sight, people, hiding, actors                 who is on the path and beside it, what hides whom
    speed, rules, junction                        accelerations that all of these allow
    decision, control                             the least of them, and the wheel: one decision
    agent                                         the agent around the kernels

Where a name says no unit: speeds are in m/s, accelerations in m/s2, lengths, distances and gaps in
m, yaws in rad. A station is metres along the path, an offset metres to its right; `times` (M,) are
the seconds in which the car is 0, 1, 2, … metres on, from `speed.forecast`.
"""
