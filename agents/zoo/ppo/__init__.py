"""PPO on prompts, by Stable-Baselines3: what learns from reward and not from an expert."""
