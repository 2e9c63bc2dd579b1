"""Tyre property files: what is read, refused and warned of, whatever program has written them."""

from __future__ import annotations

import codecs
import random
import re
from math import isfinite

import pytest

from tests.refusals import each_mentions, mentions, refused, texts_of
from tests.vehicles.tir_files import UNITS, text_of, write
from yawbench.components.tyre_models.pacejka_2012_set import COMMON, LONGITUDINAL, REST
from yawbench.foundation.errors import ScenarioError
from yawbench.vehicles.tir import read_tir


def read(tmp_path, *arguments, **options):
    return read_tir(write(tmp_path / "a.tir", *arguments, **options))


def warnings(file):
    return [str(w).removeprefix(str(file.path)).lstrip(":") for w in file.warnings]


def test_a_file_gives_every_parameter_of_the_tyre_by_its_name(tmp_path):
    file = read(tmp_path)
    assert set(COMMON | LONGITUDINAL | REST) <= set(file.values)
    assert (file.kind, file.side, file.warnings) == ("MF-Tyre 6.2", "LEFT", ())
    assert file.values["pky1"] == -15.0
    assert file.values["inflpres"] == 230000.0
    assert file.values["lmuy"] == 0.98


def test_what_a_file_leaves_out_is_neutral_and_not_another_tyres(tmp_path):
    found = read(tmp_path, without=["PKY4", "PKX2", "LMUY"]).values
    for name, row in (COMMON | LONGITUDINAL | REST).items():
        if name.upper() not in text_of() and row.unit == "1":
            assert found[name] == (1.0 if name.startswith("l") else 0.0), name
    assert (found["pky4"], found["pkx2"], found["lmuy"]) == (2.0, 0.0, 1.0)


ENCODINGS = {
    "LF": lambda text: text.encode(),
    "CRLF": lambda text: text.replace("\n", "\r\n").encode(),
    "CR": lambda text: text.replace("\n", "\r").encode(),
    "BOM": lambda text: codecs.BOM_UTF8 + text.encode(),
    "cp1252": lambda text: text.encode("cp1252"),
    "UTF-16": lambda text: text.encode("utf-16"),
}
DIALECTS = {
    "no format": ({"FITTYP": "61"}, {}),
    "format only": ({"PROPERTY_FILE_FORMAT": "'MF_62'"}, {"without": ["FITTYP"]}),
    "user": ({"PROPERTY_FILE_FORMAT": "'USER'"}, {}),
    "PAC2002": ({"PROPERTY_FILE_FORMAT": "'PAC2002'", "PHY3": "0.02"}, {"without": ["FITTYP"]}),
    "side right": ({"TYRESIDE": "'Right'"}, {}),
    "side unknown": ({"TYRESIDE": "'UNKNOWN'"}, {}),
    "LFZ0": ({"LFZ0": "0.58"}, {}),
    "only products have a sign": ({"PDY1": "0.95", "PDY2": "-0.15", "PKY1": "27.4", "PKY4": "-2.0"}, {}),
    "one-sided slip": ({"KPUMIN": "-1", "KPUMAX": "0"}, {}),
    "no value": ({"RIM_WIDTH": ""}, {"more": "[INERTIA]\nMASS = kg\nMASS = 9.3"}),
    "table": (
        {},
        {"more": "[SHAPE]\n{radial width}\n 1.0 0.0\n 1.0 0.4\n[DEFLECTION]\n{pen fz}\n0 0\n0.01 2000"},
    ),
    "a section twice": ({}, {"more": "[MODEL] \nPEY1 = -1.0\n[LATERAL]\n[model]\nPEY2 = -0.5"}),
    "a key twice": ({}, {"more": "PKY1 = -16"}),
    "wrapped comment": ({}, {"more": "$ fitted by us in\nthe year of the Bär, with care\nand 1.5 = no key"}),
    "comments": ({}, {"more": "! all\nPEY1 = -1.0 ! ü\nQSX3 = 0.1$none\nPVY2 = '0.01' $ 'quoted'"}),
    "lower case": ({}, {"more": "[lateral_coefficients]\npey1 = -1.0\nrhy1=0.01"}),
    "Fortran": ({"PEX2": "1.5D-2", "PEX3": "+.5d0", "PDX3": "3."}, {}),
    "unquoted": ({"CONSTRUCTION": "R20 16 x 7.5"}, {}),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_reads_the_same_to_the_bit_in_every_encoding(tmp_path, name):
    changed, options = DIALECTS[name]
    text = text_of(changed, **options) + "$ Größe\n"
    files = []
    for encoding, encode in ENCODINGS.items():
        path = tmp_path / f"{encoding}.tir"
        path.write_bytes(encode(text))
        files.append(read_tir(path))
    first = files[0]
    for file in files[1:]:
        assert file.values == first.values
        assert (file.kind, file.side, warnings(file)) == (first.kind, first.side, warnings(first))
    assert len({file.sha256 for file in files}) == len(files)


def test_dialects_mean_what_they_say(tmp_path):
    files = {name: read(tmp_path, changed, **options) for name, (changed, options) in DIALECTS.items()}
    assert [files[name].kind for name in ("no format", "PAC2002")] == ["MF-Tyre 6.1", "MF-Tyre 5.2"]
    assert (files["side right"].side, files["side right"].values["tyreside"]) == ("RIGHT", -1.0)
    for name, said in (
        ("PAC2002", {"fittyp": 6.0}),
        ("LFZ0", {"lfzo": 0.58}),
        ("a section twice", {"pey1": -1.0, "pey2": -0.5}),
        ("a key twice", {"pky1": -16.0}),  # the last counts
        ("comments", {"qsx3": 0.1, "pvy2": 0.01}),
        ("lower case", {"rhy1": 0.01}),
        ("Fortran", {"pex2": 0.015, "pex3": 0.5}),
    ):
        assert said.items() <= files[name].values.items(), name


@pytest.mark.parametrize("key, instead", [("LKYG", "LGAY"), ("LKYC", "LGAY"), ("LKZC", "LGAZ")])
def test_scalings_of_camber_that_a_set_of_5_2_does_not_have_are_named_as_ignored(key, instead, tmp_path):
    def told(kind, value):
        return [one for one in warnings(read(tmp_path, {"FITTYP": kind, key: value})) if "camber" in one]

    assert each_mentions(told("6", "0.5"), (key, "5.2", instead))
    assert told("62", "0.5") == told("6", "1") == []


def test_other_spellings_are_the_same_coefficients(tmp_path):
    given = {"LKYG": "0.9", "QPMX1": "0.1", "QPZ1": "0.2", "IP_NOM": "210000"}
    found = read(tmp_path, given, without=["NOMPRES"]).values
    assert (found["lkyc"], found["ppmx1"], found["ppz1"], found["nompres"]) == (0.9, 0.1, 0.2, 210000.0)
    assert read(tmp_path, {"LKG": "0.8"}).values["lkyc"] == 0.8


def test_values_are_converted_from_the_units_of_the_file(tmp_path):
    units = {"LENGTH": "'mm'", "FORCE": "'kN'", "ANGLE": "radians", "PRESSURE": "'bar'"}
    given = {
        **{"FNOMIN": "4", "FZMAX": "9", "UNLOADED_RADIUS": "313", "NOMPRES": "2.2", "INFLPRES": "2.3"},
        **{"VERTICAL_STIFFNESS": "0.21", "LONGITUDINAL_STIFFNESS": "0.358", "LATERAL_STIFFNESS": "0.1027"},
    }
    file, plain = read(tmp_path, given, units=units), read(tmp_path)
    assert file.values == pytest.approx(plain.values, rel=1e-14)
    assert file.rolling_radius == pytest.approx(plain.rolling_radius)


def test_without_pressures_there_is_no_effect_of_pressure(tmp_path):
    found = read(tmp_path, without=["NOMPRES", "INFLPRES"]).values
    assert "nompres" not in found  # the FMU's own two, which are equal
    found = read(tmp_path, without=["INFLPRES"]).values
    assert found["inflpres"] == found["nompres"] == 220000.0


def test_without_fzmax_loads_go_to_three_times_the_nominal_or_to_where_a_stiffness_vanishes(tmp_path):
    assert read(tmp_path, without=["FZMAX"]).values["fzmax"] == 12000.0
    assert read(tmp_path, {"FZMAX": "0", "LFZO": "0.5"}).values["fzmax"] == 6000.0
    assert read(tmp_path, {"PKY4": "3.2"}, without=["FZMAX"]).values["fzmax"] < 4000 * 3
    assert mentions([str(w) for w in read(tmp_path, {"PKX2": "-20.5"}).warnings], "sign")


@pytest.mark.parametrize(
    ("changed", "options", "names"),
    [
        ({"FITTYP": "51"}, {}, ("a.tir:11", "FITTYP", "51")),
        ({"FITTYP": "'six'"}, {}, ("FITTYP", "'six'")),
        ({}, {"without": ["FITTYP"]}, ("FITTYP",)),
        ({"PROPERTY_FILE_FORMAT": "'PAC89'"}, {}, ("PROPERTY_FILE_FORMAT", "PAC89")),
        ({"FNOMIN": "0"}, {}, ("FNOMIN", "0")),
        ({"FNOMIN": "-4000"}, {}, ("FNOMIN", "0", "-4000")),
        ({}, {"without": ["PKX1"]}, ("PKX1",)),
        ({"PKY1": "15"}, {}, ("PKY1", "stiffness")),
        ({"PKX1": "-20"}, {}, ("PKX1", "stiffness")),
        ({"PDX1": "1,1"}, {}, ("PDX1", "'1,1'")),
        ({"PCY1": ""}, {}, ("PCY1",)),
        ({"PCX1": "1e999"}, {}, ("PCX1",)),
        ({"PDX1": "1.2 1.3"}, {}, ("PDX1", "'1.2 1.3'")),
        ({"LFZO": "0"}, {}, ("LFZO", "0")),
        ({"INFLPRES": "2.2"}, {}, ("INFLPRES", "NOMPRES")),
        ({}, {"units": UNITS | {"LENGTH": "'furlong'"}}, ("a.tir:5", "LENGTH", "furlong")),
        ({}, {"units": UNITS | {"FORCE": "'stone'"}}, ("FORCE", "stone")),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_sentence_with_key_and_line(tmp_path, changed, options, names):
    with refused(ScenarioError, names=names) as caught:
        read(tmp_path, changed, **options)
    (only,) = caught.value.diagnostics
    assert "without" in options or re.search(r"a\.tir:\d+: ", str(only))


@pytest.mark.parametrize(
    ("changed", "options", "names"),
    [
        ({}, {"more": "PKY1 = -16"}, ("PKY1", "twice", "line")),
        ({}, {"without": ["RBX1", "RBY1"]}, ("RBX1", "RBY1")),
        ({"KPUMAX": "0"}, {}, ("KPUMAX", "KPUMIN", "-1")),
        ({"ALPMIN": "0"}, {}, ("ALPMAX", "ALPMIN", "0")),
        ({"LATERAL_STIFFNESS": "0"}, {}, ("LATERAL_STIFFNESS", "relaxation", "lengths")),
        ({"FITTYP": "6"}, {}, ("PTX1", "PTY1")),
        ({"TYRESIDE": "'UNKNOWN'"}, {}, ("TYRESIDE", "UNKNOWN", "LEFT")),
        ({}, {"without": ["TYRESIDE"]}, ("TYRESIDE", "LEFT")),
        ({}, {"units": UNITS | {"ANGLE": "'degree'"}}, ("ANGLE", "degrees", "ranges")),
        ({}, {"without": ["UNLOADED_RADIUS"]}, ("UNLOADED_RADIUS", "tyre", "default")),
        ({"LMUV": "0.1"}, {}, ("LMUV", "friction", "decays")),
    ],
)
def test_what_is_unusual_is_read_with_a_warning(tmp_path, changed, options, names):
    file = read(tmp_path, changed, **options)
    assert len(file.warnings) == 1
    assert mentions(str(file.warnings[0]), *names)


def test_the_unloaded_radius_can_come_from_rim_and_width(tmp_path):
    given = {"RIM_RADIUS": "0.19", "WIDTH": "0.2", "ASPECT_RATIO": "0.6"}
    file = read(tmp_path, given, without=["UNLOADED_RADIUS"])
    assert file.values["unloaded_radius"] == pytest.approx(0.31)
    assert mentions(str(file.warnings[0]), "RIM_RADIUS", "WIDTH", "ASPECT_RATIO")


@pytest.mark.parametrize(
    "content", [b"", b"\x00" * 4000, b"[UNITS]\n", b"\xff\xfe\x00", b"PK\x03\x04", b"= = =\n[\n"]
)
def test_what_is_no_such_file_is_refused_in_one_sentence(tmp_path, content):
    path = tmp_path / "b.tir"
    path.write_bytes(content)
    with refused(ScenarioError, "tyre-file-invalid", names=("b.tir", "tyre", "property")):
        read_tir(path)


def test_a_missing_file_a_folder_and_a_very_large_one_are_refused(tmp_path):
    with refused(ScenarioError, "file-missing", names=("no.tir", "tyre", "property")):
        read_tir(tmp_path / "no.tir")
    with refused(ScenarioError, "file-unreadable"):
        read_tir(tmp_path)
    (tmp_path / "large.tir").write_bytes(b"$" * 1_000_001)
    with refused(ScenarioError, "file-unreadable", names=("large.tir", "1 MB")):
        read_tir(tmp_path / "large.tir")


def test_files_damaged_at_random_are_read_or_refused_in_foreseen_sentences(tmp_path):
    rng, base = random.Random(1), text_of().encode()
    path, refused = tmp_path / "damaged.tir", 0
    for _ in range(200):
        raw = bytearray(base)
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(raw))
            if rng.random() < 0.5:
                raw[at] = rng.randrange(256)
            else:
                del raw[at : at + rng.randint(1, 40)]
        path.write_bytes(bytes(raw))
        try:
            assert all(isfinite(value) for value in read_tir(path).values.values())
        except ScenarioError as error:
            refused += 1
            assert not any("not understood" in text for text in texts_of(error)), error
    assert 25 < refused < 175
