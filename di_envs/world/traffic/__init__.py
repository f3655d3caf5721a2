"""Other vehicles: who they follow, when they change lanes, and who enters a junction first."""
