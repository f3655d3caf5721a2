"""Parts that networks are built from, whatever they decide.

taps.py        marks on activations: what can be looked at, differentiated and edited, by name
mlp.py         two layers
sets.py        rows of which some are there, to one token
attention.py   multi-head attention, its weights to be looked at
decoder.py     layers in which queries look at tokens
grid.py        the cells around the ego
images.py      pixels to numbers about 0
resnet.py      images to feature maps
pyramid.py     feature maps of several scales to the finest
lift.py        features of pixels, by their depths, to cells
blocks.py      normalised convolutions, channels that are weighed
fused.py       normalisation folded into convolutions, for who no longer learns
raster_teacher.py  the true view from above to an action and waypoints
waypoint_heads.py  vectors to waypoints
weights.py     networks on disk, in float16
looking.py     features of a map at places
spatial_gru.py a GRU whose memory is a map
unet.py        a map to one of the same size that has looked far
"""
