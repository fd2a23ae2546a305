"""Tests of the names of files of figures and films."""

from analysis.figures.file_names import FileNames, file_name


def test_words_are_joined_and_folders_are_not_named() -> None:
    assert file_name("best-robot-of-sw-map=maps/a.png") == (
        "best-robot-of-sw-map=maps-a.png"
    )
    assert file_name("S-sweep-a b~2") == "S-sweep-a-b~2"
    assert file_name("G-ancestry-of-größe") == "G-ancestry-of-größe"


def test_a_long_text_is_cut_between_characters() -> None:
    assert file_name("G-" + "x" * 300) == "G-" + "x" * 98
    assert file_name("x" + "ö" * 300) == "x" + "ö" * 49


def test_a_taken_name_has_a_number_behind_it() -> None:
    names = FileNames()
    texts = ("G-a b", "G-a-b", "G-a/b", "G-A-b", "G-a-b-2", "S-a b")
    assert [names.add(text) for text in texts] == [
        "G-a-b",
        "G-a-b-2",
        "G-a-b-3",
        "G-A-b-4",
        "G-a-b-2-2",
        "S-a-b",
    ]
