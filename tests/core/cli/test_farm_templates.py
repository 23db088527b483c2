"""The templates of examples/farm: each is what its scheduler takes, and its commands are what the engine takes."""

import importlib.util
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from core.cli.main import build_parser

pytestmark = pytest.mark.process
REPO = Path(__file__).parents[3]
FARM = REPO / "examples" / "farm"
# What Flamenco gives a job type: https://flamenco.blender.org/usage/job-types/
FLAMENCO = """
const author = {
    Task: (name, type) => ({ name, type, commands: [], needs: [],
        addCommand(command) { this.commands.push(command); }, addDependency(task) { this.needs.push(task.name); } }),
    Command: (name, parameters) => ({ name, parameters }),
};
"""


@pytest.fixture
def recorder(tmp_path):
    """How a program is called that stands for the engine, and what gives the calls that it got, as the engine parses them."""
    said, script = tmp_path / "calls.jsonl", tmp_path / "recorder.py"
    script.write_text(f"import json, sys; open({str(said)!r}, 'a').write(json.dumps(sys.argv[1:]) + chr(10))")

    def calls():
        return [build_parser().parse_args(json.loads(line)) for line in said.read_text().splitlines()]

    return f"{shlex.quote(sys.executable)} {shlex.quote(str(script))}", calls


def flamenco(**settings):
    """The tasks that the job type makes, in their order; or the error's text."""
    kept = {
        "scan": "s p.ply",
        "queries": "q.json",
        "results": "r.json",
        "shards": 3,
        "processes": 0,
        "find": True,
        "options": "",
    }
    job = f"""
    const made = [];
    try {{ compileJob({{ settings: {json.dumps(kept | settings)}, addTask: (task) => made.push(task) }}); }}
    catch (error) {{ made.push(error.message); }}
    console.log(JSON.stringify({{ keys: JOB_TYPE.settings.map((one) => one.key), made }}));
    """
    script = FLAMENCO + (FARM / "gssmc-batch.js").read_text(encoding="utf-8") + job
    done = subprocess.run(["node", "-e", script], capture_output=True, text=True, check=True)
    told = json.loads(done.stdout)
    assert told["keys"] == list(kept)
    return told["made"]


needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="no node, which runs the Flamenco job type")


@needs_node
def test_the_flamenco_job_makes_commands_that_the_engine_takes():
    tasks = flamenco(options=" --lens  focal --preset 7scenes", processes=2)
    assert [task["name"] for task in tasks] == ["map", "shard-1", "shard-2", "shard-3", "merge"]
    assert [task["needs"] for task in tasks] == [[], ["map"], ["map"], ["map"], ["shard-1", "shard-2", "shard-3"]]
    calls = [command["parameters"] for task in tasks for command in task["commands"]]
    assert all(command["name"] == "exec" for task in tasks for command in task["commands"])
    assert all(call["exe"] == "{blender}" and call["args"][:2] == ["--command", "gssmc"] for call in calls)
    parsed = [build_parser().parse_args(call["args"][2:]) for call in calls]
    assert [args.command for args in parsed] == ["map", "batch", "batch", "batch", "merge"]
    for number, args in enumerate(parsed[1:4], 1):
        assert (args.shard, args.exit_zero, args.workers) == (f"{number}/3", True, 2)
        assert (str(args.scene), str(args.queries), str(args.out)) == ("s p.ply", "q.json", "r.json")
        assert (args.lens, args.preset, args.locate) == ("focal", "7scenes", True)
    assert str(parsed[4].out) == "r.json"


@needs_node
def test_the_flamenco_job_makes_no_map_that_nobody_needs_and_refuses_no_shards():
    tasks = flamenco(find=False, shards=1)
    assert [task["name"] for task in tasks] == ["shard-1", "merge"]
    assert build_parser().parse_args(tasks[0]["commands"][0]["parameters"]["args"][2:]).locate is False
    assert "give into how many tasks" in flamenco(shards=0)[0]


@pytest.mark.skipif(os.name == "nt", reason="a shell script")
def test_the_slurm_array_makes_commands_that_the_engine_takes(recorder, tmp_path):
    script, (program, calls) = FARM / "slurm.sh", recorder
    assert subprocess.run(["bash", "-n", script], check=False).returncode == 0
    files = {"SCAN": "s p.ply", "QUERIES": "q.json", "RESULTS": str(tmp_path / "r.json")}
    environment = {**os.environ, **files, "SHARDS": "2", "GSSMC": program}
    lacking = subprocess.run(["bash", script], env=environment, capture_output=True, text=True, check=False)
    assert lacking.returncode != 0 and "sbatch --array=1-2" in lacking.stderr
    for task in ("1", "2"):
        one = {**environment, "SLURM_ARRAY_TASK_ID": task, "SLURM_CPUS_PER_TASK": "3"}
        subprocess.run(["bash", script, "--no-locate"], env=one, check=True, capture_output=True)
    assert [(args.command, args.shard, args.workers, args.locate, args.exit_zero) for args in calls()] == [
        ("batch", f"{task}/2", 3, False, True) for task in (1, 2)
    ]
    assert {(str(args.scene), str(args.queries), str(args.out)) for args in calls()} == {tuple(files.values())}


def has_openjd():
    try:
        return importlib.util.find_spec("openjd.cli") is not None
    except ModuleNotFoundError:
        return False


@pytest.mark.skipif(not has_openjd(), reason="openjd-cli, which checks the template, is not installed")
def test_the_openjd_template_is_valid_and_makes_commands_that_the_engine_takes(recorder, tmp_path):
    template, (program, calls) = FARM / "openjd.yaml", recorder
    openjd = [sys.executable, "-m", "openjd"]
    checked = subprocess.run([*openjd, "check", template], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout
    given = {"Scan": tmp_path / "s p.ply", "Photos": tmp_path / "photos", "ResultsFolder": tmp_path, "Program": program}
    more = {"Shards": 3, "Options": "--lens focal --preset 7scenes"}
    parameters = [word for name, value in (given | more).items() for word in ("-p", f"{name}={value}")]
    done = subprocess.run([*openjd, "run", template, *parameters], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:]
    parsed = calls()
    assert [args.command for args in parsed] == ["map", "batch", "batch", "batch", "merge"]
    for number, args in enumerate(parsed[1:4], 1):
        assert (args.shard, args.exit_zero, args.lens) == (f"{number}/3", True, "focal")
        assert (args.scene, args.queries) == (tmp_path / "s p.ply", tmp_path / "photos" / "queries.json")
        assert args.out == parsed[4].out == tmp_path / "results.json"
