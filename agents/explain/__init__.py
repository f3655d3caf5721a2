"""Looking into a policy: what its waypoints respond to, where it attends, what its features show.

protocol.py        what a policy says of itself so that it can be explained
differentiate.py   one decision again, with gradients; nothing is left behind
responses.py       per component: gradients of the waypoints, attention of each head
activation.py      per place: which BEV cells and pixels the waypoints rest on
"""
