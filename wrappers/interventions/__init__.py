"""Observation edits: the world is untouched, the agent sees something else.

    from wrappers.interventions import InterventionWrapper
    env = InterventionWrapper(env, "drop:routing; noise:map,sigma=0.5@t>5")

`docs/interventions.md` lists the edits; `edit.py` says what one is, `editing.py` applies them,
`eyes.py` is all that stands between what there is and what an agent sees.
`parallel.py` is for the egos of a PettingZoo environment.
"""

from wrappers.interventions.edit import ObservationEdit, setting
from wrappers.interventions.editing import ObservationEditing
from wrappers.interventions.single import InterventionWrapper
from wrappers.interventions.table import EDITS, read_observation_edits
from wrappers.interventions.vector import VectorInterventions

__all__ = [
    "EDITS",
    "InterventionWrapper",
    "ObservationEdit",
    "ObservationEditing",
    "VectorInterventions",
    "read_observation_edits",
    "setting",
]
