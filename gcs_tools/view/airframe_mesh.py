"""The YawSitter's shape in B (nose +x, right +y, belly +z, origin at the centre of mass), from its dimensions.

The paper prints areas and lengths, no drawing. What is given: wing span and chord, where the wing stands to the centre
of mass, propellers' radius and distance, the flaps' area, the feet. What is not given is chosen: the section (12 %
thick), how far the propellers stand before the wing, the width of fuselage and nacelles.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np

from gcs_tools.view.solids import Mesh, Points, aerofoil, ball, ellipse, joined, loft, mirrored, spindle
from sitl.frames import GRAVITY_M_S2

SECTION = 0.12  # the wing's thickness by its chord
TIP_M = 0.012  # of the wing, outside the flap
ROOT_M = 0.034  # from the middle to the flap
PROP_AHEAD_M = 0.045  # of the leading edge
FUSELAGE_M = (0.032, 0.040)  # half width, half height
FLAP_MAX = 0.6  # of the chord


class Dimensions(NamedTuple):
    """What the shape is made of."""

    span_m: float
    chord_m: float
    leading_edge_m: float  # body x of it
    flap_chord_m: float
    prop_radius_m: float
    prop_arm_m: float
    slipstream_ratio: float  # R_s / R
    nose_m: float
    feet_B: Points  # (4, 3)

    @property
    def prop_x_m(self) -> float:
        return self.leading_edge_m + PROP_AHEAD_M

    @property
    def trailing_edge_m(self) -> float:
        return self.leading_edge_m - self.chord_m

    @property
    def hinge_m(self) -> float:
        """Body x of the flaps' hinges."""
        return self.trailing_edge_m + self.flap_chord_m


def dimensions(airframe: Mapping[str, Any]) -> Dimensions:
    """From `airframe` of the vehicle's description. Raises KeyError for a number that is missing."""
    number = {name: float(entry["value"]) for name, entry in airframe["parameters"].items()}
    gear = {name: float(entry["value"]) for name, entry in airframe["gear"].items()}
    chord_m, span_m = number["chord_m"], number["wing_span_m"]
    flap_chord_m = number["flap_area_m2"] / (0.5 * span_m - ROOT_M - TIP_M)
    return Dimensions(
        span_m=span_m,
        chord_m=chord_m,
        leading_edge_m=0.25 * chord_m
        - number["ac_behind_cg_m"],  # the aerodynamic centre is a quarter of the chord aft
        flap_chord_m=min(flap_chord_m, FLAP_MAX * chord_m),
        prop_radius_m=number["prop_radius_m"],
        prop_arm_m=number["prop_arm_m"],
        slipstream_ratio=number["slipstream_radius_ratio"],
        nose_m=gear["nose_m"],
        feet_B=feet(gear),
    )


def told_or_bundled(description: Mapping[str, Any]) -> Mapping[str, Any]:
    """The airframe in a vehicle's description; where it lacks numbers that the shape needs, the bundled YawSitter's."""
    airframe: Mapping[str, Any] = description.get("airframe", {})
    try:
        dimensions(airframe)
        standing_height_m(airframe)
    except (KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError):
        from sitl.vehicle_spec import load_vehicle

        bundled: Mapping[str, Any] = msgspec.to_builtins(load_vehicle("yawsitter").airframe.file)
        return bundled
    return airframe


def standing_height_m(airframe: Mapping[str, Any]) -> float:
    """The centre of mass above the ground when it stands: where the ground is in N, whose origin is there."""
    gear = airframe["gear"]
    weight_N = airframe["parameters"]["mass_kg"]["value"] * GRAVITY_M_S2
    return float(gear["height_m"]["value"] - weight_N / (4.0 * gear["stiffness_N_m"]["value"]))


def feet(gear: Mapping[str, float]) -> Points:
    """The four feet in B: a rectangle on flat ground when the body's pitch θ is the standing pitch."""
    pitch = math.radians(gear["standing_pitch_deg"])
    corners = []
    for forward, right in ((1, -1), (1, 1), (-1, -1), (-1, 1)):
        x, y, z = 0.5 * forward * gear["base_m"], 0.5 * right * gear["track_m"], gear["height_m"]
        corners.append((math.cos(pitch) * x - math.sin(pitch) * z, y, math.sin(pitch) * x + math.cos(pitch) * z))
    return np.array(corners)


def _panel(d: Dimensions, y_m: Sequence[float], first: float, last: float, origin: Sequence[float] = (0, 0, 0)) -> Mesh:
    """The wing between stations along span, and between two stations of the chord (0 … 1)."""
    section = aerofoil(SECTION, first, last)
    rings = []
    for y in y_m:
        x = d.leading_edge_m - section[:, 0] * d.chord_m
        rings.append(np.stack([x, np.full(len(x), y), section[:, 1] * d.chord_m], axis=1) - np.asarray(origin))
    return loft(rings)


def wing(d: Dimensions) -> Mesh:
    """All but the flaps: the part before the hinges, the middle, the tips."""
    half, hinge = 0.5 * d.span_m, 1.0 - d.flap_chord_m / d.chord_m
    front = _panel(d, (-half, half), 0.0, hinge - 0.012)
    middle = _panel(d, (-ROOT_M, ROOT_M), hinge - 0.02, 1.0)
    tip = _panel(d, (half - TIP_M, half), hinge - 0.02, 1.0)
    return joined(front, middle, tip, mirrored(tip))


def flap(d: Dimensions, side: int) -> Mesh:
    """One elevon, about its hinge: x aft negative, y along the hinge. side: −1 left, 1 right."""
    gap_m = 0.003
    y = (ROOT_M + gap_m, 0.5 * d.span_m - TIP_M - gap_m)
    right = _panel(d, y, 1.0 - d.flap_chord_m / d.chord_m, 1.0, (d.hinge_m, 0.0, 0.0))
    return right if side > 0 else mirrored(right)


def fuselage(d: Dimensions) -> Mesh:
    """A slender body from the nose to just behind the trailing edge."""
    width, height = FUSELAGE_M
    tail = d.trailing_edge_m - 0.012
    shape = ((0.0, 0.12), (0.04, 0.45), (0.12, 0.72), (0.26, 0.95), (0.42, 1.0), (0.6, 0.98), (0.8, 0.75), (1.0, 0.35))
    return spindle([(d.nose_m + (tail - d.nose_m) * s, width * r, height * r) for s, r in shape], points=32)


def canopy(d: Dimensions) -> Mesh:
    """A bubble on the back (−z), so that back and belly can be told apart."""
    width, height = 0.62 * FUSELAGE_M[0], 0.60 * FUSELAGE_M[1]
    x = (0.86, 0.78, 0.66, 0.48, 0.3, 0.18)
    r = (0.15, 0.6, 0.95, 1.0, 0.7, 0.15)
    z = -0.62 * FUSELAGE_M[1]
    return spindle([(d.nose_m * a, width * b, height * b) for a, b in zip(x, r, strict=True)], z=z)


def nacelles(d: Dimensions) -> Mesh:
    """The two motors before the wing."""
    x = d.prop_x_m
    back = d.leading_edge_m - 0.45 * d.chord_m
    shape = ((x - 0.004, 0.013), (x - 0.016, 0.017), (x - 0.05, 0.018), (0.5 * (x + back), 0.014), (back, 0.004))
    right = spindle([(at, r, r) for at, r in shape], y=d.prop_arm_m, points=20)
    return joined(right, mirrored(right))


def fins(d: Dimensions) -> Mesh:
    """Behind each motor a fin above and below the wing, which end in the feet."""
    plates = []
    for foot in d.feet_B:
        z_tip, x_tip = foot[2], foot[0]
        outward = math.copysign(1.0, z_tip)
        root = (d.leading_edge_m - 0.35 * d.chord_m, d.trailing_edge_m + 0.004, 0.0)
        tip = (x_tip + 0.035, x_tip, z_tip - 0.004 * outward)
        plates.append(_plate(foot[1], root, tip, 0.0035))
    return joined(*plates)


def _plate(y: float, root: tuple[float, float, float], tip: tuple[float, float, float], half_m: float) -> Mesh:
    """A plate across y: (front x, back x, z) at two ends, thinner at its edges."""
    rings = []
    for front, back, z in (root, tip):
        x = front + (back - front) * np.array([0.0, 0.15, 0.7, 1.0, 0.7, 0.15])
        width = half_m * np.array([0.2, 1.0, 0.8, 0.15, -0.8, -1.0])
        rings.append(np.stack([x, y + width, np.full(6, z)], axis=1))
    return loft(rings)


def feet_pads(d: Dimensions) -> Mesh:
    return joined(*(ball(np.add(foot, (0.006, 0.0, 0.0)), 0.009) for foot in d.feet_B))


def belly(d: Dimensions) -> Mesh:
    """A stripe on the wing's lower side (+z) near each tip: which side faces where is then seen from afar."""
    stripes = []
    for y in (0.5 * d.span_m - 0.075, 0.5 * d.span_m - 0.045):
        stripes.append(_skin(d, (y, y + 0.018), 0.06, 0.46))
    right = joined(*stripes)
    return joined(right, mirrored(right))


def _skin(d: Dimensions, y: tuple[float, float], first: float, last: float) -> Mesh:
    """A thin plate on the lower side of the wing."""
    section = aerofoil(SECTION, first, last)
    lower = section[len(section) // 2 :]
    x, z = d.leading_edge_m - lower[:, 0] * d.chord_m, lower[:, 1] * d.chord_m
    rings = []
    for at in y:
        below = np.stack([x, np.full(len(x), at), z + 0.0012], axis=1)
        above = np.stack([x, np.full(len(x), at), z - 0.001], axis=1)[::-1]
        rings.append(np.concatenate([below, above]))
    return loft(rings)


def tip_light(d: Dimensions, side: int) -> Mesh:
    """At a wing tip; side: −1 left (red), 1 right (green)."""
    return ball((d.leading_edge_m - 0.25 * d.chord_m, side * 0.5 * d.span_m, 0.0), 0.010)


def propeller(d: Dimensions, side: int) -> Mesh:
    """Two blades about the hub, in the plane x = 0; side: −1 left (turns about −x), 1 right (about +x).

    Turning about +x the blade on +y moves toward +z, so its leading edge is there, tilted forward.
    """
    radius = d.prop_radius_m
    rings = []
    for share in (0.12, 0.25, 0.4, 0.6, 0.8, 0.94, 1.0):
        chord = radius * (0.10 + 0.16 * math.sin(math.pi * min(1.0, share + 0.15)) * (1.0 if share < 1.0 else 0.3))
        pitch = math.atan(0.45 / (2.0 * math.pi * max(share, 0.2)) * 2.0)
        section = aerofoil(0.10, points=8) * chord
        ahead, across = 0.35 * chord - section[:, 0], section[:, 1]
        x = ahead * math.sin(pitch) - across * math.cos(pitch)
        z = ahead * math.cos(pitch) + across * math.sin(pitch)
        rings.append(np.stack([x, np.full(len(x), share * radius), z], axis=1))
    blade = loft(rings)
    other = Mesh(blade.vertices * (1.0, -1.0, -1.0), blade.faces)  # half a turn about x
    right = joined(blade, other)
    return right if side > 0 else mirrored(right)


def spinner() -> Mesh:
    return spindle(((0.020, 0.0015, 0.0015), (0.015, 0.007, 0.007), (0.006, 0.0115, 0.0115), (-0.006, 0.0125, 0.0125)))


def disc(d: Dimensions) -> Mesh:
    """What a turning propeller looks like to the eye: a thin disc in the plane x = 0."""
    return loft([ellipse(x, 0.0, 0.0, d.prop_radius_m, d.prop_radius_m, 48) for x in (-0.001, 0.001)])


def slipstream(d: Dimensions, length: float = 1.0) -> Mesh:
    """The wake of one propeller from its plane x = 0 back to −length, contracting to R_s within one radius."""
    radius, far = d.prop_radius_m, d.slipstream_ratio * d.prop_radius_m
    stations = np.concatenate([np.linspace(0.0, 1.0, 8) * radius, [length]])
    rings = []
    for back in stations:
        r = far + (radius - far) * math.exp(-3.0 * back / radius)
        rings.append(ellipse(-back, 0.0, 0.0, r, r, 32))
    return loft(rings, capped=False)


def hubs(d: Dimensions) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Where the propellers' hubs are, left and right."""
    return (d.prop_x_m, -d.prop_arm_m, 0.0), (d.prop_x_m, d.prop_arm_m, 0.0)
