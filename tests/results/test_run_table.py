"""The table holds every run."""

import pandas as pd

from radcal.results.run_table import write_table


def test_table_round_trips(made, tmp_path):
    write_table(tmp_path / "runs.csv", made.archive)
    table = pd.read_csv(tmp_path / "runs.csv", dtype=str).astype({"run": int})
    assert len(table) == len(made.history.runs) * len(made.targets)
    assert table["kind"].value_counts().to_dict() == {"reference": 2, "design": 8, "infill": 4}
    for name in made.targets:
        rows = table[table["material"] == name]
        assert rows["run"].tolist() == list(range(7))
        assert rows["rms"].astype(float).tolist() == [run.scores[name].rms for run in made.history.runs]
        assert rows[["xi", "omega", "alpha"]].astype(float).to_numpy().tolist() == [
            run.scores[name].dp for run in made.history.runs
        ]
        assert rows[["X1", "X2", "X3", "X4"]].astype(float).to_numpy().tolist() == [
            run.scores[name].parameters for run in made.history.runs
        ]
