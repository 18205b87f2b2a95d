"""What docs/findings.md and README.md say was found is what the kept tables say."""

import re

import pytest

from ship_trl.study.study import Study, read_study
from studies.paper.claims import claims
from studies.paper.judge import Grade
from tests.findings import NUMBER, NUMBERS, PAGE, lacking, of_grades, rewrite
from tests.studies.paper.test_confirmatory import FOLDER


@pytest.fixture(scope="module")
def study() -> Study:
    return read_study(FOLDER, claims())


def test_every_number_of_a_contrast_is_what_the_study_answers(study: Study) -> None:
    text = PAGE.read_text()
    assert re.search(NUMBERS, text)
    # A number that names no contrast would stay wrong; means of a few seeds, `+0.1 (2 of 3)`, are facts.
    wrong = re.sub(rf"{NUMBER}(?!\d| \(\d of)", lambda m: "+9." + m[0].partition(".")[2], text)
    assert rewrite(wrong, study) == text


def test_every_sentence_that_counts_is_true(study: Study) -> None:
    assert lacking(study) == []


def test_the_table_of_claims_is_that_of_the_study() -> None:
    text = PAGE.read_text()
    kept = re.search(r"<!-- begin: claims -->\n(.*?)<!-- end -->", text, re.S)
    assert kept is not None and kept[1].strip().split("\n")[2:] == of_grades()


def test_the_table_of_grades_begins_with_the_study(study: Study) -> None:
    text = PAGE.read_text()
    (row,) = re.findall(r"\| the study \| (.*) \|\n", text)
    counted = re.findall(rf"\| (?:{'|'.join(grade.value for grade in Grade)}) \((\d+)\) \|", text)
    assert [float(cell) for cell in row.split(" | ")] == [float(count) for count in counted]
