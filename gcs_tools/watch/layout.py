"""Which parts stand where on a screen of a given size."""

from typing import NamedTuple

from rich.text import Text

from gcs_tools.watch import blocks, motion, track_map
from gcs_tools.watch.gauges import compass, duration, fixed, printable
from gcs_tools.watch.lines import BAD, DIM, GOOD, WARN, beside, join, label, rule
from gcs_tools.watch.motion import PLACE_WIDTH
from gcs_tools.watch.seen import Seen

WIDE = 116  # columns from which a map and the link stand beside
GAP = 2
TALL = 33  # lines below the head, from which there is place for the link's messages
ROOMY = 18  # lines below the head, fewer of which leave no place for a rule
CURVE_MAX = 8  # lines of a curve
NEWS_ROWS = 6
TABLE_ROWS = 6  # of vehicles on a screen of 24 lines
_KEYS = "q quit   space pause   ←→ 1–9 vehicle"


class Scene(NamedTuple):
    """What is to be drawn. where: the endpoint; since_s: when listening began; hint: why nobody may be heard."""

    vehicles: list[Seen]  # in the order of their system ids
    chosen: Seen | None
    wall_s: float
    where: str
    since_s: float
    wanted: int | None = None
    hint: str = ""
    frozen: bool = False
    keys: bool = True


def lines(scene: Scene, width: int, height: int) -> list[Text]:
    """The picture, `height` lines of at most `width` cells."""
    made = _head(scene, width, height)
    footer = _footer(scene, width)
    room = height - len(made) - 1
    seen = scene.chosen
    if seen is not None and room > 0:
        made += _body(seen, scene.wall_s, width, room)
    made = made[: height - 1]
    made += [Text()] * (height - 1 - len(made))
    made.append(footer)
    for line in made:
        line.truncate(width)
    return made[-height:]


def _head(scene: Scene, width: int, height: int) -> list[Text]:
    made: list[Text] = []
    if scene.chosen is not None:
        made += blocks.header(scene.chosen, scene.wall_s, width, scene.frozen)
        made += blocks.alerts(scene.chosen, scene.wall_s, width)
    else:
        made += _waiting(scene, width)
    if len(scene.vehicles) > 1 or (scene.vehicles and scene.chosen is None):
        made += table(scene, width, max(2, TABLE_ROWS * height // 24))
    return made


def _waiting(scene: Scene, width: int) -> list[Text]:
    which = "a vehicle" if scene.wanted is None else f"system {scene.wanted}"
    waited = duration(scene.wall_s - scene.since_s)
    made = [Text(" waiting for ").append(which, "bold").append(f" at {scene.where}   {waited}", DIM)]
    if scene.hint:
        made += [Text(), *(Text(f" {line}", WARN) for line in scene.hint.splitlines())]
    return made


def _footer(scene: Scene, width: int) -> Text:
    keys = _KEYS if len(scene.vehicles) > 1 else _KEYS.partition("   ←")[0]
    return beside(Text(f" {keys if scene.keys else 'Ctrl-C quits'}", DIM), Text(f"{scene.where} ", DIM), width)


def _body(seen: Seen, wall_s: float, width: int, room: int) -> list[Text]:
    if width < WIDE:
        return _main(seen, wall_s, width, room)
    side = min(80, width * 2 // 5 - 10)
    main = _main(seen, wall_s, width - side - GAP, room, link_beside=True)
    return join(main, _side(seen, wall_s, side, room), width - side, GAP)


def _main(seen: Seen, wall_s: float, width: int, room: int, link_beside: bool = False) -> list[Text]:
    """Numbers and gauges, curves as high as there is room, mission, link, texts."""
    made = join(motion.place(seen), motion.actuators(seen, width - PLACE_WIDTH - GAP), PLACE_WIDTH + GAP, GAP)
    status = [blocks.status(seen, width)]
    if not link_beside:
        status.append(label("link", 9).append_text(blocks.link(seen, wall_s)))
        if room > TALL:
            status += blocks.flows(seen, wall_s, width, 4)
    if room >= ROOMY:
        status.insert(0, rule("status", width))
    tall = max(1, min(CURVE_MAX, (room - len(made) - 1 - len(status) - NEWS_ROWS) // 4))
    made += motion.curves(seen, wall_s, width, tall)
    made += status
    rows = room - len(made) - 1
    if rows > 0:
        made += [rule("news", width), *blocks.news(seen, wall_s, width, rows)]
    return made


def _side(seen: Seen, wall_s: float, width: int, room: int) -> list[Text]:
    """A map, and below it what the link carries."""
    rows = min(8, max(2, room - 3 - width // 2))
    high = max(3, room - rows - 4)
    return [
        *_map(seen, width, high),
        rule("link", width),
        blocks.link(seen, wall_s),
        *blocks.flows(seen, wall_s, width, rows),
    ]


def _map(seen: Seen, width: int, height: int) -> list[Text]:
    v, i = seen.vehicle, seen.instruments
    marks: list[tuple[str, tuple[float, float]]] = [("⌂", (0.0, 0.0))]
    if v.reference_m is not None and v.armed:
        marks.append(("+", (v.reference_m[0], v.reference_m[1])))
    if v.position_m is not None:
        marks.append((compass(i.heading_deg or 0.0), (v.position_m[0], v.position_m[1])))
    drawn = track_map.draw(list(i.track), marks, width, height)
    styles = {"⌂": "bold", "+": "bold yellow"}
    made = [rule(f"map · north up · {10 * drawn.metres_a_cell:g} m ├────────┤", width)]
    for row, cells in enumerate(drawn.lines):
        line = Text("".join(cells), "cyan")
        for column in range(width):
            mark = drawn.marks.get((row, column))
            if mark is not None:
                line.stylize(styles.get(mark, "bold green"), column, column + 1)
        made.append(line)
    return made


def table(scene: Scene, width: int, rows: int) -> list[Text]:
    """A row a vehicle, those around the chosen one where there are more than rows."""
    place = next((k for k, seen in enumerate(scene.vehicles) if seen is scene.chosen), 0)
    first = max(0, min(place - rows // 2, len(scene.vehicles) - rows))
    shown = scene.vehicles[first : first + rows]
    more = f", {first + 1} to {first + len(shown)} of them" if len(shown) < len(scene.vehicles) else ""
    head = f"{len(scene.vehicles)} vehicles{more}"
    return [
        rule(head, width),
        Text(_COLUMNS.format("", "id", "mode", "", "north", "east", "height", "error", "speed", "batt", "link"), DIM),
        *(_line(first + k, seen, scene) for k, seen in enumerate(shown)),
    ]


_COLUMNS = "{:>3}{:>4}  {:<9}{:<6}{:>8}{:>9}{:>8}{:>8}{:>7}{:>6}  {}"


def _line(place: int, seen: Seen, scene: Scene) -> Text:
    v, i = seen.vehicle, seen.instruments
    north, east, down = v.position_m or (None, None, None)
    lost = seen.is_lost(scene.wall_s)
    cells = _COLUMNS.format(
        "▶" if seen is scene.chosen else place + 1 if place < 9 else "",
        seen.system,
        (v.mode or "?")[:8],
        "armed" if v.armed else "",
        _told(north, 2),
        _told(east, 2),
        _told(None if down is None else -down, 2),
        _told(None if i.error_m is None else i.error.value, 3),
        _told(i.speed.value, 2),
        f"{v.battery} %" if v.battery >= 0 else "",
        "",
    )
    text = Text(printable(cells), DIM if lost else "bold" if seen is scene.chosen else "")
    if lost:
        return text.append(f"LOST {duration(seen.age_s(scene.wall_s))}", BAD)
    loss = seen.traffic.loss(scene.wall_s)
    text.append("●" if not loss else f"−{100 * loss:.0f} %", GOOD if not loss else WARN)
    return text.append(f" {blocks.STATES[v.status]}" if v.status in blocks.STATES else "", BAD)


def _told(x: float | None, digits: int) -> str:
    return "–" if x is None else fixed(x, digits)
