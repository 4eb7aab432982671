"""Scenarios: forces, torques, obstacles, routes and ground for a rollout.

In: a TOML file, a reference and a seed. Out: the events of one trial (`EventSchedule`), applied to a world by
`ScenarioManager`.
"""
