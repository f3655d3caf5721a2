"""Writes the shipped maps, routes and trigger files, and the towns that policies train in.

street_plan       a table of streets and junctions, the streets curves of `alignment`
junction_arms     the ends of streets at each junction, and who may turn where
junction_layout   roads and connectors between them
roadside          signals, crosswalks and sidewalks
opendrive_writer  the OpenDRIVE text
town05, toy       the two maps
routes            routes through a town, over the `ways` that its lanes offer
scenarios         triggers on them
"""
