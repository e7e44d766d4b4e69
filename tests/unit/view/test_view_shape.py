"""The drawn airframe has the airframe's dimensions, faces outward, and turns the way the real one does."""

import math

import numpy as np
import pytest

from gcs_tools.view import airframe_mesh as shape
from gcs_tools.view.airframe_nodes import flap_quaternion
from gcs_tools.view.solids import Mesh, ball, mirrored, rod, volume
from sitl.frames import standing
from sitl.model.airframe import description, gear
from sitl.quaternion import rotate
from sitl.vehicle_spec import load_vehicle

AIRFRAME = load_vehicle("yawsitter").airframe
TOLD = description(AIRFRAME)
D = shape.dimensions(TOLD)

PARTS = {
    "wing": shape.wing(D),
    "fuselage": shape.fuselage(D),
    "canopy": shape.canopy(D),
    "nacelles": shape.nacelles(D),
    "fins": shape.fins(D),
    "pads": shape.feet_pads(D),
    "belly": shape.belly(D),
    "spinner": shape.spinner(),
    "disc": shape.disc(D),
    **{f"flap {side}": shape.flap(D, side) for side in (-1, 1)},
    **{f"propeller {side}": shape.propeller(D, side) for side in (-1, 1)},
    **{f"light {side}": shape.tip_light(D, side) for side in (-1, 1)},
}


def open_edges(mesh: Mesh) -> int:
    """Edges that no other face runs along the other way, points at one place being one."""
    _, same = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)
    faces = same.reshape(-1)[mesh.faces]
    edges = {(a, b) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True) if a != b}
    return sum((b, a) not in edges for a, b in edges)


@pytest.mark.parametrize("name", PARTS)
def test_every_part_is_closed_and_faces_outward(name: str) -> None:
    assert open_edges(PARTS[name]) == 0
    assert volume(PARTS[name]) > 0.0


def test_the_solids_have_the_volumes_that_geometry_says() -> None:
    assert volume(ball((1.0, 2.0, 3.0), 0.5, points=48)) == pytest.approx(4 / 3 * math.pi * 0.125, rel=0.02)
    assert volume(rod((0, 0, 0), (0, 0, -2), 0.1, points=60)) == pytest.approx(2 * math.pi * 0.01, rel=0.01)
    assert volume(mirrored(ball((0, 1, 0), 0.5))) == pytest.approx(volume(ball((0, 1, 0), 0.5)))


def test_the_wing_has_span_and_chord_and_its_quarter_chord_where_the_aerodynamic_centre_is() -> None:
    a = AIRFRAME.airframe
    whole = np.concatenate(
        [PARTS["wing"].vertices, *(np.add(PARTS[f"flap {side}"].vertices, (D.hinge_m, 0, 0)) for side in (-1, 1))]
    )
    assert np.ptp(whole[:, 1]) == pytest.approx(a.wing_span_m)
    assert np.ptp(whole[:, 0]) == pytest.approx(a.chord_m, abs=1e-3)
    assert whole[:, 0].max() - 0.25 * a.chord_m == pytest.approx(-a.ac_behind_cg_m, abs=1e-3)


def test_the_flaps_have_their_area_and_the_propellers_their_circle() -> None:
    a = AIRFRAME.airframe
    flap = PARTS["flap 1"].vertices
    assert np.ptp(flap[:, 0]) * np.ptp(flap[:, 1]) == pytest.approx(a.flap_area_m2, rel=0.05)
    radius = np.hypot(*PARTS["propeller 1"].vertices[:, 1:].T).max()
    assert radius == pytest.approx(a.prop_radius_m, rel=0.01)
    assert shape.hubs(D)[0][1] == -a.prop_arm_m
    assert D.prop_x_m > D.leading_edge_m


def test_the_feet_and_the_ground_are_where_the_model_has_them() -> None:
    model = gear(AIRFRAME.file.gear, AIRFRAME.airframe)
    assert np.allclose(D.feet_B, model.points_B[:4])
    assert shape.standing_height_m(TOLD) == pytest.approx(model.ground_down_m)
    q = standing(0.7, model.standing_pitch_rad)
    downs = [rotate(q, tuple(foot))[2] for foot in D.feet_B]
    assert downs == pytest.approx([AIRFRAME.file.gear.height_m.value] * 4)


def test_in_hover_the_drawn_nose_is_up_the_belly_ahead_and_the_green_light_to_the_right() -> None:
    q = standing(0.0, math.pi / 2)  # belly to the north
    nose = PARTS["fuselage"].vertices[PARTS["fuselage"].vertices[:, 0].argmax()]
    assert rotate(q, tuple(nose)) == pytest.approx((0.0, 0.0, -D.nose_m), abs=5e-3)
    belly = PARTS["belly"].vertices.mean(axis=0)
    assert rotate(q, tuple(belly))[0] > 0.0  # north
    canopy = PARTS["canopy"].vertices.mean(axis=0)
    assert rotate(q, tuple(canopy))[0] < 0.0
    green = PARTS["light 1"].vertices.mean(axis=0)
    assert rotate(q, tuple(green))[1] == pytest.approx(0.5 * D.span_m, rel=0.01)  # east


def test_a_positive_flap_moves_the_drawn_trailing_edge_down() -> None:
    trailing = (-D.flap_chord_m, 0.1, 0.0)
    moved = rotate(flap_quaternion(10.0), trailing)
    assert moved[2] == pytest.approx(D.flap_chord_m * math.sin(math.radians(10.0)))
    assert moved[1] == 0.1


@pytest.mark.parametrize("side", [-1, 1])
def test_a_blade_that_turns_its_own_way_throws_the_air_aft(side: int) -> None:
    blade = PARTS[f"propeller {side}"]
    outer = blade.vertices[blade.vertices[:, 1] > 0.7 * D.prop_radius_m]
    moves = np.cross((side, 0.0, 0.0), (0.0, 1.0, 0.0))  # of the blade on +y
    leading = outer[(outer @ moves).argmax()]
    trailing = outer[(outer @ moves).argmin()]
    assert leading[0] > trailing[0]


def test_a_vehicle_that_tells_too_little_of_itself_gets_the_bundled_shape() -> None:
    assert shape.told_or_bundled({"airframe": TOLD}) is TOLD
    without_chord = {name: value for name, value in TOLD["parameters"].items() if name != "chord_m"}
    for told in ({}, {"airframe": {**TOLD, "parameters": without_chord}}, {"airframe": {**TOLD, "gear": None}}):
        assert shape.dimensions(shape.told_or_bundled(told)).chord_m == D.chord_m
