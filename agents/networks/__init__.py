"""Parts that networks are built from, whatever they decide.

taps.py        marks on activations: what can be looked at, differentiated and edited, by name
mlp.py         two layers
sets.py        rows of which some are there, to one token
attention.py   multi-head attention, its weights to be looked at
decoder.py     layers in which queries look at tokens
"""
