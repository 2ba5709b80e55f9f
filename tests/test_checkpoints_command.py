from __future__ import annotations

from pathlib import Path

import pytest

from peaking.cli import main


def test_the_list_says_where_missing_files_go_and_their_licences(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    (tmp_path / "adampi_64p.pth").write_bytes(b"x")
    main(["checkpoints", "--folder", str(tmp_path)])
    told = capsys.readouterr().out
    assert f"missing; put it at {tmp_path / 'adampi_32p.pth'}" in told
    assert f"not checked (no published hash is known): {tmp_path / 'adampi_64p.pth'}" in told
    assert "Apache-2.0" in told
    assert "non-commercial" in told


def test_a_wrong_hash_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    model = tmp_path / "Depth-Anything-V2-Small-hf"
    notes = model / ".cache/huggingface/download"
    notes.mkdir(parents=True)
    (model / "model.safetensors").write_bytes(b"x")
    (notes / "model.safetensors.metadata").write_text(f"commit\n{'0' * 64}\n")
    with pytest.raises(SystemExit) as left:
        main(["checkpoints", "--folder", str(tmp_path)])
    assert left.value.code == 2
    assert "SHA-256 differs from the published one" in capsys.readouterr().err


def test_a_known_hash_needs_no_note_of_the_hub(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    weights = tmp_path / "Depth-Anything-V2-Small-hf/model.safetensors"
    weights.parent.mkdir()
    weights.write_bytes(b"x")
    with pytest.raises(SystemExit):
        main(["checkpoints", "--folder", str(tmp_path)])
    assert f"WRONG HASH: {weights}" in capsys.readouterr().out
