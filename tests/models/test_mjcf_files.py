"""MJCF that is too large or no MJCF is refused in a line, at once."""

from __future__ import annotations

import os
import re

import pytest

import tiltsim
from tiltsim.errors import InputError
from tiltsim.models.mjcf_editing import check_mjcf
from tiltsim.resources import shipped_folder

SHIPPED = sorted(shipped_folder("mjcf").glob("*.xml"))
MANY = "<geom size='1'/>" * 2_001


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_vehicles_are_within_the_limits(path):
    check_mjcf(path)


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        (MANY, "more than 2000 elements"),
        ("<replicate count='99'><replicate count='99'><a/></replicate></replicate>", "more than 2"),
        ("<composite count='20 20 20'/>", "more than 2000 elements"),
        ("<sensor><user dim='100000000'/></sensor>", "user dim = 100000000: at most 1000"),
        ("<include file='own.xml'/>", "more than"),
        ("<hfield nrow='60000' ncol='60000'/>", "hfield nrow x ncol: more than"),
        ("<texture width='60000' height='60000'/>", "texture width x height: more than"),
        ("<size nuser_body='100000000'/>", "size nuser_body = 100000000: at most"),
        ("<body pos='0 nan 0'/>", "body pos = '0 nan 0': must be finite"),
        ("<body pos='0 1e999 0'/>", "must be finite"),
        ("<!-- \x01 -->", "not XML"),
        ("<body>", "not XML"),
    ],
)
def test_files_beyond_a_limit_are_refused(inside, words, tmp_path):
    file = tmp_path / "own.xml"
    file.write_text(f"<mujoco>{inside}</mujoco>")
    with pytest.raises(ValueError, match=words) as caught:
        check_mjcf(file)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=re.escape(str(caught.value))):
        tiltsim.parse_scenario({"vehicle": {"mjcf": str(file)}})


@pytest.mark.parametrize("name", ["none.xml", "9" * 400, "../none.xml", "/none.xml"])
def test_missing_includes_are_refused_in_a_line(tmp_path, name):
    file = tmp_path / "own.xml"
    file.write_text(f"<mujoco><include file='{name}'/></mujoco>")
    assert file in check_mjcf(file)
    with pytest.raises(InputError, match="MuJoCo says: ") as caught:
        tiltsim.parse_scenario({"vehicle": {"mjcf": str(file)}})
    assert "\n" not in str(caught.value)


def test_nested_includes_count(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "many.xml").write_text(f"<mujoco>{MANY}</mujoco>")
    (tmp_path / "parts" / "one.xml").write_text("<mujoco><include file='many.xml'/></mujoco>")
    (tmp_path / "own.xml").write_text("<mujoco><include file='parts/one.xml'/></mujoco>")
    with pytest.raises(ValueError, match="more than 2000 elements"):
        check_mjcf(tmp_path / "own.xml")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes are files on POSIX only")
@pytest.mark.parametrize(
    "inside", ["<include file='a.xml'/>", "<asset><mesh name='m' file='a.xml'/></asset>"]
)
def test_a_pipe_is_refused_before_anything_waits_for_it(tmp_path, inside):
    os.mkfifo(tmp_path / "a.xml")
    file = tmp_path / "own.xml"
    file.write_text(f"<mujoco>{inside}</mujoco>")
    with pytest.raises(ValueError, match=r"a.xml: no file to read, but a pipe"):
        check_mjcf(file)
