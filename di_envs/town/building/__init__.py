"""Writes the shipped maps, routes and trigger files, and the towns that policies train in."""
