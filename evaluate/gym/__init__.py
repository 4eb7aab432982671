"""The task for other reinforcement learning libraries: Gymnasium environments, and stable-baselines3 on them.

In: a motion. Out: `kinemimic/Imitation-v0`, with one humanoid (`gymnasium.make`) or a batch of them
(`gymnasium.make_vec`). Importing this package registers the environment: since version 1.0, Gymnasium no
longer looks for entry points.
"""

from gymnasium.envs.registration import register

ENVIRONMENT = "kinemimic/Imitation-v0"

register(
    ENVIRONMENT,
    # Strings: what they name is imported when an environment is made.
    entry_point="kinemimic.evaluate.gym.imitation_env:ImitationEnv",
    vector_entry_point="kinemimic.evaluate.gym.imitation_vector_env:ImitationVectorEnv",
)
