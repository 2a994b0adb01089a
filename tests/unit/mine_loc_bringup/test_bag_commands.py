"""The commands that open bags: what they print, and one line for what cannot be done."""

from made_up_bags import counts_of, new_bag, write_counts

from mine_loc_bringup.main import main


def test_repair_tells_what_it_found_in_each_file(tmp_path, capsys):
    bag = new_bag(tmp_path / "bag")
    write_counts(bag, 0, 100)
    bag.flush()
    bag.abandon()
    assert main(["bag", "repair", str(tmp_path / "bag"), str(tmp_path / "whole")]) == 0
    assert counts_of(tmp_path / "whole") == list(range(100))
    said = capsys.readouterr().out
    assert "bag_0.mcap" in said
    assert "whole: 100 messages over 0.0 s" in said


def test_what_cannot_be_done_is_one_line_and_status_2(tmp_path, capsys):
    (tmp_path / "there").mkdir()
    new_bag(tmp_path / "bag").close()
    refusals = {
        ("bag", "repair", "none", "out"): "none: there is no such bag; allowed: a folder, or a file .mcap or .db3",
        ("bag", "repair", "bag", "there"): "there: is there already; allowed: a new name",
        ("bag", "repair", "bag", "out"): "no message can be read: bag_0.mcap: it is empty",
        ("replay", "bag"): "allowed: --out OUT for a new bag, or --live for the running graph",
    }
    for (command, *words), refusal in refusals.items():
        paths = [str(tmp_path / word) if word not in {"repair"} else word for word in words]
        assert main([command, *paths]) == 2
        lines = [line for line in capsys.readouterr().err.splitlines() if refusal in line]
        assert len(lines) == 1, refusal
