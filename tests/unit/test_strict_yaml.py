"""The loader refuses what YAML would silently turn into something else, and says where."""

import msgspec
import pytest

from sitl.strict_yaml import ConfigError, load, loads


class Inner(msgspec.Struct, forbid_unknown_fields=True):
    gain: float


class Outer(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    inner: Inner
    items: list[Inner] = []


def test_a_number_in_scientific_notation_is_a_number() -> None:
    assert loads("name: a\ninner: {gain: 1e-3}", Outer).inner.gain == 1e-3


@pytest.mark.parametrize("word", ["on", "off", "yes", "no", "012", "1:30", "2020-01-01"])
def test_a_word_stays_a_word(word: str) -> None:
    assert loads(f"name: {word}\ninner: {{gain: 1}}", Outer).name == word


def test_a_key_given_twice_is_refused_with_its_line() -> None:
    with pytest.raises(ConfigError, match=r"file\.yaml:3: 'name' is given twice"):
        loads("name: a\ninner: {gain: 1}\nname: b", Outer, "file.yaml")


def test_a_wrong_type_is_named_with_line_and_field() -> None:
    with pytest.raises(ConfigError, match=r"f:5: items\[1\]\.gain: Expected `float`"):
        loads("name: a\ninner: {gain: 1}\nitems:\n  - gain: 1\n  - gain: high\n", Outer, "f")


def test_an_unknown_field_is_refused_with_the_line_of_its_parent() -> None:
    with pytest.raises(ConfigError, match=r"f:2: inner: .*unknown field `gian`"):
        loads("name: a\ninner: {gian: 1, gain: 2}", Outer, "f")


@pytest.mark.parametrize("text", ["name: [", "- a\n- b", "", "name: *nowhere", "!!python/object:os.system x", "\x00"])
def test_anything_that_is_not_the_wanted_yaml_is_a_config_error(text: str) -> None:
    with pytest.raises(ConfigError):
        loads(text, Outer)


def test_a_missing_file_is_named(tmp_path) -> None:
    with pytest.raises(ConfigError, match=r"nothing\.yaml: can't be read: No such file"):
        load(tmp_path / "nothing.yaml", Outer)


def test_a_binary_file_is_named(tmp_path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"binary\.yaml: can't be read"):
        load(path, Outer)
