"""A reward learned from recorded drivers, and an agent.

Features and likelihood of demonstrations need nothing beyond the package's own requirements. The
environment needs gymnasium, training needs stable-baselines3 and torch (the extra ``rl``).
"""
