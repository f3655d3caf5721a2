"""Our agents in CARLA: the process in which one drives there, fed by the file that is exported."""
