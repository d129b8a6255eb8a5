"""What every drive keeps to, whatever it is made of, read off shared runs of a table of drives."""

from __future__ import annotations

import drive_table as table
import pytest

from beltdyn import _core

# --- the table ------------------------------------------------------------------------------------


def test_every_pair_that_the_library_allows_is_in_the_table() -> None:
    rows = [table.drive(name).row for name in table.names()]
    assert list(table.missing(rows)) == [], "run tests/drive_table.py: it prints the rows to add"
    refused = [pair for row in rows for pair in table.pairs(row) if pair in table.REFUSED]
    assert not refused and len(rows) == len(table.names()) <= 64


def test_the_table_has_every_law_and_method_of_the_core() -> None:
    assert {name for name, *_ in _core.LAWS} == {law().law for law in table._LAWS.values()}
    methods = {table.drive(name).options["method"] for name in table.names()}
    assert methods == set(_core.METHODS)


@pytest.mark.parametrize("pair", table.REFUSED, ids=lambda pair: "-".join(v for _, v in pair))
def test_pairs_that_are_left_out_are_refused(pair: table.Pair) -> None:
    kind, is_raised, message = table.REFUSED[pair].partition("Error: ")
    row = {**table.drive(table.names()[0]).row, **dict(pair)}
    if not is_raised:
        assert table.make(row).scene.params.friction is None  # as without it
        return
    with pytest.raises({"Value": ValueError, "Type": TypeError}[kind], match=message):
        table.make(row)


def test_rows_are_found_for_whatever_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where a law comes: its rows alone, and every pair of it."""
    rows = [table.drive(name).row for name in table.names()]
    monkeypatch.setitem(table.VALUES, "law", (*table.VALUES["law"], "another"))
    assert list(table.missing(rows))
    added = list(table.further_rows(rows))
    assert {row["law"] for row in added} == {"another"} and len(added) <= 8
    assert not table.missing([*rows, *added])
    assert not [p for row in added for p in table.pairs(row) if p in table.REFUSED]


def test_drives_have_what_their_names_say() -> None:
    for name in table.names():
        drive = table.drive(name)
        params, row = drive.scene.params, drive.row
        assert name == table.name_of(row)
        assert params.belt_model == ("string" if row["belt"] == "string" else "links")
        assert bool(params.mounted) == (row["mount"] != "fixed")
        assert params.has_friction or row["law"] == "none"
        outside = any(pulley.side == "outside" for pulley in params.pulleys)
        assert outside == (row["layout"] in ("crossed", "back"))
        assert bool(drive.scene.motion) == (row["loads"] in ("speed", "crank", "moved"))
