"""The samplers of a training run as Ray actors; one that is lost is replaced, and its round done again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ray
from ray.actor import ActorHandle
from ray.exceptions import GetTimeoutError, ObjectLostError, RayActorError

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.cluster import ONE_THREAD
from kinemimic.pipeline.parallel.node_identity import NodeIdentity
from kinemimic.train.sampling.pool import SAMPLE, OpenSampler, answer
from kinemimic.train.sampling.sampler import EnvSampler, EnvStates
from kinemimic.train.sim.engines import engine_identity

# Losses of one sampler in one request before it is given up: the node is then hardly the reason.
LOSSES = 5
# These do not change what a sampler samples next, so a replacement need not repeat them.
_STATELESS = frozenset({"env_states", "run_episodes", "robust_returns", "evaluate"})
_LOST = (RayActorError, ObjectLostError)
_PATIENCE = 120.0  # s for a node to import everything and open its environments


class _SamplerActor:
    """A sampler in a process of a node."""

    def __init__(self) -> None:
        self._sampler: EnvSampler | None = None

    def node(self, engine: str) -> tuple[str, NodeIdentity | KinemimicError]:
        """The node's address, and its identity or why it cannot simulate."""
        address = ray.util.get_node_ip_address()
        try:
            return address, engine_identity(engine)
        except KinemimicError as error:
            return address, error

    def open(self, open_sampler: OpenSampler, seeds: list[np.random.SeedSequence], engine: str) -> Any:
        """Open the sampler; an error as an answer, None otherwise."""
        try:
            self._sampler = open_sampler(seeds, engine)
        except KinemimicError as error:
            return error
        return None

    def ask(self, request: str, shared: tuple[Any, ...], share: tuple[Any, ...]) -> Any:
        """The answer to a request, or the KinemimicError that it raised; and the state after samples."""
        assert self._sampler is not None  # noqa: S101 (it was opened)
        try:
            found = answer(self._sampler, request, (*shared, *share))
        except KinemimicError as error:
            return error, None
        return found, self._sampler.env_states() if request == SAMPLE else None


@dataclass
class _Seat:
    """One sampler, whoever holds it: what a replacement needs to continue exactly where the last one was.

    states: at the end of the sample before the last one; later: requests since then that change the sampler,
    up to and including the last sample and what followed it; after: state at the end of the last sample, and
    how many of `later` it includes.
    """

    seeds: list[np.random.SeedSequence]
    actor: ActorHandle[Any] | None = None
    states: EnvStates | None = None
    later: list[tuple[str, Any, tuple[Any, ...]]] = field(default_factory=list)
    after: tuple[EnvStates, int] | None = None

    def note(self, request: str, shared: Any, share: tuple[Any, ...]) -> None:
        """A request is about to be made."""
        if request == SAMPLE and self.after is not None:
            # What the last sample recorded has been taken from the sampler by now, so its end is a beginning.
            self.states, known = self.after
            self.later, self.after = self.later[known:], None
        if request not in _STATELESS:
            self.later.append((request, shared, share))


class SamplerActors:
    """`SamplerPool` of one Ray actor for each list of seeds, spread over the nodes.

    Needs a connection to Ray (`pipeline/parallel/cluster.py`). Arguments that all samplers share, a round's
    weights among them, are put into the object store once. A lost actor is replaced on a node that is left:
    from the state of the environments at the beginning of the round, it gives the same samples.
    KinemimicError if a node's engine or processor is not like the driver's.
    """

    def __init__(
        self, open_sampler: OpenSampler, seeds: Sequence[list[np.random.SeedSequence]], engine: str
    ) -> None:
        self.replaced = 0  # actors lost so far
        self._engine, self._identity = engine, engine_identity(engine)
        self._opener = ray.put(open_sampler)
        self._seats = [_Seat(own) for own in seeds]
        try:
            pending = [self._begin(seat) for seat in self._seats]
            for seat, opening in zip(self._seats, pending, strict=True):
                try:
                    self._admit(opening)
                except _LOST as loss:
                    self._replace(seat, loss)
        except BaseException:
            self.end()
            raise

    def ask(self, request: str, shared: tuple[Any, ...], shares: Sequence[tuple[Any, ...]]) -> list[Any]:
        """As `SamplerPool.ask`."""
        once = ray.put(shared)
        pending = []
        for seat, share in zip(self._seats, shares, strict=True):
            seat.note(request, once, share)
            pending.append(self._call(seat, request, once, share))
        answers = [
            self._answer(seat, reference, (request, once, share))
            for seat, reference, share in zip(self._seats, pending, shares, strict=True)
        ]
        for found in answers:
            if isinstance(found, KinemimicError):
                raise found
        return answers

    def end(self) -> None:
        """End all actors."""
        for seat in self._seats:
            _discard(seat)

    def _call(self, seat: _Seat, request: str, shared: Any, share: tuple[Any, ...]) -> Any:
        assert seat.actor is not None  # noqa: S101 (only `end` leaves a seat empty)
        return seat.actor.ask.remote(request, shared, share)

    def _answer(self, seat: _Seat, reference: Any, request: tuple[str, Any, tuple[Any, ...]]) -> Any:
        """The answer to a request, if need be of a replacement."""
        for _ in range(LOSSES):
            try:
                found, states = ray.get(reference)
            except _LOST as loss:
                self._replace(seat, loss, but_for=request)
                reference = self._call(seat, *request)
                continue
            if states is not None:
                seat.after = (states, len(seat.later))
            return found
        raise KinemimicError(
            f"expected a node to carry out {request[0]!r}, found that {LOSSES} actors were lost in it; "
            "memory may be short on the nodes: `ray status` and the nodes' logs say more"
        )

    def _begin(self, seat: _Seat) -> tuple[Any, Any]:
        """Start an actor for a seat; its node's identity and the opening of its sampler, both pending."""
        # A replacement shares a core where none is free: slower, but the training goes on.
        cores = min(1.0, ray.available_resources().get("CPU", 0.0)) if self.replaced else 1
        options = {"num_cpus": int(cores), "scheduling_strategy": "SPREAD", "runtime_env": ONE_THREAD}
        remote: Any = ray.remote(_SamplerActor)  # its type has no `options`
        actor = remote.options(**options).remote()
        seat.actor = actor
        return actor.node.remote(self._engine), actor.open.remote(self._opener, seat.seeds, self._engine)

    def _admit(self, pending: tuple[Any, Any]) -> None:
        """Wait for an actor; KinemimicError if its node is not like this one, or its sampler cannot open."""
        try:
            (address, identity), refused = ray.get(list(pending), timeout=_PATIENCE)
        except GetTimeoutError:
            raise KinemimicError(
                f"expected a free core on the Ray cluster within {_PATIENCE:g} s, found none; use fewer "
                "--workers, or wait for other work on it to end"
            ) from None
        if isinstance(identity, KinemimicError):
            raise KinemimicError(f"node {address}: {identity}")
        self._identity.require(identity, address)
        if refused is not None:
            raise refused

    def _replace(
        self, seat: _Seat, loss: Exception, but_for: tuple[str, Any, tuple[Any, ...]] | None = None
    ) -> None:
        """Put a new actor into a seat, and bring it to where the lost one was before request `but_for`."""
        for _ in range(LOSSES):
            _discard(seat)  # an actor that is only unreachable must not stay
            self.replaced += 1
            try:
                self._admit(self._begin(seat))
                if seat.states is not None:
                    _repeat(self._call(seat, "set_env_states", (), (seat.states,)))
                for request in seat.later:
                    if request is not but_for and not _same(request, but_for):
                        _repeat(self._call(seat, *request))
            except _LOST as again:
                loss = again
                continue
            return
        found = " ".join(str(loss).split())[:300]
        raise KinemimicError(
            f"expected a node for a lost actor, found that it was lost {LOSSES} times: {found}"
        )


def _same(request: tuple[str, Any, tuple[Any, ...]], other: tuple[str, Any, tuple[Any, ...]] | None) -> bool:
    """Whether both are one request: its arguments were put into the object store for it alone."""
    return other is not None and request[1] is other[1]


def _repeat(reference: Any) -> None:
    """Wait for a repeated request and discard its answer; raise it if it is a KinemimicError."""
    found, _ = ray.get(reference)
    if isinstance(found, KinemimicError):
        raise found


def _discard(seat: _Seat) -> None:
    if seat.actor is not None:
        ray.kill(seat.actor)
        seat.actor = None
