"""Towns: lane networks, signals and crosswalks read from OpenDRIVE, and routes over them.

`loading.load_town` gives a `town.Town`; the kernels of `queries` and `lanes_below` find poses and
lanes in it; `once` keeps what follows from a town alone for a process, `kept` for the next one. An
OpenDRIVE file becomes a town in these steps, each a module:

    opendrive -> stretches -> sampling -> links, network, conflicts -> signals, crosswalks -> cache

Nothing is imported here, so that modules that only read routes stay light.
"""
