from __future__ import annotations

from kinemimic.train.task.timer import Timer, split, summed, table


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_all_time_is_assigned_to_a_name() -> None:
    clock = Clock()
    timer = Timer(clock)
    for name, spent in (("work", 2.0), ("rest", 0.5), ("work", 3.0)):
        clock.now += spent
        assert timer.lap(name) == spent
    assert timer.seconds == {"work": 5.0, "rest": 0.5}
    assert sum(timer.seconds.values()) == clock.now - 1000.0


def test_a_restart_discards_all_time() -> None:
    clock = Clock()
    timer = Timer(clock)
    timer.lap("work")
    clock.now += 7.0
    timer.restart()
    clock.now += 1.0
    timer.lap("rest")
    assert timer.seconds == {"rest": 1.0}


def test_sums_take_every_name() -> None:
    assert summed({"a": 1.0}, {}, {"b": 2.0, "a": 0.5}) == {"a": 1.5, "b": 2.0}
    assert summed() == {}


def test_splitting_a_part_keeps_the_total() -> None:
    seconds = {"rollout": 10.0, "update": 4.0}
    found = split(seconds, "rollout", {"simulation": 7.0, "inference": 1.0}, "waiting")
    assert found == {"simulation": 7.0, "inference": 1.0, "waiting": 2.0, "update": 4.0}
    assert sum(found.values()) == sum(seconds.values())


def test_the_table_has_a_row_for_each_part_and_the_total() -> None:
    head, *lines = table({"update": 30.0, "simulation": 90.0}).splitlines()
    assert head.split() == ["seconds", "share", "of", "a", "minute"]
    assert [line.split() for line in lines] == [
        ["simulation", "90.0", "75.0", "%", "45.0", "s"],
        ["update", "30.0", "25.0", "%", "15.0", "s"],
        ["together", "120.0", "100.0", "%", "60.0", "s"],
    ]


def test_a_table_of_no_time_at_all() -> None:
    assert table({"update": 0.0}).splitlines()[-1].split()[1] == "0.0"
