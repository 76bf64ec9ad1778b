import json

import pytest

from train import optimisers


def test_the_optimisers_stand_side_by_side(tmp_path, monkeypatch):
    out = tmp_path / "out"
    few = (
        "--scenarios",
        "0",
        "--max-evaluations",
        "3000",
        "--limited",
        "1",
        "--limited-evaluations",
        "60",
        "--workers",
        "1",
    )
    monkeypatch.setattr("sys.argv", ["train.optimisers", *few, "--out", str(out)])
    assert optimisers.main() == 0
    found = json.loads((out / "comparison.json").read_text())
    assert [(each["search"]["family"], each["search"]["optimiser"]) for each in found] == [
        ("spline", "nelder-mead"),
        ("spline", "gauss-newton"),
        ("harmonic", "nelder-mead"),
        ("harmonic", "gauss-newton"),
    ]
    for plain, quick in zip(found[::2], found[1::2], strict=True):
        assert quick["omega1"] == pytest.approx(plain["omega1"], rel=0.01)
        assert quick["omega1"] < 1e-3 * quick["still"]
        assert quick["evaluations"] < plain["evaluations"]
    table = (out / "comparison.md").read_text(encoding="utf-8").splitlines()
    row = next(line for line in table if line.startswith("| paper | spline |"))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[2:4] == ["18", f"{found[0]['still']:.4g}"]
    assert cells[5] == f"{found[0]['evaluations']:,}"
    assert cells[7] == str(found[1]["evaluations"])
    assert sum(line.startswith(("| spline, ", "| harmonic, ")) for line in table) == 16
