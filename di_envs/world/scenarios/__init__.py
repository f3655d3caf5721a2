"""The Leaderboard's scenarios: what triggers them, and who acts in each."""
