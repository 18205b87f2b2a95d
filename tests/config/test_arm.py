"""Arms: their names, their order, and which layers they copy and freeze."""

import pytest

from ship_trl.config.arm import Arm, SourceWeights
from tests.config.test_config import composed

FIGURES = (
    "scratch FE1 FE2 FE3 FE4 FEH FE3-random FE3-permuted FT1 FT2 FT3 FT4 FTH FTB FTW FT3-pretrained "
    "FTW-permuted GU3 GUW SP3 SPH SPW G G3 GW QD QD3 QDW QR QR3"
)
CONVS = ("conv1", "conv2", "conv3", "conv4")
LAYERS = (*CONVS, "shared", "value", "advantage")


def test_arms_sort_as_figures_list_them() -> None:
    arms = [Arm.parse(name) for name in FIGURES.split()]
    backwards = [*reversed(arms)]
    assert sorted(backwards) == arms
    assert len(set(arms)) == len(arms)
    assert [str(arm) for arm in arms] == FIGURES.split()


@pytest.mark.parametrize(
    "name",
    [
        *("", "FE", "FE0", "FE-1", "FE03", "FE٣", "FEW", "FE1-", "FE1-learned", "FE1-other", "fe1", "FT1 "),
        *("scratch-random", "FT", "FTall", "FE3-random-demonstrations", "XX3", "all", "-random", "GUH", "GU"),
        *("FEB", "SP", "H", "GW3", "QRW"),
    ],
)
def test_a_wrong_arm_name_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="names no arm"):
        Arm.parse(name)


@pytest.mark.parametrize(
    ("method", "layers", "weights"),
    [
        ("scratch", 1, SourceWeights.learned),
        ("feature_extraction", "all", SourceWeights.learned),
        ("finetune", 0, SourceWeights.learned),
        ("finetune", True, SourceWeights.learned),
        ("finetune", "3", SourceWeights.learned),
    ],
)
def test_an_impossible_arm_is_not_made(method: str, layers: int | str, weights: SourceWeights) -> None:
    with pytest.raises(ValueError, match="no arm has"):
        Arm(method, layers, weights)


@pytest.mark.parametrize(
    ("name", "copied", "frozen", "trained"),
    [
        ("scratch", (), 0, False),
        ("FE3", CONVS[:3], 3, True),
        ("FE5-permuted", CONVS, 5, True),
        ("FE2-random", CONVS[:2], 2, False),
        ("FEH", LAYERS[4:], 0, True),
        ("FT3", CONVS[:3], 0, True),
        ("FTB", LAYERS[:5], 0, True),
        ("FTW", LAYERS, 0, True),
        ("QR", (), 0, True),
    ],
)
def test_an_arm_knows_what_is_copied_and_frozen(
    name: str, copied: tuple[str, ...], frozen: int, trained: bool
) -> None:
    arm = Arm.parse(name)
    assert (arm.copied(LAYERS, CONVS), arm.frozen_layers, arm.has_trained_source) == (copied, frozen, trained)


def test_demonstrations_change_the_label_and_not_the_arm() -> None:
    config = composed("+pair=high", "+arm=FE3", "demonstrations=demos")
    assert config.arm == Arm.parse("FE3") and config.arm_label == "FE3-demonstrations"
