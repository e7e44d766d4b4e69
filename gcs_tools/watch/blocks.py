"""The parts of the dashboard that tell how one vehicle is doing: head, mission, estimator, link, news."""

from rich.text import Text

from gcs_tools.vehicle_state import LANDED, SEVERITIES
from gcs_tools.vehicle_state import Text as Told
from gcs_tools.watch import gauges
from gcs_tools.watch.gauges import printable
from gcs_tools.watch.instruments import SEEN
from gcs_tools.watch.lines import BAD, DIM, GOOD, NUMBER, WARN, beside, label
from gcs_tools.watch.seen import Seen
from gcs_tools.watch.traffic import total
from sitl.mavlink.codec import mav

_MISSION = ("", "no mission", "not started", "under way", "paused", "complete")
STATES = {mav.MAV_STATE_CRITICAL: "FAILSAFE", mav.MAV_STATE_EMERGENCY: "EMERGENCY", 8: "FLIGHT TERMINATED"}
_LABEL = 9
_UNDER_WAY, _COMPLETE = 3, 5  # MISSION_STATE
_SEVERE = (BAD, BAD, BAD, BAD, WARN, "cyan", "", DIM)


def header(seen: Seen, wall_s: float, width: int, frozen: bool) -> list[Text]:
    """Who it is, what it does, and whether that is still so."""
    v, lost = seen.vehicle, seen.is_lost(wall_s)
    left = Text(" ").append(printable(v.name or "unnamed vehicle"), "bold").append(f" · system {seen.system}   ", DIM)
    left.append(f" {(v.mode or '?').upper()} ", "bold reverse cyan" if not lost else "reverse").append(" ")
    left.append(" ARMED " if v.armed else " disarmed ", "bold reverse yellow" if v.armed else DIM).append("  ")
    if v.status in STATES:
        left.append(f" {STATES[v.status]} ", "bold reverse red").append("  ")
    left.append(LANDED.get(v.landed, ""))
    right = Text()
    if frozen:
        right.append(" DRAWING PAUSED ", "reverse").append(" ")
    if lost:
        right.append(f" LOST for {gauges.duration(seen.age_s(wall_s))} ", "bold reverse red").append(" ")
    else:
        told = "heartbeat " if width >= 100 else ""
        right.append("● ", GOOD).append(f"{told}{_heartbeat_age_s(seen, wall_s):.1f} s ", DIM)
    return [beside(left, right, width), _second(seen, wall_s, width)]


def _heartbeat_age_s(seen: Seen, wall_s: float) -> float:
    since_s = seen.instruments.heartbeat_s
    return wall_s - since_s if since_s is not None else seen.age_s(wall_s)


def _second(seen: Seen, wall_s: float, width: int) -> Text:
    v, i = seen.vehicle, seen.instruments
    text = Text()
    if v.ready is not None and not v.armed:
        text.append(" ready " if v.ready else " not ready ", GOOD if v.ready else WARN)
    if i.flight_s is not None:
        text.append(" flight ", DIM).append(f"{'≥ ' if i.joined_in_flight else ''}{gauges.duration(i.flight_s)} ")
    if v.battery >= 0:
        style = GOOD if v.battery > 30 else WARN if v.battery > 15 else BAD
        text.append(" battery ", DIM).append(f"{v.battery} % ", NUMBER)
        full = gauges.bar(v.battery / 100.0, 8).rstrip()
        text.append(full, style).append("░" * (8 - len(full)), DIM)
        text.append(f" {v.battery_V:.1f} V" if v.battery_V is not None else "")
        text.append(f" {v.battery_A:.1f} A" if v.battery_A is not None else "")
    right = Text()
    if v.clock.newest_s is not None:
        rate = i.rate(wall_s)
        right.append("t ", DIM).append(f"{v.clock.newest_s:.1f} s ")
        if rate == 0.0:
            right.append("stands still ", WARN)
        elif rate is not None:
            right.append(f"{rate:.2f} × ")
    return beside(text, right, width)


def alerts(seen: Seen, wall_s: float, width: int) -> list[Text]:
    """What is wrong, one line each; usually none."""
    v, found = seen.vehicle, []
    if seen.is_lost(wall_s):
        found.append((BAD, "nothing heard: what is shown is what it told last; it shows again once it is back"))
    if v.unhealthy:
        found.append((BAD, f"not well: {', '.join(v.unhealthy)}"))
    if v.ready is False and not v.armed and seen.not_ready:
        found.append((WARN, f"not ready: {seen.not_ready}"))
    if seen.instruments.missing:
        found.append((BAD, f"estimator: not known: {', '.join(seen.instruments.missing)}"))
    if seen.trouble:
        found.append((WARN, seen.trouble))
    lines = [Text(f" ! {printable(text)}", style) for style, text in found]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines


def status(seen: Seen, width: int) -> Text:
    """Mission and estimator."""
    right = _estimator(seen)
    return beside(_mission(seen, width - right.cell_len - 2), right, width)


def _mission(seen: Seen, width: int) -> Text:
    """How far it is with its mission."""
    v = seen.vehicle
    text = label("mission", _LABEL)
    if v.mission_item is None:
        return text.append("–", DIM)
    state = _MISSION[v.mission_state] if v.mission_state < len(_MISSION) else ""
    if v.mission_total is None:
        return text.append(state or f"item {v.mission_item}", DIM)
    done = v.mission_total if v.mission_state == _COMPLETE else v.mission_item
    text.append(f"item {min(v.mission_item + 1, v.mission_total)} of {v.mission_total} ", NUMBER)
    cells = max(4, min(40, width - text.cell_len - 14))
    text.append("▕", DIM).append(gauges.bar(done / v.mission_total, cells), GOOD).append("▏ ", DIM)
    return text.append(state, GOOD if v.mission_state == _UNDER_WAY else "")


def _estimator(seen: Seen) -> Text:
    m, missing = seen.instruments.estimator, seen.instruments.missing
    text = Text().append("estimator ", DIM)
    if m is None:
        return text.append("–", DIM)
    text.append("not ok" if missing else "ok", BAD if missing else GOOD)
    if m.pos_horiz_accuracy > 0.0:
        text.append(f" ±{100 * m.pos_horiz_accuracy:.1f} cm across, ±{100 * m.pos_vert_accuracy:.1f} up")
    return text


def link(seen: Seen, wall_s: float) -> Text:
    """What the link carries, all messages together, and how well."""
    every = total(seen.traffic.flows(wall_s))
    loss, trip_s = seen.traffic.loss(wall_s), seen.instruments.round_trip_s
    text = Text().append(f"{every.frames_Hz:.0f}/s {every.bytes_Hz / 1000.0:.1f} kB/s", NUMBER)
    if loss is not None:
        style = BAD if loss > 0.05 else WARN if loss > 0.005 else GOOD
        text.append("  lost ", DIM).append(f"{100.0 * loss:.1f} %", style)
    if trip_s is not None:
        text.append("  trip ", DIM).append(f"{1000.0 * trip_s:.1f} ms")
    return text


def flows(seen: Seen, wall_s: float, width: int, rows: int) -> list[Text]:
    """The messages that take most of the link, one a line below a head."""
    lines = [beside(label("message", 0), label("/s    B/s", 0), width)]
    for flow in seen.traffic.flows(wall_s)[:rows]:
        lines.append(beside(label(flow.name, 0), Text(f"{flow.frames_Hz:5.1f}{flow.bytes_Hz:7.0f}"), width))
    return lines


def news(seen: Seen, wall_s: float, width: int, rows: int) -> list[Text]:
    """The vehicle's newest texts, and what was seen to change; the newest at the bottom, what is said again once."""
    lines: list[Text] = []
    for text, times in _collapsed(seen)[-rows:] if rows > 0 else []:
        style = _SEVERE[text.severity] if text.severity < SEEN else "cyan"
        line = label(f"{gauges.duration(wall_s - text.wall_s):>7} ago ", 0)
        line.append(f"{SEVERITIES[text.severity]:<9} " if text.severity < SEEN else " " * 10, style)
        line.append(printable(text.text), style).append(f" (×{times})" if times > 1 else "", DIM)
        line.truncate(width, overflow="ellipsis")
        lines.append(line)
    return lines


def _collapsed(seen: Seen) -> list[tuple[Told, int]]:
    """Texts with how often each came in a row."""
    found: list[tuple[Told, int]] = []
    for text in sorted((*seen.vehicle.texts, *seen.instruments.changes), key=lambda text: text.wall_s):
        if found and found[-1][0][1:] == text[1:]:
            found[-1] = (text, found[-1][1] + 1)
        else:
            found.append((text, 1))
    return found
