"""The less constrained learner: a reward learned from recorded drivers, and an agent trained on it.

Features and likelihood of demonstrations need nothing beyond the package's own requirements;
the environment needs gymnasium, training needs stable-baselines3 and torch (the extra ``rl``).
"""
