"""Other vehicles: who they follow, when they change lanes, and who enters a junction first.

tables, spawn           what traffic needs of a town; who drives where at the start
occupancy               who is where on the lanes, made anew each tick
car_following           the Intelligent Driver Model
lane_change             MOBIL
speed_choice            whom a vehicle follows, and how fast it goes
approach, yielding      what it meets at the end of its lane, and who is in its way
right_of_way, granting  who may enter a junction: who asks, and who of them gets a grant
motion                  how vehicles move along their lanes
"""
