"""The Bullet world, the imitation rewards and the learner."""
