"""Gradient steps on a GPU: those of one control step are one CUDA graph.

The layers are so small that a GPU would wait for the launch of each of some 200 operations in a step; a graph
launches all operations of all steps at once. Their noise is drawn on the CPU, from the generators and in the
order that stable-baselines3 uses there.
"""

from __future__ import annotations

from dataclasses import fields

import torch
from stable_baselines3 import SAC, TD3
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from torch import Tensor

from kinemimic.train.baselines.gradient_steps import Minibatch, sac_step, td3_step
from kinemimic.train.ppo.mlp import CPU


class GraphedSteps:
    """The gradient steps of a model on a GPU; the optimisers must be `capturable`."""

    def __init__(self, model: SAC | TD3) -> None:
        self._model = model
        self._batches: list[Minibatch] = []
        # By the number of steps and that of the first one within the actor's delay.
        self._graphs: dict[tuple[int, int], torch.cuda.CUDAGraph] = {}
        self._warm = False

    def run(self, count: int, size: int) -> None:
        """`count` gradient steps, each on `size` samples of the replay buffer."""
        model = self._model
        drawn = [draw(model, size) for _ in range(count)]
        if len(self._batches) != count:
            self._batches, self._graphs = drawn, {}
        for batch, new in zip(self._batches, drawn, strict=True):
            for part in fields(Minibatch):
                getattr(batch, part.name).copy_(getattr(new, part.name))
        first = 0 if isinstance(model, SAC) else model._n_updates % model.policy_delay
        if not self._warm:
            # Not recorded: the first steps create what a graph must find, the state of the optimisers and
            # the workspace of matrix products. Recording requires that they run on another stream.
            stream = torch.cuda.Stream()  # type: ignore[no-untyped-call]
            stream.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(stream):
                steps(model, self._batches, first)
            torch.cuda.current_stream().wait_stream(stream)
            # A graph that created the state of an optimiser would zero it in every replay; the actor's comes
            # last, as its steps may be delayed.
            self._warm = bool(model.actor.optimizer.state)
        else:
            if (count, first) not in self._graphs:
                self._graphs[count, first] = self._recorded(first)
            self._graphs[count, first].replay()
        model._n_updates += count

    def _recorded(self, first: int) -> torch.cuda.CUDAGraph:
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            steps(self._model, self._batches, first)
        return graph


class GraphedTraining(OffPolicyAlgorithm):
    """Mixed into stable-baselines3's TD3 (and DDPG) and SAC: their `train` on a CPU, a graph on a GPU."""

    _graphed: GraphedSteps | None = None

    def train(self, gradient_steps: int, batch_size: int = 256) -> None:
        """`gradient_steps` steps, each on `batch_size` samples."""
        if self.device == CPU:
            super().train(gradient_steps, batch_size)
            return
        assert isinstance(self, SAC | TD3)  # noqa: S101 (it is mixed into those)
        if self._graphed is None:
            self._graphed = GraphedSteps(self)
        self._graphed.run(gradient_steps, batch_size)


def draw(model: SAC | TD3, size: int) -> Minibatch:
    """A minibatch on the model's device, drawn as stable-baselines3 does."""
    assert model.replay_buffer is not None  # noqa: S101 (narrows the type)
    samples = model.replay_buffer.sample(size, env=model._vec_normalize_env)
    draws = 2 if isinstance(model, SAC) else 1
    noise = torch.stack([_normal(samples.actions) for _ in range(draws)])
    return Minibatch(
        samples.observations,
        samples.actions,
        samples.next_observations,
        samples.dones,
        samples.rewards,
        noise,
    )


def steps(model: SAC | TD3, batches: list[Minibatch], first: int) -> None:
    """A gradient step on each minibatch; first: number of steps since the actor's last one."""
    for number, batch in enumerate(batches, start=first + 1):
        if isinstance(model, SAC):
            sac_step(model, batch)
        else:
            td3_step(model, batch, actor=number % model.policy_delay == 0)


def _normal(actions: Tensor) -> Tensor:
    return torch.empty(actions.shape).normal_().to(actions.device)
