"""What is run: which seeds, in which batches, and with which body."""

from __future__ import annotations

import pickle
from itertools import chain

from canbase_campaign.robots import rolls_out
from canbase_config.load import load_robot, sample
from canbase_qualification.job import A_BODY, FAILURES, Amount, Batch, Job, Load, batches
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP
from canbase_qualification.qualification import job_of, missing
from canbase_qualification.runs import body

ROBOT = load_robot(sample("bench")).robot
JOB, _ = job_of(ROBOT, Load())


def seeds(found: list[Batch], kind: str) -> list[int]:
    return list(chain.from_iterable(batch.seeds for batch in found if batch.kind == kind))


def test_every_scenario_and_drive_has_the_seeds_from_the_first_one_on() -> None:
    found = list(batches(JOB, Amount(scenarios=60, stops=0, drives=3, first=40)))
    assert seeds(found, SCENARIO) == list(range(40, 100))
    assert seeds(found, DRIVING) == [40, 41, 42]
    assert all(seed // A_BODY == batch.body for batch in found if batch.kind == SCENARIO for seed in batch.seeds)


def test_each_failure_that_stops_the_robot_is_tried_once_with_each_body() -> None:
    found = list(batches(JOB, Amount(scenarios=0, stops=2, drives=0, first=5)))
    assert [batch.body for batch in found] == [5, 6]
    for batch in found:
        assert tuple(seed % len(FAILURES) for seed in batch.seeds) == JOB.failures
        assert {seed // len(FAILURES) for seed in batch.seeds} == {batch.body}


def test_nothing_is_nothing() -> None:
    assert list(batches(JOB, Amount(0, 0, 0))) == []


def test_what_is_done_is_not_run_again() -> None:
    amount = Amount(scenarios=30, stops=0, drives=1)
    done = frozenset({(SCENARIO, seed) for seed in range(26)} | {(DRIVING, 0), (STOP, 27)})
    assert missing(JOB, amount, done) == [Batch(SCENARIO, 1, (26, 27, 28, 29))]


def test_a_job_goes_to_another_process_as_it_is() -> None:
    again = pickle.loads(pickle.dumps(JOB))
    assert again == JOB
    assert isinstance(again, Job)


def test_the_same_number_gives_the_same_body_with_a_load_on_a_slope_as_given() -> None:
    job, _ = job_of(ROBOT, Load((1.0, 3.0), 0.06))
    bodies = [body(job, number) for number in range(200)]
    assert bodies == [body(job, number) for number in range(200)]
    payloads = [drawn.body.payload_factor for drawn in bodies]
    assert (min(payloads), max(payloads)) == (1.0, 3.0)
    assert len(set(payloads)) > 10
    slopes = [drawn.push_n / (9.81 * drawn.body.mass_kg * drawn.body.payload_factor) for drawn in bodies]
    assert max(slopes) <= 0.0605
    assert min(slopes) >= -0.0605
    assert max(slopes) > 0.059
    assert min(slopes) < -0.059
    assert all(rolls_out(drawn)[0] > 0.0 for drawn in bodies), "without power it comes to a stand"
