"""What the commands do, as functions: for notebooks and scripts. `leaderboard` offers them."""
