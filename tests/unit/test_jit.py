from pathlib import Path

import pytest

from sitl import jit


def test_the_kernels_cache_follows_their_sources_and_what_they_import_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jit, "_SOURCES", tmp_path)
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "law.py").write_text("from sitl.numbers import G\n\n\n@kernel\ndef law():\n    return G\n")
    (tmp_path / "numbers.py").write_text("G = 9.8\n")
    (tmp_path / "user.py").write_text("from sitl.model.law import law\n")
    digest = jit._digest()
    (tmp_path / "user.py").write_text("from sitl.model.law import law as other\n")
    assert jit._digest() == digest
    (tmp_path / "numbers.py").write_text("G = 9.9\n")
    assert jit._digest() != digest
