"""From an OpenDRIVE file to lanes, links, crosswalks and signals."""
