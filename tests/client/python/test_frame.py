"""Units, axes, yaw and ids, without a server."""

import math

import numpy as np
import pytest

import throng
from throng._frame import Axes
from throng._ids import BadFrame, IdTable


def axes(unit="m", up="z", yaw="ccw_rad", handed="right", origin=None):
    return Axes(unit, up, yaw, handed, origin)


# Published test vectors of FNV-1a, 64 bit, which throng::trajectory::hash_id is too.
@pytest.mark.parametrize("name, expected", [
    ("", 0xCBF29CE484222325), ("a", 0xAF63DC4C8601EC8C), ("foobar", 0x85944171F73967E8),
    ("person_é", None)])
def test_hash_of_a_string_id_is_fnv1a_of_its_utf8_bytes(name, expected):
    if expected is None:
        expected = 0xCBF29CE484222325
        for byte in name.encode("utf-8"):
            expected = ((expected ^ byte) * 0x100000001B3) % 2**64
    assert throng.hash_id(name) == expected


@pytest.mark.parametrize("settings, source, world", [
    ({}, (1, 2, 3), (1, 2, 3)),
    ({"unit": "cm"}, (100, 200, 300), (1, 2, 3)),
    ({"unit": 0.5}, (2, 4, 6), (1, 2, 3)),
    ({"up": "y"}, (1, 3, -2), (1, 2, 3)),                      # glTF: +Y up, ground is X and -Z
    ({"up": "y", "handed": "left"}, (1, 3, 2), (1, 2, 3)),      # Unity: +Z is forward
    ({"handed": "left", "unit": "cm"}, (100, -200, 300), (1, 2, 3)),  # Unreal
    ({"origin": (690000, 5335000)}, (690001, 5335002, 3), (1, 2, 3)),
    ({}, (1, 2), (1, 2, 0)),
    ({"up": "y"}, (1, -2), (1, 2, 0)),
])
def test_positions_come_out_in_the_world_frame(settings, source, world):
    np.testing.assert_allclose(axes(**settings).positions([source], 1), [world], rtol=1e-6)


def test_origin_is_subtracted_before_rounding_to_float32():
    utm = axes(origin=(691234.0, 5335678.0)).positions(np.array([[691234.125, 5335678.0625]]), 1)
    assert utm[0].tolist() == [0.125, 0.0625, 0.0]


@pytest.mark.parametrize("yaw, angle, expected", [
    ("ccw_rad", 0.5, 0.5), ("ccw_deg", 90, math.pi / 2), ("cw_deg", 90, -math.pi / 2), ("cw_rad", 0.5, -0.5),
    ("north_cw_deg", 0, math.pi / 2), ("north_cw_deg", 90, 0), ("north_cw_rad", math.pi, -math.pi / 2)])
def test_yaw_becomes_radians_counter_clockwise_from_x(yaw, angle, expected):
    headings, quaternions = axes(yaw=yaw).headings([angle], 1)
    assert quaternions is None
    assert headings[0] == pytest.approx(expected, abs=1e-6)


def test_direction_vectors_become_angles_and_zero_becomes_unknown():
    headings, _ = axes().headings([(0, 2), (-1, 0), (0, 0)], 3)
    assert headings[0] == pytest.approx(math.pi / 2)
    assert abs(headings[1]) == pytest.approx(math.pi)
    assert math.isnan(headings[2])


def test_wkt_is_scaled_and_mirrored_as_positions_are():
    text = axes(unit="cm", handed="left").wkt("POLYGON ((0 0, 1000 0, 1000 500, 0 0), (1e2 200, 300 -4.5e2, 100 200))")
    assert text == "POLYGON ((0.0 -0.0, 10.0 -0.0, 10.0 -5.0, 0.0 -0.0), (1.0 -2.0, 3.0 4.5, 1.0 -2.0))"


def test_same_ids_keep_their_membership():
    table = IdTable()
    first, rows = table.lookup(np.array([5, 6, 7]))
    again, rows_again = table.lookup(np.array([5, 6, 7]))
    assert again is first and rows is None and rows_again is None


@pytest.mark.parametrize("make", [np.array, list, tuple])
def test_ids_in_another_order_keep_the_membership_and_sort_the_rows(make):
    table = IdTable()
    first, _ = table.lookup(make([5, 6, 7, 8]))
    again, rows = table.lookup(make([8, 5, 7, 6]))
    assert again is first
    np.testing.assert_array_equal(np.array([8, 5, 7, 6])[rows], first.ids)
    _, rows_of_repeat = table.lookup(make([8, 5, 7, 6]))
    np.testing.assert_array_equal(rows_of_repeat, rows)


def test_ids_that_come_or_go_make_a_new_membership():
    table = IdTable()
    first, _ = table.lookup([1, 2, 3])
    second, _ = table.lookup([1, 2])
    third, _ = table.lookup([])
    assert first is not second and third.ids.size == 0


def test_string_ids_are_hashed_and_keep_their_names():
    membership, _ = IdTable().lookup(["walker.0", "walker.1"])
    assert membership.ids.tolist() == [throng.hash_id("walker.0"), throng.hash_id("walker.1")]
    assert membership.names == ["walker.0", "walker.1"]
    from_array, _ = IdTable().lookup(np.array(["walker.0", "walker.1"]))
    assert from_array.ids.tolist() == membership.ids.tolist()


def test_negative_and_large_ids_are_taken_as_64_bits():
    assert IdTable().lookup(np.array([-1, 1]))[0].ids.tolist() == [2**64 - 1, 1]
    assert IdTable().lookup([2**64 - 1, 1])[0].ids.tolist() == [2**64 - 1, 1]


def test_duplicate_ids_keep_the_first_row_and_are_counted():
    table = IdTable()
    membership, rows = table.lookup([4, 9, 4, 2])
    assert membership.ids.tolist() == [4, 9, 2] and rows.tolist() == [0, 1, 3]
    assert table.duplicates == 1


def test_colliding_string_ids_leave_the_later_one_out_and_name_both(monkeypatch):
    monkeypatch.setattr("throng._ids.hash_id", lambda name: 7 if name in ("ann", "bob") else len(name))
    table = IdTable()
    membership, rows = table.lookup(["ann", "bob", "carol"])
    assert membership.names == ["ann", "carol"] and rows.tolist() == [0, 2]
    assert table.collisions == 1
    assert "'ann'" in table.messages[0][1] and "'bob'" in table.messages[0][1]


@pytest.mark.parametrize("ids", [[1.5, 2.5], [[1, 2], [3, 4]], [None, 1], [object()], np.array([True, False])])
def test_ids_that_are_neither_integers_nor_strings_are_refused(ids):
    with pytest.raises(BadFrame):
        IdTable().lookup(ids)
