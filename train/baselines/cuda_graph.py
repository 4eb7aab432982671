"""Gradient steps on a GPU: those of one update are one CUDA graph.

The layers are so small that a GPU would wait for the launch of each of some 200 operations in a step; a graph
launches all operations of all steps at once.
"""

from __future__ import annotations

from dataclasses import fields

import torch
from stable_baselines3 import SAC, TD3

from kinemimic.train.baselines.gradient_steps import Minibatch, draw, steps, steps_since_actor


class GraphedSteps:
    """The gradient steps of a model on a GPU; its optimisers must be `capturable`.

    A graph keeps the rates and the addresses of the state from its recording: restore the model before.
    """

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
        first = steps_since_actor(model)
        if not self._warm:
            # Not recorded: the first steps create the state of the optimisers. They must run on a stream of
            # their own if others are to be recorded.
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

    def _recorded(self, first: int) -> torch.cuda.CUDAGraph:
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            steps(self._model, self._batches, first)
        return graph
