"""The JSON Schema of sweep files takes what the program takes, and rejects what an editor should mark."""

import json
import subprocess
import tomllib

import jsonschema
import pytest
from conftest import ROOT

GOOD = [
    'name = "a"',
    'name = "a"\nwhere = ["V0 > 1e-5", "frequency < 500"]\n[axes]\nV0 = { log = [1e-5, 1e-4], points = 3 }\n',
    'name = "a"\n[model]\nbreak_on = "tension"\nDelta = 0\n[axes]\nseed = { count = 3, first = 7 }\n',
    'name = "a"\n[[axes.zip]]\nV0 = [1e-5, 1e-4]\nfs = { linear = [1, 2], points = 2 }\n',
    'name = "a"\n[axes.sobol]\npoints = 8\nseed = 3\nV0 = { log = [1e-5, 1e-4] }\nKd = { linear = [1e7, 4e7] }\n',
    'name = "a"\n[[axes.sobol]]\npoints = 8\nV0 = { log = [1e-5, 1e-4] }\n[[axes.sobol]]\npoints = 3\nK = { log = [1e7, 1e8] }\n',
    'name = "a"\n[record]\nslips = 7\nprecursors = true\ndrop_size = 0.5\n[solver]\nmethod = "fixed-step"\ndt = 1e-6\n',
    'name = "a"\n[record]\ntime = 5\n',
    'name = "a"\n[record]\ntime = 5\nslips = 30\nmax_time = 9.5\n',
    'name = "a"\n[solver]\nresolve = "taylor"\ntolerance = 1e-9\n',
    'name = "a"\n[precision]\nof = ["tau_mean", "drop_mean"]\nrelative = 0.01\nseeds = { from = 4, to = 64 }\n',
    'name = "a"\n[axes]\nV0 = { log = [1e-5, 1e-4], points = 3 }\n'
    '[refine]\naxis = "V0"\nby = ["tau_mean", "tau_sd"]\nthreshold = 0.1\nto = 0.1\nseeds = { first = 3, from = 24, to = 48 }\njobs = 99\n',
]
BAD = [
    "[model]\nN = 3",
    'name = "-a"',
    'name = "a"\nrecords = 3',
    'name = "a"\n[model]\nv0 = 1e-5',
    'name = "a"\n[model]\nV0 = 0',
    'name = "a"\n[model]\nV0 = [1e-5, 1e-4]',
    'name = "a"\n[model]\nN = 2.5',
    'name = "a"\n[model]\nN = 100001',
    'name = "a"\n[model]\nbreak_on = "both"',
    'name = "a"\n[axes]\nV0 = 1e-5',
    'name = "a"\n[axes]\nV0 = []',
    'name = "a"\n[axes]\nV0 = { log = [1e-5, 1e-4] }',
    'name = "a"\n[axes]\nV0 = { count = 3 }',
    'name = "a"\n[axes]\nV0 = { linear = [1e-5, 1e-4], log = [1e-5, 1e-4], points = 3 }',
    'name = "a"\n[axes.sobol]\nV0 = { log = [1e-5, 1e-4] }',
    'name = "a"\n[record]\nslips = 0',
    'name = "a"\n[record]\nprecursors = 1',
    'name = "a"\n[record]\nmax_time = -1',
    'name = "a"\n[record]\ntime = 0',
    'name = "a"\n[record]\ntime = "5 s"',
    'name = "a"\n[solver]\ntolerance = 1',
    'name = "a"\n[solver]\nmethod = "euler"',
    'name = "a"\n[precision]\nof = "tau_25"\nrelative = 0.01\nseeds = { from = 4, to = 64 }\n',
    'name = "a"\n[precision]\nof = "tau_mean"\nseeds = { from = 4, to = 64 }\n',
    'name = "a"\n[precision]\nof = "tau_mean"\nrelative = 0.1\nabsolute = 1\nseeds = { from = 4, to = 64 }\n',
    'name = "a"\n[axes]\nV0 = { log = [1e-5, 1e-4], points = 3 }\n[refine]\naxis = "V0"\nby = "tau_mean_bound"\nthreshold = 0.1\nto = 0.1\nseeds = { from = 24, to = 48 }\njobs = 99\n',
]


@pytest.fixture(scope="module")
def validator(stickslip):
    schema = json.loads(stickslip("generate", "schema").stdout)
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


@pytest.mark.parametrize("sweep", sorted((ROOT / "sweeps").glob("*.toml")), ids=lambda path: path.stem)
def test_every_sweep_of_the_project_is_valid(validator, sweep):
    validator.validate(tomllib.loads(sweep.read_text()))


@pytest.mark.parametrize("text, is_good", [(text, True) for text in GOOD] + [(text, False) for text in BAD])
def test_schema_and_program_agree(validator, program, tmp_path, text, is_good):
    sweep = tmp_path / "a.toml"
    sweep.write_text(text)
    planned = subprocess.run([program, "plan", sweep], capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert (planned.returncode == 0) == is_good, planned.stderr
    assert validator.is_valid(tomllib.loads(text)) == is_good
