"""The world: its state as a value, and the kernels that move it; here alone time moves.

    state, kinds                     the record of a world, and the names of what is in it
    building                         what a world is built of, and its first moment
    world                            one world: reset, advance, save, restore
    step                             the order of a tick
    lights, traffic/, walkers/       who moves by themselves
    scenarios/                       who is put in an ego's way
    dynamics, bodies, contact        egos, and what they touch
    events/                          what the rules count
    changes                          what no tick does: somebody removed, a light forced

Where a kernel's argument says no unit: speeds are in m/s, accelerations in m/s2, lengths, distances
and gaps in m, yaws in rad; poses are in the world frame. `s` is a station: metres along a lane or
an edge. Actors, lanes, signals, junctions and crosswalks are named by their indices, -1 for none;
egos are the actors [0, egos), vehicles [egos, vehicle_end), walkers [vehicle_end, walker_end).
`out` (N, 8) are event rows and `n` how many of them are in use, as in `events.rows`.
"""
