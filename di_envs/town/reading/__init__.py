"""From an OpenDRIVE file to lanes, links, crosswalks and signals.

opendrive    the text, as `records` of roads, sections, lanes, signals and junctions
stretches    lanes: what leads on one to one through a road's sections is one of them
sampling     their points, laid along each road's `reference_line`
links        which lane leads into which
conflicts    where the lanes of a junction come too close to each other
network      all of it as `Lanes`
crosswalks   zebra crossings, and the lanes below them
arms         the ways into each junction
map_signals  heads of lights and signs that the file has, or …
sidecar      … those of a file beside it, or guessed ones
signals      heads and stop lines as `Signals`
"""
