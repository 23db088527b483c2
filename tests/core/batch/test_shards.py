"""A batch in shards, and the shards joined: the same results as one run's, and everything that does not fit is named."""

import json
from pathlib import Path

import pytest
from cli_place import FAST, Place
from solved_photos import LENS, record_of, solved_photo

from core.batch.farm.shards import Shard, find_shards, join, own_head
from core.batch.keys import BatchQuery, key_of
from core.batch.store import ResultsError, ResultStore
from core.cameras.unplaced import Unplaced
from core.cli.main import main
from core.cli.sharing import share_lenses
from core.errors import UsageError
from core.support.sealed import sealed

pytestmark = pytest.mark.process
COUNT = 2


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    found = Place(tmp_path_factory.mktemp("place"))
    (found.folder / "queries.json").write_text(json.dumps({"frames": _frames(found)}))
    return found


def _frames(found):
    """Three photos, one of which is nowhere."""
    frames = json.loads(Path(found.json(found.folder / "starts.json", found.starts)).read_text())["frames"]
    return [frames[0], {**frames[0], "file": "nowhere.png"}, frames[1]]


def batch(place, out, *more):
    argv = ["batch", str(place.scene), str(place.folder / "queries.json"), "--out", str(out), "--workers", "1", "--no-locate"]
    return main([*argv, *FAST, *more])


@pytest.fixture(scope="module")
def whole(place):
    """The folder with the results of one run, and with those of all shards."""
    assert batch(place, place.folder / "one.json") == 3
    for number in range(1, COUNT + 1):
        batch(place, place.folder / "all.json", "--shard", f"{number}/{COUNT}")
    return place.folder


def timeless(file):
    """All of the records but how long each took, and what follows from that."""
    frames = json.loads(file.read_text())["frames"]
    return [{k: v for k, v in frame.items() if k not in ("seconds", "sum")} for frame in frames]


def test_joined_shards_say_what_one_run_says_in_the_order_of_the_queries(whole, capsys):
    assert sorted(path.name for path in find_shards(whole / "all.json")) == [f"all.shard-{i}-of-2.json" for i in (1, 2)]
    assert main(["merge", "--out", str(whole / "all.json"), "--poses", str(whole / "all.txt")]) == 3
    captured = capsys.readouterr()
    assert timeless(whole / "all.json") == timeless(whole / "one.json")
    assert "missing" not in captured.err
    assert "'nowhere.png' could not be used" in captured.err
    assert len((whole / "all.txt").read_text().splitlines()) == 2


def test_a_batch_goes_on_from_joined_shards(place, whole, tmp_path, capsys):
    out = tmp_path / "part.json"
    assert main(["merge", str(whole / "all.shard-1-of-2.json"), "--out", str(out)]) == 3
    said = capsys.readouterr().err
    assert "1 of 3 photos is missing: shard 2 of 2 (1), of which nothing is finished." in said
    batch(place, out)
    assert "2 of 3 photos were finished before and are kept." in capsys.readouterr().err
    assert timeless(out) == timeless(whole / "one.json")


def test_results_that_hold_more_than_the_shards_are_not_written_over(whole, tmp_path, capsys):
    out = tmp_path / "part.json"
    out.write_bytes((whole / "one.json").read_bytes())
    assert main(["merge", str(whole / "all.shard-1-of-2.json"), "--out", str(out)]) == 2
    assert "holds 3 photos, and the shards only 2 of them" in capsys.readouterr().err
    assert out.read_bytes() == (whole / "one.json").read_bytes()


def test_a_killed_shard_is_joined_from_its_journal_and_its_gap_is_named(whole, tmp_path, capsys):
    head, *lines = (whole / "all.shard-1-of-2.json").read_text().splitlines(keepends=True)
    said = json.dumps({"gssmc_journal": 1, "shard": json.loads(head + "]}")["shard"]})
    (tmp_path / "x.shard-1-of-2.json.journal").write_text(f"{said}\n{lines[0][:50]}\n{lines[1]}{lines[1][:50]}")
    assert main(["merge", "--out", str(tmp_path / "x.json")]) == 3
    told = capsys.readouterr().err
    assert "2 lines cut short or damaged" in told
    assert "shard 1 of 2 ('photo_0.png')" in told and "shard 2 of 2 (1), of which nothing is finished" in told
    assert [f["file"] for f in json.loads((tmp_path / "x.json").read_text())["frames"]] == ["photo_1.png"]


@pytest.mark.parametrize("begun", ["", '{"gssmc_jour', '{"gssmc_journal": 1, "shard": {"sha'])
def test_a_shard_that_has_finished_nothing_yet_keeps_no_other_from_being_joined(whole, tmp_path, capsys, begun):
    first, second = "x.shard-1-of-2.json", tmp_path / "x.shard-2-of-2.json.journal"
    (tmp_path / first).write_text((whole / "all.shard-1-of-2.json").read_text())
    second.write_text(begun)
    assert main(["merge", "--out", str(tmp_path / "x.json")]) == 3
    assert "1 of 3 photos is missing: shard 2 of 2 (1), of which nothing is finished." in capsys.readouterr().err
    assert len(json.loads((tmp_path / "x.json").read_text())["frames"]) == 2
    assert second.read_text() == begun
    (tmp_path / first).unlink()
    with pytest.raises(ResultsError, match=r"has no finished photo yet, nor has any other shard; wait for the first\.$"):
        join(find_shards(tmp_path / "x.json"))


def test_a_name_that_no_pose_list_can_hold_is_told_before_anything_is_written(whole, tmp_path, capsys):
    shard = tmp_path / "x.shard-1-of-2.json"
    head, *lines = (whole / "all.shard-1-of-2.json").read_text().splitlines(keepends=True)
    renamed = sealed(json.loads(lines[1]) | {"file": "photo 1.png"})
    shard.write_text(f"{head}{lines[0]}{json.dumps(renamed)}\n]}}\n")
    assert main(["merge", "--out", str(tmp_path / "x.json"), "--poses", str(tmp_path / "x.txt")]) == 2
    assert "'photo 1.png' cannot stand in a pose list" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [shard]


def test_of_more_shards_than_photos_those_without_one_are_not_asked_for(whole, tmp_path):
    head, *lines = (whole / "all.shard-1-of-2.json").read_text().splitlines(keepends=True)
    said = json.loads(head + "]}")["shard"] | {"shards": 10**9}
    (tmp_path / "a.json").write_text(f'{{"shard": {json.dumps(said)}, "frames": [\n' + "".join(lines))
    assert join([tmp_path / "a.json"]).gaps == ["shard 2 of 1000000000 (1), of which nothing is finished"]


@pytest.mark.parametrize("name", ["scan", "options", "queries", "shards", "shared_lens"])
def test_shards_of_another_batch_are_refused(whole, tmp_path, name):
    first, other = whole / "all.shard-1-of-2.json", tmp_path / "other.json"
    head, *lines = (whole / "all.shard-2-of-2.json").read_text().splitlines(keepends=True)
    said = json.loads(head + "]}")["shard"] | {name: "another"}
    other.write_text(f'{{"shard": {json.dumps(said)}, "frames": [\n' + "".join(lines))
    with pytest.raises(ResultsError, match=r"^'.*1-of-2.json' and '.*other.json' are not of one batch, for .* differs; .*\.$"):
        join([first, other])


def test_the_same_photo_twice_counts_once_and_two_answers_are_named(whole, tmp_path):
    again, other = tmp_path / "again.json", tmp_path / "other.json"
    first = whole / "all.shard-1-of-2.json"
    again.write_text(first.read_text())
    joined = join([first, again])
    assert (joined.double, joined.conflicts, sorted(joined.records)) == (2, [], [0, 2])
    head, *lines = first.read_text().splitlines(keepends=True)
    record = json.loads(lines[0].rstrip(",\n"))
    other.write_text(head + json.dumps(sealed(record | {"fx": 1.0})) + "\n]}\n")
    joined = join([first, other])
    assert joined.conflicts == [f"'photo_0.png' has another answer in '{other}' than in '{first}', which is taken."]
    assert joined.records[0]["fx"] == record["fx"]


@pytest.mark.parametrize("text", ["", "words", '{"frames": []}', '{"shard": {"number": 1}, "frames": [\n]}\n'])
def test_what_is_no_shard_is_refused(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(ResultsError, match=r"holds no shard of a batch; give the files that batch --shard has written\.$"):
        join([tmp_path / "a.json"])


def test_shards_have_each_photo_once_and_are_of_one_size():
    for total, count in ((10, 3), (2, 5), (0, 2), (12, 4)):
        shares = [Shard(number, count).of(total) for number in range(1, count + 1)]
        assert sorted(i for share in shares for i in share) == list(range(total))
        assert max(map(len, shares)) - min(map(len, shares)) <= 1


@pytest.mark.parametrize("text", ["", "3", "0/3", "4/3", "a/b", "1/0", "-1/2", "1/2/3", f"1/{'9' * 5000}"])
def test_a_shard_that_is_none_is_one_sentence(text):
    with pytest.raises(UsageError, match="give the shard and their number"):
        Shard.parse(text)


def test_shards_that_are_nowhere_and_poses_of_one_are_one_sentence(place, tmp_path, capsys):
    assert main(["merge", "--out", str(tmp_path / "r.json")]) == 2
    assert "No shard lies beside" in capsys.readouterr().err
    assert batch(place, tmp_path / "r.json", "--shard", "1/2", "--poses", str(tmp_path / "p.txt")) == 2
    assert "give --poses to merge" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_exit_zero_is_for_photos_that_failed_and_not_for_those_that_are_missing(whole, tmp_path):
    shards = [str(whole / f"all.shard-{number}-of-2.json") for number in (1, 2)]
    assert main(["merge", *shards, "--out", str(tmp_path / "r.json"), "--exit-zero"]) == 0
    assert main(["merge", shards[0], "--out", str(tmp_path / "s.json"), "--exit-zero"]) == 3


@pytest.mark.parametrize("name", ["r", "r.json", "a [1]*.b.json"])
def test_only_files_that_are_named_as_shards_are_found(tmp_path, name):
    out = tmp_path / name
    shards = [Shard(number, 12).file(out) for number in (1, 11)]
    for path in (shards[0], shards[1].with_name(f"{shards[1].name}.journal")):
        path.touch()
    for path in (out, *(shards[0].with_name(f"{shards[0].name}{more}") for more in (".old", ".x.part", "~"))):
        path.touch()
    assert sorted(find_shards(out)) == sorted(shards)
    assert find_shards(tmp_path / "nowhere" / name) == []


def test_of_many_missing_shards_ten_are_named(tmp_path, whole, capsys):
    head, *lines = (whole / "all.shard-1-of-2.json").read_text().splitlines(keepends=True)
    said = json.loads(head + "]}")["shard"] | {"shards": 100, "photos": 100}
    (tmp_path / "a.json").write_text(f'{{"shard": {json.dumps(said)}, "frames": [\n' + "".join(lines))
    assert main(["merge", str(tmp_path / "a.json"), "--out", str(tmp_path / "r.json")]) == 3
    told = capsys.readouterr().err
    assert "98 of 100 photos are missing: shard 2 of 100 (1), of which" in told
    assert "shard 12 of 100 (1), of which nothing is finished; and 88 more shards." in told and "shard 13" not in told


def test_a_lens_is_shared_by_the_photos_of_all_shards(tmp_path, capsys):
    records = [record_of(solved_photo(seed, LENS)) for seed in range(4)]
    keys = [key_of(k) for k in range(4)]
    queries = [BatchQuery(Unplaced(r["file"]), tmp_path / r["file"]) for r in records]
    with ResultStore(tmp_path / "one.json", keys) as store:
        for k in range(4):
            store.put(k, records[k])
        share_lenses("one", queries, store)
    common = {"photos": 4, "scan": "s", "queries": "q", "options": "o", "shared_lens": "one"}
    for shard in (Shard(1, 2), Shard(2, 2)):
        own = list(shard.of(4))
        head = own_head(common, shard, [queries[k] for k in own], [keys[k] for k in own])
        with ResultStore(shard.file(tmp_path / "all.json"), [keys[k] for k in own], head) as store:
            for place, k in reversed(list(enumerate(own))):
                store.put(place, records[k])
    capsys.readouterr()
    assert main(["merge", "--out", str(tmp_path / "all.json")]) == 0
    assert "One lens for 4 photos" in capsys.readouterr().out
    assert (tmp_path / "all.json").read_bytes() == (tmp_path / "one.json").read_bytes()
