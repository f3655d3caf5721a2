"""The DriveInsight policy: cameras, LiDAR and a structured prompt in, waypoints out.

Source: Li et al., Exploring the Causality of End-to-End Autonomous Driving, 2024, sections 3 and
4.1. The authors published no code; this is written from the text.
"""
