"""The page reads what the vehicle sends: its fields are among the sender's, and a real vehicle's messages are read."""

import msgspec
import pytest

from gcs_tools.view import topics
from gcs_tools.view.feed import ROOT, SUBSCRIBED
from gcs_tools.view.vehicle import Vehicle
from sitl.telemetry import keys, schema
from sitl.telemetry.feed import Feed
from sitl.vehicle import Vehicle as Flown
from sitl.vehicle_spec import load_vehicle

SENT = {
    "state": schema.StateMessage,
    "attitude": schema.AttitudeMessage,
    "setpoint": schema.SetpointMessage,
    "actuators": schema.ActuatorsMessage,
    "loads": schema.LoadsMessage,
    "mode": schema.ModeMessage,
    "loop": schema.LoopMessage,
    "event": schema.EventMessage,
    "events": schema.EventsMessage,
    "parameters": schema.ParametersMessage,
    "mission": schema.MissionMessage,
}


def names(kind: type) -> set[str]:
    return {field.name for field in msgspec.structs.fields(kind)}


@pytest.mark.parametrize("topic", SENT)
def test_every_field_that_the_page_reads_is_sent(topic: str) -> None:
    assert names(topics.TYPES[topic]) <= names(SENT[topic])


def test_the_topics_are_the_vehicle_s_under_its_root() -> None:
    sent = {topic.name for topic in keys.TOPICS}
    assert set(topics.TYPES) <= sent
    assert set(SUBSCRIBED) <= set(topics.TYPES)
    assert ROOT == keys.ROOT
    assert {t.name for t in keys.TOPICS if t.cadence is keys.Cadence.SAMPLED} == set(topics.SAMPLED)


def test_a_vehicle_that_stands_is_known_from_its_answers_alone() -> None:
    flown = Flown(load_vehicle("yawsitter"))
    feed = Feed(flown, 4, lambda: schema.LoopMessage(*(0,) * len(names(schema.LoopMessage))))
    vehicle = Vehicle(4)
    for topic in keys.TOPICS:
        if topic.queryable:
            vehicle.take(topic.name, feed.latest(topic))
    assert vehicle.unreadable == 0
    assert vehicle.name == "yawsitter 4"
    assert vehicle.instant is not None
    assert vehicle.mode is not None
    assert vehicle.mission is not None
    assert vehicle.mode.mission_plan_id == vehicle.mission.plan_id
    assert "RATE_Y_P" in vehicle.parameters
