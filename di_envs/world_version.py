"""The version of the world: what recorded drives are compared by, whatever its sources look like.

Raise it with any change that moves a bit of a world, an observation, a reward or an event: another
constant of the traffic, another order of sums, another reader of maps, another shipped town or
suite. Nothing else raises it: no renamed module, no comment, no new sensor or option. The drives in
`tests/golden` say when it is due.
"""

from __future__ import annotations

WORLD_VERSION = 3
